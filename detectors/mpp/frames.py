"""Frames: rectangles whose border is one roof level all round; parts of the inside may be higher.

Nouns
-----
box
    Rectangle that the high cells of a block fill (`candidates`), levels of all heights taken together.
border
    The cells of a box between half a cell and `_BORDER` cells from its nearest side.
base
    The median height of the roof in the border.
storey
    A patch (`superstructures`) inside the box whose mean height lies more than a step above the base, that stands on
    roof of that level rather than of another, and that reaches the border on one side at most: a tower on its podium,
    a storey set back from the front. A house in a row reaches two opposite sides, a house with a low annexe three:
    both stay.
wave
    Boxes of which none shares a cell with another, each later than all larger boxes that it shares cells with.

A box is a frame when at least three sides of its border lie at the base and little in it is lower. Its storeys are
lowered to the plane of its base, as other superstructures are: one building has one rectangle.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...core.kernels import kernel
from ..shared.selection import ordered_value
from .arrays import Heights, Integers, Labels, Mask, Rectangles, States
from .cells import HIGH, LOW, VOID
from .rectangles import overlap_area, row_span
from .reshaping import move_edge
from .threads import ONE_THREAD, Threads

__all__ = ["lower_storeys"]

#: Width of the border, cells.
_BORDER = 2.0
#: Strips that a box may grow by on each side.
_GROWTH = 6
#: How far beyond its sides a box may look, cells.
_REACH = 0.5 * _GROWTH + 2.0
#: Side of the squares by which boxes near each other are found, cells.
_SQUARE = 16
#: Share of a side's known cells that must lie at the base, share of a box that may lie lower, and share that must have
#: the texture of a roof.
_LEVEL, _LOWER, _SMOOTH = 0.6, 0.2, 0.8
#: Share of a side's cells with which a storey reaches it, and share of a storey's cells that lie inside the box.
_REACHED, _INSIDE = 0.2, 0.85
#: Sides of the border are 0 to 3; cells within the border, and cells at the very edge of the box.
_CORE, _EDGE = 4, 5
#: Fewest cells of roof in a border that has a base, and fewest sides that lie at it.
_FEWEST_CELLS, _FEWEST_SIDES = 8, 3
#: Cells by which the side of a box moves out at a time.
_STRIP = 0.5


class _Surface(NamedTuple):
    """What the boxes are compared with.

    Attributes
    ----------
    height : ndarray of int32, shape (rows, columns)
        Centimetres; lowered in place.
    state : ndarray of uint8, shape (rows, columns)
        Changed in place where storeys are lowered.
    roofs : ndarray of int32, shape (rows, columns)
        Centimetres before anything is lowered, walls at the height of the roof beside them.
    labels : ndarray of int32, shape (rows, columns)
        Patches, 0 elsewhere.
    sizes : ndarray of int64, shape (count + 1,)
        Cells of each patch; those of patches that are no storeys whatever they look like exceed every box.
    step : int
        Centimetres.
    """

    height: Heights
    state: States
    roofs: Heights
    labels: Labels
    sizes: Integers
    step: int


class _Storeys(NamedTuple):
    """Which patches are storeys: `marked` of those with the labels from `least` on."""

    marked: Mask
    least: int


def lower_storeys(
    height: Heights,
    state: States,
    roofs: Heights,
    labels: Labels,
    sizes: Integers,
    boxes: Rectangles,
    step: int,
    *,
    threads: Threads = ONE_THREAD,
) -> None:
    """Lower the storeys of all frames among the boxes, one box after the other, in place.

    Boxes that share no cell do not depend on each other, so several threads process wave after wave of such boxes.

    Parameters
    ----------
    height : ndarray of int32, shape (rows, columns)
        Centimetres.
    state : ndarray of uint8, shape (rows, columns)
    roofs : ndarray of int32, shape (rows, columns)
        Centimetres before anything is lowered, walls at the height of the roof beside them.
    labels : ndarray of int32, shape (rows, columns)
        Patches from 1, 0 elsewhere.
    sizes : ndarray of int64, shape (count + 1,)
        Cells of each patch; those of patches that are no storeys whatever they look like exceed every box.
    boxes : ndarray, shape (n, 5)
        Largest first.
    step : int
        Centimetres.
    threads : Threads
    """
    surface = _Surface(height, state, roofs, labels, sizes, step)
    wave = np.zeros(len(boxes), dtype=np.int64) if threads.count == 1 else _waves(boxes, *height.shape)
    for turn in range(wave.max(initial=-1) + 1):
        batch = boxes[wave == turn]

        def work(part: tuple[int, int], batch: Rectangles = batch) -> None:
            _lower_boxes(surface, batch[slice(*part)])

        threads.map(work, threads.ranges(batch[:, 2] * batch[:, 3], each=2))


@kernel
def _waves(boxes: Rectangles, rows: int, columns: int) -> Integers:
    """Return the wave of each box: the first after those of all boxes before it that it may share a cell with."""
    wave = np.zeros(len(boxes), dtype=np.int64)
    grown = boxes.copy()
    grown[:, 2:4] += 2 * _REACH
    # Earlier boxes that meet a square of the grid are linked, the last one first.
    last = np.full((rows // _SQUARE + 1, columns // _SQUARE + 1), -1, dtype=np.int64)
    links, size = np.empty((4 * len(boxes) + 64, 2), dtype=np.int64), 0
    for k in range(len(boxes)):
        cos, sin = abs(math.cos(grown[k, 4])), abs(math.sin(grown[k, 4]))
        wide = 0.5 * (grown[k, 2] * cos + grown[k, 3] * sin)
        tall = 0.5 * (grown[k, 2] * sin + grown[k, 3] * cos)
        left, right = _square(grown[k, 0] - wide, columns), _square(grown[k, 0] + wide, columns) + 1
        top, bottom = _square(grown[k, 1] - tall, rows), _square(grown[k, 1] + tall, rows) + 1
        for r in range(top, bottom):
            for c in range(left, right):
                link = last[r, c]
                while link >= 0:
                    other = links[link, 0]
                    if wave[other] >= wave[k] and overlap_area(grown[k], grown[other]) > 0.0:
                        wave[k] = wave[other] + 1
                    link = links[link, 1]
        while size + (bottom - top) * (right - left) > len(links):
            links = np.concatenate((links, np.empty_like(links)))
        for r in range(top, bottom):
            for c in range(left, right):
                links[size, 0], links[size, 1] = k, last[r, c]
                last[r, c] = size
                size += 1
    return wave


@kernel(inline="always")
def _square(place: float, size: int) -> int:
    """Return the square of the grid along one axis that a place lies in, the nearest one outside."""
    return int(min(max(place, 0.0), size - 1.0)) // _SQUARE


@kernel
def _lower_boxes(surface: _Surface, boxes: Rectangles) -> None:
    """Lower the storeys of some boxes, in place."""
    for k in range(len(boxes)):
        box = boxes[k].copy()
        _grow(surface, box)
        _lower_one(surface, box)


@kernel(inline="always")
def _cell_at(box: Rectangles, cos: float, sin: float, u: float, v: float) -> tuple[int, int]:
    """Return row and column of the cell at u, v from the centre of a box; cosine and sine of its angle are known."""
    return math.floor(box[1] + u * sin + v * cos), math.floor(box[0] + u * cos - v * sin)


@kernel
def _grow(surface: _Surface, box: Rectangles) -> None:
    """Move the sides of a box out over strips of half a cell that are mostly high, in place, but not up a step.

    A box of cells that are all high stops short of the ragged edge of a roof that is turned against the grid.
    """
    height, state = surface.height, surface.state
    rows, columns = state.shape
    cos, sin = math.cos(box[4]), math.sin(box[4])
    for side in range(4):
        axis, end = side // 2, 1.0 if side % 2 == 0 else -1.0
        for _ in range(_GROWTH):
            along = box[3 - axis]
            many = max(int(along), 1)
            high, unknown = 0, 0
            out = end * (0.5 * box[2 + axis] + 0.5 * _STRIP)
            for k in range(many):
                at = ((k + 0.5) / many - 0.5) * along
                r, c = _cell_at(box, cos, sin, out if axis == 0 else at, at if axis == 0 else out)
                if 0 <= r < rows and 0 <= c < columns:
                    back = out - end * _BORDER
                    i, j = _cell_at(box, cos, sin, back if axis == 0 else at, at if axis == 0 else back)
                    inner = 0 <= i < rows and 0 <= j < columns and state[i, j] == HIGH
                    level = not inner or height[r, c] <= height[i, j] + surface.step
                    high += state[r, c] == HIGH and level
                    unknown += state[r, c] == VOID
            if high < _LEVEL * (many - unknown) or 3 * high < many:
                break
            move_edge(box, side, _STRIP, box)


@kernel
def _cells_of(box: Rectangles, shape: tuple[int, int], inner: bool) -> Labels:
    """Return row, column and side of the border, `_CORE` or `_EDGE` of the cells of a box.

    Without `inner` those within the border are left out.
    """
    rows, columns = shape
    cx, cy, half_a, half_b = box[0], box[1], 0.5 * box[2], 0.5 * box[3]
    cos, sin = math.cos(box[4]), math.sin(box[4])
    tall = half_a * abs(sin) + half_b * abs(cos)
    core_a, core_b = half_a - _BORDER, half_b - _BORDER
    room = (box[2] + 2) * (box[3] + 2) + 8
    if not inner:
        room -= max(2 * core_a - 4, 0.0) * max(2 * core_b - 4, 0.0)
    members = np.empty((int(room), 3), dtype=np.int32)
    n = 0
    for r in range(max(int(cy - tall), 0), min(int(cy + tall) + 1, rows)):
        dy = r + 0.5 - cy
        lo, hi = row_span(dy, half_a, half_b, cos, sin)
        if not lo < hi:
            continue
        first, last = max(int(cx + lo + 0.5), 0), min(int(cx + hi + 0.5), columns)
        left, right = last, last
        if core_a > 0 and core_b > 0:
            lo, hi = row_span(dy, core_a, core_b, cos, sin)
            if lo + 4.0 < hi:
                # Cells that rounding might put on either side of the core's edge are examined.
                left = max(min(int(cx + lo + 2.0), last), first)
                right = max(min(int(cx + hi - 1.0), last), left)
        n = _append(members, n, box, r, first, left, inner)
        if inner:
            for c in range(left, min(right, left + len(members) - n)):
                members[n, 0], members[n, 1], members[n, 2] = r, c, _CORE
                n += 1
        n = _append(members, n, box, r, right, last, inner)
    return members[:n]


@kernel(inline="always")
def _append(members: Labels, n: int, box: Rectangles, r: int, first: int, last: int, inner: bool) -> int:
    """Append the cells of a part of a row, as `_cells_of` does; return how many there are now."""
    cos, sin = math.cos(box[4]), math.sin(box[4])
    dy = r + 0.5 - box[1]
    for c in range(first, min(last, first + len(members) - n)):
        dx = c + 0.5 - box[0]
        u, v = dx * cos + dy * sin, dy * cos - dx * sin
        away_u, away_v = 0.5 * box[2] - abs(u), 0.5 * box[3] - abs(v)
        away = min(away_u, away_v)
        if inner or away < _BORDER:
            side = (1 if u > 0 else 0) if away_u < away_v else (3 if v > 0 else 2)
            members[n, 0], members[n, 1] = r, c
            members[n, 2] = _EDGE if away < 0.5 else (side if away < _BORDER else _CORE)
            n += 1
    return n


@kernel
def _base_of(surface: _Surface, box: Rectangles, known: Integers) -> int:
    """Return the base of a box, -1 where it has none or too few sides lie at it; fill the known cells per side.

    Most boxes are recognised as no frames here, by their border alone.
    """
    height, state, labels, step = surface.height, surface.state, surface.labels, surface.step
    cells = _cells_of(box, height.shape, False)
    border = np.empty(len(cells), dtype=np.int32)
    n = 0
    for i in range(len(cells)):
        r, c, side = cells[i, 0], cells[i, 1], cells[i, 2]
        if side < _CORE and labels[r, c] > 0:
            border[n] = height[r, c]
            n += 1
        if side < _CORE and state[r, c] != VOID:
            known[side] += 1
    if n < _FEWEST_CELLS:
        return -1
    base = int(ordered_value(border, n, n // 2))
    level, higher = np.zeros(4, dtype=np.int64), np.zeros(4, dtype=np.int64)
    for i in range(len(cells)):
        r, c, side = cells[i, 0], cells[i, 1], cells[i, 2]
        if side < _CORE and state[r, c] != VOID:
            above = _rise(height, state, r, c, base)
            if abs(above) <= step:
                level[side] += 1
            elif above > step and labels[r, c] > 0:
                higher[side] += 1
    sides = 0
    for side in range(4):
        if level[side] >= _LEVEL * max(level[side] + higher[side], known[side] // 2) and level[side] > 0:
            sides += 1
    return base if sides >= _FEWEST_SIDES else -1


@kernel(inline="always")
def _rise(height: Heights, state: States, r: int, c: int, base: int) -> int:
    """Return how high a cell lies above the base, centimetres."""
    return height[r, c] - base if state[r, c] == HIGH else -base


@kernel
def _lower_one(surface: _Surface, box: Rectangles) -> None:
    """Lower the storeys of one box, in place, if it is a frame."""
    known = np.zeros(4, dtype=np.int64)
    base = _base_of(surface, box, known)
    if base < 0:
        return
    cells = _cells_of(box, surface.height.shape, True)
    lower, higher, all_known, smooth = 0, 0, 0, 0
    least, most = len(surface.sizes), 0
    for i in range(len(cells)):
        r, c = cells[i, 0], cells[i, 1]
        label = surface.labels[r, c]
        if label > 0:
            least, most = min(least, label), max(most, label)
        if cells[i, 2] != _EDGE and surface.state[r, c] != VOID:
            all_known += 1
            smooth += label > 0
            above = _rise(surface.height, surface.state, r, c, base)
            lower += above < -surface.step
            higher += above > surface.step
    if higher == 0 or lower > _LOWER * all_known or smooth < _SMOOTH * all_known:
        return
    # Storeys are marked first: their cells are lowered to the plane of the other cells.
    storeys = _Storeys(np.zeros(most - least + 1, dtype=np.bool_), least)
    _mark_storeys(surface, cells, known, base, storeys)
    if storeys.marked.any():
        _keep_carried(surface, cells, base, storeys)
    if storeys.marked.any():
        _flatten(surface, cells, base, storeys, box)


@kernel
def _mark_storeys(surface: _Surface, cells: Labels, known: Integers, base: int, storeys: _Storeys) -> None:
    """Mark, in place, the patches that lie inside a box, above its base, and reach its border on one side at most."""
    count, least = len(storeys.marked), storeys.least
    inside, rise = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    reached = np.zeros((count, 4), dtype=np.int64)
    for i in range(len(cells)):
        r, c, side = cells[i, 0], cells[i, 1], cells[i, 2]
        label = surface.labels[r, c]
        if label > 0:
            inside[label - least] += 1
            rise[label - least] += surface.height[r, c]
            if side < _CORE:
                reached[label - least, side] += 1
    for patch in range(count):
        many = inside[patch]
        low = rise[patch] <= (base + surface.step) * many
        if many == 0 or many < _INSIDE * surface.sizes[least + patch] or low:
            continue
        contacts = 0
        for side in range(4):
            if reached[patch, side] > _REACHED * known[side]:
                contacts += 1
        storeys.marked[patch] = contacts <= 1


@kernel
def _keep_carried(surface: _Surface, cells: Labels, base: int, storeys: _Storeys) -> None:
    """Unmark storeys that stand on a roof of another level than the base, in place.

    The penthouse of a tower beside the box may lie in it as well, but is carried by its tower.
    """
    roofs, labels, marked, least = surface.roofs, surface.labels, storeys.marked, storeys.least
    rows, columns = roofs.shape
    balance = np.zeros(len(marked), dtype=np.int64)
    for i in range(len(cells)):
        r, c = cells[i, 0], cells[i, 1]
        patch = labels[r, c] - least
        if patch < 0 or not marked[patch]:
            continue
        for side in range(4):
            j = r + (1 if side == 0 else (-1 if side == 1 else 0))
            k = c + (1 if side == 2 else (-1 if side == 3 else 0))
            if not (0 <= j < rows and 0 <= k < columns) or labels[j, k] == 0 or roofs[j, k] >= roofs[r, c]:
                continue
            other = labels[j, k] - least
            if not (0 <= other < len(marked) and marked[other]):
                balance[patch] += 1 if abs(roofs[j, k] - base) <= surface.step else -1
    for patch in range(len(marked)):
        marked[patch] = marked[patch] and balance[patch] >= 0


@kernel
def _flatten(surface: _Surface, cells: Labels, base: int, storeys: _Storeys, box: Rectangles) -> None:
    """Lower storeys, and walls and roof structures above the base, to the plane of the base, in place."""
    height, state, labels, step = surface.height, surface.state, surface.labels, surface.step
    n, x, y, xx, xy, yy, h, xh, yh = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(cells)):
        r, c = cells[i, 0], cells[i, 1]
        label = labels[r, c]
        if label > 0 and not storeys.marked[label - storeys.least] and abs(height[r, c] - base) <= step:
            dx, dy, rise = c + 0.5 - box[0], r + 0.5 - box[1], height[r, c] - base
            n += 1.0
            x += dx
            y += dy
            xx += dx * dx
            xy += dx * dy
            yy += dy * dy
            h += rise
            xh += dx * rise
            yh += dy * rise
    normal = np.array([[n + 1.0, x, y], [x, xx + 1.0, xy], [y, xy, yy + 1.0]])
    plane = np.linalg.solve(normal, np.array([h, xh, yh]))
    for i in range(len(cells)):
        r, c = cells[i, 0], cells[i, 1]
        if state[r, c] == LOW or (cells[i, 2] == _EDGE and state[r, c] != HIGH):
            continue
        label = labels[r, c]
        if label == 0 or (storeys.marked[label - storeys.least] and height[r, c] > base + step):
            level = base + plane[0] + plane[1] * (c + 0.5 - box[0]) + plane[2] * (r + 0.5 - box[1])
            height[r, c] = min(max(round(level), base - step), base + step)
            state[r, c] = HIGH
