"""Objects on the lowest surface: what openings remove from it, and what walls surround. Roofs, crowns, bridges.

Nouns
-----
relief
    The lowest surface less the trend of the land, metres; NaN is unknown.
object, wall
    See `filter`.
foot
    Cells beside an object that its smooth step leaves above the ground.

Axis order: (row, column), row 0 northernmost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .filling import fill_unknown
from .raised import raised_parts
from .steps import CUT, SMOOTH, SMOOTH_STEP, STEEP, sharpness, step_tops, wall_cells

__all__ = ["Objects", "objects_of"]

_Floats = NDArray[np.float32]
_Mask = NDArray[np.bool_]

#: Windows up to this radius in metres remove objects without the test for walls: shrubs and crowns have ragged borders.
_NARROW = 6.0
#: Gaps of the points wider than twice this, metres, are no surface between what lies around: water, the scene's rim.
_GAP = 3.0
#: Windows up to this radius in metres remove shrubs and cars. Larger regions that narrow windows remove, square metres,
#: are crests of banks unless this share of their border has steps of so many metres.
_SHRUBS, _CREST, _STEPPED, _LOWEST_STEP = 2.0, 150.0, 0.3, 0.7
#: Share of the border of a wide object that must be wall.
_WALLED = 0.7
#: Share of the outline of a part that steps down must surround, and of its whole outline where the border of the scene
#: cuts a wide object: a hall cut at a corner has half of it, the upper side of a cliff through the scene a third.
_RINGED, _WALLED_OF_CUT = 0.6, 0.45
#: Metres: wide objects are not lower.
_LOWEST_WIDE = 2.5
#: A wide object of at least so many square metres whose walls are lower than so many metres may be a terrace.
_TERRACE = (1000.0, 5.0)
#: Metres above the lowest cell around: feet are higher, those of sharp steps twice as high.
_FOOT = 0.15
#: How many steps a building may have one above the other.
_STOREYS = 3


@dataclass(frozen=True, eq=False)
class Objects:
    """What is not ground. Masks have the shape (rows, columns).

    Attributes
    ----------
    cells : ndarray of bool
        Cells of objects, their feet included.
    feet : ndarray of bool
        Cells that are no ground, however close to it: the feet of objects of a smooth surface.
    low : ndarray of bool
        Objects so wide and so low that they may be terraces (`_TERRACE`).
    widest : float
        Area of the largest object that walls surround, square metres.
    smooth : bool
        Whether the steps of the surface rise within some metres (`steps.SMOOTH`).
    """

    cells: _Mask
    feet: _Mask
    low: _Mask
    widest: float
    smooth: bool


def objects_of(relief: _Floats, cell: float, largest: float, slope: float, wall_height: float) -> Objects:
    """Return the objects: removed by an opening and, where the window is wide, standing on walls.

    Where the steps of the surface are smooth, the feet of objects belong to them.
    """
    import cv2

    objects = np.zeros(relief.shape, dtype=bool)
    # Gaps within the scene are filled, and what was measured nowhere around is like what lies beyond the scene.
    beyond = _beyond(np.isnan(relief), _GAP / cell)
    surface = fill_unknown(relief)
    sharp = sharpness(surface)
    smooth, cut = sharp[1] < SMOOTH, sharp[0] < CUT
    ringed = Objects(objects, objects, objects, 0.0, smooth)
    hidden, walls, steep, standing = beyond, objects, objects, objects.copy()
    wide = False
    for radius in _radii(largest / 2 / cell, min(relief.shape)):
        if radius * cell > _NARROW and not wide:
            wide = True
            # Narrower windows have taken the trees off: what steps down in the surface between them is a roof.
            ringed = _ringed(surface, beyond, cell, smooth=smooth)
            hidden = beyond | ringed.cells
            without = np.where(ringed.cells, np.float32(np.inf), surface)
            walls, steep = wall_cells(without, wall_height, cell, smooth=smooth)
        window = cv2.getStructuringElement(cv2.MORPH_RECT, (2 * radius + 1, 2 * radius + 1))
        # Windows centred beyond the border would contain only the rim of a roof.
        lowest = cv2.erode(np.where(hidden, np.float32(np.inf), surface), window)
        opened = cv2.dilate(np.where(hidden, np.float32(-np.inf), lowest), window)
        removed = ~hidden & (surface - opened > np.minimum(0.3 + slope * radius * cell, 2.0))
        if not wide and not smooth and radius * cell > _SHRUBS:
            removed = _without_banks(removed, surface, cell)
        if wide:
            removed = _standing(removed, surface - opened, (walls, steep), (beyond, ringed.cells), cell)
            standing |= removed
            walls, steep = _with_rim(removed, walls, steep)
        objects = objects | removed
        surface = np.where(removed, opened, surface)
    objects = objects | ringed.cells
    feet = np.zeros(relief.shape, dtype=bool)
    if smooth or cut:
        # Smooth steps surround all objects, sharp ones those with walls.
        feet = _feet(objects if smooth else standing | ringed.cells, objects, relief, beyond, cell, smooth=smooth)
    return Objects(objects | feet, feet, ringed.low, ringed.widest, smooth)


def _ringed(surface: _Floats, beyond: _Mask, cell: float, *, smooth: bool) -> Objects:
    """Return the objects that steps down surround, of any width.

    What stands on such a part is found first; without it, the part below it has its own outline only.
    """
    import cv2

    ringed = np.zeros(surface.shape, dtype=bool)
    low, widest = ringed.copy(), 0.0
    for _ in range(_STOREYS):
        raised = raised_parts(surface, beyond | ringed, cell, smooth=smooth)
        standing = [part for part in raised.parts if part.fall >= _LOWEST_WIDE and part.stands(_RINGED, _WALLED_OF_CUT)]
        if not standing:
            break
        ringed |= raised.cells(standing)
        low |= raised.cells([part for part in standing if part.area >= _TERRACE[0] and part.fall < _TERRACE[1]])
        widest = max(widest, *(part.area for part in standing))
    if widest:
        # Corners between two steps, which belong to neither part, lie no lower than the parts around.
        square = np.ones((3, 3), np.uint8)
        closed = cv2.morphologyEx(ringed.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8)) > 0
        around = cv2.erode(np.where(ringed, surface, np.float32(np.inf)), square)
        ringed |= closed & ~beyond & (surface > around - 1)
    return Objects(ringed, np.zeros(surface.shape, dtype=bool), low, widest, smooth)


def _with_rim(removed: _Mask, walls: _Mask, steep: _Mask) -> tuple[_Mask, _Mask]:
    """Return the walls, and which are steep, with the border of what was removed: the rest of a roof stands there."""
    import cv2

    beside = cv2.dilate(removed.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return walls | beside, steep | beside


def _radii(largest: float, size: int) -> list[int]:
    """Window radii in cells, 1, 2, 3, 4, 6, 8, 12 ... up to the largest, none wider than the grid."""
    radii, radius = [], 1.0
    while True:
        radii.append(round(radius))
        if radius >= largest or 2 * radius + 1 >= size:
            return sorted(set(radii))
        radius = min(radius + max(1.0, radius * 0.41), largest)


def _feet(standing: _Mask, objects: _Mask, relief: _Floats, beyond: _Mask, cell: float, *, smooth: bool) -> _Mask:
    """Return the cells around objects with walls that the lower part of a step lifts above the lowest of them.

    Where the steps are sharp, this is the cell that a wall cuts.
    """
    import cv2

    reach = 2 * round(SMOOTH_STEP / cell) + 1 if smooth else 7
    wide = cv2.morphologyEx(standing.astype(np.uint8), cv2.MORPH_OPEN, np.ones((5, 5), np.uint8))
    around = cv2.dilate(wide, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (reach, reach))) > 0
    ground = np.where(objects | beyond | np.isnan(relief), np.float32(np.inf), relief)
    lowest = cv2.erode(ground, np.ones((reach, reach), np.uint8))
    with np.errstate(invalid="ignore"):
        return np.asarray(around & ~objects & (ground - lowest > (_FOOT if smooth else 2 * _FOOT)))


def _beyond(unknown: _Mask, reach: float) -> _Mask:
    """Return the unknown cells of gaps that a square reaching so many cells to all sides fits into."""
    import cv2

    # What lies around the grid is unknown, too.
    window = np.ones((2 * round(reach) + 1,) * 2, np.uint8)
    shrunk = cv2.erode(unknown.astype(np.uint8), window, borderValue=1)
    return np.asarray((cv2.dilate(shrunk, window) > 0) & unknown)


def _without_banks(removed: _Mask, surface: _Floats, cell: float) -> _Mask:
    """Return the removed cells without the large regions whose border has no steps: crests of dikes and ridges."""
    import cv2

    count, labels = cv2.connectedComponents(removed.astype(np.uint8), connectivity=4)
    large = np.bincount(labels.ravel(), minlength=count) * cell**2 >= _CREST
    large[0] = False
    if not large.any():
        return removed
    border = large[labels] & (cv2.erode(removed.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=1) == 0)
    _, steps, _ = step_tops(surface, _LOWEST_STEP, cell, smooth=False)
    stepped = np.bincount(labels[border & steps], minlength=count)
    bank = large & (stepped < _STEPPED * np.bincount(labels[border], minlength=count))
    return np.asarray(removed & ~bank[labels])


def _standing(
    removed: _Mask, above: _Floats, border_of: tuple[_Mask, _Mask], beside: tuple[_Mask, _Mask], cell: float
) -> _Mask:
    """Return the removed cells of the regions whose border is wall.

    Parameters
    ----------
    removed : ndarray of bool, shape (rows, columns)
    above : ndarray of float32, shape (rows, columns)
        Their height above what the opening left, metres.
    border_of : tuple of ndarray of bool
        The walls, and which of them are steep.
    beside : tuple of ndarray of bool
        Where nothing is known, which is no border, and other objects: what is left of a roof beside one leans on it.
        Land beside a hall does not, since its other borders are banks.
    cell : float
        Metres.
    """
    import cv2

    walls, steep = border_of
    beyond, ringed = beside
    square = np.ones((3, 3), np.uint8)
    count, labels = cv2.connectedComponents(removed.astype(np.uint8), connectivity=4)
    inner = cv2.erode((removed | beyond).astype(np.uint8), square, borderValue=1)
    border = removed & (inner == 0)
    leaning = border & (cv2.dilate(ringed.astype(np.uint8), square) > 0)
    each = (border & ~leaning, border & ~leaning & walls, border & ~leaning & steep, leaning, removed)
    length, walled, steeply, leans, size = (np.bincount(labels[cells], minlength=count) for cells in each)
    height = np.bincount(labels[removed], weights=above[removed], minlength=count) / np.maximum(size, 1)
    # A low roof in the middle of a block leans on all sides.
    enclosed = (length == 0) & (height >= _LOWEST_WIDE)
    leans = np.where((walled > 0) | enclosed | (size * cell**2 < _CREST), leans, 0)
    stands = walled + leans >= _WALLED * np.maximum(length + leans, 1)
    stands &= steeply >= STEEP * walled
    stands &= (height >= _LOWEST_WIDE) | (size * cell**2 < _TERRACE[0])
    return np.asarray(removed & stands[labels])
