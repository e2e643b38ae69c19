"""The one ground of a scene: the DEM where it is known, the filter elsewhere, and no step between them."""

import numpy as np
import pytest
from naive import ground as naive_ground

from roofbench.scenes.builtin import hamlet
from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.geodata.raster import Elevation, Grid
from roofbench.scenes.ground.filter import ground_surface
from roofbench.scenes.ground.heights import SEAM, heights_of
from roofbench.scenes.scene import Scene

EXTENT = (1000.0, 2000.0, 1100.0, 2080.0)


def plain(height=5.0, seed=0):
    """Points on level ground, two per square metre."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(1000, 1100, 16000), rng.uniform(2000, 2080, 16000)
    return PointCloud(x, y, np.full(16000, height))


def level(height, *, extent=EXTENT, gsd=1.0):
    grid = Grid.covering(extent, gsd)
    return Elevation(np.full(grid.shape, height, dtype=np.float32), grid)


def with_void(dem, chosen, value=np.nan):
    values = dem.values.copy()
    values[chosen] = value
    return Elevation(values, dem.grid)


def test_a_complete_dem_is_the_ground_itself_without_a_copy_or_a_note():
    for extent in (EXTENT, (900, 1900, 1200, 2200)):
        dem = level(5.0, extent=extent)
        heights = heights_of(plain(), dem, EXTENT)
        assert heights.ground is dem
        assert heights.notes == ()


def test_what_a_dem_lacks_outside_the_extent_does_not_matter():
    dem = level(5.0, extent=(900, 1900, 1200, 2200))
    dem.values[:50], dem.values[:, 250:] = np.nan, -9999.0
    assert heights_of(plain(), dem, EXTENT).ground is dem


@pytest.mark.parametrize("value", [np.nan, np.inf, -9999.0, 3.4e38])
@pytest.mark.parametrize("gsd", [0.5, 1.0, 5.0])
def test_in_a_void_the_ground_is_filtered_whatever_marks_it(value, gsd):
    dem = level(5.0, gsd=gsd)
    grid = dem.grid
    dem = with_void(dem, np.s_[grid.rows // 4 :, grid.columns // 3 :], value)
    heights = heights_of(plain(), dem, EXTENT)
    assert heights.ground.values == pytest.approx(5.0, abs=1e-3)
    x, y = np.random.default_rng(0).uniform((1000, 2000), (1100, 2080), (500, 2)).T
    assert heights.ground.sample(x, y) == pytest.approx(5.0, abs=1e-3)
    assert len(heights.notes) == 1
    assert "filtered from the points" in heights.notes[0]


def test_where_the_dem_is_known_the_ground_is_the_dem_to_the_last_bit():
    rng = np.random.default_rng(1)
    dem = level(5.0, extent=(1000, 2000, 1060, 2080))
    dem.values[:] += rng.normal(0, 0.2, dem.values.shape).astype(np.float32)
    heights = heights_of(plain(), dem, EXTENT)
    x, y = np.meshgrid(np.arange(1000.5, 1060), np.arange(2000.5, 2080))
    assert heights.ground.sample(x, y).tolist() == dem.sample(x, y).tolist()


@pytest.mark.parametrize("short", [True, False], ids=["stops short", "void"])
def test_the_seam_has_no_step_and_ends_in_the_filtered_ground(short):
    # The DEM lies 1 m above the points: what remains of it fades along the seam.
    west = level(6.0, extent=(1000, 2000, 1040, 2080))
    dem = west if short else with_void(level(6.0), np.s_[:, 40:])
    ground = heights_of(plain(), dem, EXTENT).ground
    along = ground.sample(np.arange(1000.5, 1100), np.full(100, 2040.0))
    assert along[:40] == pytest.approx(6.0, abs=1e-6)
    assert along[40 + int(SEAM) :] == pytest.approx(5.0, abs=0.01)
    assert np.abs(np.diff(along)).max() < 2 / SEAM
    assert np.diff(along).max() < 0.01


def test_the_seam_is_that_of_the_slow_oracle():
    rng = np.random.default_rng(5)
    points = plain()
    dem = level(5.5)
    dem.values[:] += rng.normal(0, 0.1, dem.values.shape).astype(np.float32)
    known = np.zeros(dem.values.shape, dtype=bool)
    known[10:30, 20:50], known[50:52, 70:90] = True, True
    ground = heights_of(points, with_void(dem, ~known), EXTENT).ground
    filtered = ground_surface(points, EXTENT)
    fading = naive_ground.fading(known, 1.0, SEAM)
    # Cells of the ground lie one cell further out to each side, so that sampling at the rim is known.
    inner = ground.values[1:-1, 1:-1]
    far = fading == 0
    x, y = np.meshgrid(np.arange(1000.5, 1100), np.arange(2079.5, 2000, -1))
    below = filtered.sample(x, y)
    assert inner[known].tolist() == dem.values[known].tolist()
    assert inner[far] == pytest.approx(below[far], abs=1e-4)
    near = ~known & ~far
    # The difference of DEM and filter is 0.5 m with a scatter of 0.1 m, interpolated between the known cells.
    assert np.abs(inner[near] - below[near] - 0.5 * fading[near]).max() < 0.3


@pytest.mark.parametrize("dem", [None, with_void(level(5.0), np.s_[:]), level(5.0, extent=(0, 0, 50, 50))])
def test_without_a_known_dem_all_ground_is_filtered(dem):
    heights = heights_of(plain(), dem, EXTENT)
    assert heights.ground.values.tolist() == ground_surface(plain(), EXTENT).values.tolist()
    assert "ground was filtered from the points" in heights.notes[0]


def test_without_points_voids_are_interpolated_and_without_anything_the_ground_is_at_zero():
    nothing = PointCloud(*np.empty((3, 0)))
    for points in (None, nothing):
        filled = heights_of(points, with_void(level(7.0), np.s_[20:40, 20:50]), EXTENT)
        assert filled.ground.values == pytest.approx(7.0)
        assert "interpolated" in filled.notes[0]
        for dem in (None, with_void(level(7.0), np.s_[:])):
            assert not heights_of(points, dem, EXTENT).ground.values.any()


def test_heights_that_are_not_plausible_are_unknown():
    z = np.array([5.0, 25.0, -20.0, 900.0, np.nan, 4.0])
    points = PointCloud(np.full(6, 1010.0), np.full(6, 2010.0), z)
    assert heights_of(points, level(5.0), EXTENT).above(points) == pytest.approx(
        [0.0, 20.0, np.nan, np.nan, np.nan, -1.0], nan_ok=True
    )


def test_a_scene_notes_what_was_estimated_once_it_is_used():
    whole = hamlet(1)
    bare = Scene("bare", whole.extent, points=whole.points)
    seen = bare.for_detection()
    assert seen.for_detection() is seen
    assert seen.notes == ()
    assert seen.heights is seen.heights
    assert seen.notes == ("there is no DEM: the ground was filtered from the points",)
    assert whole.heights.ground is whole.dem
    assert whole.notes == ()
