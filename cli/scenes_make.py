"""``roofbench scenes make``: a synthetic scene folder from a preset, or the scenes of a suite without references."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..core.errors import ParameterError
from . import completion
from .console import print_result
from .options import Assignment, OverwriteOption, ParameterOption, SuiteOption

__all__ = ["make"]


def make(
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FOLDER", help="Scene folder to make; the parent with --suite.")
    ],
    preset: Annotated[
        str | None,
        typer.Argument(
            metavar="PRESET",
            help="Preset such as fairfield or knox-small (see 'roofbench scenes list').",
            autocompletion=completion.presets,
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option("--seed", min=0, metavar="N", help="Seed; the same seed gives the same scene.")
    ] = 1,
    parameter: ParameterOption = None,
    suite: SuiteOption = None,
    overwrite: OverwriteOption = False,
) -> None:
    """Make a synthetic scene folder, or the scenes of a suite without references.

    Example: roofbench scenes make knox-small --seed 3 -p tree_density=40 -o knox
    """
    if (preset is None) == (suite is None):
        raise ParameterError("name either a preset or, by suite=, a suite")
    if suite is not None:
        _make_suite(suite, output, overwrite)
    else:
        assert preset is not None
        _make_scene(preset, seed, parameter or [], output, overwrite)


def _make_scene(preset: str, seed: int, parameters: list[Assignment], output: Path, overwrite: bool) -> None:
    from ..benchmark.identity.recipes import SceneRecipe
    from ..core.output import check_target
    from ..scenes.folder import save_scene

    check_target(output, overwrite)
    scene = SceneRecipe.of_preset(preset, seed=seed, parameters=dict(parameters)).open()
    save_scene(scene, output, overwrite=overwrite)
    assert scene.reference is not None
    points = 0 if scene.points is None else len(scene.points)
    print_result(f"{output}: scene {scene.name!r} with {points} points and {len(scene.reference)} reference rectangles")


def _make_suite(suite: str, output: Path, overwrite: bool) -> None:
    from ..benchmark.contribution import blind_scenes
    from ..benchmark.suite import suite_of_words

    for folder, scene in blind_scenes(suite_of_words([suite]), output, overwrite=overwrite):
        print_result(f"{folder}: {', '.join(scene.contents)}, without reference")
