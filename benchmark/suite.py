"""Suites: scenes, detectors and evaluators, from a TOML file, the command line, or Python objects.

Nouns
-----
suite
    Named scenes, detectors and evaluators; every detector runs on every scene.
scene entry
    A folder (``path``), a real scene that comes with roofbench (``name``), or a preset of the generator with ``seeds``
    and parameters, of which a list is a sweep axis. A folder with ``tile`` is a city: detectors see it tile by tile.
detector entry
    A detector with parameters and the seeds of its random streams.
"""

from __future__ import annotations

import fnmatch
import itertools
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

from ..core.errors import InputError, ParameterError, RoofbenchError, UnknownNameError
from ..core.inputs import require_file
from ..core.registry import nearest_hint, parse_selection
from ..detectors.base import Detector
from ..detectors.external.external_paths import with_absolute_paths
from ..detectors.registry import DETECTORS, make_detector
from ..evaluators.base import Evaluator
from ..evaluators.registry import make_evaluator
from ..scenes.remote import is_address
from ..scenes.scene import Scene
from ..scenes.shipped import shipped_names
from .identity.recipes import SceneRecipe, label_of, preset_names

__all__ = [
    "DetectorEntry",
    "Suite",
    "named_suite",
    "read_suite",
    "scenes_of",
    "suite_names",
    "suite_of_scenes",
    "suite_of_words",
]

_TABLES = ("scenes", "detectors", "evaluators")
_MAX_AXIS = 10_000
#: Endings of files that are imported, not run on.
_MEASUREMENTS = (".las", ".laz", ".tif", ".tiff", ".jp2", ".vrt")


@dataclass(frozen=True)
class DetectorEntry:
    """A detector and the seeds with which it runs on every scene."""

    detector: Detector
    seeds: tuple[int, ...] = (0,)

    def __post_init__(self) -> None:
        if not self.detector.stochastic and self.seeds != (0,):
            object.__setattr__(self, "seeds", (0,))  # other seeds would give the same footprints

    @property
    def label(self) -> str:
        """Name with changed parameters."""
        return label_of(self.detector)


@dataclass(frozen=True)
class Suite:
    """Scenes, detectors and evaluators.

    Attributes
    ----------
    name : str
    scenes : tuple of SceneRecipe or Scene
        Scene objects stay in this process, or are written to files for workers.
    detectors : tuple of DetectorEntry
    evaluators : tuple of Evaluator
    """

    name: str
    scenes: tuple[SceneRecipe | Scene, ...]
    detectors: tuple[DetectorEntry, ...]
    evaluators: tuple[Evaluator, ...]

    def with_scenes(self, pattern: str) -> Suite:
        """Return the suite with only the scenes whose name matches a pattern such as ``knox*``."""
        kept = tuple(scene for scene in self.scenes if fnmatch.fnmatchcase(scene.name, pattern))
        if not kept:
            names = [scene.name for scene in self.scenes]
            raise UnknownNameError(
                f"no scene matches {pattern!r}{nearest_hint(pattern, names)}; {self.name!r} has {_some(names)}"
            )
        return replace(self, scenes=kept)

    def with_seeds(self, count: int) -> Suite:
        """Return the suite with seeds 1 to `count` of every preset instead of its own seeds."""
        scenes: dict[str, SceneRecipe | Scene] = {}
        for scene in self.scenes:
            if isinstance(scene, Scene) or scene.kind not in ("preset", "builtin"):
                scenes[scene.name] = scene
                continue
            for seed in range(1, count + 1):
                recipe = SceneRecipe.of_preset(scene.place, seed=seed, parameters=scene.parameters)
                scenes[recipe.name] = recipe
        return replace(self, scenes=tuple(scenes.values()))


def suite_names() -> list[str]:
    """Return the names of the suites that come with roofbench."""
    folder = resources.files(__package__) / "suites"
    return sorted(item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml"))


def named_suite(name: str) -> Suite:
    """Return a suite that comes with roofbench."""
    if name not in suite_names():
        raise UnknownNameError(
            f"no suite called {name!r}{nearest_hint(name, suite_names())}; there are {', '.join(suite_names())}"
        )
    text = (resources.files(__package__) / "suites" / f"{name}.toml").read_text("utf-8")
    return _parse(text, source=f"suite {name}", folder=Path(), default_name=name)


def read_suite(path: str | Path) -> Suite:
    """Read a suite from a TOML file; scene paths and plugin files are relative to it.

    Raises
    ------
    InputError
        Missing file, TOML syntax, unknown keys or values; the line is named.
    """
    file = Path(path)
    require_file(file, "a suite, a TOML file")
    try:
        text = file.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file} cannot be read as a suite: {error}") from error
    return _parse(text, source=str(file), folder=file.resolve().parent, default_name=file.stem)


def scenes_of(words: Iterable[str]) -> tuple[SceneRecipe, ...]:
    """Return the scenes that words on the command line name: folders, presets, ``preset[seed=3,tree_density=40]``."""
    recipes: dict[str, SceneRecipe] = {}
    for word in words:
        path = Path(word)
        if is_address(word):
            recipe = SceneRecipe.of_folder(word)
        elif path.is_dir() and (word not in shipped_names() or (path / "scene.toml").is_file()):
            recipe = SceneRecipe.of_folder(path)
        elif word in shipped_names():
            recipe = SceneRecipe.of_shipped(word)
        else:
            name, values = parse_selection(word)
            if name not in preset_names():
                known = [*shipped_names(), *preset_names(), *suite_names()]
                known += (file.parent.name for file in Path().glob("*/scene.toml"))
                if path.suffix.lower() in _MEASUREMENTS:
                    raise UnknownNameError(
                        f"{word!r} is a measurement file, not a scene: make a scene folder of it with "
                        "'roofbench scenes import'"
                    )
                if word in suite_names() or path.suffix == ".toml":
                    raise UnknownNameError(
                        f"{word!r} is a suite, not a scene: 'roofbench run {word}' runs it by itself, "
                        "'roofbench list scenes' shows single scenes"
                    )
                raise UnknownNameError(
                    f"{word!r} is not a scene, preset or suite{nearest_hint(name, known)}: 'roofbench list scenes' "
                    "and 'roofbench list suites' show what there is"
                )
            parameters = {key: _number(value) for key, value in values.items()}
            seed = parameters.pop("seed", 1)
            if not isinstance(seed, int):
                raise ParameterError(f"{word}: seed must be a whole number, not {seed!r}")
            recipe = SceneRecipe.of_preset(name, seed=seed, parameters=parameters)
        recipes[recipe.name] = recipe
    return tuple(recipes.values())


def suite_of_words(
    words: Sequence[str] | None = None,
    detectors: Sequence[str] | None = None,
    evaluators: Sequence[str] | None = None,
    *,
    seeds: int = 1,
) -> Suite:
    """Return the suite that words and selections mean.

    Parameters
    ----------
    words : sequence of str, optional
        One suite (a TOML file or the name of one that comes with roofbench), or scene folders and presets; the suite
        ``quick`` when empty.
    detectors, evaluators : sequence of str, optional
        Selections that replace those of the suite.
    seeds : int
        Seeds of stochastic detectors that are selected here.

    Raises
    ------
    UnknownNameError
        No such suite, scene, detector or evaluator; the nearest name is given.
    """
    words = words or ["quick"]
    if len(words) == 1 and words[0].endswith(".toml"):
        suite = read_suite(words[0])
    elif len(words) == 1 and words[0] in suite_names():
        suite = named_suite(words[0])
    else:
        suite = suite_of_scenes(scenes_of(words))
    if detectors:
        numbers = tuple(range(seeds))
        suite = replace(suite, detectors=tuple(DetectorEntry(make_detector(name), numbers) for name in detectors))
    if evaluators:
        suite = replace(suite, evaluators=tuple(make_evaluator(name) for name in evaluators))
    return suite


def suite_of_scenes(scenes: Iterable[SceneRecipe | Scene], *, name: str = "scenes") -> Suite:
    """Return a suite of these scenes with every detector that needs no parameter and the default evaluator."""
    return Suite(name, tuple(scenes), all_detectors(), (make_evaluator(),))


def all_detectors() -> tuple[DetectorEntry, ...]:
    """Return every registered detector that runs with default parameters."""
    detectors = []
    for name in DETECTORS.names():
        try:
            detectors.append(DetectorEntry(make_detector(name)))
        except (ParameterError, ModuleNotFoundError):
            continue  # needs a program, a file or an extra package, and is run on request only
    return tuple(detectors)


def _number(text: str) -> Any:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return {"true": True, "false": False}.get(text.lower(), text)


def _some(names: Sequence[str], most: int = 8) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


class _Places:
    """Line numbers of the tables and keys of a TOML text, for messages."""

    def __init__(self, text: str, source: str) -> None:
        self._lines = text.splitlines()
        self._source = source

    def error(self, message: str, table: str | None = None, number: int = 0, key: str | None = None) -> InputError:
        """Return an error that names file, line and table."""
        line = self._line(table, number, key)
        place = f"{self._source}, line {line}" if line else self._source
        where = f" in [[{table}]] number {number + 1}" if table else ""
        return InputError(f"{place}: {message}{where}")

    def _line(self, table: str | None, number: int, key: str | None) -> int | None:
        at = None
        if table is None:
            start, end = 0, len(self._lines)
        else:
            heads = [i for i, line in enumerate(self._lines) if line.replace(" ", "").startswith(f"[[{table}]]")]
            if number >= len(heads):
                return None
            start, at = heads[number] + 1, heads[number] + 1
            later = [i for i in range(start, len(self._lines)) if self._lines[i].lstrip().startswith("[")]
            end = later[0] if later else len(self._lines)
        for i in range(start, end):
            if key is not None and self._lines[i].partition("=")[0].strip().strip('"') == key:
                return i + 1
        return at


def _parse(text: str, *, source: str, folder: Path, default_name: str) -> Suite:
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{source}: no valid TOML: {error}") from error
    places = _Places(text, source)
    known = ("name", *_TABLES)
    for key in content:
        if key not in known:
            raise places.error(
                f"unknown key {key!r}{nearest_hint(key, known)}; a suite has {', '.join(known)}", key=key
            )
    name = content.get("name", default_name)
    if not isinstance(name, str) or not name:
        raise places.error(f"name must be a text, not {name!r}", key="name")
    for table in _TABLES:
        if not isinstance(content.get(table, []), list) or not all(isinstance(t, dict) for t in content.get(table, [])):
            raise places.error(f"write {table} as tables with the heading [[{table}]]", key=table)
    scenes: dict[str, SceneRecipe] = {}
    for number, entry in enumerate(content.get("scenes", [])):
        for recipe in _scene_entry(entry, folder, places, number):
            scenes[recipe.name] = recipe
    if not scenes:
        raise places.error("a suite needs at least one [[scenes]]")
    detectors = [_detector_entry(entry, folder, places, n) for n, entry in enumerate(content.get("detectors", []))]
    evaluators = [_evaluator(entry, folder, places, n) for n, entry in enumerate(content.get("evaluators", []))]
    return Suite(
        name,
        tuple(scenes.values()),
        tuple(detectors) or all_detectors(),
        tuple(evaluators) or (make_evaluator(),),
    )


def _scene_entry(entry: Mapping[str, Any], folder: Path, places: _Places, number: int) -> Iterator[SceneRecipe]:
    sources = [key for key in ("path", "name", "preset") if key in entry]
    if len(sources) != 1:
        raise places.error("give a path, a name or a preset, one of them,", "scenes", number)
    (source,) = sources
    if source != "preset":
        for key in entry:
            if key != source and (source, key) != ("path", "tile"):
                raise places.error(f"{key!r} is not allowed for a scene with a {source}", "scenes", number, key)
        tile = entry.get("tile", 0.0)
        if "tile" in entry and not (isinstance(tile, int | float) and 16 <= tile <= 100_000):
            raise places.error(f"tile must be from 16 to 100000 metres, not {tile!r}", "scenes", number, "tile")
        try:
            value = str(entry[source])
            if source == "path":
                place = value if is_address(value) else folder / value
                if value in shipped_names() and not (folder / value).exists():
                    raise InputError(f'there is no folder {place}; the scene of roofbench is named by name = "{value}"')
                yield SceneRecipe.of_folder(place, tile=float(tile))
            else:
                yield SceneRecipe.of_shipped(value)
        except RoofbenchError as error:
            raise places.error(str(error), "scenes", number, source) from error
        return
    preset = entry["preset"]
    if preset not in preset_names():
        hint = nearest_hint(str(preset), preset_names())
        raise places.error(
            f"no preset {preset!r}{hint}; there are {', '.join(preset_names())}", "scenes", number, "preset"
        )
    seeds = _seeds(entry.get("seeds", [1]), first=1, places=places, table="scenes", number=number)
    names = [key for key in entry if key not in ("preset", "seeds")]
    axes = [value if isinstance(value := entry[key], list) else [value] for key in names]
    for key, axis in zip(names, axes, strict=True):
        if not axis or not all(isinstance(value, bool | int | float | str) for value in axis):
            raise places.error(f"{key!r} must be a value or a list of values", "scenes", number, key)
    for values in itertools.product(*axes):
        parameters = dict(zip(names, values, strict=True))
        for seed in seeds:
            try:
                yield SceneRecipe.of_preset(preset, seed=seed, parameters=parameters)
            except RoofbenchError as error:
                raise places.error(str(error), "scenes", number, _named_key(error, parameters)) from error


def _detector_entry(entry: Mapping[str, Any], folder: Path, places: _Places, number: int) -> DetectorEntry:
    use, values = _use(entry, folder, places, "detectors", number)
    seeds = values.pop("seeds", [0])
    if use in ("command", "precomputed"):
        values = with_absolute_paths(values, folder)
    try:
        detector = make_detector(use, values)
    except RoofbenchError as error:
        raise places.error(str(error), "detectors", number, _named_key(error, values) or "use") from error
    return DetectorEntry(detector, _seeds(seeds, first=0, places=places, table="detectors", number=number))


def _evaluator(entry: Mapping[str, Any], folder: Path, places: _Places, number: int) -> Evaluator:
    use, values = _use(entry, folder, places, "evaluators", number)
    try:
        return make_evaluator(use, values)
    except RoofbenchError as error:
        raise places.error(str(error), "evaluators", number, _named_key(error, values) or "use") from error


def _use(
    entry: Mapping[str, Any], folder: Path, places: _Places, table: str, number: int
) -> tuple[str, dict[str, Any]]:
    values = dict(entry)
    use = values.pop("use", None)
    if not isinstance(use, str):
        raise places.error(f"use must name a {table.removesuffix('s')}", table, number, "use")
    if ".py" in use and not Path(use).is_absolute():
        use = str(folder / use)
    return use, values


def _named_key(error: RoofbenchError, values: Mapping[str, Any]) -> str | None:
    return next((key for key in values if f"{key} " in str(error) or f"{key!r}" in str(error)), None)


def _seeds(value: Any, *, first: int, places: _Places, table: str, number: int) -> tuple[int, ...]:
    """Read ``5`` (so many, from `first`) or ``[1, 2, 3]``."""
    if isinstance(value, int) and not isinstance(value, bool) and 0 < value <= _MAX_AXIS:
        return tuple(range(first, first + value))
    if (
        isinstance(value, list)
        and value
        and all(isinstance(seed, int) and not isinstance(seed, bool) and seed >= 0 for seed in value)
    ):
        return tuple(dict.fromkeys(value))
    raise places.error(f"seeds must be a number of seeds or a list of them, not {value!r}", table, number, "seeds")
