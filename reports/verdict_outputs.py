"""The files that a comparison of footprints writes, checked before the work begins."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from ..core.errors import OutputError
from ..core.output import check_target
from ..scenes.geodata.vector_files import output_driver, split_layer

__all__ = ["check_targets"]


def check_targets(verdicts: Path | None, plot: Path | None, *, inputs: Iterable[str | None], overwrite: bool) -> None:
    """Raise `OutputError` for any output that could not be written, or that is an input, before there is a first one.

    Parameters
    ----------
    verdicts, plot : Path, optional
        Vector file and picture.
    inputs : iterable of str
        What is read, layers included.
    overwrite : bool
    """
    read = {os.path.realpath(split_layer(name)[0]) for name in inputs if name}
    for target in (verdicts, plot):
        if target is not None:
            check_target(target, overwrite)
            if os.path.realpath(target) in read:
                raise OutputError(f"{target} is an input of this comparison: name another file")
    if verdicts is not None:
        output_driver(verdicts)
    if plot is not None:
        from .figures import check_picture  # here, since an evaluation without pictures loads no matplotlib

        check_picture(plot)
