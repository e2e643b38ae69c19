"""Trees: their positions and crowns.

Nouns
-----
candidate
    A place where a tree may grow, with a *mark* and all its properties. Candidates are drawn for the highest possible
    density; a scene keeps the allowed ones with the lowest marks, so the trees at 20 per hectare are among those at 40.
crown
    A cluster of ellipsoids (*blobs*): a core and a dozen lobes around its upper side, so that outlines are ragged,
    heights vary within a crown and light passes through.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from ..geodata.raster import Elevation
from .layout import FIELDS, Layout, locate, zone_of
from .palettes import PALETTES, draw_colour
from .recipe import MOST_TREES, SceneParameters
from .solids import Body, Solid
from .streams import stream

__all__ = ["Trees", "grow", "nearest_rectangle", "rectangle_table"]

_LOBES = 13
_GAPS = (1.0, 6.0)
_STREET_TREES = 0.16
_STREET_TREE_STEP = 9.0


@dataclass(frozen=True)
class Trees:
    """Trees and their blobs.

    Attributes
    ----------
    x, y, ground, height, radius : ndarray of float64, shape (n,)
        Trunk, elevation of the ground, height above it, crown radius; metres.
    colour : ndarray of float32, shape (n, 4)
    candidate : ndarray of int64, shape (n,)
        Number of the candidate: equal numbers are equal trees, at whatever density.
    blobs : ndarray of float64, shape (m, 5)
        x, y, z (elevation) of the centre, horizontal and vertical radius.
    tree : ndarray of int32, shape (m,)
        Tree of each blob.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    ground: NDArray[np.float64]
    height: NDArray[np.float64]
    radius: NDArray[np.float64]
    colour: NDArray[np.float32]
    candidate: NDArray[np.int64]
    blobs: NDArray[np.float64]
    tree: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.x)


def grow(terrain: Elevation, layout: Layout, buildings: list[Solid], recipe: SceneParameters, seed: int) -> Trees:
    """Return the trees of a scene."""
    count = math.ceil(MOST_TREES * recipe.hectares)
    draws = stream(seed, "trees").random((count, 16))
    x, y = _places(draws, layout, recipe)
    away = nearest_rectangle(x, y, rectangle_table(solid for solid in buildings if solid.body == Body.BUILDING))
    clumped = draws[:, 10] < max(recipe.tree_clumping, 0.25)
    allowed = (away >= recipe.tree_gap) & _plantable(x, y, layout, clumped)
    allowed &= (x > -1) & (x < recipe.width + 1) & (y > -1) & (y < recipe.height + 1)
    mark = draws[:, 0] * (1 - 0.85 * recipe.woodland * np.clip((away - 4) / 16, 0, 1))
    order = np.argsort(np.where(allowed, mark, np.inf), kind="stable")
    kept = order[: min(round(recipe.tree_density * recipe.hectares), int(allowed.sum()))]
    x, y = x[kept], y[kept]
    if recipe.gap_trees > 0:
        _move_into_gaps(x, y, buildings, recipe.gap_trees, seed)
    return _crowns(kept, x, y, draws[kept], terrain, recipe, seed)


def _move_into_gaps(
    x: NDArray[np.float64], y: NDArray[np.float64], buildings: list[Solid], share: float, seed: int
) -> None:
    """Move the first trees, in place, to the middle of a share of the gaps between buildings.

    A gap is the shortest line between two buildings, `_GAPS` metres long.
    """
    import shapely

    parts = [solid for solid in buildings if solid.body == Body.BUILDING]
    outlines = shapely.polygons(np.array([part.corners() for part in parts]).reshape(-1, 4, 2))
    owner = np.array([part.owner for part in parts], dtype=np.int64)
    one, two = shapely.STRtree(outlines).query(outlines, predicate="dwithin", distance=_GAPS[1])
    pairs = owner[one] < owner[two]
    lines = shapely.shortest_line(outlines[one[pairs]], outlines[two[pairs]])
    lines = lines[shapely.length(lines) >= _GAPS[0]]
    middle = shapely.get_coordinates(shapely.line_interpolate_point(lines, 0.5, normalized=True))
    middle = middle[stream(seed, "gap-trees").random(len(middle)) < share][: len(x)]
    x[: len(middle)], y[: len(middle)] = middle.T


def _places(
    draws: NDArray[np.float64], layout: Layout, recipe: SceneParameters
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where the candidates stand: anywhere, in clumps, or in rows along the streets."""
    extent = np.array((recipe.width, recipe.height))
    place = draws[:, 1:3] * extent
    clumps = max(1, round(recipe.hectares * 5))
    parent = draws[np.minimum((draws[:, 3] * clumps).astype(np.intp), len(draws) - 1)][:, 4:6] * extent
    spread = (draws[:, 6:8] + draws[:, 8:10] - 1) * 16
    clumped = draws[:, 10] < recipe.tree_clumping
    place = np.where(clumped[:, None], parent + spread, place)
    x, y = place[:, 0], place[:, 1]
    along = draws[:, 11] < _STREET_TREES
    period, origin, verge = layout.pattern[0], layout.pattern[5], layout.pattern[2] / 2 - 1.6
    u, v = layout.u.sample(x[along], y[along]), layout.v.sample(x[along], y[along])
    u = np.round(u / _STREET_TREE_STEP) * _STREET_TREE_STEP + (draws[along, 6] - 0.5) * 1.5
    side = np.where(draws[along, 7] < 0.5, -1, 1)
    v = origin + np.round((v - origin) / period) * period + side * verge
    x[along], y[along] = layout.to_world(u, v)
    return x, y


def _plantable(
    x: NDArray[np.float64], y: NDArray[np.float64], layout: Layout, clumped: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return where trees may stand: not on asphalt, and in fields only as copses."""
    u, v = layout.u.sample(x, y), layout.v.sample(x, y)
    free: NDArray[np.bool_] = _off_road(u, v, clumped, layout.pattern, layout.key, layout.zones, np.array(layout.first))
    return free


@kernel
def _off_road(
    u: NDArray[np.float64],
    v: NDArray[np.float64],
    clumped: NDArray[np.bool_],
    pattern: NDArray[np.float64],
    key: int,
    zones: NDArray[np.uint8],
    first: NDArray[np.int64],
) -> NDArray[np.bool_]:
    free = np.zeros(len(u), dtype=np.bool_)
    for k in range(len(u)):
        block, row, along, across = locate(u[k], v[k], pattern, key)
        # The street but for its two verges.
        main = min(across, pattern[0] - across) < pattern[2] / 2 - 2.4
        road = main or min(along, pattern[1] - along) < pattern[3] / 2 - 2.0
        free[k] = not road and (clumped[k] or zone_of(block, row, zones, first) != FIELDS)
    return free


def rectangle_table(solids: Iterable[Solid]) -> NDArray[np.float64]:
    """Return x, y, angle, length, width of solids, shape (n, 5)."""
    return np.array([(s.x, s.y, s.angle, s.length, s.width) for s in solids], dtype=np.float64).reshape(-1, 5)


@kernel
def nearest_rectangle(
    x: NDArray[np.float64], y: NDArray[np.float64], rectangles: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the signed distance to the nearest rectangle, negative inside, at most 50 m, shape of `x`."""
    nearest = np.full(len(x), 50.0)
    for r in range(len(rectangles)):
        cx, cy, angle, length, width = rectangles[r]
        cosine, sine = math.cos(angle), math.sin(angle)
        reach = 50.0 + length + width
        for k in range(len(x)):
            dx, dy = x[k] - cx, y[k] - cy
            if abs(dx) > reach or abs(dy) > reach:
                continue
            along = abs(cosine * dx + sine * dy) - length / 2
            across = abs(cosine * dy - sine * dx) - width / 2
            # Negative inside; beyond a corner, the distance to it.
            beyond = math.sqrt(max(along, 0.0) ** 2 + max(across, 0.0) ** 2)
            nearest[k] = min(nearest[k], beyond + min(max(along, across), 0.0))
    return nearest


def _crowns(
    candidate: NDArray[np.intp],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    draws: NDArray[np.float64],
    terrain: Elevation,
    recipe: SceneParameters,
    seed: int,
) -> Trees:
    """Give the accepted trees their height, colour and blobs."""
    count = math.ceil(MOST_TREES * recipe.hectares)
    rng = stream(seed, "crowns")
    looks = rng.random((count, 8))[candidate]
    lobes = rng.random((count, _LOBES, 5), dtype=np.float32).astype(np.float64)[candidate]
    spread = (looks[:, 0] + looks[:, 1] + looks[:, 2] - 1.5) * 2
    height = np.clip(recipe.tree_height * (1 + 0.36 * spread + 0.10 * spread * spread), 2.2, 45)
    conifer = draws[:, 12] < recipe.conifers
    slender = 0.24 + 0.16 * looks[:, 3]
    radius = np.clip(np.where(conifer, 0.20 + 0.05 * looks[:, 3], slender) * height + 0.35, 0.9, 8.5)
    ground = terrain.sample(x, y)
    colour = np.empty((len(x), 4), dtype=np.float32)
    for k in range(len(x)):
        autumn = draws[k, 13] < recipe.autumn_share and not conifer[k]
        palette = PALETTES["needles" if conifer[k] else "autumn" if autumn else "leaves"]
        colour[k] = draw_colour(palette, looks[k, 4], looks[k, 5], looks[k, 6])
    blobs = np.concatenate(
        [_leafy(x, y, ground, height, radius, lobes)[~conifer], _needled(x, y, ground, height, radius, lobes)[conifer]]
    )
    number = np.arange(len(x), dtype=np.int32)
    tree = np.repeat(np.concatenate([number[~conifer], number[conifer]]), _LOBES + 1)
    return Trees(x, y, ground, height, radius, colour, candidate.astype(np.int64), blobs.reshape(-1, 5), tree)


def _leafy(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    ground: NDArray[np.float64],
    height: NDArray[np.float64],
    radius: NDArray[np.float64],
    lobes: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return blobs of broad-leaved trees, shape (trees, lobes + 1, 5): lobes sit around a core, more of them above."""
    blobs = np.empty((len(x), _LOBES + 1, 5))
    deep = np.minimum(0.36 * height, 1.15 * radius)
    middle = ground + height - deep
    blobs[:, 0] = np.stack([x, y, middle - 0.12 * deep, 0.62 * radius, 0.76 * deep], axis=-1)
    for k in range(_LOBES):
        turn, up, out, size = lobes[:, k, 0], lobes[:, k, 1], lobes[:, k, 2], lobes[:, k, 3]
        cosine, sine = _direction(k / _LOBES + 0.12 * turn)
        # The first lobes form the rim, the later ones the top.
        rim = k < _LOBES * 0.6
        away = radius * (0.46 + 0.42 * out if rim else 0.42 * out)
        lift = deep * (-0.60 + 0.75 * up if rim else 0.20 + 0.42 * up)
        girth = radius * (0.26 + 0.20 * size if rim else 0.28 + 0.16 * size)
        blobs[:, k + 1] = np.stack(
            [x + away * cosine, y + away * sine, middle + lift, girth, np.minimum(girth, deep * 0.42)], axis=-1
        )
    return blobs


def _needled(
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    ground: NDArray[np.float64],
    height: NDArray[np.float64],
    radius: NDArray[np.float64],
    lobes: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return blobs of conifers: a cone of whorls, narrower towards the top."""
    blobs = np.empty((len(x), _LOBES + 1, 5))
    whorl = height / (_LOBES + 1)
    for k in range(_LOBES + 1):
        share = (k + 0.5) / (_LOBES + 1)
        shift = lobes[:, min(k, _LOBES - 1)]
        cosine, sine = _direction(shift[:, 0])
        girth = radius * (1.02 - 0.95 * share) * (0.8 + 0.4 * shift[:, 3])
        away = 0.22 * radius * (1 - share) * shift[:, 2]
        level = ground + height * (0.12 + 0.84 * share)
        blobs[:, k] = np.stack([x + away * cosine, y + away * sine, level, girth, whorl * 1.1], axis=-1)
    return blobs


def _direction(turn: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a unit vector for a share of a full turn (rational, so that every processor computes the same bits)."""
    quarter = np.mod(turn, 1.0) * 4
    side = quarter.astype(np.intp) & 3
    # Half-angle form: t between -tan(22.5 degrees) and tan(22.5 degrees) spans a quarter turn.
    t = ((quarter - np.floor(quarter)) * 2 - 1) * 0.41421356237309503
    cosine, sine = (1 - t * t) / (1 + t * t), 2 * t / (1 + t * t)
    turned_x = np.choose(side, (cosine, -sine, -cosine, sine))
    turned_y = np.choose(side, (sine, cosine, -sine, -cosine))
    return turned_x, turned_y
