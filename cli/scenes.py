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
app.command("fetch", cls=Command)(fetch)
app.command("import", cls=Command)(import_)
app.command("index", cls=Command)(index)
app.command("make", cls=Command)(make)
app.command("list", cls=Command)(list_scenes)
app.command("check", cls=Command)(check)
app.command("show", cls=Command)(show)
