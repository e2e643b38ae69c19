"""Bare earth by the cloth simulation filter, from the package that its authors maintain (extra ``ground``).

A cloth is laid over the upside-down point cloud; points near it are ground (Zhang et al. 2016, "An easy-to-use airborne
LiDAR data filtering method based on cloth simulation", Remote Sensing 8(6) 501). It runs on the lowest point of each
half-metre cell, which is all that it can touch, so that its memory follows the area and not the number of points.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from ...core.errors import ParameterError
from ..geodata.points import PointCloud
from ..geodata.raster import Elevation, Grid
from .filter import elevation_from_points

__all__ = ["cloth_surface"]

#: Cells of which the lowest point is kept, metres.
_THINNED = 0.5


def cloth_surface(
    points: PointCloud,
    extent: Sequence[float],
    *,
    cell: float | None = None,
    cloth_resolution: float = 1.0,
    rigidness: int = 2,
    threshold: float = 0.5,
) -> Elevation:
    """Return the bare earth below all points, whatever they were reflected by.

    Parameters
    ----------
    points : PointCloud
    extent : sequence of float
        ``(xmin, ymin, xmax, ymax)``, metres.
    cell : float, optional
        Cell size of the result, metres; by default as in `ground.ground_surface`.
    cloth_resolution : float
        Distance of the particles of the cloth, metres.
    rigidness : int
        1 for steep slopes, 2 for terraces, 3 for flat land.
    threshold : float
        Points nearer to the cloth than this, metres, are ground.

    Raises
    ------
    ParameterError
        The package cloth-simulation-filter is not installed.
    """
    try:
        import CSF
    except ImportError as error:
        raise ParameterError(
            "the cloth simulation filter is not installed: pip install cloth-simulation-filter, or use opening"
        ) from error
    lowest = points.take(_lowest_points(points, Grid.covering(extent, _THINNED)))
    cloth = CSF.CSF()
    cloth.params.bSloopSmooth = True
    cloth.params.cloth_resolution = cloth_resolution
    cloth.params.rigidness = rigidness
    cloth.params.class_threshold = threshold
    cloth.params.time_step = 0.65
    cloth.params.interations = 500
    cloth.setPointCloud(np.column_stack([lowest.x - extent[0], lowest.y - extent[1], lowest.z]))
    ground, other = CSF.VecInt(), CSF.VecInt()
    with _silent():
        cloth.do_filtering(ground, other, False)
    index = np.array(ground, dtype=np.intp)
    # Where nothing is left, the thinned cloud itself is the best guess.
    return elevation_from_points(lowest.take(index) if len(index) else lowest, extent, cell=cell)


def _lowest_points(points: PointCloud, grid: Grid) -> NDArray[np.intp]:
    """Return the index of the lowest point of each cell that has one."""
    index, inside = grid.cells(points.x, points.y)
    candidates = np.flatnonzero(inside)
    order = candidates[np.lexsort((points.z[candidates], index[candidates]))]
    first = np.ones(len(order), dtype=bool)
    first[1:] = np.diff(index[order]) != 0
    return order[first]


@contextmanager
def _silent() -> Iterator[None]:
    """Keep what the library prints (from C++, so past `sys.stdout`) out of the standard output."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)
