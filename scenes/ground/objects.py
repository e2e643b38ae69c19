"""Objects on the lowest surface, removed from it by openings: roofs, crowns, bridges.

Nouns
-----
relief
    The lowest surface less the trend of the land, metres; NaN is unknown.
object, wall
    See `filter`.
cut object
    A large one that the border of the scene, or of what is known, cuts.

Axis order: (row, column), row 0 northernmost.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .filling import fill_unknown

__all__ = ["objects_of"]

_Floats = NDArray[np.float32]
_Mask = NDArray[np.bool_]

#: Windows up to this radius in metres remove objects without the test for walls: shrubs and crowns have ragged borders.
_NARROW = 6.0
#: Gaps of the points wider than twice this, metres, are no surface between what lies around: water, the scene's rim.
_GAP = 3.0
#: Metres within which the step of a smooth surface rises from its foot to its top.
_SMOOTH_STEP = 4.0
#: Share of the border of a wide object that must be wall.
_WALLED = 0.7
#: Share of its whole outline that must be wall where the border of the scene cuts a wide object: a hall cut at a corner
#: has half of it, the upper side of a cliff through the scene a third.
_WALLED_OF_CUT = 0.45
#: Rise over run that is still no wall, whatever the cell size: an embankment of 35 degrees.
_STEEPEST = 0.75
#: Side in metres of the blocks in which the widest windows look for the ground.
_COARSE = 4.0


def objects_of(
    relief: _Floats, cell: float, largest: float, slope: float, wall_height: float, *, feet: bool = False
) -> _Mask:
    """Return the cells of objects: removed by an opening and, where the window is wide, standing on walls.

    With `feet`, cells around an object that its step leaves above the ground belong to it.
    """
    import cv2

    objects = np.zeros(relief.shape, dtype=bool)
    # Gaps within the scene are filled, and what was measured nowhere around is like what lies beyond the scene.
    beyond = _beyond(np.isnan(relief), _GAP / cell)
    surface, walls = fill_unknown(relief), None
    for radius in _radii(largest / 2 / cell, min(relief.shape)):
        if radius * cell > _NARROW and walls is None:
            # Narrower windows have taken the trees off: what steps down in the surface between them is a roof.
            walls = _wall_cells(surface, wall_height, cell)
        window = cv2.getStructuringElement(cv2.MORPH_RECT, (2 * radius + 1, 2 * radius + 1))
        # Windows centred beyond the border would contain only the rim of a roof.
        lowest = cv2.erode(np.where(beyond, np.float32(np.inf), surface), window)
        opened = cv2.dilate(np.where(beyond, np.float32(-np.inf), lowest), window)
        removed = ~beyond & (surface - opened > np.minimum(0.3 + slope * radius * cell, 2.0))
        if walls is not None:
            removed = _standing(removed, walls, beyond)
            if feet:
                removed |= _foot(removed, surface - opened, cell) & ~beyond
            # Where a wing of a roof was removed, the border of the rest counts as wall, too.
            walls |= cv2.dilate(removed.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        objects |= removed
        surface = np.where(removed, opened, surface)
    return objects if walls is None else objects | _cut_objects(surface, walls, beyond, cell, largest)


def _cut_objects(surface: _Floats, walls: _Mask, beyond: _Mask, cell: float, largest: float) -> _Mask:
    """Return the cells of objects that the border of the scene cuts and no window above has removed.

    A window at the border holds half of what it holds inside, so that as deep an object needs one of twice the width.
    """
    objects = np.zeros(surface.shape, dtype=bool)
    block = max(1, round(_COARSE / cell))
    for radius in _radii(largest / cell / block, min(surface.shape) // block):
        if radius * block * cell <= largest / 2:
            continue
        opened = _opened_by_blocks(np.where(beyond, np.float32(np.inf), surface), radius, block)
        removed = _cut_by_border(~beyond & (surface - opened > 2.0), walls, beyond)
        objects |= removed
        surface = np.where(removed, opened, surface)
    return objects


def _opened_by_blocks(surface: _Floats, radius: int, block: int) -> _Floats:
    """Return an opening of the lowest values of blocks, by a window of that many; unknown cells are infinite."""
    import cv2

    rows, columns = surface.shape
    blocks = np.pad(surface, ((0, -rows % block), (0, -columns % block)), constant_values=np.inf)
    blocks = blocks.reshape(blocks.shape[0] // block, block, blocks.shape[1] // block, block).min(axis=(1, 3))
    window = cv2.getStructuringElement(cv2.MORPH_RECT, (2 * radius + 1, 2 * radius + 1))
    lowest = cv2.erode(blocks, window)
    lowest[np.isinf(blocks)] = -np.inf
    opened = cv2.dilate(lowest, window)
    return np.repeat(np.repeat(opened, block, axis=0), block, axis=1)[:rows, :columns]


def _cut_by_border(removed: _Mask, walls: _Mask, beyond: _Mask) -> _Mask:
    """Return the removed cells of the regions that stand on walls and reach the border of what is known."""
    import cv2

    standing = _standing(removed, walls, beyond)
    if not standing.any():
        return standing
    square = np.ones((3, 3), np.uint8)
    outside = cv2.dilate(np.pad(beyond, 1, constant_values=True).astype(np.uint8), square)[1:-1, 1:-1] > 0
    count, labels = cv2.connectedComponents(standing.astype(np.uint8), connectivity=4)
    outline = standing & (cv2.erode(standing.astype(np.uint8), square, borderValue=0) == 0)
    length, cut, walled = (
        np.bincount(labels[outline & part], minlength=count) for part in (standing, outside, walls & ~outside)
    )
    cut_off = (cut > 0) & (walled >= _WALLED_OF_CUT * length)
    return np.asarray(standing & cut_off[labels])


def _radii(largest: float, size: int) -> list[int]:
    """Window radii in cells, 1, 2, 3, 4, 6, 8, 12 ... up to the largest, none wider than the grid."""
    radii, radius = [], 1.0
    while True:
        radii.append(round(radius))
        if radius >= largest or 2 * radius + 1 >= size:
            return sorted(set(radii))
        radius = min(radius + max(1.0, radius * 0.41), largest)


def _foot(removed: _Mask, above: _Floats, cell: float) -> _Mask:
    """Return the cells around an object that a smooth step leaves above the ground."""
    import cv2

    reach = 2 * round(_SMOOTH_STEP / 2 / cell) + 1
    around = cv2.dilate(removed.astype(np.uint8), cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (reach, reach))) > 0
    return np.asarray(around & (above > 0.3))


def _wall_cells(relief: _Floats, height: float, cell: float) -> _Mask:
    """Return the cells above a step, and those around the steps of a smooth surface.

    A cell is above a step when the fall within two cells, less half the rise, exceeds `height`: a steep slope rises as
    much as it falls; the border of a roof falls to the ground and rises to its ridge at most. Surfaces of image
    matching and rasters have smooth steps. Within `_SMOOTH_STEP` metres the fall must be higher in proportion, and the
    border of the object lies at the foot of the step, as far away.
    """
    import cv2

    walls = _above_step(relief, 2, max(height, _STEEPEST * cell))
    reach = round(_SMOOTH_STEP / cell)
    if reach > 2:
        window = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
        smooth = _above_step(relief, reach, 0.75 * height * max(cell, 1.0) * reach)
        walls |= cv2.dilate(smooth.astype(np.uint8), window) > 0
    return walls


def _above_step(relief: _Floats, reach: int, height: float) -> _Mask:
    """Return the cells where the fall within `reach` cells, less half the rise, exceeds `height`."""
    import cv2

    window = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    fall = relief - cv2.erode(relief, window)
    rise = cv2.dilate(relief, window) - relief
    return np.asarray(fall - rise / 2 > height)


def _beyond(unknown: _Mask, reach: float) -> _Mask:
    """Return the unknown cells of gaps that a square reaching so many cells to all sides fits into."""
    import cv2

    # What lies around the grid is unknown, too.
    window = np.ones((2 * round(reach) + 1,) * 2, np.uint8)
    shrunk = cv2.erode(unknown.astype(np.uint8), window, borderValue=1)
    return np.asarray((cv2.dilate(shrunk, window) > 0) & unknown)


def _standing(removed: _Mask, walls: _Mask, beyond: _Mask) -> _Mask:
    """Return the removed cells of the regions whose border is wall; where nothing is known beyond it is no border."""
    import cv2

    count, labels = cv2.connectedComponents(removed.astype(np.uint8), connectivity=4)
    inner = cv2.erode((removed | beyond).astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=1)
    border = removed & (inner == 0)
    length = np.bincount(labels[border], minlength=count)
    walled = np.bincount(labels[border & walls], minlength=count)
    stands = walled >= _WALLED * np.maximum(length, 1)
    return np.asarray(removed & stands[labels])
