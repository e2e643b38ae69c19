"""Superstructures: lift houses, plant rooms and towers that stand on a roof belong to the building below them.

Nouns
-----
patch, rim
    See `patches`; of cells with the texture of a roof, and of the rough cells between them (walls, which have any
    height between two roofs, and roof structures), which take the height of the roof beside them that is nearer in
    height (`roughness`). Crowns belong to none.
superstructure
    A patch that is not too long (`patches.Division`) and whose rim is lower roof nearly all round. A house in a row is
    none: its front and back stand free.
roof structure
    A small rough area with roof nearly all round: chimneys, ducts, a terrace with plants.

Storeys of frames are lowered first (`frames`), then roof structures and superstructures, towers on towers from the top
down: each cell to the level of the roof beside it, before roofs are fitted, so that it neither spoils the fit nor
becomes a building of its own.
"""

from __future__ import annotations

import numpy as np

from ...core.kernels import kernel
from .arrays import Heights, Labels, Mask, States
from .candidates import propose_boxes
from .cells import HIGH, LOW
from .frames import lower_storeys
from .patches import Division, count_rims, label_patches, longer_patches, patch_sizes
from .roughness import assign_rough_cells
from .threads import ONE_THREAD, Threads

__all__ = ["lower_superstructures"]

#: Centimetres by which cells of a ledge differ at most.
_LEDGE = 30
#: Longest run of void cells that a tower's shadow leaves on a roof.
_SHADOW = 12
#: Largest number of superstructures on top of each other.
_ROUNDS = 5
#: Centimetres: more than any two heights differ by.
_ANY = 1 << 30
#: States of the cells that are to be lowered.
_DONE, _WAITING, _NEXT = np.uint8(0), np.uint8(1), np.uint8(2)
#: Cells of patches that are too long for storeys.
_TOO_MANY = np.int64(1) << 40


def lower_superstructures(
    height: Heights,
    state: States,
    roof: Mask,
    *,
    step: float,
    share: float,
    most: int,
    division: Division | None = None,
    threads: Threads = ONE_THREAD,
) -> tuple[Heights, States]:
    """Return heights and states with superstructures lowered to the roofs that carry them, and their shadows filled.

    Parameters
    ----------
    height : ndarray of int32, shape (rows, columns)
        Centimetres.
    state : ndarray of uint8, shape (rows, columns)
    roof : ndarray of bool, shape (rows, columns)
        Cells whose texture is that of a roof.
    step : float
        Metres by which neighbouring cells of a patch differ at most.
    share : float
        Share of the rim that must be lower roof; more than 1 changes nothing.
    most : int
        Largest number of cells of a roof structure.
    division : Division, optional
        Says which patches are long: they are neither searched for frames nor superstructures, because what is decided
        at a place must not depend on what a window of the scene does not show.
    threads : Threads
    """
    if share > 1:
        return height, state
    limit = round(100 * step)
    lowered, state = _lower_storeys(height, state, roof, limit, division, threads)
    labels, count = label_patches(lowered, roof, limit, threads=threads)
    assign_rough_cells(lowered, state, labels, threads=threads)
    if _level_structures(lowered, state, labels, share, most, threads):
        labels, count = label_patches(lowered, labels, limit, threads=threads)
    for turn in range(_ROUNDS):
        if turn > 0:
            labels, count = label_patches(lowered, labels, limit, threads=threads)
        rims = count_rims(labels, count, lowered, state, labels, fall=1, threads=threads)
        chosen = rims.carried(share) & ~_too_long(labels, count, division)
        if not _lower_to_roof(lowered, labels, labels, chosen, -limit // 2, threads):
            break
    return lowered, state


def _too_long(labels: Labels, count: int, division: Division | None) -> Mask:
    """Return which patches are so long that a division divides them, shape (count + 1,)."""
    if division is None:
        return np.zeros(count + 1, dtype=np.bool_)
    return np.asarray(longer_patches(labels, count, division.longest))


def _without_long(
    height: Heights, mask: Mask | Labels, step: float, division: Division | None, threads: Threads
) -> Mask | Labels:
    """Return the cells of a mask that belong to no long patch; a row of houses that is cut somewhere looks like frames.

    `step` is in metres.
    """
    if division is None:
        return mask
    labels, count = label_patches(height, mask, round(100 * step), threads=threads)
    kept = ~_too_long(labels, count, division)
    kept[0] = False
    return kept.take(labels)


def _lower_storeys(
    height: Heights, state: States, roof: Mask, step: int, division: Division | None, threads: Threads
) -> tuple[Heights, States]:
    """Return heights and states with the storeys of frames lowered."""
    rows, columns = state.shape
    smooth, lowered, filled = np.empty_like(height), np.empty_like(height), np.empty_like(state)
    solid = np.empty_like(roof)

    def begin(first: int, last: int) -> None:
        smooth[first:last], lowered[first:last], filled[first:last] = (
            height[first:last],
            height[first:last],
            state[first:last],
        )
        _add_ledges(height, state, roof, first, last, solid)

    threads.bands(begin, rows)
    labels, count = label_patches(smooth, solid, step, threads=threads)
    assign_rough_cells(smooth, state, labels, threads=threads)
    threads.bands(lambda first, last: np.equal(state[first:last], HIGH, out=solid[first:last]), rows)
    threads.bands(lambda first, last: _add_shadows(state, first, last, solid), rows)
    threads.bands(lambda first, last: _add_shadows(state.T, first, last, solid.T), columns)
    boxes = np.concatenate(
        [
            propose_boxes(
                smooth,
                _without_long(smooth, mask, metres, division, threads),
                steps=(metres,),
                least_cells=24,
                threads=threads,
            )
            for mask, metres in ((solid, 1e6), (labels, 0.01 * step))
        ]
    )
    boxes = boxes[np.lexsort((boxes[:, 4], boxes[:, 0], boxes[:, 1], -boxes[:, 2] * boxes[:, 3]))]
    sizes = patch_sizes(labels, count, threads=threads)
    sizes[_too_long(labels, count, division)] = _TOO_MANY
    lower_storeys(lowered, filled, smooth, labels, sizes, boxes, step, threads=threads)
    return lowered, filled


@kernel
def _add_shadows(state: States, first: int, last: int, solid: Mask) -> None:
    """Add the runs of void cells between two high ones of a row, in place: shadows of towers."""
    for r in range(first, last):
        high = -_SHADOW
        for c in range(state.shape[1]):
            if state[r, c] == HIGH:
                if 1 < c - high <= _SHADOW:
                    solid[r, high + 1 : c] = True
                high = c
            elif state[r, c] == LOW:
                high = -_SHADOW


@kernel
def _add_ledges(height: Heights, state: States, roof: Mask, first: int, last: int, solid: Mask) -> None:
    """Fill for some rows which cells are roof or, if high, share their height with four of their eight neighbours.

    A ledge around a tower is too narrow for a window of texture, but it is level.
    """
    rows, columns = state.shape
    for r in range(first, last):
        for c in range(columns):
            solid[r, c] = roof[r, c]
            if roof[r, c] or state[r, c] != HIGH or r in (0, rows - 1) or c in (0, columns - 1):
                continue
            level = 0
            for i in range(r - 1, r + 2):
                for j in range(c - 1, c + 2):
                    if state[i, j] == HIGH and abs(height[i, j] - height[r, c]) <= _LEDGE:
                        level += 1
            solid[r, c] = level > 4


def _level_structures(
    height: Heights,
    state: States,
    labels: Labels,
    share: float,
    most: int,
    threads: Threads,
) -> bool:
    """Level the roof structures, in place; return whether there was any."""
    rough_cells = np.empty(labels.shape, dtype=np.bool_)

    def begin(first: int, last: int) -> None:
        np.logical_and(state[first:last] == HIGH, labels[first:last] == 0, out=rough_cells[first:last])

    threads.bands(begin, len(rough_cells))
    areas, count = label_patches(height, rough_cells, _ANY, threads=threads)
    rims = count_rims(areas, count, height, state, labels, fall=-_ANY, threads=threads)
    return _lower_to_roof(height, labels, areas, rims.carried(share) & (rims.cells <= most), _ANY, threads)


def _lower_to_roof(
    height: Heights,
    labels: Labels,
    patches: Labels,
    chosen: Mask,
    above: int,
    threads: Threads,
) -> bool:
    """Give the cells of some patches the height of the roof beside them, in place; return whether there was any.

    Only roof at most `above` centimetres higher than the cell counts; a step of the roof below continues under the
    superstructure.
    """
    if not chosen.any():
        return False
    waiting = np.empty(labels.shape, dtype=np.uint8)
    threads.bands(lambda first, last: _choose(patches, chosen, first, last, waiting), len(waiting))
    rings = threads.bands(lambda first, last: _outer_ring(height, labels, waiting, first, last, above), len(waiting))
    _lower_rings(height, labels, waiting, np.concatenate(rings), above)
    return True


@kernel
def _choose(patches: Labels, chosen: Mask, first: int, last: int, waiting: States) -> None:
    """Mark, in place, for some rows the cells of the chosen patches."""
    for r in range(first, last):
        for c in range(patches.shape[1]):
            waiting[r, c] = _WAITING if chosen[patches[r, c]] else _DONE


@kernel
def _outer_ring(height: Heights, labels: Labels, waiting: States, first: int, last: int, above: int) -> Labels:
    """Return row and column of the waiting cells of some rows that have roof beside them."""
    # Sized for the worst case; pages that are not written take no memory.
    ring = np.empty(((last - first) * waiting.shape[1], 2), dtype=np.int32)
    size = 0
    for r in range(first, last):
        for c in range(waiting.shape[1]):
            if waiting[r, c] != _DONE and _beside(height, labels, waiting, r, c, above) >= 0:
                ring[size, 0], ring[size, 1] = r, c
                size += 1
    return ring[:size].copy()


@kernel
def _lower_rings(height: Heights, labels: Labels, waiting: States, ring: Labels, above: int) -> None:
    """Lower waiting cells, in place, one ring at a time, so that no direction is favoured."""
    rows, columns = height.shape
    for k in range(len(ring)):
        waiting[ring[k, 0], ring[k, 1]] = _NEXT
    while len(ring) > 0:
        for k in range(len(ring)):
            r, c = ring[k, 0], ring[k, 1]
            beside = _beside(height, labels, waiting, r, c, above)
            if beside >= 0:
                height[r, c] = beside
        for k in range(len(ring)):
            r, c = ring[k, 0], ring[k, 1]
            waiting[r, c] = _DONE
            labels[r, c] = max(labels[r, c], 1)
        inner, size = np.empty((8 * len(ring), 2), dtype=np.int32), 0
        for k in range(len(ring)):
            for i in range(max(ring[k, 0] - 1, 0), min(ring[k, 0] + 2, rows)):
                for j in range(max(ring[k, 1] - 1, 0), min(ring[k, 1] + 2, columns)):
                    if waiting[i, j] == _WAITING:
                        waiting[i, j] = _NEXT
                        inner[size, 0], inner[size, 1] = i, j
                        size += 1
        ring = inner[:size]


@kernel
def _beside(height: Heights, labels: Labels, waiting: States, r: int, c: int, above: int) -> int:
    """Mean height of the roof among a cell's eight neighbours, of the level that most of them share; -1 without one."""
    rows, columns = height.shape
    levels = np.empty(8, dtype=np.int64)
    n = 0
    for i in range(max(r - 1, 0), min(r + 2, rows)):
        for j in range(max(c - 1, 0), min(c + 2, columns)):
            roof = labels[i, j] > 0 and waiting[i, j] == _DONE
            if roof and 0 <= height[i, j] <= height[r, c] + above:
                levels[n] = height[i, j]
                n += 1
    best, most = -1, 0
    for k in range(n):
        total, many = 0, 0
        for other in range(n):
            if abs(levels[other] - levels[k]) <= _LEDGE:
                total += levels[other]
                many += 1
        if many > most or (many == most and total < best * many):
            best, most = total // many, many
    return best
