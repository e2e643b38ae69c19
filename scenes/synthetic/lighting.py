"""Light and colour of the surface seen straight from above: cast shadows, sunlit and shaded faces, textures."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ..geodata.raster import Frame
from .clutter import Cover
from .palettes import GROUND, LAWNS
from .recipe import SceneParameters
from .solids import Body, Texture
from .streams import uniform
from .surface import Surface
from .world import World

__all__ = ["AMBIENT", "HAZE", "colour_surface", "sun_vector", "sunlit"]

#: Share of the light on flat ground that comes from the sky, per band: the sky is blue, so shadows are.
AMBIENT: NDArray[np.float32] = np.array((0.36, 0.39, 0.44, 0.28), dtype=np.float32)
#: Light that the air between camera and ground adds, per band, in grey values.
HAZE: NDArray[np.float32] = np.array((11.0, 12.5, 14.0, 5.0), dtype=np.float32)

_TILES, _CORRUGATED, _GRAVEL, _PLANTED = map(int, (Texture.TILES, Texture.CORRUGATED, Texture.GRAVEL, Texture.PLANTED))
_HEDGE = int(Body.HEDGE)


_PLAZA, _VINES = int(Cover.PLAZA), int(Cover.VINES)


def sun_vector(recipe: SceneParameters) -> tuple[float, float, float]:
    """Return the unit vector towards the sun: east, north, up."""
    elevation, azimuth = math.radians(recipe.sun_elevation), math.radians(recipe.sun_azimuth)
    flat = math.cos(elevation)
    return flat * math.sin(azimuth), flat * math.cos(azimuth), math.sin(elevation)


def sunlit(surface: Surface, recipe: SceneParameters) -> NDArray[np.bool_]:
    """Return which cells the sun reaches, by carrying the height of the shadow along lines away from the sun."""
    east, north, up = sun_vector(recipe)
    flat = math.hypot(east, north)
    lit = np.ones(surface.z.shape, dtype=np.bool_)
    if flat < 1e-6:
        return lit
    # Shadows travel away from the sun: in rows by +north, in columns by -east.
    drow, dcolumn = north / flat, -east / flat
    drop = surface.grid.gsd * up / flat
    if abs(drow) >= abs(dcolumn):
        _sweep(surface.z, lit, drow > 0, dcolumn / abs(drow), drop / abs(drow))
    else:
        _sweep(surface.z.T, lit.T, dcolumn > 0, drow / abs(dcolumn), drop / abs(dcolumn))
    return lit


@kernel
def _sweep(z: NDArray[np.float32], lit: NDArray[np.bool_], downwards: bool, slant: float, drop: float) -> None:
    """Fill `lit` row by row along the shadows; each slanted line keeps the present height of its shadow."""
    rows, columns = z.shape
    base = int(abs(slant) * rows) + 2
    front = np.full(columns + 2 * base, -1e9)
    for k in range(rows):
        r = k if downwards else rows - 1 - k
        offset = base - round(slant * k)
        for c in range(columns):
            level = front[c + offset] - drop
            height = z[r, c]
            if height >= level - 0.02:
                front[c + offset] = max(height, level)
            else:
                front[c + offset] = level
                lit[r, c] = False


def colour_surface(
    world: World,
    surface: Surface,
    codes: NDArray[np.uint8],
    tiles: tuple[NDArray[np.float32], NDArray[np.float32]],
    bands: int,
) -> NDArray[np.uint8]:
    """Return the lit colours of the surface, shape (bands, rows, columns), 0..255.

    `tiles` are a fine and a coarse noise tile.
    """
    solids, trees = world.solids, world.trees
    sun = np.array(sun_vector(world.recipe))
    face_light = np.maximum((solids.planes[:, :, :3] * sun).sum(axis=-1), 0) / sun[2]
    colours = np.empty((bands, *surface.z.shape), dtype=np.uint8)
    _paint(
        colours,
        _View(surface.z, surface.label, codes, sunlit(surface, world.recipe), surface.grid.frame),
        _Roofs(face_light, solids.rectangle, solids.texture, solids.body, solids.colour),
        _Crowns(trees.blobs, trees.tree, trees.colour, np.stack([trees.ground, trees.height], axis=-1)),
        _Cover(GROUND, LAWNS, float(world.layout.pattern[8]), float(world.layout.pattern[9])),
        _Light(sun, AMBIENT, HAZE, world.recipe.exposure),
        tiles,
    )
    return colours


class _View(NamedTuple):
    """The surface seen from above, ground cover, and where the sun reaches; all on the grid of `frame`."""

    z: NDArray[np.float32]
    label: NDArray[np.int32]
    codes: NDArray[np.uint8]
    lit: NDArray[np.bool_]
    frame: Frame


class _Roofs(NamedTuple):
    """Solids as the sun sees them; `face_light` is the share of direct light on each face."""

    face_light: NDArray[np.float64]
    rectangle: NDArray[np.float64]
    texture: NDArray[np.uint8]
    body: NDArray[np.uint8]
    colour: NDArray[np.float32]


class _Crowns(NamedTuple):
    """Blobs of leaves, the tree of each, and colour and size (ground, height) of each tree."""

    blobs: NDArray[np.float64]
    tree: NDArray[np.int32]
    colour: NDArray[np.float32]
    size: NDArray[np.float64]


class _Cover(NamedTuple):
    """Colours of ground covers and lawns, and the direction of the drills of fields (cosine, sine)."""

    ground: NDArray[np.float32]
    lawns: NDArray[np.float32]
    cosine: float
    sine: float


class _Light(NamedTuple):
    """Vector towards the sun, light of the sky and of the air per band, and exposure."""

    sun: NDArray[np.float64]
    ambient: NDArray[np.float32]
    haze: NDArray[np.float32]
    exposure: float


class _Spot(NamedTuple):
    """A cell: its place, and fine and coarse noise there."""

    x: float
    y: float
    grain: float
    patchy: float


@kernel
def _paint(
    colours: NDArray[np.uint8],
    view: _View,
    roofs: _Roofs,
    crowns: _Crowns,
    cover: _Cover,
    light: _Light,
    tiles: tuple[NDArray[np.float32], NDArray[np.float32]],
) -> None:
    """Fill the colours of every cell: those of what lies there, by the light that reaches it."""
    z, label, codes, lit, frame = view
    west, north, gsd, _, _ = frame
    sun, ambient, haze, exposure = light
    fine, coarse = tiles
    bands, rows, columns = colours.shape
    mask = fine.shape[0] - 1
    wide = coarse.shape[0] - 1
    albedo = np.zeros(4)
    for r in range(rows):
        y = north - (r + 0.5) * gsd
        for c in range(columns):
            x = west + (c + 0.5) * gsd
            mark = label[r, c]
            grain = fine[r & mask, c & mask]
            # Coarse noise is tied to metres: one cell of the tile is 0.5 m.
            patchy = coarse[int(y * 2.0) & wide, int(x * 2.0) & wide]
            if mark == 0:
                drill = cover.cosine * y - cover.sine * x  # across the drills of a field
                direct = _ground_albedo(albedo, codes[r, c], drill, grain, patchy, cover)
                r1, c1 = max(r - 1, 0), max(c - 1, 0)
                if label[r1, c] == 0 and label[r, c1] == 0:
                    dzdx = (z[r, c] - z[r, c1]) / gsd
                    dzdy = (z[r1, c] - z[r, c]) / gsd
                    direct *= max((sun[2] - sun[0] * dzdx - sun[1] * dzdy), 0.0) / sun[2]
            elif mark > 0:
                k, face = (mark - 1) >> 3, (mark - 1) & 7
                direct = _solid_albedo(albedo, k, face, _Spot(x, y, grain, patchy), roofs)
                direct *= roofs.face_light[k, face]
            else:
                direct = _leaf_albedo(albedo, -1 - mark, z[r, c], _Spot(x, y, grain, patchy), sun, crowns)
            for b in range(bands):
                bright = ambient[b] + ((1.0 - ambient[b]) * direct if lit[r, c] else 0.0)
                colours[b, r, c] = int(min(max(albedo[b] * bright * 255.0 * exposure + haze[b], 2.0), 253.0))


@kernel
def _ground_albedo(
    albedo: NDArray[np.float64],
    code: int,
    drill: float,
    grain: float,
    patchy: float,
    cover: _Cover,
) -> float:
    """Fill the colour of the ground; return its share of direct light."""
    if code >= 64:
        dry = min(max((code - 64) / 63.0 + 0.22 * patchy, 0.0), 1.0)
        factor = 1.0 + 0.07 * grain + 0.05 * patchy
        for b in range(4):
            albedo[b] = (cover.lawns[0, b] * (1 - dry) + cover.lawns[1, b] * dry) * factor
    else:
        rough = 0.03 if code < 3 else 0.06
        factor = 1.0 + rough * grain + 0.05 * patchy
        if code == _VINES:
            factor *= 0.72 if (drill * 0.5) % 1.0 < 0.45 else 1.12
        elif code > _PLAZA:
            factor *= 1.0 + 0.10 * (((drill * 0.33) % 1.0) - 0.5)
        for b in range(4):
            albedo[b] = cover.ground[code, b] * factor
    return 1.0


@kernel
def _solid_albedo(albedo: NDArray[np.float64], k: int, face: int, spot: _Spot, roofs: _Roofs) -> float:
    """Fill the colour of a solid's top by its texture; return its share of direct light."""
    x, y, grain, patchy = spot
    _, rectangle, texture, body, colour = roofs
    look = texture[k]
    cosine, sine = math.cos(rectangle[k, 2]), math.sin(rectangle[k, 2])
    dx, dy = x - rectangle[k, 0], y - rectangle[k, 1]
    along, across = cosine * dx + sine * dy, cosine * dy - sine * dx
    down = along if face >= 6 else across  # down the slope of this face
    level = along if face < 6 else across
    factor = 1.0 + 0.025 * grain + 0.06 * patchy
    direct = 1.0
    if look == _TILES:
        factor += 0.05 * (((down * 2.9) % 1.0) - 0.5) + 0.04 * grain
    elif look == _CORRUGATED:
        factor += 0.06 * (1.0 if (level * 1.3) % 1.0 < 0.5 else -1.0)
        if (level * 0.11) % 1.0 < 0.03:
            factor -= 0.06
    elif look == _GRAVEL:
        factor += 0.035 * grain + 0.06 * patchy
    elif look == _PLANTED:
        factor += 0.10 * grain + 0.10 * patchy
        bed = (along * 0.17) % 1.0 < 0.04 or (across * 0.17) % 1.0 < 0.04
        factor *= 0.92 if bed else 1.0
    if body[k] == _HEDGE:
        factor += 0.16 * grain
        direct = 0.85 + 0.2 * grain
    # Each face has a different weathering.
    factor += 0.05 * (uniform(np.uint64(977), k * 8 + face) - 0.5)
    for b in range(4):
        albedo[b] = colour[k, b] * factor
    return max(direct, 0.1)


@kernel
def _leaf_albedo(
    albedo: NDArray[np.float64], k: int, z: float, spot: _Spot, sun: NDArray[np.float64], crowns: _Crowns
) -> float:
    """Fill the colour of a crown; return its share of direct light, by the blob's normal and its leaves."""
    x, y, grain, patchy = spot
    blobs, tree, colour, size = crowns
    t = tree[k]
    nx = (x - blobs[k, 0]) / (blobs[k, 3] * blobs[k, 3])
    ny = (y - blobs[k, 1]) / (blobs[k, 3] * blobs[k, 3])
    nz = max(z - blobs[k, 2], 0.05) / (blobs[k, 4] * blobs[k, 4])
    scale = 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz + 1e-12)
    facing = (nx * sun[0] + ny * sun[1] + nz * sun[2]) * scale
    # Leaves stand in all directions, so the normal counts only in part.
    direct = max(0.38 + 0.62 * facing + 0.20 * grain, 0.0)
    height = (z - size[t, 0]) / size[t, 1]
    factor = (0.78 + 0.30 * min(max(height, 0.0), 1.0)) * (1.0 + 0.13 * grain + 0.05 * patchy)
    for b in range(4):
        albedo[b] = colour[t, b] * factor
    return float(direct)
