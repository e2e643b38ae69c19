"""The whole scene: every tile annealed, the seams polished, the traces of all tiles added up."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from .annealing import Annealed, Schedule, anneal
from .moves import MOVES
from .parameters import MPPParameters
from .polish import polish
from .preparation import Prepared
from .random_stream import stream
from .rectangles import corners
from .strips import take_in_strips
from .tiles import Tile, tiles_of, work_off
from .walls import close_walls
from .workers import Workers

__all__ = ["join_traces", "sample_city", "total_energy"]

_Rectangles = NDArray[np.float64]

#: First and last temperature of the chain.
_HOT, _COLD = 3.0, 0.1
#: Expected buildings per km2 before the data are seen (lambda).
_INTENSITY = 200.0
#: Shares of births and deaths, and of splits and merges, among the moves; share of births that the data propose.
_JUMP_SHARE, _SPLIT_SHARE, _DATA_BIRTHS = 0.3, 0.1, 0.9
#: Metres between the centres of two buildings that may merge.
_MERGE_REACH = 20.0


def sample_city(
    parameters: MPPParameters, prepared: Prepared, seed: int, workers: Workers
) -> tuple[_Rectangles, list[Annealed]]:
    """Anneal every tile, then polish the seams, close the walls and take in what is no building by itself."""
    grid, model, tables = prepared.grid, prepared.model, prepared.tables
    size = max(parameters.tile, 2.0 * parameters.largest_side)
    reach = math.sqrt(2.0) * model.largest_side
    results: dict[tuple[int, int], Annealed] = {}

    def annealed(tile: Tile, own: _Rectangles, fixed: _Rectangles) -> _Rectangles:
        inside = tile.owns(prepared.boxes)
        result = anneal(
            tables,
            model,
            tile.window,
            prepared.boxes[inside],
            prepared.weights[inside],
            prepared.energies[inside],
            own,
            _within_reach(fixed, tile, model.largest_side),
            stream([seed, tile.column % 2**32, tile.row % 2**32]),
            _schedule(parameters, tile, grid.gsd, int(np.count_nonzero(inside))),
        )
        results[tile.column, tile.row] = result
        return result.rectangles

    def mended(tile: Tile, own: _Rectangles, fixed: _Rectangles) -> _Rectangles:
        inside = tile.owns(prepared.boxes)
        boxes, energies = prepared.boxes[inside], prepared.energies[inside]
        fixed = _within_reach(fixed, tile, model.largest_side)
        window = np.array(tile.window)
        sweeps = min(parameters.sweeps, 4)
        best, _ = polish(tables.small, tables.large, model, window, own, fixed, boxes, energies, len(own) + 64, sweeps)
        return best  # type: ignore[no-any-return]

    tiles = tiles_of(grid, size)
    rectangles = work_off(tiles, np.empty((0, 5)), annealed, reach=reach, workers=workers)
    if len(tiles) > 1:
        rectangles = work_off(tiles_of(grid, size, shifted=True), rectangles, mended, reach=reach, workers=workers)
    rectangles = np.ascontiguousarray(rectangles[np.lexsort(rectangles.T)])
    close_walls(tables.small, tables.large, model, rectangles, 0.25 * parameters.price)
    rectangles = take_in_strips(tables, model, rectangles, slender=parameters.slender, part_share=parameters.part_share)
    return rectangles, [results[key] for key in sorted(results)]


def _schedule(parameters: MPPParameters, tile: Tile, cell: float, boxes: int) -> Schedule:
    """Return how the chain of a tile is run: proposals by its area, and for each box."""
    x0, y0, x1, y1 = tile.window
    area = (x1 - x0) * (y1 - y0) * cell * cell
    return Schedule(
        proposals=max(int(parameters.effort * (0.2 * area + 60 * boxes)), 1),
        hot=_HOT,
        cold=_COLD,
        intensity=_INTENSITY * 1e-6 * cell * cell,
        jump_share=_JUMP_SHARE,
        split_share=_SPLIT_SHARE,
        data_share=_DATA_BIRTHS,
        merge_reach=_MERGE_REACH / cell,
        greedy=parameters.start == "greedy",
        sweeps=parameters.sweeps,
    )


def _within_reach(fixed: _Rectangles, tile: Tile, largest: float) -> _Rectangles:
    """Return the fixed buildings that one centred in the tile can overlap."""
    x0, y0, x1, y1 = tile.window
    x, y = fixed[:, 0], fixed[:, 1]
    apart = np.hypot(np.maximum(np.maximum(x0 - x, x - x1), 0), np.maximum(np.maximum(y0 - y, y - y1), 0))
    return fixed[apart < 0.5 * (np.hypot(fixed[:, 2], fixed[:, 3]) + math.sqrt(2.0) * largest)]


def total_energy(prepared: Prepared, rectangles: _Rectangles, energies: NDArray[np.float64]) -> float:
    """Return U of a whole scene from the energies of its buildings by themselves."""
    polygons = shapely.polygons(corners(rectangles))
    first, second = shapely.STRtree(polygons).query(polygons, predicate="intersects")
    first, second = first[first < second], second[first < second]
    common = shapely.area(shapely.intersection(polygons[first], polygons[second])).sum()
    return float(energies.sum() + prepared.model.overlap * common)


def join_traces(results: list[Annealed], rows: int = 100) -> dict[str, Any]:
    """Add up the traces of all tiles at equal shares of their schedules.

    Every tile runs the same schedule on its own number of proposals, so that the temperature at a share is the same.
    """
    results = [result for result in results if len(result.trace)]
    if not results:
        return {}
    rows = min(rows, max(len(result.trace) for result in results))
    total = np.zeros((rows, results[0].trace.shape[1]))
    for result in results:
        trace = result.trace.copy()
        trace[:, 4:] = np.cumsum(trace[:, 4:], axis=0)
        total += trace[-(-np.arange(1, rows + 1) * len(trace) // rows) - 1]
    total[1:, 4:] -= total[:-1, 4:].copy()
    return {
        "proposals": total[:, 0].tolist(),
        "temperature": (total[:, 1] / len(results)).tolist(),
        "energy": total[:, 2].tolist(),
        "buildings": total[:, 3].tolist(),
        "tried": {move: total[:, 4 + k].tolist() for k, move in enumerate(MOVES)},
        "accepted": {move: total[:, 12 + k].tolist() for k, move in enumerate(MOVES)},
    }
