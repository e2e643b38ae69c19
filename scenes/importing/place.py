"""The place of a scene that is being imported: its CRS and extent, and the log of what was done to get there.

Nouns
-----
extent
    ``(xmin, ymin, xmax, ymax)``, metres.
note
    One sentence on something that was assumed, resampled, repaired, left out or derived.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

__all__ = ["Extent", "ImportLog", "Place", "common_extent", "extent_text", "file_names", "file_paths"]

Extent = tuple[float, float, float, float]


class ImportLog:
    """Notes of an import, and how each derived layer was made.

    Parameters
    ----------
    report : callable, optional
        Called with each note as it is made.
    """

    def __init__(self, report: Callable[[str], None] | None = None) -> None:
        self.notes: list[str] = []
        self.derived: dict[str, str] = {}
        self._report = report

    def note(self, sentence: str) -> None:
        """Keep a note and report it."""
        self.notes.append(sentence)
        if self._report is not None:
            self._report(sentence)


@dataclass(frozen=True)
class Place:
    """The CRS and extent of a scene that is being imported, and its log."""

    crs: str
    extent: Extent
    log: ImportLog


def file_paths(paths: Sequence[Path]) -> str:
    """Return the path of one file, or of the first of several, for errors."""
    return str(paths[0]) if len(paths) == 1 else f"{paths[0]} and {len(paths) - 1} more"


def file_names(paths: Sequence[Path]) -> str:
    """Return the same without folders, for notes, which stay with the scene."""
    return file_paths([Path(path.name) for path in paths])


def extent_text(extent: Sequence[float]) -> str:
    """Return an extent in words: x from to, y from to."""
    xmin, ymin, xmax, ymax = extent
    return f"x {xmin:.1f} to {xmax:.1f}, y {ymin:.1f} to {ymax:.1f}"


def common_extent(one: Extent, two: Extent) -> Extent | None:
    """Return the intersection of two extents; None when they are apart or only touch."""
    xmin, ymin = max(one[0], two[0]), max(one[1], two[1])
    xmax, ymax = min(one[2], two[2]), min(one[3], two[3])
    return (xmin, ymin, xmax, ymax) if xmax > xmin and ymax > ymin else None
