"""Frames: rectangles whose border is one roof all round, whatever stands higher inside.

Nouns
-----
box
    Rectangle that the high cells of a block fill (`candidates`), levels of all heights taken together.
border
    The cells of a box between half a cell and `_BORDER` cells from its nearest side.
base
    The median height of the roof in the border.
storey
    A patch (`superstructures`) inside the box whose mean height lies more than a step above the base and that reaches
    the border on one side at most: a tower on its podium, a storey set back from the front. A house in a row reaches
    two opposite sides, a house with a low annexe three: both stay.

A box is a frame when at least three sides of its border lie at the base and little in it is lower. Its storeys are
lowered to the plane of its base, as other superstructures are: one building has one rectangle.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .cells import HIGH, LOW, VOID
from .rectangles import row_span

__all__ = ["lower_storeys"]

#: Width of the border, cells.
_BORDER = 2.0
#: Strips that a box may grow by on each side.
_GROWTH = 6
#: Share of a side's known cells that must lie at the base, share of a box that may lie lower, and share that must have
#: the texture of a roof.
_LEVEL, _LOWER, _SMOOTH = 0.6, 0.2, 0.8
#: Share of a side's cells with which a storey reaches it, and share of a storey's cells that lie inside the box.
_REACHED, _INSIDE = 0.2, 0.85


@njit(cache=True, nogil=True)
def lower_storeys(height, state, labels, count, boxes, step):  # type: ignore[no-untyped-def]
    """Lower the storeys of all frames among the boxes in place; return whether there was any.

    Parameters
    ----------
    height : ndarray of int32, shape (rows, columns)
        Centimetres.
    state : ndarray of uint8, shape (rows, columns)
    labels : ndarray of int32, shape (rows, columns)
        Patches from 1 to `count`, 0 elsewhere.
    count : int
    boxes : ndarray, shape (n, 5)
        Largest first.
    step : int
        Centimetres.
    """
    rows, columns = height.shape
    sizes = np.zeros(count + 1, dtype=np.int64)
    for r in range(rows):
        for c in range(columns):
            sizes[labels[r, c]] += 1
    inside = np.zeros(count + 1, dtype=np.int64)
    rise = np.zeros(count + 1, dtype=np.int64)
    reached = np.zeros((count + 1, 4), dtype=np.int64)
    storey = np.zeros(count + 1, dtype=np.bool_)
    found = False
    box = np.empty(5)
    for k in range(len(boxes)):
        box[:] = boxes[k]
        _grow(height, state, box, step)
        if _lower_one(height, state, labels, box, step, sizes, inside, rise, reached, storey):
            found = True
    return found


@njit(cache=True, nogil=True)
def _grow(height, state, box, step):  # type: ignore[no-untyped-def]
    """Move the sides of a box out over strips of half a cell that are mostly high, in place, but not up a step.

    A box of cells that are all high stops short of the ragged edge of a roof that is turned against the grid.
    """
    rows, columns = state.shape
    cos, sin = math.cos(box[4]), math.sin(box[4])
    for side in range(4):
        axis, end = side // 2, 1.0 if side % 2 == 0 else -1.0
        for _ in range(_GROWTH):
            along = box[3 - axis]
            many = max(int(along), 1)
            high, unknown = 0, 0
            out = end * (0.5 * box[2 + axis] + 0.25)
            for k in range(many):
                at = ((k + 0.5) / many - 0.5) * along
                u, v = (out, at) if axis == 0 else (at, out)
                c, r = math.floor(box[0] + u * cos - v * sin), math.floor(box[1] + u * sin + v * cos)
                if 0 <= r < rows and 0 <= c < columns:
                    u, v = (out - end * _BORDER, at) if axis == 0 else (at, out - end * _BORDER)
                    j, i = math.floor(box[0] + u * cos - v * sin), math.floor(box[1] + u * sin + v * cos)
                    inner = 0 <= i < rows and 0 <= j < columns and state[i, j] == HIGH
                    level = not inner or height[r, c] <= height[i, j] + step
                    high += state[r, c] == HIGH and level
                    unknown += state[r, c] == VOID
            if high < _LEVEL * (many - unknown) or 3 * high < many:
                break
            box[2 + axis] += 0.5
            box[0] += 0.25 * end * (cos if axis == 0 else -sin)
            box[1] += 0.25 * end * (sin if axis == 0 else cos)


@njit(cache=True, nogil=True)
def _cells_of(box, shape):  # type: ignore[no-untyped-def]
    """Return row, column and side of the border (4: within it, 5: at its very edge) of the cells of a box."""
    rows, columns = shape
    cx, cy, half_a, half_b = box[0], box[1], 0.5 * box[2], 0.5 * box[3]
    cos, sin = math.cos(box[4]), math.sin(box[4])
    tall = half_a * abs(sin) + half_b * abs(cos)
    members = np.empty((int((box[2] + 2) * (box[3] + 2) + 8), 3), dtype=np.int32)
    n = 0
    for r in range(max(int(cy - tall), 0), min(int(cy + tall) + 1, rows)):
        dy = r + 0.5 - cy
        lo, hi = row_span(dy, half_a, half_b, cos, sin)
        if not lo < hi:
            continue
        for c in range(max(int(cx + lo + 0.5), 0), min(int(cx + hi + 0.5), columns)):
            if n == len(members):
                break
            dx = c + 0.5 - cx
            u, v = dx * cos + dy * sin, dy * cos - dx * sin
            away_u, away_v = half_a - abs(u), half_b - abs(v)
            side = (1 if u > 0 else 0) if away_u < away_v else (3 if v > 0 else 2)
            away = min(away_u, away_v)
            members[n, 0], members[n, 1] = r, c
            members[n, 2] = 5 if away < 0.5 else (side if away < _BORDER else 4)
            n += 1
    return members[:n]


@njit(cache=True, nogil=True)
def _lower_one(height, state, labels, box, step, sizes, inside, rise, reached, storey):  # type: ignore[no-untyped-def]
    cells = _cells_of(box, height.shape)
    border = np.empty(len(cells), dtype=np.int32)
    known = np.zeros(4, dtype=np.int64)
    n = 0
    for i in range(len(cells)):
        r, c, side = cells[i, 0], cells[i, 1], cells[i, 2]
        if side < 4 and labels[r, c] > 0:
            border[n] = height[r, c]
            n += 1
        if side < 4 and state[r, c] in (LOW, HIGH):
            known[side] += 1
    if n < 8:
        return False
    base = np.int64(np.sort(border[:n])[n // 2])
    level, taken = np.zeros(4, dtype=np.int64), np.zeros(4, dtype=np.int64)
    lower, higher, all_known, smooth = 0, 0, 0, 0
    for i in range(len(cells)):
        r, c, side = cells[i, 0], cells[i, 1], cells[i, 2]
        if side == 5 or (state[r, c] != LOW and state[r, c] != HIGH):
            continue
        all_known += 1
        smooth += labels[r, c] > 0
        above = height[r, c] - base if state[r, c] == HIGH else -base
        if above < -step:
            lower += 1
        elif above > step:
            higher += 1
            if side < 4 and labels[r, c] > 0:
                taken[side] += 1
        elif side < 4:
            level[side] += 1
    if higher == 0 or lower > _LOWER * all_known or smooth < _SMOOTH * all_known:
        return False
    sides = 0
    for side in range(4):
        if level[side] >= _LEVEL * max(level[side] + taken[side], known[side] // 2) and level[side] > 0:
            sides += 1
    if sides < 3:
        return False
    for i in range(len(cells)):
        r, c, side = cells[i, 0], cells[i, 1], cells[i, 2]
        label = labels[r, c]
        if label > 0:
            inside[label] += 1
            rise[label] += height[r, c]
            if side < 4:
                reached[label, side] += 1
    # Storeys are marked first: their cells are lowered to the plane of what is none.
    any_storey = False
    for i in range(len(cells)):
        label = labels[cells[i, 0], cells[i, 1]]
        if label == 0 or storey[label] or inside[label] < _INSIDE * sizes[label]:
            continue
        contacts = 0
        for side in range(4):
            if reached[label, side] > _REACHED * known[side]:
                contacts += 1
        if rise[label] > (base + step) * inside[label] and contacts <= 1:
            storey[label] = True
            any_storey = True
    if any_storey:
        _flatten(height, state, labels, cells, base, step, storey, box)
    for i in range(len(cells)):
        label = labels[cells[i, 0], cells[i, 1]]
        inside[label], rise[label], storey[label] = 0, 0, False
        reached[label, :] = 0
    return any_storey


@njit(cache=True, nogil=True)
def _flatten(height, state, labels, cells, base, step, storey, box):  # type: ignore[no-untyped-def]
    """Lower storeys, and walls and furniture above the base, to the plane of the base."""
    a = np.zeros((3, 3))
    b = np.zeros(3)
    x = np.empty(3)
    for i in range(len(cells)):
        r, c = cells[i, 0], cells[i, 1]
        if labels[r, c] > 0 and not storey[labels[r, c]] and abs(height[r, c] - base) <= step:
            x[0], x[1], x[2] = 1.0, c + 0.5 - box[0], r + 0.5 - box[1]
            for p in range(3):
                b[p] += x[p] * (height[r, c] - base)
                for q in range(3):
                    a[p, q] += x[p] * x[q]
    for p in range(3):
        a[p, p] += 1.0
    plane = np.linalg.solve(a, b)
    for i in range(len(cells)):
        r, c = cells[i, 0], cells[i, 1]
        if state[r, c] == LOW or (cells[i, 2] == 5 and state[r, c] != HIGH):
            continue
        if labels[r, c] == 0 or (storey[labels[r, c]] and height[r, c] > base + step):
            h = base + plane[0] + plane[1] * (c + 0.5 - box[0]) + plane[2] * (r + 0.5 - box[1])
            height[r, c] = min(max(round(h), base - step), base + step)
            state[r, c] = HIGH
