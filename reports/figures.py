"""Figures as files: PNG, SVG or PDF, written completely or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.text import Text

from ..core.errors import OutputError
from ..core.output import whole_file

__all__ = ["check_picture", "save_figure", "save_plot"]

_ENDINGS = (".png", ".svg", ".pdf")


def check_picture(path: Path) -> None:
    """Raise `OutputError` when the ending of a file names no format for figures."""
    if path.suffix.lower() not in _ENDINGS:
        raise OutputError(f"{path}: unknown file ending {path.suffix!r}: name it {', '.join(_ENDINGS)}")


def save_figure(
    figure: Figure,
    path: str | os.PathLike[str],
    *,
    dpi: float | None = None,
    tight: bool = False,
    overwrite: bool = False,
) -> None:
    """Write a figure; the ending of the file name chooses the format, `dpi` the pixels per inch of a PNG.

    `tight` fits the picture to what is drawn: no empty margins, and no key cut off.

    Raises
    ------
    OutputError
        Unknown ending, existing file, or folder that cannot be written.
    """
    target = Path(path)
    check_picture(target)
    with whole_file(target, overwrite=overwrite) as scratch:
        # No creation date: the same input gives the same bytes.
        metadata = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}[target.suffix.lower()]
        figure.savefig(
            scratch, metadata=metadata, dpi="figure" if dpi is None else dpi, bbox_inches="tight" if tight else None
        )


def save_plot(
    figure: Figure, path: str | os.PathLike[str], *, dpi: float | None = None, overwrite: bool = False
) -> None:
    """Write a figure on a white background; a ``$`` in a label is printed and starts no formula."""
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        text.set_parse_math(False)
    figure.set_facecolor("white")
    figure.patch.set_alpha(1)
    save_figure(figure, path, dpi=dpi, overwrite=overwrite)
