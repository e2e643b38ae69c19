"""``roofbench scenes index``: a folder of tiles as a scene."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .console import print_result, say
from .options import QuietOption
from .progress import import_progress

if TYPE_CHECKING:
    from ..scenes.importing.tile_index import IndexedFolder

__all__ = ["index", "report_index"]


def index(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Folder of LAS, LAZ or COPC files, images and elevation models.")
    ],
    crs: Annotated[
        str | None, typer.Option("--crs", metavar="CRS", help="CRS of files that name none, such as EPSG:25832.")
    ] = None,
    name: Annotated[
        str | None, typer.Option("--name", metavar="NAME", help="Name of the scene [name of the folder].")
    ] = None,
    quiet: QuietOption = False,
) -> None:
    """Make a folder of tiles a scene by an index of their bounds; no file is copied.

    Run it again after files were added, repaired or removed. Exit code 3 when a file is left out.

    Example: roofbench scenes index tiles/ --crs EPSG:28992
    """
    from ..scenes.importing.tile_index import index_folder

    with import_progress() as (_, progress):
        found = index_folder(folder, crs=crs, name=name, progress=None if quiet else progress)
    report_index(folder, found)


def report_index(folder: Path, found: IndexedFolder) -> None:
    """Print what a folder of tiles holds and which files are left out of it; exit code 3 when there are any."""
    for problem in found.problems:
        say(f"Error: {problem}")
    for note in found.notes:
        say(f"note: {note}")
    print_result(f"{folder}: scene {found.scene.name!r} with {', '.join(found.scene.contents)}")
    if found.problems:
        raise typer.Exit(3)
