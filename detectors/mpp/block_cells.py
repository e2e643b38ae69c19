"""The cells of blocks: which high cells are built, seen in evidence, rectangles and the heights beside them.

Nouns
-----
evidence
    Score (`scores`) of the high cells around a high cell, summed up with the weights of a Gaussian.
core
    High cells with evidence for a roof, wherever they are, and all but low cells inside rectangles.
gap
    High cells without evidence, narrower than `_NARROW`, between cells of the core: rough corners, roofed passages and
    yards, and crowns. A gap between two blocks is a crown where it rises `_CROWN_RISE` above the roofs beside it, or
    where as many pulses pass it, or return from it in parts, as from the crowns of the scene (`openness`, see `cells`).
rim
    High cells within `_RIM` of a block at the height of the roof beside them: the window of texture of the eaves holds
    walls, ground and what grows there, so that it is rough whatever the roof is. Cells as open as crowns are none.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..shared.morphology import closed, closed_heights, opened, without_holes
from .arrays import Heights, Labels, Mask, Rectangles, Scores, States
from .cells import HIGH, LOW
from .rectangles import inside_any

__all__ = ["built_cells"]

#: Metres: sigma of the mean of evidence, radius of the opening, width of gaps, reach of rims.
_SIGMA, _OPENING, _NARROW, _RIM = 0.75, 1.0, 5.0, 1.0
#: Centimetres: what rises by a storey above the roofs beside it is no part of them, and largest step between a roof and
#: its rim (`roof_step`).
_CROWN_RISE, _RIM_STEP = 250, 50
#: Share of the openness of crowns from which a gap between two blocks, or what surrounds a cell beside a block, is a
#: crown: through roofs few pulses pass.
_AS_OPEN = 0.65
#: Square metres: largest hole that is filled.
_HOLE = 10.0
#: Share of a block that must lie inside rectangles.
_CONFIRMED = 0.5
#: Offsets of the eight neighbours of a cell.
_AROUND = tuple((row, column) for row in (-1, 0, 1) for column in (-1, 0, 1) if row or column)


def built_cells(
    rectangles: Rectangles,
    gsd: float,
    height: NDArray[np.uint16],
    state: States,
    score: Scores,
    openness: States,
    crown_openness: float,
) -> Mask:
    """Return the cells of the blocks that rectangles, shape (n, 5), belong to.

    Parameters
    ----------
    rectangles : ndarray, shape (n, 5)
        Grid frame.
    gsd : float
        Cell, m.
    height : ndarray of uint16, shape (rows, columns)
        Height above ground, cm.
    state : ndarray of uint8, shape (rows, columns)
        See `cells`.
    score : ndarray of int16, shape (rows, columns)
        See `scores`.
    openness : ndarray of uint8, shape (rows, columns)
        See `cells`.
    crown_openness : float
        Mean openness of crowns, 0 to 1; nan where it is not known.
    """
    import cv2

    inside = inside_any(rectangles, state.shape)
    high = state == HIGH
    around = cv2.GaussianBlur(np.multiply(score, high, dtype=np.float32), (0, 0), _SIGMA / gsd)
    sure = inside & (state != LOW)
    core = (high & (around > 0)) | sure
    least = 255 * _AS_OPEN * crown_openness
    gaps = high & closed(core, 0.5 * _NARROW / gsd) & ~core
    if gaps.any():
        rising = height > _roofs_around(core & high, height, gsd).astype(np.int32) + _CROWN_RISE
        gaps[_crowns(gaps, _whole(core, sure, gsd), rising, openness, least)] = False
    built = _whole(core | gaps, sure, gsd)
    closed_to_pulses = ~(cv2.blur(openness.astype(np.float32), (3, 3)) >= least)
    built = _with_rims(built, height, high & closed_to_pulses, max(round(_RIM / gsd), 1))
    _, labels = cv2.connectedComponents(built.astype(np.uint8), connectivity=4)
    cells = np.bincount(labels.ravel())
    kept = np.bincount(labels[inside], minlength=len(cells)) >= _CONFIRMED * cells
    kept[0] = False
    return np.asarray(kept.take(labels))


def _whole(built: Mask, sure: Mask, gsd: float) -> Mask:
    """Return cells without small holes and, outside rectangles, without narrow parts."""
    return np.asarray(opened(without_holes(built, _HOLE / gsd**2), _OPENING / gsd) | sure)


def _components(mask: Mask) -> Labels:
    """Return the number of the connected part of each cell, 0 outside the mask, with a border of one cell."""
    import cv2

    solid = cv2.copyMakeBorder(mask.astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
    labels: Labels = cv2.connectedComponents(solid, connectivity=4)[1]
    return labels


def _roofs_around(roof: Mask, height: NDArray[np.uint16], gsd: float) -> NDArray[np.uint16]:
    """Return the height of the roofs on both sides of a narrow gap; 0 elsewhere."""
    return closed_heights(np.where(roof, height, np.uint16(0)), 0.5 * _NARROW / gsd)


def _crowns(
    gaps: Mask, apart: Mask, rising: Mask, openness: States, least: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return row and column of the cells of crowns in gaps between two blocks of the mask `apart`.

    These are cells that rise above the roofs on both sides, and all cells of a gap of at least some mean openness.
    """
    row, column = np.nonzero(gaps)
    own = _components(gaps)[row + 1, column + 1]
    lowest, highest = _labels_beside(_components(apart), row, column)
    first, last = np.full(own.max() + 1, np.iinfo(np.int32).max), np.zeros(own.max() + 1, np.int32)
    np.minimum.at(first, own, lowest)
    np.maximum.at(last, own, highest)
    cells = np.bincount(own)
    as_open = np.bincount(own, weights=openness[row, column]) >= least * np.maximum(cells, 1)
    crown = (first < last)[own] & (rising[row, column] | as_open[own])
    return row[crown], column[crown]


def _labels_beside(
    labels: Labels, row: NDArray[np.int64], column: NDArray[np.int64]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the least and the greatest label around cells; `labels` has a border of one cell, and 0 is no label."""
    none = np.iinfo(np.int32).max
    least, most = np.full(len(row), none, np.int32), np.zeros(len(row), np.int32)
    for down, right in _AROUND:
        label = labels[row + 1 + down, column + 1 + right]
        np.minimum(least, np.where(label > 0, label, none), out=least)
        np.maximum(most, label, out=most)
    return least, most


def _with_rims(built: Mask, height: NDArray[np.uint16], high: Mask, rounds: int) -> Mask:
    """Return blocks grown by their rims, a cell in each round; no two blocks are joined."""
    import cv2

    labels = _components(built)
    levels: Heights = np.pad(height.astype(np.int32), 1)
    ring = np.ones((3, 3), np.uint8)
    for _ in range(rounds):
        beside = cv2.dilate((labels[1:-1, 1:-1] > 0).astype(np.uint8), ring) > 0
        row, column = np.nonzero(high & beside & (labels[1:-1, 1:-1] == 0))
        low, top = np.full(len(row), np.iinfo(np.int32).max), np.full(len(row), -1, np.int32)
        for down, right in _AROUND:
            place = row + 1 + down, column + 1 + right
            known = labels[place] > 0
            np.minimum(low, np.where(known, levels[place], low), out=low)
            np.maximum(top, np.where(known, levels[place], top), out=top)
        own = levels[row + 1, column + 1]
        least, most = _labels_beside(labels, row, column)
        near = (least == most) & (own <= top + _RIM_STEP) & (own >= low - _RIM_STEP)
        row, column, most = row[near], column[near], most[near]
        labels[row + 1, column + 1] = most
        least, most = _labels_beside(labels, row, column)
        touching = least < most
        labels[row[touching] + 1, column[touching] + 1] = 0
    return np.asarray(labels[1:-1, 1:-1] > 0)
