"""The surface seen straight from above: elevation and what lies there, on the image's grid.

A *label* is 0 on the ground, ``1 + 8 * solid + face`` on a solid's top and ``-1 - blob`` on a crown.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ..geodata.raster import Frame, Grid
from .solids import Body
from .world import Relief, World, ground_at

__all__ = ["Surface", "rasterise"]

_HEDGE = int(Body.HEDGE)


@dataclass(frozen=True)
class Surface:
    """What a vertical view meets first.

    Attributes
    ----------
    grid : Grid
        Local coordinates.
    z : ndarray of float32, shape (rows, columns)
    label : ndarray of int32, shape (rows, columns)
    """

    grid: Grid
    z: NDArray[np.float32]
    label: NDArray[np.int32]


def rasterise(world: World, grid: Grid, tile: NDArray[np.float32]) -> Surface:
    """Return the highest surface on a grid; `tile` is the noise that roughens leaves."""
    terrain = world.terrain
    frame = grid.frame
    z = _bare(frame, Relief.of(terrain))
    label = np.zeros(grid.shape, dtype=np.int32)
    solids = world.solids
    _raise_solids(z, label, frame, solids.rectangle, solids.slant, solids.planes, solids.body, tile)
    _raise_blobs(z, label, frame, world.trees.blobs, tile)
    return Surface(grid, z, label)


@kernel
def _bare(frame: Frame, relief: Relief) -> NDArray[np.float32]:
    """Return the elevation of the bare earth in each cell."""
    z = np.empty((frame.rows, frame.columns), dtype=np.float32)
    for r in range(frame.rows):
        y = frame.north - (r + 0.5) * frame.gsd
        for c in range(frame.columns):
            z[r, c] = ground_at(relief, frame.west + (c + 0.5) * frame.gsd, y)
    return z


@kernel
def _raise_solids(
    z: NDArray[np.float32],
    label: NDArray[np.int32],
    frame: Frame,
    rectangle: NDArray[np.float64],
    slant: NDArray[np.float64],
    planes: NDArray[np.float64],
    body: NDArray[np.uint8],
    tile: NDArray[np.float32],
) -> None:
    """Write the tops of solids into the surface, in place, where they are the highest."""
    west, north, gsd, _, _ = frame
    mask = tile.shape[0] - 1
    for k in range(len(rectangle)):
        x0, y0, angle, length, width = rectangle[k]
        cosine, sine = np.cos(angle), np.sin(angle)
        long = length + abs(slant[k]) * width
        reach_x = (abs(cosine) * long + abs(sine) * width) / 2
        reach_y = (abs(sine) * long + abs(cosine) * width) / 2
        first_row, last_row = int((north - y0 - reach_y) / gsd), int((north - y0 + reach_y) / gsd)
        first_column, last_column = int((x0 - reach_x - west) / gsd), int((x0 + reach_x - west) / gsd)
        rough = 0.22 if body[k] == _HEDGE else 0.0
        for r in range(max(0, first_row), min(z.shape[0], last_row + 1)):
            y = north - (r + 0.5) * gsd
            for c in range(max(0, first_column), min(z.shape[1], last_column + 1)):
                x = west + (c + 0.5) * gsd
                dx, dy = x - x0, y - y0
                across = cosine * dy - sine * dx
                if abs(cosine * dx + sine * dy - slant[k] * across) > length / 2 or abs(across) > width / 2:
                    continue
                top, face = np.inf, 4
                for f in range(4, 8):
                    if planes[k, f, 2] > 0:
                        level = (planes[k, f, 3] - planes[k, f, 0] * x - planes[k, f, 1] * y) / planes[k, f, 2]
                        if level < top:
                            top, face = level, f
                top += rough * tile[(r * 2) & mask, (c * 2) & mask]
                if top > z[r, c]:
                    z[r, c] = top
                    label[r, c] = 1 + 8 * k + face


@kernel
def _raise_blobs(
    z: NDArray[np.float32],
    label: NDArray[np.int32],
    frame: Frame,
    blobs: NDArray[np.float64],
    tile: NDArray[np.float32],
) -> None:
    """Write the blobs of crowns into the surface, in place, where they are the highest."""
    west, north, gsd, _, _ = frame
    mask = tile.shape[0] - 1
    for k in range(len(blobs)):
        x0, y0, z0, across, up = blobs[k]
        first_row, last_row = int((north - y0 - across) / gsd), int((north - y0 + across) / gsd)
        first_column, last_column = int((x0 - across - west) / gsd), int((x0 + across - west) / gsd)
        for r in range(max(0, first_row), min(z.shape[0], last_row + 1)):
            dy = (north - (r + 0.5) * gsd - y0) / across
            for c in range(max(0, first_column), min(z.shape[1], last_column + 1)):
                dx = (west + (c + 0.5) * gsd - x0) / across
                leaf = tile[r & mask, c & mask]
                # Noise in the radius frays the rim; noise in the height makes leaves.
                room = 1.0 - (dx * dx + dy * dy) * (1.0 + 0.22 * leaf)
                if room > 0:
                    top = z0 + up * np.sqrt(room) + 0.16 * leaf
                    if top > z[r, c]:
                        z[r, c] = top
                        label[r, c] = -1 - k
