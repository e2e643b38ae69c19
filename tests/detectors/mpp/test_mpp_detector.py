"""The detector as a whole: same seed, same rectangles; nothing where nothing is; odd clouds do no harm."""

import json
from dataclasses import replace

import numpy as np
import pytest
import shapely

from roofbench.core.errors import ParameterError
from roofbench.detectors.mpp import annealing
from roofbench.detectors.mpp.squares import rounds_of
from roofbench.detectors.registry import make_detector
from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.geodata.raster import Elevation, Grid
from roofbench.scenes.scene import Scene

EXTENT = (1000.0, 2000.0, 1120.0, 2090.0)
#: Roofs: x0, y0, x1, y1, eaves, and rise of a gable along x to its ridge.
ROOFS = ((1010, 2010, 1022, 2018, 4.0, 2.0), (1022, 2010, 1030, 2018, 6.5, 0.0), (1050, 2040, 1080, 2060, 8.0, 0.0))


def cloud(seed=0, *, density=6.0, roofs=ROOFS, trees=((1100.0, 2070.0, 5.0),)):
    """Points over sloping ground, gables and flats, and trees whose pulses return several times."""
    rng = np.random.default_rng(seed)
    n = int(density * 120 * 90)
    x, y = rng.uniform(1000, 1120, n), rng.uniform(2000, 2090, n)
    ground = 3.0 + 0.02 * (x - 1000)
    h = rng.normal(0, 0.05, n)
    returns = np.ones(n, np.uint8)
    for x0, y0, x1, y1, eaves, rise in roofs:
        on = (x >= x0) & (x < x1) & (y >= y0) & (y < y1)
        h[on] += eaves + rise * (1 - np.abs(y[on] - (y0 + y1) / 2) * 2 / (y1 - y0))
    for cx, cy, radius in trees:
        on = (x - cx) ** 2 + (y - cy) ** 2 < radius**2
        h[on] = rng.uniform(0, 1, on.sum()) ** 0.5 * (4 + 5 * (1 - ((x[on] - cx) ** 2 + (y[on] - cy) ** 2) / radius**2))
        returns[on] = rng.integers(1, 4, on.sum())
    return PointCloud(x, y, ground + h, return_number=np.minimum(returns, 1), number_of_returns=returns)


def scene(points, extent=EXTENT):
    grid = Grid.covering(extent, 2.0)
    x, _ = grid.to_world(*np.meshgrid(np.arange(grid.rows) + 0.5, np.arange(grid.columns) + 0.5, indexing="ij"))
    dem = Elevation((3.0 + 0.02 * (x - 1000)).astype(np.float32), grid)
    return Scene("made", extent, crs="EPSG:25832", points=points, dem=dem)


def detect(points, selection="mpp[level=part]", seed=0):
    return make_detector(selection).detect(scene(points), np.random.default_rng(seed))


def wkb(footprints):
    return sorted(shapely.to_wkb(footprints.polygons).tolist())


@pytest.mark.slow
def test_houses_are_found_with_party_wall_and_roof_and_trees_are_not():
    found = detect(cloud())
    assert len(found) == 3
    for x0, y0, x1, y1, _, rise in ROOFS:
        truth = shapely.box(x0, y0, x1, y1)
        shares = shapely.area(shapely.intersection(found.polygons, truth)) / shapely.area(
            shapely.union(found.polygons, truth)
        )
        best = int(np.argmax(shares))
        assert shares[best] > 0.85
        assert found.attributes["roof"][best] == ("gable" if rise else "flat")
    assert found.crs == "EPSG:25832"


SAMPLER = "mpp[level=part,optimiser=rjmcmc]"


def test_the_default_is_a_search_that_draws_no_random_number_and_compiles_no_chain(monkeypatch):
    monkeypatch.setattr(annealing, "run_chain", None)
    assert not make_detector("mpp").stochastic
    one, two = detect(cloud(), seed=0), detect(cloud(), seed=1)
    assert len(one) == 3
    assert wkb(one) == wkb(two)
    assert json.loads(json.dumps(one.metadata)) == one.metadata
    assert not {"seed", "trace"} & one.metadata.keys()


def test_the_sampler_is_random_and_its_seed_decides():
    assert make_detector(SAMPLER).stochastic
    runs = [detect(cloud(), "mpp[level=part,optimiser=rjmcmc,effort=8]", seed=seed) for seed in (0, 0, 1)]
    assert [len(run) for run in runs] == [3, 3, 3]
    assert wkb(runs[0]) == wkb(runs[1])
    energies = [run.metadata["trace"]["energy"] for run in runs]
    assert energies[0] == energies[1] != energies[2]


def test_parameters_of_the_sampler_alone_do_not_change_the_search():
    assert make_detector("mpp[effort=4,start=empty]") == make_detector("mpp")
    assert make_detector("mpp[effort=4,optimiser=rjmcmc]") != make_detector("mpp[optimiser=rjmcmc]")


def test_the_record_of_the_sampler_holds_the_convergence_as_json():
    record = detect(cloud(), SAMPLER).metadata
    assert json.loads(json.dumps(record)) == record
    trace = record["trace"]
    assert len(trace["energy"]) == len(trace["temperature"]) == len(trace["buildings"]) == len(trace["tried"]["birth"])
    assert trace["temperature"][0] > trace["temperature"][-1]
    assert sum(map(sum, trace["tried"].values())) == pytest.approx(trace["proposals"][-1])


@pytest.mark.slow
def test_same_seed_same_bits_with_any_number_of_threads_and_squares():
    points = cloud(1)
    for optimiser in ("search", "rjmcmc"):
        small = f"mpp[level=part,largest_side=30,optimiser={optimiser},threads={{}}]"
        one = detect(points, small.format(1))
        assert len(one) >= 3
        assert wkb(one) == wkb(detect(points, small.format(2))) == wkb(detect(points, small.format(3)))


def test_order_of_points_does_not_matter():
    points = cloud(2)
    order = np.random.default_rng(0).permutation(len(points))
    assert wkb(detect(points)) == wkb(detect(points.take(order)))


def test_a_large_scene_in_squares_finds_what_one_square_finds():
    points = cloud(3)
    whole, tiled = detect(points), detect(points, "mpp[level=part,largest_side=32]")
    assert len(rounds_of(Grid.covering(EXTENT, 0.5), EXTENT, 32.0).chains) > 1
    assert len(whole) == len(tiled)
    shared = shapely.area(shapely.intersection(shapely.union_all(whole.polygons), shapely.union_all(tiled.polygons)))
    assert shared > 0.93 * max(whole.areas.sum(), tiled.areas.sum())


@pytest.mark.parametrize("border", [22, 24, 28, 30])
def test_a_building_of_three_wings_is_found_wherever_a_border_of_squares_divides_it(border):
    wings = ((1014, 2020, 1028, 2030, 6.0, 0.0), (1028, 2016, 1046, 2034, 6.0, 0.0), (1022, 2030, 1028, 2040, 5.0, 0.0))
    points = cloud(4, roofs=wings, trees=())
    # Borders lie at multiples of 128 m.
    moved = replace(points, x=points.x - 1000 + 10 * 128 - border)
    west = 10.0 * 128 - border
    extent = (west, 2010.0, west + 60, 2046.0)
    grid = Grid.covering(extent, 2.0)
    x, _ = grid.to_world(*np.meshgrid(np.arange(grid.rows) + 0.5, np.arange(grid.columns) + 0.5, indexing="ij"))
    dem = Elevation((3.0 + 0.02 * (x - west)).astype(np.float32), grid)
    place = Scene("made", extent, crs="EPSG:25832", points=moved, dem=dem)
    found = make_detector("mpp[level=part]").detect(place, np.random.default_rng(0))
    offset = np.array([west - 1000, 0, west - 1000, 0])
    truth = shapely.box(*(np.array([wing[:4] for wing in wings]) + offset).T)
    shares = shapely.area(shapely.intersection(found.polygons[:, None], truth))
    shares /= shapely.area(shapely.union(found.polygons[:, None], truth))
    assert len(found) == 3
    assert (shares.max(axis=0) > 0.8).all()


@pytest.mark.parametrize(
    "points",
    [
        cloud(roofs=(), trees=()),
        cloud(roofs=(), trees=tuple((x, y, 6.0) for x in range(1010, 1120, 11) for y in range(2010, 2090, 11))),
        PointCloud(np.array([1010.0]), np.array([2010.0]), np.array([9.0])),
        PointCloud(np.full(500, 1010.0), np.full(500, 2010.0), np.full(500, 9.0)),
        PointCloud(*np.full((3, 400), np.nan)),
        PointCloud(*np.empty((3, 0))),
    ],
    ids=["ground", "trees", "one point", "one place", "NaN", "no points"],
)
def test_without_buildings_nothing_is_found(points):
    found = detect(points)
    assert len(found) == 0
    assert len(make_detector("mpp").detect(Scene("no DEM", EXTENT, points=points), np.random.default_rng(0))) == 0


@pytest.mark.slow
@pytest.mark.parametrize("dem", [True, False], ids=["DEM", "own ground"])
def test_nothing_is_found_on_a_lake_except_the_house_on_its_shore(dem):
    """Water gives few returns, some of them far below: the surface must neither break nor bring forth buildings."""
    points = cloud(8, trees=())
    rng = np.random.default_rng(3)
    wet = points.y > 2070
    z = np.where(wet, 3.0 + rng.normal(0, 0.05, len(points)), points.z)
    z = np.where(wet & (rng.random(len(points)) < 0.02), -6.0, z)
    lake = replace(points, z=z).take(~wet | (rng.random(len(points)) < 0.03))
    shore = Scene("lake", EXTENT, points=lake, dem=scene(lake).dem if dem else None)
    found = make_detector("mpp[level=part]").detect(shore, np.random.default_rng(0))
    assert len(found) == 3
    assert (shapely.bounds(found.polygons)[:, 3] < 2065).all()
    water = Scene("water", (1000.0, 2072.0, 1120.0, 2090.0), points=lake.take(lake.y > 2072))
    assert len(make_detector("mpp").detect(water, np.random.default_rng(0))) == 0


@pytest.mark.parametrize("size", [(3.6, 3.0), (100.0, 60.0)], ids=["shed of 11 m2", "hall of 100 m"])
@pytest.mark.parametrize("dem", [True, False], ids=["DEM", "own ground"])
def test_sheds_and_halls_on_a_slope_are_found_with_their_size(size, dem):
    rng = np.random.default_rng(11)
    extent = (0.0, 0.0, 170.0, 130.0)
    n = 8 * 170 * 130
    x, y = rng.uniform(0, 170, n), rng.uniform(0, 130, n)
    truth = shapely.box(40.3, 30.2, 40.3 + size[0], 30.2 + size[1])
    on = shapely.contains_xy(truth, x, y)
    floor = 20.0 + 0.08 * (truth.centroid.x - x) if size[0] < 10 else np.full(n, 20.0)
    z = np.where(on, floor + (2.8 if size[0] < 10 else 9.0), 20.0 + 0.08 * (truth.centroid.x - x))
    points = PointCloud(x, y, z + rng.normal(0, 0.03, n))
    grid = Grid.covering(extent, 1.0)
    east, _ = grid.to_world(*np.meshgrid(np.arange(grid.rows) + 0.5, np.arange(grid.columns) + 0.5, indexing="ij"))
    ground = Elevation((20.0 + 0.08 * (truth.centroid.x - east)).astype(np.float32), grid) if dem else None
    found = make_detector("mpp").detect(Scene("slope", extent, points=points, dem=ground), rng)
    assert len(found) == 1
    common = found.polygons[0].intersection(truth).area
    assert common / found.polygons[0].union(truth).area > (0.6 if size[0] < 10 else 0.95)


def test_birds_holes_and_broken_points_change_little():
    points = cloud(4)
    expected = detect(points)
    rng = np.random.default_rng(5)
    odd = rng.choice(len(points), 300, replace=False)
    z = points.z.copy()
    z[odd[:100]], z[odd[100:200]], z[odd[200:]] = -999.0, np.nan, 400.0
    broken = detect(replace(points, z=z))
    assert len(broken) == len(expected)
    shared = shapely.intersection(shapely.union_all(expected.polygons), shapely.union_all(broken.polygons)).area
    assert shared > 0.93 * expected.areas.sum()


def test_doubled_points_change_nothing():
    points = cloud(6)
    assert wkb(detect(points)) == wkb(detect(points.take(np.repeat(np.arange(len(points)), 2))))


def test_rectangles_of_more_cells_than_the_sums_hold_are_refused_with_what_to_do():
    with pytest.raises(ParameterError, match="lower it to 72, or raise cell"):
        detect(cloud(), "mpp[level=part,cell=0.2]")
    assert len(detect(cloud(), "mpp[level=part,cell=0.25,largest_side=90]")) >= 3


def test_sides_that_cross_each_other_are_refused():
    with pytest.raises(ParameterError, match="least_side of 9 is more than largest_side of 5"):
        make_detector("mpp[least_side=9,largest_side=5]")


@pytest.mark.parametrize("value", ["paper", "reversible"])
def test_the_former_mode_is_answered_with_the_detector_of_the_printed_algorithm(value):
    with pytest.raises(ParameterError, match="mpp-printed"):
        make_detector(f"mpp[mode={value}]")


@pytest.mark.parametrize("name", ["workers", "hot", "intensity", "furniture"])
def test_removed_parameters_are_answered_with_what_to_do(name):
    with pytest.raises(ParameterError, match=rf"mpp: no parameter '{name}': .*(threads|leave it out)"):
        make_detector(f"mpp[{name}=1]")


def test_every_parameter_has_a_meaning_and_a_source():
    for detector in ("mpp", "mpp-printed"):
        for rule in make_detector(detector).parameters().values():
            assert rule.doc
            assert rule.source.startswith(("Yu et al. 2013", "roofbench", "Awrangjeb et al. 2010"))


def test_without_births_from_data_the_sampler_still_finds_the_houses(monkeypatch):
    monkeypatch.setattr(annealing, "_DATA_BIRTHS", 0.0)
    monkeypatch.setattr(annealing, "_HOT", 30.0)
    found = detect(cloud(7), "mpp[optimiser=rjmcmc,start=empty,effort=30]")
    truth = shapely.union_all([shapely.box(*roof[:4]) for roof in ROOFS])
    assert shapely.intersection(shapely.union_all(found.polygons), truth).area > 0.85 * truth.area


def test_the_steps_end_with_the_buildings_of_the_same_run():
    for selection, more in (("mpp[level=part]", []), (SAMPLER, ["convergence"])):
        steps = list(make_detector(selection).steps(scene(cloud()), np.random.default_rng(0)))
        assert [step.name for step in steps] == ["heights", "evidence", "boxes", *more, "buildings"]
        buildings = steps[-1].panels[0].layers[-1].polygons
        assert wkb(detect(cloud(), selection)) == sorted(shapely.to_wkb(buildings).tolist())
