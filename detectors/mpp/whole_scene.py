"""The whole scene: every square annealed, a local search along their borders, the traces of all added up."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely

from .annealing import Annealed, Boxes, Schedule, anneal, room_of, search
from .arrays import Floats, Rectangles
from .moves import Move
from .parameters import MPPParameters
from .preparation import Prepared
from .random_stream import stream
from .rectangles import corners
from .sampler import ChainSchedule, Trace
from .squares import Square, process_squares, rounds_of
from .strips import absorb_strips
from .threads import Threads
from .walls import close_walls
from .windows import Window

__all__ = ["join_traces", "sample_scene", "total_energy"]

#: First and last temperature of the chain.
_HOT, _COLD = 3.0, 0.1
#: Expected buildings per km2 before the data are seen (lambda).
_INTENSITY = 200.0
#: Shares of births and deaths, and of splits and merges, among the moves; share of births that the data propose.
_JUMP_SHARE, _SPLIT_SHARE, _DATA_BIRTHS = 0.3, 0.1, 0.9
#: Metres between the centres of two buildings that may merge.
_MERGE_REACH = 20.0
#: Proposals at effort 1, per square metre and per box.
_PER_AREA, _PER_BOX = 0.2, 60
#: Rows of a trace.
_ROWS = 100
#: Along the borders of squares: maximum number of local-search sweeps, and buildings that a square may hold besides the
#: present ones.
_SEAM_SWEEPS, _SEAM_ROOM = 4, 64
#: Share of the energy of a rectangle by which an edge that closes a wall may raise it.
_WALL_TOLERANCE = 0.25
#: Fractions of a cell, and of a radian, that the order of rectangles distinguishes.
_FRACTIONS = 64


def sample_scene(
    parameters: MPPParameters, prepared: Prepared, seed: int, threads: Threads
) -> tuple[Rectangles, list[Annealed]]:
    """Anneal every square, search along their borders, close the walls and absorb parts of larger buildings.

    Of a window only the squares on which its core depends are annealed.
    """
    grid, model, tables = prepared.grid, prepared.model, prepared.tables
    rounds = rounds_of(grid, prepared.core, parameters.largest_side)
    results: dict[tuple[int, int], Annealed] = {}

    def boxes_of(square: Square) -> Boxes:
        return prepared.boxes.take(square.owns(prepared.boxes.rectangles))

    def started(square: Square, own: Rectangles, fixed: Rectangles) -> Rectangles:
        window, boxes = Window(tables, model, square.edges, fixed), boxes_of(square)
        return search(window, own, boxes, capacity=room_of(boxes, own), sweeps=parameters.sweeps)

    def annealed(square: Square, own: Rectangles, fixed: Rectangles) -> Rectangles:
        window, boxes = Window(tables, model, square.edges, fixed), boxes_of(square)
        state = stream([seed, square.column % 2**32, square.row % 2**32])
        result = anneal(window, boxes, own, _schedule(parameters, square, grid.gsd, len(boxes)), state)
        results[square.column, square.row] = result
        return result.rectangles

    def joined(square: Square, own: Rectangles, fixed: Rectangles) -> Rectangles:
        window, sweeps = Window(tables, model, square.edges, fixed), min(parameters.sweeps, _SEAM_SWEEPS)
        return search(window, own, boxes_of(square), capacity=len(own) + _SEAM_ROOM, sweeps=sweeps)

    rectangles, largest = np.empty((0, 5)), model.largest_side
    if parameters.start == "greedy":
        rectangles = process_squares(rounds.greedy, rectangles, started, largest=largest, threads=threads)
    rectangles = process_squares(rounds.chains, rectangles, annealed, largest=largest, groups=1, threads=threads)
    rectangles = process_squares(rounds.shifted, rectangles, joined, largest=largest, threads=threads)
    rectangles = _ordered(rectangles)
    close_walls(tables, model, rectangles, _WALL_TOLERANCE * parameters.price)
    rectangles = absorb_strips(tables, model, rectangles, slender=parameters.slender, part_share=parameters.part_share)
    return rectangles, [results[key] for key in sorted(results)]


def _ordered(rectangles: Rectangles) -> Rectangles:
    """Return the rectangles by angle, sides and place; what differs by rounding alone does not change their order."""
    return np.ascontiguousarray(rectangles[np.lexsort(np.round(rectangles * _FRACTIONS).T)])


def _schedule(parameters: MPPParameters, square: Square, cell: float, boxes: int) -> Schedule:
    """Return how a square is processed: proposals by its area, and for each box."""
    x0, y0, x1, y1 = square.edges.tolist()
    area = (x1 - x0) * (y1 - y0) * cell * cell
    proposals = max(int(parameters.effort * (_PER_AREA * area + _PER_BOX * boxes)), 1)
    chain = ChainSchedule(
        proposals=proposals,
        hot=_HOT,
        cold=_COLD,
        intensity=_INTENSITY * 1e-6 * cell * cell,
        jump_share=_JUMP_SHARE,
        split_share=_SPLIT_SHARE,
        merge_reach=_MERGE_REACH / cell,
        stride=max(proposals // _ROWS, 1),
    )
    greedy = parameters.start == "greedy"
    return Schedule(chain=chain, data_share=_DATA_BIRTHS, greedy=greedy, sweeps=parameters.sweeps)


def total_energy(prepared: Prepared, rectangles: Rectangles, energies: Floats) -> float:
    """Return U of a whole scene from the energies of its buildings by themselves."""
    polygons = shapely.polygons(corners(rectangles))
    first, second = shapely.STRtree(polygons).query(polygons, predicate="intersects")
    first, second = first[first < second], second[first < second]
    common = shapely.area(shapely.intersection(polygons[first], polygons[second])).sum()
    return float(energies.sum() + prepared.model.overlap * common)


def join_traces(results: list[Annealed], rows: int = _ROWS) -> dict[str, Any]:
    """Add up the traces of all squares at equal shares of their schedules.

    Every square runs the same schedule on its own number of proposals, so that the temperature at a share is the same.
    """
    results = [result for result in results if len(result.trace)]
    if not results:
        return {}
    rows = min(rows, max(len(result.trace) for result in results))
    total = np.zeros((rows, Trace.COLUMNS))
    for result in results:
        trace = result.trace.copy()
        trace[:, Trace.TRIED :] = np.cumsum(trace[:, Trace.TRIED :], axis=0)
        total += trace[-(-np.arange(1, rows + 1) * len(trace) // rows) - 1]
    total[1:, Trace.TRIED :] -= total[:-1, Trace.TRIED :].copy()
    return {
        "proposals": total[:, Trace.PROPOSALS].tolist(),
        "temperature": (total[:, Trace.TEMPERATURE] / len(results)).tolist(),
        "energy": total[:, Trace.ENERGY].tolist(),
        "buildings": total[:, Trace.BUILDINGS].tolist(),
        "tried": {move.name.lower(): total[:, Trace.TRIED + move].tolist() for move in Move},
        "accepted": {move.name.lower(): total[:, Trace.ACCEPTED + move].tolist() for move in Move},
    }
