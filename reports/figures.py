"""Figures as files: PNG, SVG or PDF, whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from matplotlib.figure import Figure

from ..scenes.errors import OutputError
from ..scenes.output import whole_file

__all__ = ["save_figure"]

_ENDINGS = (".png", ".svg", ".pdf")


def save_figure(
    figure: Figure, path: str | os.PathLike[str], *, dpi: float | None = None, overwrite: bool = False
) -> None:
    """Write a figure; the ending of the file name chooses the format, `dpi` the pixels per inch of a PNG.

    Raises
    ------
    OutputError
        Unknown ending, existing file, or folder that cannot be written.
    """
    target = Path(path)
    if target.suffix.lower() not in _ENDINGS:
        raise OutputError(f"{target}: unknown file ending {target.suffix!r}: name it {', '.join(_ENDINGS)}")
    with whole_file(target, overwrite=overwrite) as scratch:
        # No creation date: the same input gives the same bytes.
        metadata = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}[target.suffix.lower()]
        figure.savefig(scratch, metadata=metadata, dpi="figure" if dpi is None else dpi)
