"""``roofbench scenes make`` and ``roofbench scenes list``: synthetic scenes from presets."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..core.errors import ParameterError

__all__ = ["list_", "make"]


def make(
    preset: Annotated[str, typer.Argument(help="Name of a preset: fairfield, knox-small, ... (see scenes list).")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Scene folder to make.")],
    seed: Annotated[int, typer.Option(min=0, help="Seed; the same seed gives the same scene.")] = 0,
    parameter: Annotated[
        list[str] | None,
        typer.Option("--parameter", "-p", help="NAME=VALUE of a generator parameter; repeat for more."),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the folder if it exists.")] = False,
) -> None:
    """Make a synthetic scene folder.

    Example: roofbench scenes make knox-small --seed 3 -p tree_density=40 -o knox
    """
    from ..scenes.folder import save_scene
    from ..scenes.synthetic import make_scene

    scene = make_scene(preset, seed=seed, **_read(parameter or []))
    save_scene(scene, output, overwrite=overwrite)
    assert scene.reference is not None
    points = 0 if scene.points is None else len(scene.points)
    typer.echo(f"{output}: scene {scene.name!r} with {points} points and {len(scene.reference)} reference rectangles")


def _read(settings: list[str]) -> dict[str, str]:
    values = {}
    for setting in settings:
        name, equals, value = setting.partition("=")
        if not equals:
            raise ParameterError(f"cannot read {setting!r}: write -p name=value")
        values[name.strip()] = value.strip()
    return values


def list_(
    parameters: Annotated[
        bool, typer.Option("--parameters", help="List the generator's parameters with unit, range and default instead.")
    ] = False,
) -> None:
    """List the presets of the generator, or its parameters."""
    from tabulate import tabulate

    from ..scenes.synthetic import SceneParameters, preset_names
    from ..scenes.synthetic.presets import preset

    if parameters:
        rows = [
            (rule.name, _plain(rule.default), rule.unit, rule.range_text, rule.doc)
            for rule in SceneParameters.parameters().values()
        ]
        typer.echo(tabulate(rows, ("parameter", "default", "unit", "range", "meaning"), disable_numparse=True))
        return
    rows = []
    for name in preset_names():
        recipe = preset(name)
        image = "none" if recipe.bands == "none" else f"{recipe.bands} {recipe.gsd:g} m"
        extent = f"{recipe.width:g} x {recipe.height:g} m"
        rows.append(
            (name, extent, f"{recipe.buildings} {recipe.counted}", image, f"{recipe.pulse} {recipe.point_spacing:g} m")
        )
    typer.echo(tabulate(rows, ("preset", "extent", "reference", "image", "pulses, spacing"), disable_numparse=True))


def _plain(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
