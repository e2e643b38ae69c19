"""The hamlet: a very small scene drawn by plain numpy, so that a first run needs no file and no generator.

Two dozen houses with gable and flat roofs on a gentle slope, some of them L-shaped (two rectangles of one building),
some as small as a garage, and as many trees, a few of them leaning over roofs. Points carry return numbers, the
orthoimage has red, green and blue. Ground truth is what was drawn; nothing is tuned to a detector.

Axis order: x east, y north, metres. Buildings are rectangles ``(x, y, length, width, angle, eaves height)``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .geodata.footprints import Footprints
from .geodata.points import PointCloud
from .geodata.raster import Elevation, Grid, Image
from .scene import Scene

__all__ = ["DENSITY", "GSD", "SIZE", "hamlet"]

SIZE = 120.0  # side of the square extent, m
GSD = 0.25  # of the orthoimage, m
DENSITY = 2.0  # laser pulses per m2
_EAST, _NORTH = 500_000.0, 5_400_000.0  # lower left corner, m
_ROOF_COLOURS = np.array([[150, 74, 58], [120, 62, 52], [112, 110, 112], [84, 86, 92], [176, 170, 160]])

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _House:
    building: int
    x: float
    y: float
    length: float
    width: float
    angle: float
    eaves: float
    ridge: float
    colour: Array

    def local(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return coordinates along and across the house."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return (x - self.x) * c + (y - self.y) * s, (y - self.y) * c - (x - self.x) * s

    def corners(self) -> Array:
        c, s = np.cos(self.angle), np.sin(self.angle)
        u = np.array([-1, 1, 1, -1]) * self.length / 2
        v = np.array([-1, -1, 1, 1]) * self.width / 2
        return np.stack([self.x + u * c - v * s, self.y + u * s + v * c], axis=-1)

    def roof(self, x: Array, y: Array) -> Array:
        """Return the roof's height above its ground, 0 beside it: a gable whose ridge runs along the house."""
        along, across = self.local(x, y)
        inside = (np.abs(along) <= self.length / 2) & (np.abs(across) <= self.width / 2)
        rise = self.ridge * (1 - np.abs(across) / (self.width / 2))
        return np.where(inside, self.eaves + rise, 0.0)


def hamlet(seed: int = 1) -> Scene:
    """Return the built-in scene; the same seed gives the same scene.

    Examples
    --------
    >>> scene = hamlet(seed=1)
    >>> scene.name, len(scene.reference.polygons) > 20
    ('hamlet-1', True)
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 0x4A31E7]))
    houses = _houses(rng)
    trees = _trees(rng)
    reference = Footprints.from_rectangles(
        np.array([house.corners() for house in houses]),
        crs="EPSG:25832",
        building_ids=[house.building for house in houses],
        source=f"hamlet-{seed}",
    )
    return Scene(
        f"hamlet-{seed}",
        (_EAST, _NORTH, _EAST + SIZE, _NORTH + SIZE),
        crs="EPSG:25832",
        points=_points(houses, trees, rng),
        image=_image(houses, trees, rng),
        dem=_dem(rng),
        reference=reference,
        facts={"source": "drawn by roofbench", "builtin": "hamlet", "seed": seed},
    )


def _ground(x: Array, y: Array) -> Array:
    u, v = x - _EAST, y - _NORTH
    return 200.0 + 0.06 * u + 0.02 * v + 0.5 * np.sin(u / 23) * np.cos(v / 31)


def _houses(rng: np.random.Generator) -> list[_House]:
    """Place houses on a 5 x 5 grid of parcels, each turned and shifted by chance; a few parcels stay empty."""
    houses: list[_House] = []
    pitch = SIZE / 5
    for parcel in range(25):
        if rng.random() < 0.08:
            continue
        x = _EAST + (parcel % 5 + 0.5) * pitch + rng.uniform(-2, 2)
        y = _NORTH + (parcel // 5 + 0.5) * pitch + rng.uniform(-2, 2)
        angle = rng.uniform(0, np.pi)
        colour = _ROOF_COLOURS[rng.integers(len(_ROOF_COLOURS))] * rng.uniform(0.85, 1.15)
        length, width = rng.uniform(9, 14), rng.uniform(6.5, 8.5)
        eaves, ridge = rng.uniform(3, 6), rng.choice([0.0, 2.0, 3.0])
        building = len({house.building for house in houses})
        houses.append(_House(building, x, y, length, width, angle, eaves, ridge, colour))
        extra = rng.random()
        c, s = np.cos(angle), np.sin(angle)
        if extra < 0.25:  # a wing across one end makes an L
            u, v = length / 2 - width / 2, width / 2 + 1.0
            wing = (x + u * c - v * s, y + u * s + v * c)
            houses.append(_House(building, *wing, width, 5.5, angle + np.pi / 2, eaves, ridge, colour))
        elif extra < 0.5:  # a garage with a gap
            u = length / 2 + rng.uniform(2.5, 4)
            houses.append(_House(building + 1, x + u * c, y + u * s, 3.2, 5.5, angle, 2.7, 0.0, colour))
    return [house for house in houses if _is_inside(house)]


def _is_inside(house: _House) -> bool:
    from_corner = house.corners() - np.array([_EAST, _NORTH])
    return bool((from_corner > 0).all() and (from_corner < SIZE).all())


def _trees(rng: np.random.Generator) -> Array:
    """Return trees as rows of x, y, crown radius, height."""
    count = 32
    place = rng.uniform(0, SIZE, (count, 2)) + np.array([_EAST, _NORTH])
    return np.column_stack([place, rng.uniform(1.2, 3.2, count), rng.uniform(3.0, 9.0, count)])


def _surfaces(houses: list[_House], trees: Array, x: Array, y: Array) -> tuple[Array, Array, NDArray[np.intp]]:
    """Return height above ground of roofs and of crowns (0 where none), and which house it is (-1 none)."""
    roof, crown, which = np.zeros(x.shape), np.zeros(x.shape), np.full(x.shape, -1)
    for number, house in enumerate(houses):
        near = _near(x, y, house.x, house.y, np.hypot(house.length, house.width) / 2)
        height = house.roof(x[near], y[near])
        which[near] = np.where(height > roof[near], number, which[near])
        roof[near] = np.maximum(roof[near], height)
    for tree_x, tree_y, radius, height in trees:
        near = _near(x, y, tree_x, tree_y, radius)
        reach = np.clip(1 - ((x[near] - tree_x) ** 2 + (y[near] - tree_y) ** 2) / radius**2, 0, None)
        crown[near] = np.maximum(crown[near], np.where(reach > 0, height * (0.55 + 0.45 * np.sqrt(reach)), 0))
    return roof, crown, which


def _near(x: Array, y: Array, centre_x: float, centre_y: float, reach: float) -> tuple[NDArray[np.intp], ...]:
    """Return the indices of places in a square around a centre."""
    return np.nonzero((np.abs(x - centre_x) <= reach) & (np.abs(y - centre_y) <= reach))


def _points(houses: list[_House], trees: Array, rng: np.random.Generator) -> PointCloud:
    count = int(DENSITY * SIZE**2)
    x = _EAST + rng.uniform(0, SIZE, count)
    y = _NORTH + rng.uniform(0, SIZE, count)
    ground = _ground(x, y)
    roof, crown, _ = _surfaces(houses, trees, x, y)
    over = crown > roof
    depth = rng.beta(1.2, 4, count) * 0.5  # how deep a pulse enters the crown
    first = np.where(over, crown * (1 - depth), roof) + ground + rng.normal(0, 0.04, count)
    passes = over & (rng.random(count) < 0.45)
    last = (ground + roof + rng.normal(0, 0.04, count))[passes]
    ones = np.ones(count, np.uint8)
    returns = np.where(passes, 2, 1).astype(np.uint8)
    z = np.round(np.concatenate([first, last]), 3)
    return PointCloud(
        np.round(np.concatenate([x, x[passes]]), 3),
        np.round(np.concatenate([y, y[passes]]), 3),
        z,
        return_number=np.concatenate([ones, ones[passes] * 2]).astype(np.uint8),
        number_of_returns=np.concatenate([returns, returns[passes]]),
    )


def _image(houses: list[_House], trees: Array, rng: np.random.Generator) -> Image:
    grid = Grid.covering((_EAST, _NORTH, _EAST + SIZE, _NORTH + SIZE), GSD)
    x, y = grid.to_world(*np.meshgrid(np.arange(grid.rows) + 0.5, np.arange(grid.columns) + 0.5, indexing="ij"))
    roof, crown, which = _surfaces(houses, trees, x, y)
    patch = np.sin((x - _EAST) / 9) * np.sin((y - _NORTH) / 13)
    colours = np.stack([104 + 22 * patch, 122 + 12 * patch, 78 + 14 * patch])
    for number, house in enumerate(houses):
        on_it = which == number
        _, across = house.local(x[on_it], y[on_it])
        light = np.where(across > 0, 1.08, 0.86 if house.ridge else 1.08)
        colours[:, on_it] = house.colour[:, None] * light
    green = np.stack([58 + 30 * crown / 9, 88 + 34 * crown / 9, 46 + 20 * crown / 9])
    colours = np.where(crown > roof, green, colours)
    colours = colours + rng.normal(0, 5, colours.shape)
    return Image(np.clip(np.round(colours), 0, 255).astype(np.uint8), ("red", "green", "blue"), grid)


def _dem(rng: np.random.Generator) -> Elevation:
    grid = Grid.covering((_EAST, _NORTH, _EAST + SIZE, _NORTH + SIZE), 1.0)
    x, y = grid.to_world(*np.meshgrid(np.arange(grid.rows) + 0.5, np.arange(grid.columns) + 0.5, indexing="ij"))
    return Elevation((_ground(x, y) + rng.normal(0, 0.03, x.shape)).astype(np.float32), grid)
