"""Raised parts of a surface: regions that steps down surround, whatever their size and shape.

A roof, a terrace held by walls all around and a block between streets are raised; a hill, a bank and the upper side of
a cliff are not. Unlike an opening, which needs a window wider than the object and land without a bend in it, this
looks at the outline only (segmentation before filtering: Sithole & Vosselman 2005, "Filtering of airborne laser scanner
data based on segmented point clouds", ISPRS Archives 36(3/W19)).

Nouns
-----
core
    Connected cells without a step, away from steps, so that a ramp of up to 8 m width does not join two of them.
outline
    Cells of a core, grown back, beside a step, beside unknown cells or the border of the scene (*cut*), or beside
    another core (*open*). A step goes *down* from the part or *up* from it.

Axis order: (row, column), row 0 northernmost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .steps import SMOOTH_STEP, STEEP, step_tops

__all__ = ["RaisedPart", "RaisedParts", "raised_parts"]

_Floats = NDArray[np.float32]
_Mask = NDArray[np.bool_]
_Labels = NDArray[np.int32]

#: Metres: half the width of a ramp or a gap in the steps.
_RAMP = 4.0
#: Least step, metres: lower ones do not bound a building.
_STEP = 2.0
#: Share of a step by which its top may lie above the core of the part that it bounds.
_LEVEL = 0.3
#: Square metres: smaller parts are left to the openings.
_SMALLEST = 100.0


@dataclass(frozen=True)
class RaisedPart:
    """One raised part.

    Attributes
    ----------
    number : int
        Its value in the labels.
    area : float
        Square metres.
    down, up, cut, open : float
        Shares of its outline.
    fall : float
        Median height of the steps down, metres.
    steep : float
        Share of the steps down that are walls and no banks.
    corners : int
        How many corners of the scene it contains.
    """

    number: int
    area: float
    down: float
    up: float
    cut: float
    open: float
    fall: float
    steep: float
    corners: int

    def stands(self, ringed: float, ringed_of_cut: float) -> bool:
        """Return whether steps down are the given share of its outline; less where the border of the scene is the rest.

        A part with two corners of the scene and less than half of its outline is the upper side of a cliff.
        """
        if self.steep < STEEP:
            return False
        if self.down >= ringed:
            return True
        inner = self.down + self.up + self.open
        cut_off = self.cut > 0 and self.down >= ringed_of_cut and self.down >= ringed * inner
        return cut_off and (self.corners < 2 or self.down > 0.5)


@dataclass(frozen=True, eq=False)
class RaisedParts:
    """The raised parts of a surface.

    Attributes
    ----------
    parts : list of RaisedPart
    labels : ndarray of int32, shape (rows, columns)
        The number of the part, or of another core; the tops of steps belong to none.
    tops : ndarray of bool, shape (rows, columns)
    rim : int
        How many cells wide the tops of a step can be.
    """

    parts: list[RaisedPart]
    labels: _Labels
    tops: _Mask
    rim: int

    def cells(self, chosen: list[RaisedPart]) -> _Mask:
        """Return the cells of some parts, with the tops of the steps around them."""
        found = np.isin(self.labels, [part.number for part in chosen]) if chosen else self.labels < 0
        return _grown(found.astype(np.int32), self.tops, self.rim) > 0


def raised_parts(surface: _Floats, unknown: _Mask, cell: float, *, smooth: bool) -> RaisedParts:
    """Return the parts of a surface that steps down bound.

    Parameters
    ----------
    surface : ndarray of float32, shape (rows, columns)
        Metres, finite.
    unknown : ndarray of bool, shape (rows, columns)
        Cells that are no part of the surface.
    cell : float
        Metres.
    smooth : bool
        Whether its steps rise within some metres (`steps.SMOOTH`).
    """
    import cv2

    values = np.where(unknown, np.float32(np.inf), surface)
    tops, steep, fall = step_tops(values, _STEP, cell, smooth=smooth)
    rim = 2 * round(SMOOTH_STEP / cell) if smooth else 3
    if not tops.any():
        return RaisedParts([], np.zeros(surface.shape, dtype=np.int32), tops, rim)
    labels, core = _cores(~tops & ~unknown, cell)
    size = int(labels.max()) + 1
    square = np.ones((3, 3), np.uint8)
    part = labels > 0
    beside = part & (cv2.dilate(tops.astype(np.uint8), square) > 0)
    reach = 2 * round(SMOOTH_STEP / cell) + 1 if smooth else 5
    around = np.ones((reach, reach), np.uint8)
    # Steps at the top of a pit or a wall bound what lies at their foot, too: their tops are higher than its core.
    step = cv2.dilate(np.where(tops, fall, np.float32(0)), around)
    ring = cv2.dilate(np.where(tops, values, np.float32(-np.inf)), around)
    level = cv2.dilate(np.where(core, values, np.float32(-np.inf)), np.ones((2 * _ramp(cell) + 3,) * 2, np.uint8))
    with np.errstate(invalid="ignore"):
        down = beside & (ring - level < np.maximum(_STEP / 2, _LEVEL * step))
    outside = cv2.dilate(np.pad(unknown, 1, constant_values=True).astype(np.uint8), square)[1:-1, 1:-1] > 0
    cut = part & ~beside & outside
    edge = part & ~beside & ~cut & (cv2.erode(part.astype(np.uint8), square, borderValue=1) == 0)
    wider = np.ones((2 * reach + 1,) * 2, np.uint8) if smooth else around
    steep = down & (cv2.dilate(steep.astype(np.uint8), wider) > 0)
    each = (down, beside & ~down, cut, edge, steep)
    counts = np.array([np.bincount(labels[cells], minlength=size) for cells in each])
    length = np.maximum(counts[:4].sum(axis=0), 1)
    area = np.bincount(labels.ravel(), minlength=size) * cell**2
    corner = labels[[0, 0, -1, -1], [0, -1, 0, -1]]
    found = []
    for number in np.flatnonzero((area >= _SMALLEST) & (counts[0] > 0)).tolist():
        if number == 0 or counts[0, number] < 0.3 * length[number]:
            continue
        shares = (counts[:4, number] / length[number]).tolist()
        found.append(
            RaisedPart(
                number=number,
                area=float(area[number]),
                down=shares[0],
                up=shares[1],
                cut=shares[2],
                open=shares[3],
                fall=float(np.median(step[down & (labels == number)])),
                steep=float(counts[4, number] / counts[0, number]),
                corners=int(np.count_nonzero(corner == number)),
            )
        )
    return RaisedParts(found, labels, tops, rim)


def _cores(free: _Mask, cell: float) -> tuple[_Labels, _Mask]:
    """Return the labels of the free cells that belong to a core, and the cores before they grew back."""
    import cv2

    reach = _ramp(cell)
    core = cv2.erode(free.astype(np.uint8), np.ones((2 * reach + 1,) * 2, np.uint8), borderValue=1)
    _, labels = cv2.connectedComponents(core, connectivity=4)
    return _grown(labels, free, reach + 1), core > 0


def _ramp(cell: float) -> int:
    return max(1, round(_RAMP / cell))


def _grown(labels: _Labels, free: _Mask, steps: int) -> _Labels:
    """Return the labels grown by so many cells over free ones."""
    import cv2

    grown = labels.astype(np.float32)
    plus = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    square = np.ones((3, 3), np.uint8)
    for step in range(steps):
        next_one = cv2.dilate(grown, plus if step % 2 else square)
        grown = np.where((grown == 0) & free, next_one, grown)
    return grown.astype(np.int32)
