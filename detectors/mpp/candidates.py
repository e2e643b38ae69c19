"""Boxes that the data suggest: where buildings are tried first. Each is accepted or refused by the energy.

Nouns
-----
roof cells
    High cells whose texture is that of a roof.
patch
    Roof cells connected through steps no higher than a limit. Several limits are used: a low one separates houses of
    different height, no limit keeps a block together.
box
    Rectangle in the grid frame. Each patch is turned to the angle at which its bounding rectangle is smallest (one that
    the border of the scene cuts: at which most of its rim runs along the axes), gives that rectangle if it fills enough
    of it, and is taken apart greedily into the largest rectangles that it fills (L, T, U shapes and rows give several).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...core.kernels import kernel
from .arrays import Floats, Heights, Integers, Labels, Mask, Rectangles
from .patches import Division, cells_of_patches, divide_patches, label_patches
from .threads import ONE_THREAD, Threads

__all__ = ["Boxes", "propose_boxes"]

#: Angles tried in a quarter turn.
_ANGLES = 30
#: Largest rectangles taken from one patch.
_PIECES = 12
#: Fewest cells of a rim whose direction is used.
_LEAST_RIM = 12
#: A patch that fills this share of its bounding rectangle also gives that one: light wells and towers are holes in it.
_FILLED = 0.85
#: Cells and radians by which boxes differ that are not the same.
_ALIKE = 5e-4
#: Fractions of a cell to which places and sides are rounded: a power of two, so that a box is the same to the last bit
#: whatever cell of it a window of the scene begins with, and equally large boxes stay equally large.
_FRACTIONS = 1024


@dataclass(frozen=True, eq=False)
class Boxes:
    """Boxes that the data suggest, best first.

    Attributes
    ----------
    rectangles : ndarray, shape (n, 5)
    energies : ndarray, shape (n,)
        Of each box by itself.
    """

    rectangles: Rectangles
    energies: Floats

    def __len__(self) -> int:
        return len(self.rectangles)

    def take(self, chosen: Mask) -> Boxes:
        """Return some of the boxes."""
        return Boxes(self.rectangles[chosen], self.energies[chosen])


def propose_boxes(
    height: Heights,
    roof: Mask | Labels,
    *,
    steps: tuple[float, ...],
    least_cells: int,
    division: Division | None = None,
    threads: Threads = ONE_THREAD,
) -> Rectangles:
    """Return boxes of the patches of several step limits, shape (n, 5), without duplicates.

    Parameters
    ----------
    height : ndarray of int32, shape (rows, columns)
        Centimetres.
    roof : ndarray of bool or int32, shape (rows, columns)
        Not 0 where there is roof.
    steps : tuple of float
        Limits in metres, rising.
    least_cells : int
        Smaller patches and pieces are left out.
    division : Division, optional
        Where patches longer than any building are divided.
    threads : Threads
    """
    boxes, finer = [np.empty((0, 5))], np.zeros((1, 1), dtype=np.int32)
    for step in steps:
        labels, count = label_patches(height, roof, round(100 * step), threads=threads)
        if division is not None:
            labels, count = divide_patches(labels, count, division)
        boxes += _boxes_of_patches(labels, count, finer, least_cells, threads)
        finer = labels
    together = np.concatenate(boxes)
    together[:, :4] = np.round(together[:, :4] * _FRACTIONS) / _FRACTIONS
    order = np.lexsort(together.T)
    first = np.ones(len(order), dtype=np.bool_)
    first[1:] = (np.abs(together[order[1:]] - together[order[:-1]]) > _ALIKE).any(axis=1)
    return together[np.sort(order[first])]


def _boxes_of_patches(
    labels: Labels, count: int, finer: Labels, least_cells: int, threads: Threads
) -> list[Rectangles]:
    cells, starts = cells_of_patches(labels, count, threads=threads)

    def work(part: tuple[int, int]) -> Rectangles:
        return _boxes(cells, starts, *part, finer, least_cells, labels.shape)  # type: ignore[no-any-return]

    return threads.map(work, threads.ranges(np.diff(starts)))


@kernel
def _boxes(
    members: Labels, starts: Integers, first: int, last: int, finer: Labels, least_cells: int, shape: tuple[int, int]
) -> Rectangles:
    """Return the boxes of some patches, except of those that are patches of the `finer` labels, too."""
    boxes = np.empty(((_PIECES + 1) * (last - first), 5))
    n = 0
    for patch in range(first, last):
        cells = members[starts[patch] : starts[patch + 1]]
        if len(cells) >= least_cells and not _is_patch(finer, cells):
            rim = _rim_inside(cells, shape)
            angle = _wall_angle(rim) if len(rim) >= _LEAST_RIM else _best_angle(_row_ends(cells))
            n = _take_apart(cells, angle, least_cells, boxes, n)
    return boxes[:n].copy()


@kernel
def _is_patch(labels: Labels, cells: Labels) -> bool:
    """Whether all cells have one label; a finer step only splits patches, so that this label has no other cells."""
    if len(labels) == 1:
        return False
    label = labels[cells[0, 0], cells[0, 1]]
    others = 0
    for i in range(len(cells)):
        others += labels[cells[i, 0], cells[i, 1]] != label
    return others == 0


@kernel
def _row_ends(cells: Labels) -> Labels:
    """Return the first and last cell of each row: no other lies farthest out in any direction."""
    ends = np.empty_like(cells)
    n = 0
    for i in range(len(cells)):
        if i == 0 or i == len(cells) - 1 or cells[i - 1, 0] != cells[i, 0] or cells[i + 1, 0] != cells[i, 0]:
            ends[n] = cells[i]
            n += 1
    return ends[:n]


@kernel
def _bounding_area(cells: Labels, angle: float) -> float:
    """Area of the bounding rectangle at an angle."""
    cos, sin = math.cos(angle), math.sin(angle)
    low_u, high_u, low_v, high_v = np.inf, -np.inf, np.inf, -np.inf
    for i in range(len(cells)):
        u = cells[i, 1] * cos + cells[i, 0] * sin
        v = cells[i, 0] * cos - cells[i, 1] * sin
        low_u, high_u = min(low_u, u), max(high_u, u)
        low_v, high_v = min(low_v, v), max(high_v, v)
    return (high_u - low_u + 1.0) * (high_v - low_v + 1.0)


@kernel
def _best_angle(cells: Labels) -> float:
    """Angle in a quarter turn at which the bounding rectangle is smallest, to an eighth of the first step."""
    best, best_angle = np.inf, 0.0
    for k in range(_ANGLES):
        angle = 0.5 * math.pi * k / _ANGLES
        area = _bounding_area(cells, angle)
        if area < best:
            best, best_angle = area, angle
    turn = 0.25 * math.pi / _ANGLES
    for _ in range(3):
        middle = best_angle
        for side in (-1.0, 1.0):
            area = _bounding_area(cells, middle + side * turn)
            if area < best:
                best, best_angle = area, middle + side * turn
        turn *= 0.5
    return best_angle % (0.5 * math.pi)


@kernel
def _rim_inside(cells: Labels, shape: tuple[int, int]) -> Labels:
    """Return the first and last cells of the rows and columns of a patch but those at the border of the scene.

    None for a patch that does not reach the border.
    """
    rows, columns = shape
    top, bottom = cells[0, 0], cells[-1, 0]
    left, right = cells[:, 1].min(), cells[:, 1].max()
    if top > 0 and bottom < rows - 1 and left > 0 and right < columns - 1:
        return cells[:0]
    ends = np.empty((2 * (bottom - top + 1 + right - left + 1), 2), dtype=cells.dtype)
    upper = np.full(right - left + 1, rows, dtype=np.int64)
    lower = np.full(right - left + 1, -1, dtype=np.int64)
    n = 0
    for i in range(len(cells)):
        r, c = cells[i, 0], cells[i, 1]
        first = i == 0 or cells[i - 1, 0] != r
        last = i == len(cells) - 1 or cells[i + 1, 0] != r
        for side in range(2):
            if (first if side == 0 else last) and 0 < r < rows - 1 and 0 < c < columns - 1:
                ends[n, 0], ends[n, 1] = r, c
                n += 1
        upper[c - left], lower[c - left] = min(upper[c - left], r), max(lower[c - left], r)
    for c in range(left, right + 1):
        for side in range(2):
            r = upper[c - left] if side == 0 else lower[c - left]
            if 0 < r < rows - 1 and 0 < c < columns - 1:
                ends[n, 0], ends[n, 1] = r, c
                n += 1
    return ends[:n]


@kernel
def _wall_angle(rim: Labels) -> float:
    """Angle in a quarter turn at which most cells of a rim lie on common lines along the axes."""
    reach = 0
    for i in range(len(rim)):
        reach = max(reach, abs(rim[i, 0] - rim[0, 0]) + abs(rim[i, 1] - rim[0, 1]))
    best, best_angle = -1, 0.0
    lines = np.empty((2, 2 * reach + 3), dtype=np.int64)
    for k in range(4 * _ANGLES):
        angle = 0.125 * math.pi * k / _ANGLES
        cos, sin = math.cos(angle), math.sin(angle)
        lines[:] = 0
        for i in range(len(rim)):
            dy, dx = rim[i, 0] - rim[0, 0], rim[i, 1] - rim[0, 1]
            lines[0, math.floor(dx * cos + dy * sin + 0.5) + reach + 1] += 1
            lines[1, math.floor(dy * cos - dx * sin + 0.5) + reach + 1] += 1
        order = (lines * lines).sum()
        if order > best:
            best, best_angle = order, angle
    return best_angle


@kernel
def _take_apart(cells: Labels, angle: float, least_cells: int, boxes: Rectangles, n: int) -> int:
    """Append the bounding and the largest filled rectangles of a patch at an angle, until the rest is small."""
    cos, sin = math.cos(angle), math.sin(angle)
    low_u, high_u, low_v, high_v = np.inf, -np.inf, np.inf, -np.inf
    for i in range(len(cells)):
        x, y = cells[i, 1] + 0.5, cells[i, 0] + 0.5
        u, v = x * cos + y * sin, y * cos - x * sin
        low_u, high_u, low_v, high_v = min(low_u, u), max(high_u, u), min(low_v, v), max(high_v, v)
    wide, high = high_u - low_u + 0.8, high_v - low_v + 0.8
    if len(cells) > _FILLED * wide * high:
        u, v = 0.5 * (low_u + high_u), 0.5 * (low_v + high_v)
        boxes[n, 0], boxes[n, 1] = u * cos - v * sin, u * sin + v * cos
        boxes[n, 2], boxes[n, 3], boxes[n, 4] = wide, high, angle
        n += 1
    width, tall = int(high_u - low_u) + 3, int(high_v - low_v) + 3
    # Cells set four places each, so that a turned grid has no holes.
    full = np.zeros((tall, width), dtype=np.bool_)
    for i in range(len(cells)):
        x, y = cells[i, 1] + 0.5, cells[i, 0] + 0.5
        u, v = x * cos + y * sin - low_u + 0.5, y * cos - x * sin - low_v + 0.5
        full[int(v), int(u)] = True
        full[int(v), int(u + 0.5)] = True
        full[int(v + 0.5), int(u)] = True
        full[int(v + 0.5), int(u + 0.5)] = True
    for _ in range(_PIECES):
        area, top, left, bottom, right = _largest_filled(full)
        if area < least_cells or bottom - top < 3 or right - left < 3:
            break
        # Where the grid was dilated by half a cell the box is shortened again.
        u, v = 0.5 * (left + right) + low_u - 0.75, 0.5 * (top + bottom) + low_v - 0.75
        boxes[n, 0], boxes[n, 1] = u * cos - v * sin, u * sin + v * cos
        boxes[n, 2], boxes[n, 3], boxes[n, 4] = right - left - 0.5, bottom - top - 0.5, angle
        n += 1
        full[top:bottom, left:right] = False
    return n


@kernel
def _largest_filled(full: Mask) -> tuple[int, int, int, int, int]:
    """Area, top, left, bottom, right of the largest rectangle of true cells (histogram of runs, one stack per row)."""
    rows, columns = full.shape
    run = np.zeros(columns + 1, dtype=np.int64)
    stack = np.empty(columns + 2, dtype=np.int64)
    area, top, left, bottom, right = 0, 0, 0, 0, 0
    for r in range(rows):
        size = 0
        for c in range(columns + 1):
            if c < columns:
                run[c] = run[c] + 1 if full[r, c] else 0
            while size > 0 and run[stack[size - 1]] >= run[c]:
                size -= 1
                tall = run[stack[size]]
                begin = stack[size - 1] + 1 if size > 0 else 0
                if tall * (c - begin) > area:
                    area, top, left, bottom, right = tall * (c - begin), r - tall + 1, begin, r + 1, c
            stack[size] = c
            size += 1
    return area, top, left, bottom, right
