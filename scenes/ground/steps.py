"""Steps of a surface: where it falls so fast that it is the border of an object and no slope.

Nouns
-----
fall, rise
    Height of a cell above the lowest, and of the highest above it, within a distance, metres.
sharp, smooth
    Walls of a *sharp* surface fall within two cells. Image matching and resampled rasters have *smooth* ones: the step
    rises within some metres from its foot to its top, as a bank does.
top
    Cells at the upper side of a step.

Axis order: (row, column), row 0 northernmost.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["CUT", "SMOOTH", "SMOOTH_STEP", "STEEP", "sharpness", "step_tops", "wall_cells"]

_Floats = NDArray[np.float32]
_Mask = NDArray[np.bool_]

#: Metres within which the step of a smooth surface rises from its foot to its top.
SMOOTH_STEP = 4.0
#: Rise over run that is still no wall, whatever the cell size: an embankment of 35 degrees.
_STEEPEST = 0.75
#: Cells within which a wall falls, and within which a bank goes on falling; twice as far where the surface is smooth.
#: The share of the latter that a wall falls within the former: all of it where the surface is sharp, 0.8 where it is
#: smooth; a bank has 0.4 and 0.5.
_WALL, _BANK, _SHARE = 2, 5, 0.65
#: Share of the steps around an object that must be walls and no banks.
STEEP = 0.5
#: Share of the fall of one in twenty steps below which steps are smooth, and of one in ten below which walls cut cells
#: although they are sharp. Steps that a Gaussian of one cell blurs have 0.7, those of scanned points and of rasters of
#: the highest points 1.
SMOOTH, CUT = 0.8, 0.96
#: Metres: lower steps say nothing on how sharp a surface is.
_TELLING = 3.0
#: Fewest cells with telling steps.
_FEWEST = 30


def sharpness(surface: _Floats) -> tuple[float, float]:
    """Return which share of its fall one in ten and one in twenty steps of a surface fall within the reach of a wall.

    Trees, cars and houses of a sharp surface have sharp steps, and its banks do not: a few are enough. 0 without steps.
    """
    wide, rise = _fall(surface, _BANK), _rise(surface, _WALL)
    # On a roof beside its wall; less the slope of the land, by which it rises as it falls.
    top = (wide > _TELLING) & (rise < wide / 8)
    falls = wide[top] - _rise(surface, _BANK)[top]
    shares = (_fall(surface, _WALL)[top] - rise[top])[falls > _TELLING] / falls[falls > _TELLING]
    if len(shares) < _FEWEST:
        return 0.0, 0.0
    ten, twenty = np.quantile(shares, [0.9, 0.95]).tolist()
    return ten, twenty


def wall_cells(relief: _Floats, height: float, cell: float, *, smooth: bool) -> tuple[_Mask, _Mask]:
    """Return the cells above a step and those around the steps of a smooth surface, and which of them are steep.

    A cell is above a step when the fall within two cells, less half the rise, exceeds `height`: a steep slope rises as
    much as it falls; the border of a roof falls to the ground and rises to its ridge at most. A bank goes on falling.
    Of a smooth surface, the fall within `SMOOTH_STEP` metres must be higher in proportion, and the border of the object
    lies at the foot of the step, as far away. Cells of infinite height are unknown: there is no step beside them.
    """
    import cv2

    fall, rise = _fall(relief, _WALL), _rise(relief, _WALL)
    with np.errstate(invalid="ignore"):
        walls = np.asarray(fall - rise / 2 > max(height, _STEEPEST * cell))
    reach = round(SMOOTH_STEP / cell)
    if not smooth or reach <= _WALL:
        # At the foot of a bank all that is left falls within two cells, and the bank rises as much.
        steep = walls & _is_steep(relief, fall, _BANK) & (rise < fall / 2)
        return walls, np.asarray(walls & (cv2.dilate(steep.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0))
    fall, rise = _fall(relief, reach), _rise(relief, reach)
    with np.errstate(invalid="ignore"):
        tops = fall - rise / 2 > _STEEPEST * height * max(cell, 1.0) * reach
    steep = tops & _is_steep(relief, fall, 2 * reach) & (rise < fall / 2)
    window = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    walls |= cv2.dilate(tops.astype(np.uint8), window) > 0
    return walls, np.asarray(walls & (cv2.dilate(steep.astype(np.uint8), window) > 0))


def step_tops(surface: _Floats, height: float, cell: float, *, smooth: bool) -> tuple[_Mask, _Mask, _Floats]:
    """Return the upper sides of the steps higher than `height`, which of them are steep, and the fall there, metres.

    Cells of infinite height are unknown: there is no step beside them.
    """
    reach = max(_WALL, round(SMOOTH_STEP / cell)) if smooth else _WALL
    if smooth:
        height = max(height, _STEEPEST * reach * cell)
    fall = _fall(surface, reach)
    rise = _rise(surface, reach)
    with np.errstate(invalid="ignore"):
        tops = np.asarray((fall - rise > height) & np.isfinite(surface))
    return tops, np.asarray(tops & _is_steep(surface, fall, 2 * reach if smooth else _BANK)), fall


def _is_steep(surface: _Floats, fall: _Floats, reach: int) -> _Mask:
    """Return where the fall within the reach of a wall is most of that within the given reach of a bank."""
    return np.asarray(fall >= _SHARE * _fall(surface, reach))


def _fall(surface: _Floats, reach: int) -> _Floats:
    """Return how far the surface falls within so many cells, metres."""
    import cv2

    with np.errstate(invalid="ignore"):
        return np.asarray(surface - cv2.erode(surface, _window(reach)), dtype=np.float32)


def _rise(surface: _Floats, reach: int) -> _Floats:
    """Return how far the surface rises within so many cells, metres; infinite heights do not count."""
    import cv2

    known = np.where(np.isfinite(surface), surface, np.float32(-np.inf))
    with np.errstate(invalid="ignore"):
        return np.asarray(cv2.dilate(known, _window(reach)) - known, dtype=np.float32)


def _window(reach: int) -> NDArray[np.uint8]:
    import cv2

    shape = cv2.MORPH_ELLIPSE if reach == _WALL else cv2.MORPH_RECT
    return np.asarray(cv2.getStructuringElement(shape, (2 * reach + 1, 2 * reach + 1)))
