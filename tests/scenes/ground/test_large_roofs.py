"""Roofs of any width leave the ground, and banks, dikes and land between canals stay in it."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.ground.filter import filtered_ground


def rows_and_columns(width, height, spacing):
    x, y = np.meshgrid(np.arange(spacing / 2, width, spacing), np.arange(spacing / 2, height, spacing))
    return x, y


def errors(land, roofs, size, *, spacing=1.0, blur=0.0, scanned=False, noise=0.03):
    """Filtered less true ground on roofs and elsewhere, and the doubt; land z(x, y), roofs (inside, height).

    `blur` (m) smooths the steps of a raster; *scanned* points lie at random places, four to the square metre.
    """
    rng = np.random.default_rng(5)
    width, height = size
    if scanned:
        x, y = (rng.uniform(0, end, 4 * width * height) for end in size)
    else:
        x, y = rows_and_columns(width, height, spacing)
    surface, roof = np.array(land(x, y), dtype=float), np.zeros(x.shape, dtype=bool)
    for inside, top in roofs:
        within = inside(x, y)
        surface[within] = top(x, y)[within] if callable(top) else top
        roof |= within
    if blur:
        surface = gaussian_filter(surface, blur / spacing)
    points = PointCloud(x.ravel(), y.ravel(), (surface + rng.normal(0, noise, x.shape)).ravel())
    ground, doubt = filtered_ground(points, (0, 0, width, height))
    error = ground.sample(points.x, points.y) - np.asarray(land(x, y)).ravel()
    return error[roof.ravel()], error[~roof.ravel()], doubt


def box(west, south, east, north):
    return lambda x, y: (x > west) & (x < east) & (y > south) & (y < north)


def flat(x, y):
    return 5 + 0 * x


def levelled(x, y):
    """A slope of 10 % with a level site of 190 m x 90 m, between banks of 30 degrees."""
    land = 50 + 0.1 * x
    away = np.hypot(np.maximum(abs(x - 160) - 95, 0), np.maximum(abs(y - 90) - 45, 0))
    return np.clip(land, 66 - 0.6 * away, 66 + 0.6 * away)


HALLS = {
    "400 m x 200 m": (flat, [(box(60, 60, 460, 260), 19.0)], (520, 320)),
    "180 m x 180 m": (flat, [(box(60, 60, 240, 240), 20.0)], (300, 300)),
    "two, 8 m apart": (flat, [(box(40, 40, 300, 130), 16.0), (box(40, 138, 300, 228), 16.0)], (340, 270)),
    "on a levelled site": (levelled, [(box(80, 60, 240, 120), 76.0)], (320, 180)),
    "with a ramp to the roof": (
        flat,
        [(box(60, 50, 260, 150), 15.0), (box(260, 96, 340, 104), lambda x, y: 15 - 10 * (x - 260) / 80)],
        (380, 200),
    ),
    "with storeys": (
        flat,
        [(box(60, 50, 160, 150), 12.0), (box(160, 50, 260, 150), 15.0), (box(260, 50, 360, 150), 21.0)],
        (420, 200),
    ),
    "around a lower roof": (flat, [(box(60, 60, 160, 160), 29.0), (box(98, 96, 122, 124), 17.0)], (220, 220)),
    "cut by two sides": (flat, [(box(-10, 60, 410, 150), 16.0)], (400, 210)),
    "cut at a corner": (flat, [(box(-10, -10, 130, 130), 16.0)], (350, 300)),
}


@pytest.mark.parametrize("surface", [{}, {"blur": 1.0}, {"blur": 2.0}, {"scanned": True}], ids=str)
@pytest.mark.parametrize("name", HALLS)
def test_halls_of_any_width_are_removed_whole(name, surface):
    land, roofs, size = HALLS[name]
    below, elsewhere, _ = errors(land, roofs, size, **surface)
    assert abs(np.median(below)) < 0.5
    assert np.mean(np.abs(below) > 2) < 0.01
    # Steps of 2 m blur lift the ground beside a wall by more than half a metre up to 4 m away.
    assert np.mean(np.abs(elsewhere) > 0.5) < (0.03 if surface.get("blur", 0) < 2 else 0.06)


LAND = {
    "dike of 35 degrees": lambda x, y: 5 + np.clip(7 - abs(y - 150) * 0.7, 0, 5),
    "rail embankment": lambda x, y: 5 + np.clip(10 - abs(y - 150 + 0.1 * x) / 1.5, 0, 6),
    "gorge of 50 degrees": lambda x, y: 20 + np.clip(1.2 * (abs(x - 150 + 20 * np.sin(y / 50)) - 10), 0, 30),
    "river banks of 45 degrees": lambda x, y: (
        10 - np.clip(6 - np.maximum(abs(y - 150 + 15 * np.sin(x / 50)) - 15, 0), 0, 6)
    ),
    "rock of 68 degrees": lambda x, y: 10 + np.clip(2.5 * (90 - np.hypot(x - 150, 1.2 * (y - 150))), 0, 25),
    "land between canals": lambda x, y: 3 - 2.2 * ((abs(x - 140) < 7) | (abs(y - 100) < 6)),
    "island in a moat": lambda x, y: (
        5 - 2.2 * ((abs(x - 150) < 67) & (abs(y - 150) < 57) & ~((abs(x - 150) < 60) & (abs(y - 150) < 50)))
    ),
}
HOUSES = [(box(20 + 60 * i, 12, 32 + 60 * i, 22), lambda x, y, i=i: 0 * x) for i in range(5)]


@pytest.mark.parametrize("surface", [{}, {"scanned": True}], ids=str)
@pytest.mark.parametrize("name", LAND)
def test_banks_and_low_walls_stay_ground_where_houses_show_that_walls_are_sharp(name, surface):
    land = LAND[name]
    houses = [(inside, lambda x, y: land(x, y) + 6.0) for inside, _ in HOUSES]
    below, elsewhere, _ = errors(land, houses, (300, 300), **surface)
    assert np.mean(np.abs(elsewhere) > 2) < 0.004
    assert np.abs(below).max() < 2


def test_the_upper_side_of_a_cliff_is_no_roof():
    for depth in (80, 150):
        _, error, _ = errors(lambda x, y, d=depth: np.where(y < d, 12.0, 0.0), [], (300, 240))
        assert np.mean(np.abs(error) > 2) < 0.02
