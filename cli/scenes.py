"""``roofbench scenes``: commands that fetch, import, index, make, check, list and show scenes, one file each."""

from __future__ import annotations

import typer

from .command import Command
from .scenes_check import check
from .scenes_fetch import fetch
from .scenes_import import import_
from .scenes_index import index
from .scenes_list import list_scenes
from .scenes_make import make
from .scenes_show import show

__all__ = ["app"]

app = typer.Typer(
    name="scenes",
    help="Fetch, import, index, make, check, list and show scenes.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
)
app.command("fetch", cls=Command, short_help="Download open data and print the import command.")(fetch)
app.command("import", cls=Command, short_help="Make a scene of point files, images and footprints.")(import_)
app.command("index", cls=Command, short_help="Make a folder of tiles a scene, without copies.")(index)
app.command("make", cls=Command, short_help="Make a synthetic scene, or the scenes of a suite.")(make)
app.command("list", cls=Command, short_help="List presets, or the generator's parameters.")(list_scenes)
app.command("check", cls=Command, short_help="Check a scene folder and print its contents.")(check)
app.command("show", cls=Command, short_help="Draw a scene as a picture.")(show)
