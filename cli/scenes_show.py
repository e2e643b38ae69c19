"""``roofbench scenes show``: a scene as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .console import print_result
from .options import DpiOption, OverwriteOption, PictureOption

__all__ = ["show"]


def show(
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="Scene folder.")],
    output: PictureOption,
    dpi: DpiOption = 130,
    overwrite: OverwriteOption = False,
) -> None:
    """Draw a scene: orthoimage, height above ground and reference side by side."""
    from ..reports.figures import save_figure
    from ..reports.scene_map import scene_figure
    from ..scenes.folder import open_scene

    save_figure(scene_figure(open_scene(scene), dpi=dpi), output, overwrite=overwrite)
    print_result(output)
