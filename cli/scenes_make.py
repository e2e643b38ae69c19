"""``roofbench scenes make``: a synthetic scene folder from a preset."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from . import completion
from .options import OverwriteOption, ParameterOption

__all__ = ["make"]


def make(
    preset: Annotated[
        str,
        typer.Argument(
            metavar="PRESET",
            help="Preset such as fairfield or knox-small (see 'roofbench scenes list').",
            autocompletion=completion.presets,
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FOLDER", help="Scene folder to make.")],
    seed: Annotated[
        int, typer.Option("--seed", min=0, metavar="N", help="Seed; the same seed gives the same scene.")
    ] = 1,
    parameter: ParameterOption = None,
    overwrite: OverwriteOption = False,
) -> None:
    """Make a synthetic scene folder.

    Example: roofbench scenes make knox-small --seed 3 -p tree_density=40 -o knox
    """
    from ..benchmark.identity.recipes import SceneRecipe
    from ..core.output import check_target
    from ..scenes.folder import save_scene

    check_target(output, overwrite)
    scene = SceneRecipe.of_preset(preset, seed=seed, parameters=dict(parameter or ())).open()
    save_scene(scene, output, overwrite=overwrite)
    assert scene.reference is not None
    points = 0 if scene.points is None else len(scene.points)
    typer.echo(f"{output}: scene {scene.name!r} with {points} points and {len(scene.reference)} reference rectangles")
