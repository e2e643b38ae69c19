"""Input files by pattern and by ending."""

from __future__ import annotations

import glob
from collections.abc import Iterable, Sequence
from pathlib import Path

from ...core.errors import InputError

__all__ = ["expanded", "sorted_by_ending"]

_POINT_ENDINGS = (".las", ".laz")
_IMAGE_ENDINGS = (".tif", ".tiff", ".vrt", ".jp2", ".png", ".jpg", ".jpeg", ".img")


def expanded(patterns: Iterable[str]) -> list[str]:
    """Return the files of names and patterns, those of a pattern in alphabetical order."""
    found = []
    for pattern in patterns:
        if glob.has_magic(pattern) and not Path(pattern).exists():
            matches = sorted(glob.glob(pattern, recursive=True))
            if not matches:
                raise InputError(f"{pattern}: no file matches this pattern")
            found.extend(matches)
        else:
            found.append(pattern)
    return found


def sorted_by_ending(files: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the point files and the images; a file that is neither by its ending is refused."""
    points = [file for file in files if file.lower().endswith(_POINT_ENDINGS)]
    images = [file for file in files if file.lower().endswith(_IMAGE_ENDINGS)]
    for file in files:
        if file not in points and file not in images:
            raise InputError(
                f"{file} ends neither as a point file (.las, .laz) nor as an image: pass it as points=, ortho=, dem=, "
                "reference= or area="
            )
    return points, images
