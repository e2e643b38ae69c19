"""Any executable as a detector: it gets a scene folder and a parameter file, and writes footprints.

The program runs without a shell, in an empty working folder. The scene folder (see `scenes.folder`) has a neutral path
and name and holds measurements only: no reference, area, classification, provenance or times of files. What the program
writes is checked, and everything that goes wrong is a failure with one sentence that contains the end of what the
program printed.
"""

from __future__ import annotations

import importlib.metadata
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...core.errors import MissingInputError, ParameterError, ProgramError
from ...core.package import FOLDER
from ...core.parameters import execution_option, parameter
from ...core.processes import Limits, death_reason
from ...core.program import run_program, telling_line
from ...scenes.folder import save_scene
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.las_files import write_points
from ...scenes.scene import INPUTS, Scene
from ..base import Detector
from .external_paths import absolute_words, content_digest, path_in, split_words
from .program_output import read_output
from .recipe_list import RECIPES

__all__ = ["Command"]

#: Exit code of a program that cannot run on this machine (the convention of automake): skipped, not failed.
_SKIP = 77
#: Time of every file in the folder of a program: 2000-01-01.
_TIME = 946_684_800
#: What a recipe depends on in roofbench.
_RECIPE_CODE = (
    "detectors/external/recipes",
    "detectors/shared/morphology.py",
    "detectors/shared/regularise.py",
    "scenes/geodata/outlines.py",
)
_CSV = ("x", "y", "z", "return_number", "number_of_returns", "intensity")
_PLACES = ("{scene}", "{parameters}", "{output}")


@dataclass(frozen=True, kw_only=True)
class Command(Detector):
    """A program in any language: scene folder and parameter file in, footprints out."""

    name = "command"

    run: str = parameter(
        "",
        doc="program with its arguments; {scene}, {parameters} and {output} stand for the paths, which follow the "
        "arguments in this order where none of them is named",
    )
    recipe: str = parameter(
        "", choices=("", *RECIPES), doc="an installed tool with the script that comes with roofbench, in place of run"
    )
    settings: str = parameter("", doc="values for the parameter file: 'height=2.5 name=text'")
    inputs: str = parameter("points", doc="inputs that a scene must have, separated by spaces: points, image, ...")
    files: str = parameter("", doc="further files and folders that the result depends on, such as a trained model")
    packages: str = parameter("", doc="Python packages whose version the result depends on")
    points: Literal["laz", "las", "csv"] = parameter(
        "laz",
        choices=("laz", "las", "csv"),
        doc="format of the points; las (not compressed) and csv are written beside points.laz",
    )
    output: Literal["geojson", "gpkg", "fgb"] = parameter(
        "geojson", choices=("geojson", "gpkg", "fgb"), doc="file format in which the program writes footprints"
    )
    seeded: bool = parameter(False, doc="whether the result depends on the seed in the parameter file")
    label: str = parameter("", doc="name in tables, in place of the parameters")
    time_limit: float = execution_option(600.0, unit="s", minimum=0.01, doc="wall clock time of the program")
    memory_limit: float | None = execution_option(None, unit="MB", minimum=1, doc="resident memory; none: no limit")
    size_limit: float = execution_option(256.0, unit="MB", minimum=0.001, doc="size of the file that it writes")

    def __post_init__(self) -> None:
        super().__post_init__()
        if bool(self.run.strip()) == bool(self.recipe):
            raise ParameterError("command: give either run (a program with its arguments) or recipe")
        given = _settings(self.settings)
        inputs = tuple(self.inputs.split())
        for need in inputs:
            if need not in INPUTS:
                raise ParameterError(f"command: inputs must be some of {', '.join(INPUTS)}, not {need!r}")
        object.__setattr__(self, "run", absolute_words(self.run, "run", Path.cwd()))
        object.__setattr__(self, "files", absolute_words(self.files, "files", Path.cwd()))
        object.__setattr__(self, "requires", inputs)
        object.__setattr__(self, "stochastic", self.seeded)
        if "seed" in given:
            raise ParameterError(
                "command: the value 'seed' is set by the run: set seeded=true and choose the seeds there"
            )
        for word in split_words(self.files, "files"):
            if not os.path.exists(word):
                raise ParameterError(f"command: files names {word}, which does not exist")
        if self.run:
            program = split_words(self.run, "run")[0]
            if shutil.which(program) is None and not Path(program).is_file():
                raise ParameterError(f"command: run names the program {program!r}, which does not exist")

    def own_label(self) -> str:
        """Return the name in tables: that of the recipe where nothing else is changed."""
        return self.label or (self.recipe if set(self.changed()) == {"recipe"} else "")

    def fingerprint(self) -> str:
        """Return a digest of the content of the executable and of every file that it is known to depend on."""
        paths = [Path(word) for word in split_words(self.files, "files")]
        packages = self.packages.split()
        if self.recipe:
            recipe = RECIPES[self.recipe]
            paths += [FOLDER / name for name in _RECIPE_CODE]
            packages += recipe.packages
            programs = recipe.programs
        else:
            words = split_words(self.run, "run")
            programs = (words[0],)
            paths += filter(None, map(path_in, words[1:]))
        paths += [Path(found) for program in programs if (found := shutil.which(program))]
        return content_digest(paths) + "".join(f" {name} {_version(name)}" for name in packages)

    def code_files(self) -> tuple[Path, ...]:
        """Return the program, the files among its arguments and those of `files`, but no installed program."""
        words = (*split_words(self.run, "run"), *split_words(self.files, "files"))
        found = filter(None, map(path_in, words))
        return tuple(path for path in found if shutil.which(path.name) != str(path))

    def detect(self, scene: Scene, rng: np.random.Generator) -> Footprints:
        """Return the footprints that the program wrote; metadata keep what it printed."""
        scene = scene.for_detection()
        seed = int(rng.integers(2**31)) if self.seeded else None
        with tempfile.TemporaryDirectory(prefix="roofbench-") as name:
            folder = Path(name)
            work = folder / "work"
            work.mkdir()
            parameters, output = folder / "parameters.json", work / f"footprints.{self.output}"
            save_scene(scene, folder / "scene")
            _write_points(scene, folder / "scene" / f"points.{self.points}")
            seeds = {} if seed is None else {"seed": seed}
            _write_parameters({**_settings(self.settings), **seeds}, parameters)
            _hide_times(folder)
            command, environment = self._command(folder / "scene", parameters, output)
            most = int(self.size_limit * 1e6)
            log = folder / "log.txt"
            end = run_program(
                command,
                folder=work,
                log=log,
                limits=Limits(self.time_limit, None if self.memory_limit is None else int(self.memory_limit * 1e6)),
                largest={output: most, log: most},
                environment={"TMPDIR": str(work), **environment},
            )
            program = self.recipe or Path(command[0]).name
            if end.code == _SKIP:
                last = " ".join(end.log.splitlines()[-1:])
                raise MissingInputError(f"{program} cannot run here: {last or 'it gives no reason'}")
            if end.code:
                cause = telling_line(end.log)
                raise ProgramError(death_reason(end.code, program) + (f": {cause}" if cause else ""), log=end.log)
            return read_output(output, crs=scene.crs, program=program, log=end.log)

    def _command(self, scene: Path, parameters: Path, output: Path) -> tuple[list[str], dict[str, str]]:
        """Return the words of the command line, and variables of its environment."""
        if self.recipe:
            words = [sys.executable, "-P", "-m", RECIPES[self.recipe].module]
            environment = {"PYTHONPATH": os.pathsep.join([str(FOLDER.parent), *(path for path in sys.path if path)])}
        else:
            words = split_words(self.run, "run")
            # That of this process may belong to another version of Python.
            environment = {"PYTHONPATH": ""}
        paths = dict(zip(_PLACES, map(str, (scene, parameters, output)), strict=True))
        if not any(place in word for word in words for place in _PLACES):
            return [*words, *paths.values()], environment
        for place, path in paths.items():
            words = [word.replace(place, path) for word in words]
        return words, environment


def _settings(text: str) -> dict[str, Any]:
    """Return the values of ``height=2.5 name=text`` as JSON holds them."""
    values: dict[str, Any] = {}
    for word in split_words(text, "settings"):
        name, equals, value = word.partition("=")
        if not equals or not name:
            raise ParameterError(f"command: settings must be written NAME=VALUE, separated by spaces, not {word!r}")
        try:
            values[name] = json.loads(value, parse_constant=_refuse_constant)
        except ValueError:
            values[name] = value
    return values


def _refuse_constant(text: str) -> None:
    raise ValueError(f"{text} is not JSON")  # Python reads NaN, other languages do not


def _write_parameters(values: Mapping[str, Any], file: Path) -> None:
    """Write values as JSON, one per line: a shell script reads them by sed."""
    lines = [f" {json.dumps(name)}: {json.dumps(value, ensure_ascii=False)}" for name, value in values.items()]
    file.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def _write_points(scene: Scene, file: Path) -> None:
    """Write the points for programs that cannot read LAZ; CSV holds coordinates, returns and intensity."""
    cloud = scene.points
    if cloud is None or file.exists():
        return
    if file.suffix == ".las":
        write_points(cloud, file, crs=scene.crs)
        return
    import pandas as pd  # slow to load

    columns = {name: getattr(cloud, name) for name in _CSV if getattr(cloud, name) is not None}
    pd.DataFrame(columns).to_csv(file, index=False, float_format="%.3f")


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "absent"


def _hide_times(folder: Path) -> None:
    """Give every file and folder the same time."""
    for path in [*folder.rglob("*"), folder]:
        os.utime(path, (_TIME, _TIME))
