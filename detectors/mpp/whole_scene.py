"""The whole scene: a greedy search of every square, the chains of the sampler, a local search along the borders."""

from __future__ import annotations

import numpy as np
import shapely

from .annealing import Annealed, anneal
from .arrays import Floats, Rectangles
from .candidates import Boxes
from .local_search import room_of, search
from .parameters import MPPParameters
from .preparation import Prepared
from .random_stream import stream
from .rectangles import corners
from .squares import Square, at_borders, process_squares, rounds_of
from .strips import absorb_strips
from .threads import Threads
from .walls import close_walls
from .windows import Window, window_energy

__all__ = ["find_rectangles", "total_energy"]

#: Along the borders of squares: maximum number of local-search sweeps, and buildings that a square may hold besides the
#: present ones.
_SEAM_SWEEPS, _SEAM_ROOM = 4, 64
#: Share of the energy of a rectangle by which an edge that closes a wall may raise it.
_WALL_TOLERANCE = 0.25
#: Fractions of a cell, and of a radian, that the order of rectangles distinguishes.
_FRACTIONS = 64


def find_rectangles(
    parameters: MPPParameters, prepared: Prepared, seed: int, threads: Threads
) -> tuple[Rectangles, list[Annealed]]:
    """Search every square and along their borders, close the walls and absorb parts of larger buildings.

    Of a window the chains of the sampler run only in the squares around its core. Returns the rectangles, and of the
    sampler what it found in each square; the seed is that of its random streams.
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
        window, state = Window(tables, model, square.edges, fixed), stream([seed, *square.place])
        result = results[square.column, square.row] = anneal(parameters, window, boxes_of(square), own, state)
        return result.rectangles

    def joined(square: Square, own: Rectangles, fixed: Rectangles) -> Rectangles:
        window, sweeps = Window(tables, model, square.edges, fixed), min(parameters.sweeps, _SEAM_SWEEPS)
        boxes, capacity = boxes_of(square), len(own) + _SEAM_ROOM
        found = search(window, own, boxes, capacity=capacity, sweeps=sweeps)
        # One that grew over a border before the boxes beyond it were tried stands in the way of better ones.
        free = own[~at_borders(own, rounds.greedy)]
        if len(free) == len(own):
            return found
        again = search(window, free, boxes, capacity=capacity, sweeps=sweeps)
        return again if window_energy(window, again) < window_energy(window, found) else found

    rectangles, largest = np.empty((0, 5)), model.largest_side
    if parameters.start == "greedy":
        rectangles = process_squares(rounds.greedy, rectangles, started, largest=largest, threads=threads)
    if parameters.optimiser == "rjmcmc":
        rectangles = process_squares(rounds.chains, rectangles, annealed, largest=largest, groups=1, threads=threads)
    rectangles = process_squares(rounds.shifted, rectangles, joined, largest=largest, threads=threads)
    rectangles = _ordered(rectangles)
    close_walls(tables, model, rectangles, _WALL_TOLERANCE * parameters.price)
    rectangles = absorb_strips(tables, model, rectangles, slender=parameters.slender, part_share=parameters.part_share)
    return rectangles, [results[key] for key in sorted(results)]


def _ordered(rectangles: Rectangles) -> Rectangles:
    """Return the rectangles by angle, sides and place; what differs by rounding alone does not change their order."""
    return np.ascontiguousarray(rectangles[np.lexsort(np.round(rectangles * _FRACTIONS).T)])


def total_energy(prepared: Prepared, rectangles: Rectangles, energies: Floats) -> float:
    """Return U of a whole scene from the energies of its buildings by themselves."""
    polygons = shapely.polygons(corners(rectangles))
    first, second = shapely.STRtree(polygons).query(polygons, predicate="intersects")
    first, second = first[first < second], second[first < second]
    common = shapely.area(shapely.intersection(polygons[first], polygons[second])).sum()
    return float(energies.sum() + prepared.model.overlap * common)
