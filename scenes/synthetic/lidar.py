"""The laser scanner: pulses in scan lines, their intersections with solids and crowns, and the returns.

Nouns
-----
strip
    The swath of one flight line; neighbouring strips overlap, so the point density differs from place to place.
pulse
    A ray through a place on the bare earth, tilted towards the flight line: walls facing the aircraft return points,
    the ground behind a building returns none.
footprint
    A pulse is some decimetres wide: at an edge, part of it hits the roof and the rest the ground.

In a crown a pulse loses energy along its path through leaves (Beer-Lambert): the optical depth until the
next return is exponentially distributed. Returns closer than the receiver's dead zone are one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ..geodata.points import PointCloud
from ..geodata.raster import Frame, Grid
from .clutter import Cover
from .groundcover import cover_codes
from .palettes import GROUND, LAWNS
from .recipe import SceneParameters
from .solids import Body
from .streams import counter_key, gauss, stream, uniform
from .world import CellIndex, CellLists, Relief, World, ground_at

__all__ = ["scan"]

_FLYING_HEIGHT = 900.0
_OVERLAP = 0.12
_FOOTPRINT = 0.22
_DEAD_ZONE = 1.0
_MOST = 5
_MODES = {"first": 0, "last": 1, "all": 2, "single": 0}
_CHUNK = 250_000
_POOL = int(Cover.POOL)
_BUILDING, _ROOF_STRUCTURE, _HEDGE = int(Body.BUILDING), int(Body.ROOF_STRUCTURE), int(Body.HEDGE)
#: First extinction (to the first return) and later extinction, per metre of leaves.
_DENSE, _LOOSE = 0.85, 0.42
#: Extinction of what is left for the surface below a crown, per metre of leaves.
_OPAQUE = 0.11


def scan(world: World, origin: tuple[float, float]) -> PointCloud:
    """Return the point cloud of a world in world coordinates, rounded to centimetres."""
    recipe = world.recipe
    places = _pulses(recipe, world.seed)
    solids, trees = world.solids, world.trees
    solid_index, blob_index = CellIndex.of_solids(world), CellIndex.of_blobs(world)
    cover_grid = Grid.covering((0, 0, recipe.width, recipe.height), 0.5)
    ground_nir = np.zeros(256)
    ground_nir[: len(GROUND)] = GROUND[:, 3]
    ground_nir[64:128] = LAWNS[0, 3] + (LAWNS[1, 3] - LAWNS[0, 3]) * np.arange(64) / 63
    ground = _Ground(Relief.of(world.terrain), cover_codes(world, cover_grid), cover_grid.frame, ground_nir)
    standing = _Standing(
        solids.planes,
        solids.body,
        np.ascontiguousarray(solids.colour[:, 3]),
        np.ascontiguousarray(solids.wall[:, 3]),
        solid_index.lists,
    )
    leaves = _Leaves(trees.blobs, trees.tree, np.ascontiguousarray(trees.colour[:, 3]), blob_index.lists)
    scanner = _Scanner(
        recipe.width,
        recipe.height,
        recipe.vertical_noise,
        recipe.horizontal_noise,
        recipe.dropouts,
        _MODES[recipe.pulse],
        counter_key(world.seed, "lidar"),
    )
    pieces = []
    for start in range(0, len(places), _CHUNK):
        pieces.append(_scan_chunk(places[start : start + _CHUNK], start, ground, standing, leaves, scanner))
    xyz, returns, intensity, classes = (np.concatenate(column) for column in zip(*pieces, strict=True))
    known = recipe.pulse in ("all", "single")
    if recipe.pulse == "single":
        returns[:] = 1
    return PointCloud(
        x=np.round((xyz[:, 0] + origin[0]) * 100) / 100,
        y=np.round((xyz[:, 1] + origin[1]) * 100) / 100,
        z=np.round(xyz[:, 2] * 100) / 100,
        return_number=np.ascontiguousarray(returns[:, 0]) if known else None,
        number_of_returns=np.ascontiguousarray(returns[:, 1]) if known else None,
        intensity=intensity,
        classification=classes,
    )


def _pulses(recipe: SceneParameters, seed: int) -> NDArray[np.float64]:
    """Return x, y on the ground and the tilt (metres towards the aircraft per metre of height), shape (n, 4)."""
    rng = stream(seed, "lidar")
    heading, phase = rng.random() * math.pi, rng.random(2)
    cosine, sine = math.cos(heading), math.sin(heading)
    half = max(_FLYING_HEIGHT * math.tan(math.radians(recipe.scan_angle)), 60.0)
    between = 2 * half * (1 - _OVERLAP)
    spacing = recipe.point_spacing * math.sqrt(_strips_over(recipe, (cosine, sine), half, between, phase[0]))
    centre = (recipe.width / 2, recipe.height / 2)
    reach = math.hypot(recipe.width, recipe.height) / 2
    strips = []
    first = math.floor((-reach - half) / between + phase[0])
    last = math.ceil((reach + half) / between + phase[0])
    for number in range(first, last + 1):
        middle = (number - phase[0]) * between
        low, high = max(middle - half, -reach), min(middle + half, reach)
        if high <= low:
            continue
        strips.append(
            _strip(
                (low, high, middle, half, reach),
                (spacing, phase[1], math.tan(math.radians(recipe.scan_angle))),
                (cosine, sine, *centre),
                (recipe.width, recipe.height),
                counter_key(seed, "lidar") ^ np.uint64(number & 0xFFFF),
            )
        )
    return np.concatenate(strips)


def _strips_over(
    recipe: SceneParameters, heading: tuple[float, float], half: float, between: float, phase: float
) -> float:
    """Return the mean number of strips that cover a place in the extent."""
    x, y = ((np.arange(80) + 0.5) / 80 - 0.5) * recipe.width, ((np.arange(80) + 0.5) / 80 - 0.5) * recipe.height
    q = heading[0] * y[:, None] - heading[1] * x[None, :]
    number = q / between + phase
    offset = np.abs(number - np.round(number)) * between
    # The nearest strip always covers the place, the second nearest within its half width.
    return float((1.0 + (between - offset < half)).mean())


@kernel
def _strip(
    span: tuple[float, float, float, float, float],
    rhythm: tuple[float, float, float],
    frame: tuple[float, float, float, float],
    extent: tuple[float, float],
    key: int,
) -> NDArray[np.float64]:
    """Return the pulses of one strip: lines across the flight, slightly irregular, like mirror and aircraft."""
    low, high, middle, half, reach = span
    spacing, phase, tangent = rhythm
    cosine, sine, cx, cy = frame
    # The mirror is a little slower at the ends of its swing; lines are somewhat wider apart than pulses on a line.
    along_step, across_step = spacing * 1.12, spacing / 1.12
    lines, dots = int(2 * reach / along_step) + 2, int((high - low) / across_step) + 2
    out = np.empty((lines * dots, 4))
    count = 0
    for i in range(lines):
        # Aircraft and mirror speed vary slowly, and with them the density of lines and pulses.
        drift = 5.5 * math.sin(i * along_step / 37.0 + 6.0 * phase) / along_step + 0.12 * gauss(key, i)
        for k in range(dots):
            counter = (i * dots + k) * 2 + (1 << 40)
            crowding = 3.2 * math.sin((low + k * across_step) / 29.0 + 9.0 * phase)
            q = low + crowding + (k + 0.5 * (i & 1) + phase + 0.40 * gauss(key, counter)) * across_step
            p = -reach + (i + drift + 0.36 * gauss(key, counter + 1)) * along_step
            if q >= high:
                continue
            x, y = cx + cosine * p - sine * q, cy + sine * p + cosine * q
            if x < 0 or y < 0 or x >= extent[0] or y >= extent[1]:
                continue
            tilt = -tangent * (q - middle) / half
            out[count, 0], out[count, 1], out[count, 2], out[count, 3] = x, y, -sine * tilt, cosine * tilt
            count += 1
    return out[:count].copy()


class _Ray(NamedTuple):
    """A pulse: its place on the bare earth, the elevation there, and its tilt in metres per metre of height."""

    x: float
    y: float
    ground: float
    tx: float
    ty: float


class _Ground(NamedTuple):
    """Bare earth and ground cover; `nir` is the reflectance of each cover code."""

    relief: Relief
    codes: NDArray[np.uint8]
    frame: Frame
    nir: NDArray[np.float64]


class _Standing(NamedTuple):
    """Solids: planes of their faces, kind, and reflectance of roofs and walls."""

    planes: NDArray[np.float64]
    body: NDArray[np.uint8]
    roof_nir: NDArray[np.float32]
    wall_nir: NDArray[np.float32]
    cells: CellLists


class _Leaves(NamedTuple):
    """Crowns: blobs, the tree of each, and the reflectance of each tree."""

    blobs: NDArray[np.float64]
    tree: NDArray[np.int32]
    nir: NDArray[np.float32]
    cells: CellLists


class _Scanner(NamedTuple):
    """The extent that is kept, noise in metres, share of dropouts, mode, and key of the random numbers."""

    width: float
    height: float
    vertical_noise: float
    horizontal_noise: float
    dropouts: float
    mode: int
    key: np.uint64


@kernel
def _solid_top(ray: _Ray, cells: CellLists, planes: NDArray[np.float64]) -> tuple[float, int, int]:
    """Return the height above ground at which a pulse meets the first solid, the solid (-1: none), and its face."""
    x, y, ground, tx, ty = ray
    start, items, top, highest, size_x, size_y = cells
    best, hit, where = 0.0, -1, 0
    lean = max(abs(tx), abs(ty))
    height, previous = 0.0, -1
    while True:
        i, j = int((x + tx * height) // 4.0), int((y + ty * height) // 4.0)
        if i < 0 or j < 0 or i >= size_x or j >= size_y:
            break
        cell = j * size_x + i
        if cell != previous and top[cell] > ground + best:
            for n in range(start[cell], start[cell + 1]):
                k = items[n]
                low, high, face = 0.0, 1e9, -1
                for f in range(8):
                    a = planes[k, f, 0] * x + planes[k, f, 1] * y + planes[k, f, 2] * ground
                    b = planes[k, f, 0] * tx + planes[k, f, 1] * ty + planes[k, f, 2]
                    room = planes[k, f, 3] - a
                    if b > 1e-12:
                        if room < high * b:
                            high, face = room / b, f
                    elif b < -1e-12:
                        low = max(low, room / b)
                    elif room < 0:
                        high = -1.0
                    if high <= low:
                        break
                if high > low and high > best:
                    best, hit, where = high, k, face
        previous = cell
        # Continue along the path while an object may be that tall.
        height += 2.0 / max(lean, 1e-6)
        if ground + height > highest:
            break
    return best, hit, where


@kernel
def _leaf_hits(
    ray: _Ray, floor: float, cells: CellLists, blobs: NDArray[np.float64], found: NDArray[np.float64]
) -> int:
    """Fill the paths through blobs above `floor` (heights above ground: entry, exit, blob); return how many."""
    x, y, ground, tx, ty = ray
    start, items, top, highest, size_x, size_y = cells
    count, height, previous = 0, 0.0, -1
    lean = max(abs(tx), abs(ty), 1e-6)
    while ground + height <= highest:
        i, j = int((x + tx * height) // 4.0), int((y + ty * height) // 4.0)
        if i < 0 or j < 0 or i >= size_x or j >= size_y:
            break
        cell = j * size_x + i
        if cell != previous and top[cell] > ground + floor:
            for n in range(start[cell], start[cell + 1]):
                k = items[n]
                dx, dy, dz = x - blobs[k, 0], y - blobs[k, 1], ground - blobs[k, 2]
                across, up = blobs[k, 3] * blobs[k, 3], blobs[k, 4] * blobs[k, 4]
                a = (tx * tx + ty * ty) / across + 1.0 / up
                b = (tx * dx + ty * dy) / across + dz / up
                c = (dx * dx + dy * dy) / across + dz * dz / up - 1.0
                root = b * b - a * c
                if root <= 0 or count == len(found):
                    continue
                root = math.sqrt(root)
                enter, leave = (-b + root) / a, (-b - root) / a
                if enter <= floor:
                    continue
                known = False
                for m in range(count):
                    known = known or found[m, 2] == k
                if not known:
                    # Keep them sorted by entry, the highest first.
                    m = count
                    while m > 0 and found[m - 1, 0] < enter:
                        found[m] = found[m - 1]
                        m -= 1
                    found[m, 0], found[m, 1], found[m, 2] = enter, max(leave, floor), k
                    count += 1
        previous = cell
        height += 2.0 / lean
    return count


@kernel
def _scan_chunk(
    places: NDArray[np.float64],
    number: int,
    ground: _Ground,
    standing: _Standing,
    leaves: _Leaves,
    scanner: _Scanner,
) -> tuple[NDArray[np.float64], NDArray[np.uint8], NDArray[np.uint16], NDArray[np.uint8]]:
    """Send pulses; return coordinates, (return number, number of returns), intensities, ASPRS classes."""
    mode, key = scanner.mode, scanner.key
    codes, cover = ground.codes, ground.frame
    room = len(places) * (_MOST if mode == 2 else 1)
    xyz, returns = np.empty((room, 3)), np.empty((room, 2), dtype=np.uint8)
    intensity, classes = np.empty(room, dtype=np.uint16), np.empty(room, dtype=np.uint8)
    found = np.empty((48, 3))
    echo = np.empty((_MOST + 1, 3))  # height above ground, reflectance, class
    count = 0
    for p in range(len(places)):
        x, y, tx, ty = places[p]
        counter = (number + p) * 32
        level = ground_at(ground.relief, x, y)
        ray = _Ray(x, y, level, tx, ty)
        height, hit, face = _solid_top(ray, standing.cells, standing.planes)
        echoes, length = _crown_echoes(ray, height, leaves, found, echo, key, counter)
        # Energy that a crown has not absorbed reaches the roof or the ground below.
        if echoes == 0 or uniform(key, counter + 7) < math.exp(-_OPAQUE * length):
            row = min(int((cover.north - y) / cover.gsd), codes.shape[0] - 1)
            column = min(int((x - cover.west) / cover.gsd), codes.shape[1] - 1)
            code = codes[row, column]
            if hit >= 0:
                kind = standing.body[hit]
                rough = 0.10 * gauss(key, counter + 1) if kind == _HEDGE else 0.0
                cls = 6.0 if kind in (_BUILDING, _ROOF_STRUCTURE) else 3.0 if kind == _HEDGE else 1.0
                nir = standing.roof_nir[hit] if face >= 4 else standing.wall_nir[hit]
                _put(echo, echoes, max(height + rough, 0.0), nir, cls)
                echoes += 1
            elif not (code == _POOL and uniform(key, counter + 2) < 0.93):
                # Grass stands a few centimetres high, unevenly.
                tuft = 0.03 * abs(gauss(key, counter + 3)) if code >= 64 else 0.0
                _put(echo, echoes, tuft, ground.nir[code], 2.0 if code != _POOL else 9.0)
                echoes += 1
        if hit >= 0 or top_near(x, y, standing.cells) > level:
            echoes = _edge_echo(ray, height, standing, echo, echoes, key, counter)
        if echoes == 0:
            continue
        brightness = echo[0, 1]
        if uniform(key, counter + 4) < scanner.dropouts * (2.5 if brightness < 0.3 else 1.0):
            continue
        first = echoes - 1 if mode == 1 else 0
        last = 1 if mode == 0 else echoes
        off_x, off_y = (
            scanner.horizontal_noise * gauss(key, counter + 5),
            scanner.horizontal_noise * gauss(key, counter + 6),
        )
        share = 1.0 / echoes
        for e in range(first, last):
            above = echo[e, 0]
            px, py = x + tx * above + off_x, y + ty * above + off_y
            if px < 0 or py < 0 or px >= scanner.width or py >= scanner.height:
                continue
            xyz[count, 0], xyz[count, 1] = px, py
            xyz[count, 2] = level + above + scanner.vertical_noise * gauss(key, counter + 8 + e)
            returns[count, 0], returns[count, 1] = e + 1, echoes
            strength = echo[e, 1] * (0.35 + 0.65 * share) * (1.0 + 0.12 * gauss(key, counter + 16 + e))
            intensity[count] = int(min(max(strength, 0.004), 1.0) * 40000.0)
            classes[count] = int(echo[e, 2])
            count += 1
    return xyz[:count].copy(), returns[:count].copy(), intensity[:count].copy(), classes[:count].copy()


@kernel
def _put(echo: NDArray[np.float64], e: int, level: float, reflectance: float, asprs: float) -> None:
    """Fill one echo: height above ground, reflectance, ASPRS class."""
    echo[e, 0], echo[e, 1], echo[e, 2] = level, reflectance, asprs


@kernel
def top_near(x: float, y: float, cells: CellLists) -> float:
    """Return the highest elevation of anything in the cell of a place."""
    return float(cells.top[int(y // 4.0) * cells.columns + int(x // 4.0)])


@kernel
def _crown_echoes(
    ray: _Ray,
    floor: float,
    leaves: _Leaves,
    found: NDArray[np.float64],
    echo: NDArray[np.float64],
    key: np.uint64,
    counter: int,
) -> tuple[int, float]:
    """Fill `echo` with the returns of leaves, the highest first; return how many, and the path length in leaves."""
    ways = _leaf_hits(ray, floor, leaves.cells, leaves.blobs, found)
    echoes, length = 0, 0.0
    reached = 1e9
    left = -math.log(1.0 - uniform(key, counter + 24)) / _DENSE
    for m in range(ways):
        upper, lower = min(found[m, 0], reached), found[m, 1]
        length += max(upper - lower, 0.0)
        while upper - lower > left and echoes < _MOST - 1:
            upper -= left
            k = int(found[m, 2])
            apart = echoes == 0 or echo[echoes - 1, 0] - upper >= _DEAD_ZONE
            if apart and upper > floor + _DEAD_ZONE * 0.5:
                _put(echo, echoes, upper, leaves.nir[leaves.tree[k]], 5.0)
                echoes += 1
            left = -math.log(1.0 - uniform(key, counter + 25 + echoes)) / _LOOSE
        if upper > lower:
            left -= upper - lower
        reached = min(reached, lower)
    return echoes, length


@kernel
def _edge_echo(
    ray: _Ray,
    height: float,
    standing: _Standing,
    echo: NDArray[np.float64],
    echoes: int,
    key: np.uint64,
    counter: int,
) -> int:
    """Append to `echo` the return of the other part of the footprint where an edge runs through it."""
    if echoes != 1:
        return echoes
    aside_x, aside_y = _FOOTPRINT * gauss(key, counter + 20), _FOOTPRINT * gauss(key, counter + 21)
    aside = _Ray(ray.x + aside_x, ray.y + aside_y, ray.ground, ray.tx, ray.ty)
    other, hit, _ = _solid_top(aside, standing.cells, standing.planes)
    if abs(other - height) < 1.5:
        return echoes
    if other > height:
        echo[1] = echo[0]
        _put(echo, 0, other, standing.roof_nir[hit], 6.0 if standing.body[hit] <= 1 else 1.0)
    else:
        _put(echo, 1, other, echo[0, 1] * 0.8, 2.0 if hit < 0 else 6.0)
    return 2
