"""``roofbench scenes fetch``: download open data by a recipe, ready for ``scenes import``."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from . import completion
from .console import print_result
from .options import ParameterOption, QuietOption
from .progress import import_progress

if TYPE_CHECKING:
    from ..scenes.fetching import OpenData

__all__ = ["fetch", "import_command"]


def fetch(
    recipe: Annotated[
        str | None,
        typer.Argument(
            metavar="RECIPE",
            help="Recipe by name, or a TOML file; without it, list them.",
            autocompletion=completion.recipes,
        ),
    ] = None,
    parameter: ParameterOption = None,
    extent: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option("--extent", metavar="XMIN YMIN XMAX YMAX", help="What to fetch, in metres of the recipe's CRS."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FOLDER", help="Folder of the files.")
    ] = None,
    quiet: QuietOption = False,
) -> None:
    """Download open data of a mapping agency and print the command that makes a scene of it.

    Interrupted downloads continue. The SHA-256 of each file is recorded at its first download and checked after.
    """
    from ..core.errors import ParameterError
    from ..scenes.fetching import fetch as fetch_files
    from ..scenes.fetching import open_data, open_data_names

    if recipe is None:
        for name in open_data_names():
            found = open_data(name)
            print_result(f"{name}: {found.title}\n  licence: {found.licence}\n  tried: {found.tried}")
            for value, meaning in found.values.items():
                print_result(f"  -p {value}=: {meaning}")
            if found.needs_extent:
                print_result(f"  --extent XMIN YMIN XMAX YMAX: metres in {found.crs}")
        return
    chosen = open_data(recipe)
    if output is None:
        raise ParameterError("name the folder of the files: output=")
    with import_progress("downloading") as (note, move):
        files = fetch_files(
            chosen,
            output,
            values=dict(parameter or ()),
            extent=extent,
            note=(lambda _: None) if quiet else note,
            progress=move,
        )
    print_result(import_command(chosen, files, extent))


def import_command(recipe: OpenData, files: Mapping[str, list[Path]], extent: tuple[float, ...] | None) -> str:
    """Return the command that makes a scene of fetched files."""
    words = ["roofbench", "scenes", "import", "--crs", recipe.crs]
    for kind, paths in files.items():
        words += [word for path in paths for word in (f"--{kind}", str(path))]
    if recipe.building_id and "reference" in files:
        words += ["--building-id", recipe.building_id]
    if extent is not None:
        words += ["--extent", *(f"{value:g}" for value in extent)]
    words += ["--source", recipe.attribution, "--licence", recipe.licence, "-o", "my-scene"]
    return shlex.join(words)
