"""An orthoimage from coloured points, where there is no other.

Each cell takes the mean colour of the first returns in it. Cells without one are interpolated between the cells within
`REACH`, with weights that fall with the fourth power of the distance; beyond that the image has no data. The nearest
colour instead repeats pixels: many images of this kind are made so, with edges as ragged as the points lie.
"""

from __future__ import annotations

from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError
from .density import point_spacing
from .points import PointCloud
from .raster import Grid, Image

__all__ = ["REACH", "image_from_points"]

#: How far a colour is carried into cells without points, in cells.
REACH = 3
#: Cell sizes to choose from, metres.
_SIZES = (0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0)


def image_from_points(
    points: PointCloud,
    extent: tuple[float, float, float, float],
    *,
    gsd: float | None = None,
    fill: Literal["interpolated", "nearest"] = "interpolated",
    source: str = "point cloud",
) -> Image:
    """Return the colours of points as an image of 8 bits.

    Parameters
    ----------
    points : PointCloud
        With colour.
    extent : tuple of float
        ``(xmin, ymin, xmax, ymax)``, metres.
    gsd : float, optional
        Cell size in metres; by default the smallest of a list, 0.1 m to 1 m, at which a cell holds a point on average.
    fill : {"interpolated", "nearest"}
        How cells without points are filled.
    source : str
        File or files, for messages.

    Raises
    ------
    InputError
        The points carry no colour.
    """
    from scipy import ndimage

    if points.colour is None:
        raise InputError(f"{source}: the points carry no colour, so no orthoimage can be made of them; give ortho=")
    x, y, colour = points.x, points.y, points.colour
    if points.return_number is not None:
        first = points.return_number == 1
        x, y, colour = x[first], y[first], colour[first]
    # Files without colour, and points that were never coloured, are black to the last bit.
    coloured = colour.any(axis=1)
    if not coloured.all():
        x, y, colour = x[coloured], y[coloured], colour[coloured]
    grid = Grid.covering(extent, gsd if gsd is not None else _size(x, y, extent))
    index, inside = grid.cells(x, y)
    index, colour = index[inside], colour[inside]
    size = grid.rows * grid.columns
    count = np.bincount(index, minlength=size)
    values = np.empty((colour.shape[1], *grid.shape), dtype=np.uint8)
    for band in range(colour.shape[1]):
        total = np.bincount(index, weights=colour[:, band], minlength=size)
        mean = total / np.maximum(count, 1)
        values[band] = np.round(mean / 257.0).reshape(grid.shape)
    known = (count > 0).reshape(grid.shape)
    distance, nearest = ndimage.distance_transform_edt(~known, return_indices=True)
    filled = _interpolated(values, known) if fill == "interpolated" else values[:, nearest[0], nearest[1]]
    values = np.where(known, values, filled)
    valid = np.asarray(distance <= REACH)
    values[:, ~valid] = 0
    names = ("red", "green", "blue", "nir")[: colour.shape[1]]
    return Image(values, names, grid, None if valid.all() else valid)


def _interpolated(values: NDArray[np.uint8], known: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return the mean of the known cells around each cell, weighted by their distance; 0 where there is none."""
    offsets = np.arange(-REACH, REACH + 1)
    distance = np.hypot(offsets[:, None], offsets[None, :])
    weights = np.where((distance > 0) & (distance < REACH + 0.5), np.maximum(distance, 1.0) ** -4, 0).astype(np.float32)
    total = np.maximum(cv2.filter2D(known.astype(np.float32), -1, weights, borderType=cv2.BORDER_CONSTANT), 1e-9)
    sums = (
        cv2.filter2D(np.where(known, band, 0).astype(np.float32), -1, weights, borderType=cv2.BORDER_CONSTANT)
        for band in values
    )
    return np.stack([np.round(band / total) for band in sums]).astype(np.uint8)


def _size(x: NDArray[np.float64], y: NDArray[np.float64], extent: tuple[float, float, float, float]) -> float:
    """Return the cell size for the point density where there are points."""
    spacing = point_spacing(x, y, extent) or 0.0
    return next((size for size in _SIZES if size >= 0.95 * spacing), _SIZES[-1])
