"""The orthoimage: a photograph rectified with the bare-earth DEM, so that everything above the ground leans.

See `camera` for the geometry.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ..geodata.raster import Frame, Grid, Image
from .camera import camera_position, registration_offset
from .groundcover import cover_codes
from .lighting import AMBIENT, HAZE, colour_surface, sun_vector
from .streams import counter_key, fractal_tile, gauss, stream, uniform
from .surface import rasterise
from .world import Relief, World, ground_at

__all__ = ["photograph"]

_BLOCK = 8
_TILE = 512
_NOISE = 1 << 16


def photograph(world: World, origin: tuple[float, float]) -> Image | None:
    """Return the orthoimage of a world, its grid in world coordinates; None without bands."""
    recipe = world.recipe
    if recipe.bands == "none":
        return None
    names = ("red", "green", "blue", "nir")[: len(recipe.bands)]
    grid = Grid.covering((0, 0, recipe.width, recipe.height), recipe.gsd)
    rng = stream(world.seed, "texture")
    fine, coarse = fractal_tile(rng, _TILE, 4, 0.8), fractal_tile(rng, _TILE, 64, 0.62)
    surface = rasterise(world, grid, fine)
    colours = colour_surface(world, surface, cover_codes(world, grid), (fine, coarse), len(names))
    shift = registration_offset(recipe, world.seed)
    leaning = np.empty_like(colours)
    walls = _Walls(world.solids.wall, world.solids.base, sun_vector(recipe), AMBIENT, HAZE)
    view = _View(colours, surface.z, surface.label, grid.frame)
    _lean(leaning, view, Relief.of(world.terrain), camera_position(recipe, world.seed), shift, walls)
    values = _expose(leaning, _half_gaussian(recipe.blur), recipe.image_noise, counter_key(world.seed, "image"))
    moved = Grid(grid.west + origin[0], grid.north + origin[1], grid.gsd, grid.rows, grid.columns)
    return Image(values, names, moved)


def _half_gaussian(sigma: float) -> NDArray[np.float32]:
    """Return half of a normalised Gaussian, centre first."""
    if sigma < 0.05:
        return np.ones(1, dtype=np.float32)
    half = [math.exp(-0.5 * (k / sigma) ** 2) for k in range(max(1, math.ceil(2.5 * sigma)) + 1)]
    total = half[0] + 2 * sum(half[1:])
    return np.array([value / total for value in half], dtype=np.float32)


@kernel
def _block_tops(z: NDArray[np.float32], label: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return the highest elevation in each block of the image; far below everything where the ground is bare."""
    tops = np.full(((z.shape[0] + _BLOCK - 1) // _BLOCK, (z.shape[1] + _BLOCK - 1) // _BLOCK), -1e9)
    for r in range(z.shape[0]):
        for c in range(z.shape[1]):
            if label[r, c] != 0 and z[r, c] > tops[r // _BLOCK, c // _BLOCK]:
                tops[r // _BLOCK, c // _BLOCK] = z[r, c]
    return tops


@kernel
def _first_heights(
    tops: NDArray[np.float64], frame: Frame, relief: Relief, camera: tuple[float, float, float]
) -> NDArray[np.float64]:
    """Return, per block, a height above ground above which no ray of its cells can meet anything.

    The ray of the block's centre is followed block by block; neighbours count too, as the block has a size and rays
    of its cells differ a little.
    """
    rows, columns = tops.shape
    size = _BLOCK * frame.gsd
    wide = tops.copy()
    for i in range(rows):
        for j in range(columns):
            for m in range(max(0, i - 1), min(rows, i + 2)):
                for n in range(max(0, j - 1), min(columns, j + 2)):
                    wide[i, j] = max(wide[i, j], tops[m, n])
    highest = -np.inf
    for i in range(rows):
        for j in range(columns):
            highest = max(highest, tops[i, j])
    first = np.zeros((rows, columns))
    for i in range(rows):
        y = frame.north - (i + 0.5) * size
        for j in range(columns):
            x = frame.west + (j + 0.5) * size
            ground = ground_at(relief, x, y)
            low = ground
            for dx in (-0.5 * size, 0.5 * size):
                for dy in (-0.5 * size, 0.5 * size):
                    low = min(low, ground_at(relief, x + dx, y + dy))
            tx, ty = (camera[0] - x) / (camera[2] - ground), (camera[1] - y) / (camera[2] - ground)
            rise = size / max(abs(tx), abs(ty), 1e-6)
            k = 0
            while (k - 1.5) * rise < highest - low:
                height = k * rise
                p, q = int((frame.north - y - ty * height) / size), int((x + tx * height - frame.west) / size)
                if p < 0 or q < 0 or p >= rows or q >= columns:
                    break
                over = wide[p, q] - low
                if over >= (k - 1.5) * rise:
                    first[i, j] = max(first[i, j], min(over, (k + 1.5) * rise))
                k += 1
    return first


@kernel
def _block_exit(i: int, j: int, k: int, step: float, columns: float, rows: float) -> int:
    """Return the step at which a ray that comes down is certainly still in, or just leaves, the block of (i, j).

    `columns` and `rows` are the cells that the ray moves per metre of height.
    """
    fewest = 1e9
    if abs(columns) > 1e-9:
        room = j % _BLOCK if columns > 0 else _BLOCK - 1 - j % _BLOCK
        fewest = min(fewest, room / (abs(columns) * step))
    if abs(rows) > 1e-9:
        room = i % _BLOCK if rows > 0 else _BLOCK - 1 - i % _BLOCK
        fewest = min(fewest, room / (abs(rows) * step))
    return k - max(int(fewest), 1)


class _View(NamedTuple):
    """Colours and surface as seen straight from above, on the grid of `frame`."""

    colours: NDArray[np.uint8]
    z: NDArray[np.float32]
    label: NDArray[np.int32]
    frame: Frame


class _Walls(NamedTuple):
    """Colour and foot of the walls of each solid, vector towards the sun, light of the sky and of the air."""

    colour: NDArray[np.float32]
    base: NDArray[np.float64]
    sun: tuple[float, float, float]
    ambient: NDArray[np.float32]
    haze: NDArray[np.float32]


class _Ray(NamedTuple):
    """The ray from a place on the ground to the camera: x, y, and metres per metre of height."""

    x: float
    y: float
    tx: float
    ty: float


@kernel
def _lean(
    out: NDArray[np.uint8],
    view: _View,
    relief: Relief,
    camera: tuple[float, float, float],
    shift: tuple[float, float],
    walls: _Walls,
) -> None:
    """Fill every image cell with the last hit of the ray from its place on the bare earth to the camera."""
    colours, z, label, frame = view
    west, north, gsd, _, _ = frame
    bands, rows, columns = out.shape
    tops = _block_tops(z, label)
    first = _first_heights(tops, frame, relief, camera)
    for r in range(rows):
        for c in range(columns):
            x = west + (c + 0.5) * gsd - shift[0]
            y = north - (r + 0.5) * gsd - shift[1]
            row, column = (north - y) / gsd, (x - west) / gsd
            i0, j0 = min(max(int(row), 0), rows - 1), min(max(int(column), 0), columns - 1)
            tallest = first[i0 // _BLOCK, j0 // _BLOCK]
            if tallest < 0.1:
                for b in range(bands):
                    out[b, r, c] = colours[b, i0, j0]
                continue
            ground = ground_at(relief, x, y)
            tx, ty = (camera[0] - x) / (camera[2] - ground), (camera[1] - y) / (camera[2] - ground)
            lean = max(abs(tx), abs(ty), 1e-6)
            step = 0.8 * gsd / lean
            down, right = -ty / gsd, tx / gsd  # cells per metre of height
            count = int(tallest / step) + 1
            i, j, side = i0, j0, -1.0
            k = count
            while k >= 0:
                height = min(k * step, tallest)
                pi, pj = int(row + down * height), int(column + right * height)
                if pi < 0 or pj < 0 or pi >= rows or pj >= columns:
                    k -= 1
                    continue
                top = tops[pi // _BLOCK, pj // _BLOCK]
                if ground + height > top + 0.1 and k > 0:
                    # Above everything in this block: on to where the ray leaves it or comes down to its top.
                    k = max(_block_exit(pi, pj, k, step, right, down), min(int((top - ground) / step) + 1, k - 1), 0)
                    continue
                above = z[pi, pj] - ground - height
                if above >= -0.05 or k == 0:
                    i, j = pi, pj
                    # Deep below the top where the ray meets the surface: it entered through the side.
                    if k < count and above > step + 0.6:
                        side = ground + height
                    break
                k -= 1
            mark = label[i, j]
            if side < 0 or mark == 0:
                for b in range(bands):
                    out[b, r, c] = colours[b, i, j]
            elif mark < 0:
                for b in range(bands):
                    out[b, r, c] = int(colours[b, i, j] * 0.72)
            else:
                _wall(out[:, r, c], (mark - 1) >> 3, side, _Ray(x, y, tx, ty), walls)


@kernel
def _wall(out: NDArray[np.uint8], k: int, level: float, ray: _Ray, walls: _Walls) -> None:
    """Fill a cell that shows a wall: it looks towards the camera; floors are bands of windows."""
    x, y, tx, ty = ray
    wall, base, sun, ambient, haze = walls
    towards = (tx * sun[0] + ty * sun[1]) / math.sqrt(tx * tx + ty * ty)
    direct = max(towards, 0.0) / sun[2]
    storey = ((level - base[k]) / 3.2) % 1.0
    window = 0.62 if 0.35 < storey < 0.8 and ((x + y) * 0.31) % 1.0 < 0.7 else 1.0
    for b in range(out.shape[0]):
        light = ambient[b] * 1.1 + (1.0 - ambient[b]) * direct * 0.9
        out[b] = int(min(wall[k, b] * window * light * 255.0 + haze[b], 250.0))


@kernel
def _expose(values: NDArray[np.uint8], spread: NDArray[np.float32], noise: float, key: np.uint64) -> NDArray[np.uint8]:
    """Blur by the point spread and add noise that is independent for all cells and bands."""
    bands, rows, columns = values.shape
    out = np.empty_like(values)
    half = len(spread) - 1
    line = np.empty(columns, dtype=np.float32)
    # Each row of each band reads the same long strip of noise from a different start.
    grain = np.empty(_NOISE, dtype=np.float32)
    for k in range(_NOISE):
        grain[k] = noise * 255.0 * gauss(key, k)
    ring = np.empty((2 * half + 1, columns), dtype=np.float32)
    padded = np.empty(columns + 2 * half, dtype=np.float32)
    for b in range(bands):
        for r in range(-half, rows + half):
            source = values[b, min(max(r, 0), rows - 1)]
            for c in range(columns + 2 * half):
                padded[c] = source[min(max(c - half, 0), columns - 1)]
            _weighted(ring[(r + half) % (2 * half + 1)], padded[half:], spread[0])
            for t in range(1, half + 1):
                _add_pair(ring[(r + half) % (2 * half + 1)], padded[half - t :], padded[half + t :], spread[t])
            centre = r - half
            if centre < 0:
                continue
            _weighted(line, ring[(centre + half) % (2 * half + 1)], spread[0])
            for t in range(1, half + 1):
                before, after = (centre - t + half) % (2 * half + 1), (centre + t + half) % (2 * half + 1)
                _add_pair(line, ring[before], ring[after], spread[t])
            start = int(uniform(key, (1 << 40) + b * rows + centre) * _NOISE)
            for c in range(columns):
                value = line[c] + grain[(start + c) & (_NOISE - 1)] + np.float32(0.5)
                out[b, centre, c] = np.uint8(min(max(value, np.float32(0.0)), np.float32(255.0)))
    return out


@kernel
def _weighted(out: NDArray[np.float32], values: NDArray[np.float32], weight: float) -> None:
    """Fill a line with weighted values."""
    for c in range(len(out)):
        out[c] = weight * values[c]


@kernel
def _add_pair(out: NDArray[np.float32], before: NDArray[np.float32], after: NDArray[np.float32], weight: float) -> None:
    """Add the weighted sum of two lines to `out`, in place."""
    for c in range(len(out)):
        out[c] += weight * (before[c] + after[c])
