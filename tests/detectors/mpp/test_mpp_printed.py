"""The printed algorithm: each equation gives the numbers worked by hand, and the simulation follows the flow chart."""

import json
import math
from itertools import combinations

import numpy as np
import pytest
import shapely
from naive import mpp as naive
from naive import printed as naive_printed

from roofbench import detect, make_scene
from roofbench.core.errors import ParameterError
from roofbench.detectors.mpp.printed_chain import Operation, PrintedSchedule, PrintedTrace, run_printed
from roofbench.detectors.mpp.printed_detector import class_gaussians
from roofbench.detectors.mpp.printed_model import (
    GROUND,
    NU,
    TREE,
    PrintedModel,
    birth_log_ratio,
    building_sums,
    centre_log_ratios,
    common_sums,
    death_log_ratio,
    log_likelihood,
    log_posterior_gain,
    log_prior,
    matching_share,
    sorted_points,
    update_log_ratio,
)
from roofbench.detectors.mpp.random_stream import stream
from roofbench.detectors.mpp.rectangles import overlap_area
from roofbench.detectors.registry import make_detector
from roofbench.detectors.seams import join_tiles
from roofbench.detectors.tiling import measure, owned, stream_of, tiles_over
from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.geodata.raster import Elevation, Grid
from roofbench.scenes.scene import Scene

ROWS, COLUMNS = 8, 10
#: Ground N(0, 1), trees N(4, 2); priors of length, width, nu and tau.
CLASSES = np.array([[0.0, 1.0], [4.0, 2.0]])
PRIOR = np.array([[4.0, 1.0], [2.0, 0.5], [6.0, 2.0], [0.5, 0.25]])
MODEL = PrintedModel(CLASSES, PRIOR, match=2.0, log_birth=0.0, union=False)
#: One point in each cell of columns 2 to 5 of rows 3 and 4, at 6 m or 5 m.
Z = {(3, 2): 6.0, (3, 3): 6.0, (3, 4): 5.0, (3, 5): 6.0, (4, 2): 6.0, (4, 3): 5.0, (4, 4): 6.0, (4, 5): 6.0}
#: Covers all eight points; its right half and two empty columns; its left half alone.
OLD = np.array([4.0, 4.0, 4.0, 2.0, 0.0, 6.0, 0.5])
SHIFTED = np.array([6.0, 4.0, 4.0, 2.0, 0.0, 6.0, 0.5])
EMPTY = np.array([26.0, 4.0, 4.0, 2.0, 0.0, 6.0, 0.5])
SHORTER = np.array([3.0, 4.0, 2.0, 2.0, 0.0, 5.5, 0.5])


def points_of(cells=Z):
    index = np.array([row * COLUMNS + column for row, column in cells])
    return sorted_points(index, np.array(list(cells.values())), (ROWS, COLUMNS))


def log_normal(z, mean, spread):
    return -math.log(spread * math.sqrt(2 * math.pi)) - (z - mean) ** 2 / (2 * spread**2)


def sums(*z):
    return np.array([len(z), sum(z), sum(value * value for value in z)], dtype=float)


def test_the_sums_of_a_building_and_of_what_two_share_are_those_of_their_cells():
    rng = np.random.default_rng(0)
    index, z = rng.integers(0, 30 * 40, 3000), rng.normal(3, 4, 3000)
    points = sorted_points(index, z, (30, 40))
    found = np.empty(3)
    for _ in range(100):
        pair = np.column_stack(
            [rng.uniform(0, 40, 2), rng.uniform(0, 30, 2), rng.uniform(1, 25, (2, 2)), rng.uniform(0, 3, 2)]
        )
        one, other = (naive.cells_inside(rectangle, 30, 40).ravel()[index] for rectangle in pair)
        building_sums(pair[0], points.table, found)
        np.testing.assert_allclose(found, [one.sum(), z[one].sum(), (z[one] ** 2).sum()], atol=1e-9)
        common_sums(*pair, points.table, found)
        both = one & other
        np.testing.assert_allclose(found, [both.sum(), z[both].sum(), (z[both] ** 2).sum()], atol=1e-9)


def test_equation_2_is_the_sum_of_logarithms_of_normal_densities():
    # Two points at 6 and 5 under N(6, 0.5): -2 log(0.5 sqrt(2 pi)) - (0 + 1) / 0.5 = -0.4516 - 2.
    assert log_likelihood(sums(6, 5), 6.0, 0.5) == pytest.approx(-2.45158, abs=1e-5)
    assert log_likelihood(sums(6, 5), 6.0, 0.5) == pytest.approx(log_normal(6, 6, 0.5) + log_normal(5, 6, 0.5))


def test_equation_5_is_gaussian_in_length_width_nu_and_tau():
    assert log_prior(OLD, PRIOR) == 0.0
    # Length 2 is two standard deviations short, nu 5.5 a quarter: -(4 + 0.0625) / 2.
    assert log_prior(SHORTER, PRIOR) == pytest.approx(-2.03125)


def test_the_share_of_matching_points_counts_those_within_so_many_tau_of_nu():
    # Six points at 6 m and two at 5 m; nu = 6 and tau = 0.5: all within 2 tau, six within 1.9 tau.
    assert [matching_share(OLD, points_of(), match) for match in (2.0, 1.9)] == [1.0, 0.75]
    # Its left half holds 6, 6, 6 and 5; within half a tau of 5.5 lies none.
    assert [matching_share(SHORTER, points_of(), match) for match in (1.0, 0.5)] == [1.0, 0.0]
    assert matching_share(EMPTY, points_of(), 2.0) == 0.0
    # Two points of one cell, given in the order of neither cells nor rows.
    two = sorted_points(np.array([25, 13, 25]), np.array([4.0, 6.0, 5.5]), (ROWS, COLUMNS))
    both = np.array([4.5, 2.0, 4.0, 2.0, 0.0, 6.0, 0.5])
    assert [matching_share(both, two, match) for match in (1.0, 0.5)] == [2 / 3, 1 / 3]


def test_equation_6_as_printed_compares_the_likelihoods_of_two_point_sets():
    # Old: six points at nu, two a metre below. New: 6, 6, 6, 5 around nu = 5.5.
    before = 6 * log_normal(6, 6, 0.5) + 2 * log_normal(5, 6, 0.5)
    after = 3 * log_normal(6, 5.5, 0.5) + log_normal(5, 5.5, 0.5)
    assert before == pytest.approx(-5.80633, abs=1e-5)
    assert after == pytest.approx(-2.90317, abs=1e-5)
    # All points match: n/N is 1 before and after. The prior falls by 2.03125.
    assert update_log_ratio(SHORTER, OLD, points_of(), MODEL, -np.inf) == pytest.approx(0.87191, abs=1e-5)
    # Within 0.9 tau match six of eight before and none after.
    closer = MODEL._replace(match=0.9)
    assert update_log_ratio(SHORTER, OLD, points_of(), closer, -np.inf) == pytest.approx(0.87191 - 0.75, abs=1e-5)


def test_equation_6_over_the_union_counts_what_is_left_as_ground_or_tree():
    printed = update_log_ratio(SHORTER, OLD, points_of(), MODEL, -np.inf)
    # Columns 4 and 5 are left: 5, 6, 6, 6, as trees.
    left = log_normal(5, 4, 2) + 3 * log_normal(6, 4, 2)
    assert left == pytest.approx(-8.07334, abs=1e-5)
    union = update_log_ratio(SHORTER, OLD, points_of(), MODEL._replace(union=True), -np.inf)
    assert union - printed == pytest.approx(left)
    assert update_log_ratio(OLD, SHORTER, points_of(), MODEL._replace(union=True), -np.inf) == pytest.approx(-union)


@pytest.mark.parametrize(
    ("equation", "released", "taken"), [(8, GROUND, GROUND), (9, TREE, GROUND), (10, GROUND, TREE), (11, TREE, TREE)]
)
def test_equations_8_to_11(equation, released, taken):
    points = {**Z, (3, 6): 1.0}
    # log N(6) is -0.22579 in the building, -18.91894 on the ground and -2.11209 in trees; log N(5) -2.22579, -13.41894
    # and -1.73709; log N(1) -50.22579, -1.41894 and -2.73709. Two cells to the right: columns 2 and 3 are left
    # (6, 6, 6, 5), the point of 1 m in column 6 is taken in.
    left = (log_normal(6, *CLASSES[released]) - log_normal(6, 6, 0.5)) * 3
    left += log_normal(5, *CLASSES[released]) - log_normal(5, 6, 0.5)
    gained = log_normal(1, 6, 0.5) - log_normal(1, *CLASSES[taken])
    # Of the points after the move, 5, 6, 6, 6 and 1, four match; of those before, all eight.
    found = centre_log_ratios(SHIFTED, OLD, points_of(points), MODEL, -np.inf)[released, taken]
    assert found == pytest.approx(left + gained - 0.2, abs=1e-9)
    by_hand = {8: -116.07944, 9: -53.97703, 10: -114.76129, 11: -52.65888}
    assert left + gained == pytest.approx(by_hand[equation], abs=1e-4)


def test_equations_12_to_15():
    # Eight points: -5.80633 under N(6, 0.5), 6 * (-18.91894) + 2 * (-13.41894) under the ground, -16.27182 under trees.
    own = 6 * log_normal(6, 6, 0.5) + 2 * log_normal(5, 6, 0.5)
    ground = birth_log_ratio(OLD, GROUND, points_of(), MODEL)
    tree = birth_log_ratio(OLD, TREE, points_of(), MODEL)
    assert ground == pytest.approx(own + 6 * 18.918939 + 2 * 13.418939, abs=1e-4)
    assert tree == pytest.approx(own + 6 * 2.112086 + 2 * 1.737086, abs=1e-4)
    assert (ground, tree) == pytest.approx((134.54518, 10.34036), abs=1e-4)
    # Equation 12 has the factor lambda b / d.
    with_lambda = MODEL._replace(log_birth=math.log(200))
    assert birth_log_ratio(OLD, TREE, points_of(), with_lambda) == pytest.approx(10.34036 + 5.29832, abs=1e-4)
    assert birth_log_ratio(EMPTY, TREE, points_of(), MODEL) == -np.inf


def test_equation_12_becomes_13_where_deaths_are_lambda_times_as_frequent_as_births():
    classes = {"ground": (0.0, 1.0), "tree": (4.0, 2.0), "nu": (6.0, 2.0)}

    def factor(text):
        return math.exp(make_detector(f"mpp-printed[{text}]")._model(classes, 0.0, 0.5).log_birth)

    # d = lambda b leaves no factor. With b = d = 1/2 it is lambda, with b = 1/5 and d = 4/5 a quarter of it.
    assert [factor(f"buildings={number}") for number in (1, 200)] == pytest.approx([1, 1])
    assert factor("buildings=200,birth_share=0.5") == pytest.approx(200)
    assert factor("buildings=200,birth_share=0.2") == pytest.approx(50)


def test_equation_16_is_the_inverse_of_the_birth_that_would_bring_the_building_back():
    births = [birth_log_ratio(OLD, other, points_of(), MODEL) for other in (GROUND, TREE)]
    assert death_log_ratio(OLD, points_of(), MODEL) == pytest.approx(-min(births))
    # Trees explain the eight points better than the ground.
    assert death_log_ratio(OLD, points_of(), MODEL) == pytest.approx(-10.34036, abs=1e-4)
    with_lambda = MODEL._replace(log_birth=1.5)
    assert death_log_ratio(OLD, points_of(), with_lambda) == pytest.approx(-min(births) - 1.5)


def test_the_posterior_gains_what_a_birth_gains_and_the_prior():
    births = [birth_log_ratio(SHORTER, other, points_of(), MODEL) for other in (GROUND, TREE)]
    assert log_posterior_gain(SHORTER, points_of(), MODEL) == pytest.approx(min(births) + log_prior(SHORTER, PRIOR))


def schedule(**changes):
    values = {
        "steps": np.array([1.0, 1.0, 0.1, 0.5, 0.1]),
        "sides": np.array([1.0, 8.0]),
        "iterations": 400,
        "false_alarm_ratio": 0.5,
        "birth_share": 0.5,
        "least_nu": -math.inf,
        "prior_limit": math.inf,
        "overlap_share": 1.0,
        "buildings": 1.0,
        "capacity": 50,
        "stride": 1,
    }
    return PrintedSchedule(**{**values, **changes})


def test_the_flow_chart_updates_moves_and_then_tries_a_birth_or_a_death():
    _, trace = run_printed(points_of(), MODEL, schedule(), stream([1]))
    tried = trace[:, PrintedTrace.TRIED : PrintedTrace.ACCEPTED]
    held = np.concatenate([[1], trace[:-1, PrintedTrace.BUILDINGS]]) > 0
    np.testing.assert_array_equal(tried[:, Operation.UPDATE], held)
    np.testing.assert_array_equal(tried[:, Operation.CENTRE], held)
    np.testing.assert_array_equal(tried[:, Operation.BIRTH] + tried[:, Operation.DEATH], 1)
    assert 150 < tried[:, Operation.BIRTH].sum() < 250
    accepted = trace[:, PrintedTrace.ACCEPTED :]
    change = accepted[:, Operation.BIRTH] - accepted[:, Operation.DEATH]
    np.testing.assert_array_equal(np.cumsum(change) + 1, trace[:, PrintedTrace.BUILDINGS])


@pytest.mark.parametrize("changes", [{}, {"false_alarm_ratio": 0.9, "birth_share": 0.7}, {"union": True}])
def test_the_simulation_is_that_of_the_equations_term_by_term_in_the_order_of_the_flow_chart(changes):
    rng = np.random.default_rng(3)
    index = np.repeat(np.arange(ROWS * COLUMNS), rng.integers(0, 4, ROWS * COLUMNS))
    row, column = np.divmod(index, COLUMNS)
    roof = (row > 1) & (row < 6) & (column > 2) & (column < 8)
    z = np.where(roof, rng.normal(6, 0.4, len(index)), rng.normal(0, 1, len(index)))
    changes = dict(changes)
    model = MODEL._replace(union=changes.pop("union", False), log_birth=0.4)
    plan = schedule(iterations=150, **changes)
    best, trace = run_printed(sorted_points(index, z, (ROWS, COLUMNS)), model, plan, stream([5]))
    expected, accepted = naive_printed.run(index, z, (ROWS, COLUMNS), model, plan, stream([5]))
    np.testing.assert_array_equal(trace[:, PrintedTrace.ACCEPTED :], accepted)
    assert (accepted.sum(axis=0) > 0).all()
    np.testing.assert_allclose(best, expected, atol=1e-9)


def test_the_best_state_has_the_highest_posterior_of_all_that_were_visited():
    for seed in range(5):
        best, trace = run_printed(points_of(), MODEL, schedule(buildings=3.0), stream([seed]))
        value = sum(log_posterior_gain(building, points_of(), MODEL) for building in best)
        value += len(best) * math.log(3.0) - math.lgamma(len(best) + 1)
        assert -value == pytest.approx(trace[:, PrintedTrace.ENERGY].min(), abs=1e-6)


def states(**changes):
    """Buildings of the best states of some runs, and those that overlap in pairs."""
    runs = [run_printed(points_of(), MODEL, schedule(**changes), stream([seed]))[0] for seed in range(8)]
    pairs = [pair for best in runs for pair in combinations(best, 2) if overlap_area(*pair) > 0]
    return np.concatenate(runs), pairs


def test_what_is_no_part_of_the_print_is_off_unless_it_is_set():
    marks = np.array([2, 3, 5, 6])
    free, pairs = states()
    assert (np.abs(free[:, marks] - PRIOR[:, 0]) > 1.5 * PRIOR[:, 1]).any()
    assert free[:, NU].min() < 5.9
    assert pairs
    assert states(least_nu=5.9)[0][:, NU].min() >= 5.9
    kept = states(prior_limit=1.5)[0]
    assert (np.abs(kept[:, marks] - PRIOR[:, 0]) <= 1.5 * PRIOR[:, 1])[8:].all()
    assert not states(overlap_share=0.0)[1]


def test_lambda_decides_how_often_births_are_tried_unless_the_share_is_set():
    few, many = (make_detector(f"mpp-printed[buildings={number}]")._birth_share for number in (1, 99))
    assert (few, many) == pytest.approx((0.5, 0.01))
    assert make_detector("mpp-printed[buildings=99,birth_share=0.5]")._birth_share == 0.5


EXTENT = (1000.0, 2000.0, 1080.0, 2060.0)
HALL = shapely.box(1020, 2015, 1040, 2030)


def scene(seed=0):
    """A hall of 8 m on sloping ground, and a tree with several returns a pulse."""
    rng = np.random.default_rng(seed)
    n = 6 * 80 * 60
    x, y = rng.uniform(1000, 1080, n), rng.uniform(2000, 2060, n)
    h, returns = rng.normal(0, 0.05, n), np.ones(n, np.uint8)
    h[shapely.contains_xy(HALL, x, y)] += 8.0
    crown = (x - 1065) ** 2 + (y - 2045) ** 2 < 36
    h[crown], returns[crown] = rng.uniform(2, 9, crown.sum()), 2
    grid = Grid.covering(EXTENT, 2.0)
    dem = Elevation(np.full(grid.shape, 50.0, np.float32), grid)
    points = PointCloud(x, y, 50.0 + h, return_number=np.ones(n, np.uint8), number_of_returns=returns)
    return Scene("hall", EXTENT, crs="EPSG:25832", points=points, dem=dem)


def run(selection="mpp-printed", seed=0):
    return make_detector(selection).detect(scene(), np.random.default_rng(seed))


def test_the_detector_repeats_its_run_and_covers_the_hall():
    found = run()
    assert shapely.to_wkb(found.polygons).tolist() == shapely.to_wkb(run().polygons).tolist()
    assert found.crs == "EPSG:25832"
    assert shapely.intersection(shapely.union_all(found.polygons), HALL).area > 0.5 * HALL.area
    assert json.loads(json.dumps(found.metadata)) == found.metadata


def test_class_gaussians_are_estimated_unless_they_are_set():
    record = run().metadata["gaussians"]
    assert record["ground"] == pytest.approx([50.0, 0.1], abs=0.02)
    assert record["nu"] == pytest.approx([58.0, 0.1], abs=0.05)
    assert record["tree"] == pytest.approx([55.5, 2.0], abs=0.5)
    above = run("mpp-printed[heights=above-ground]").metadata["gaussians"]
    assert above["nu"][0] == pytest.approx(record["nu"][0] - 50, abs=0.01)
    given = run("mpp-printed[tree_mean=56,ground_spread=0.5]").metadata["gaussians"]
    assert (given["tree"][0], given["ground"][1]) == (56.0, 0.5)
    assert given["tree"][1] == record["tree"][1]


def test_points_without_return_numbers_and_scenes_without_objects_have_gaussians():
    flat = PointCloud(*np.random.default_rng(0).uniform(0, 1, (3, 100)))
    found = class_gaussians(flat, flat.z, flat.z)
    assert set(found) == {"ground", "tree", "nu"}
    assert all(spread >= 0.1 for _, spread in found.values())


def test_nothing_is_found_where_there_are_no_points():
    empty = Scene("empty", EXTENT, points=PointCloud(*np.empty((3, 0))))
    assert len(make_detector("mpp-printed").detect(empty, np.random.default_rng(0))) == 0


def test_the_steps_show_the_convergence_and_the_rectangles_of_the_same_run():
    steps = list(make_detector("mpp-printed").steps(scene(), np.random.default_rng(0)))
    assert [step.name for step in steps] == ["convergence", "buildings"]
    shown = steps[1].panels[0].layers[0].polygons
    assert shapely.to_wkb(shown).tolist() == shapely.to_wkb(run().polygons).tolist()


# Squares of a city


def street(width=1100.0, height=160.0):
    """Return a scene of flat ground with a house every 40 m."""
    rng = np.random.default_rng(7)
    x, y = rng.uniform(0, width, 20_000), rng.uniform(0, height, 20_000)
    roof = (x % 40 > 12) & (x % 40 < 28) & (np.abs(y - 80) < 6)
    z = np.where(roof, 6.0, 0.0) + rng.normal(0.0, 0.05, len(x))
    ones = np.ones(len(x), dtype=np.uint8)
    grid = Grid.covering((0.0, 0.0, width, height), 10.0)
    dem = Elevation(np.zeros(grid.shape, dtype=np.float32), grid)
    points = PointCloud(x, y, z, return_number=ones, number_of_returns=ones)
    return Scene("street", (0.0, 0.0, width, height), crs="EPSG:25832", points=points, dem=dem)


@pytest.mark.parametrize("side", [256.0, 300.0])
def test_tiles_find_what_the_whole_finds_square_by_square(side):
    town = street()
    detector = make_detector("mpp-printed[iterations=4000,buildings=20]")
    measured = measure(town, detector, tiles_over(town.extent, side))
    assert measured.parameters["square"] == 256.0
    fixed = detector.replaced(measured.parameters)
    whole = fixed.detect(town, np.random.default_rng([0]))
    parts = {}
    for tile in tiles_over(town.extent, side):
        window = town.window(tile.core, fixed.halo)
        found = fixed.detect(window, stream_of(0, tile, fixed))
        parts[tile] = owned(found, tile, window.extent, town.extent)
    tiled, seams = join_tiles(parts, crs=town.crs)
    assert len(whole) > 8
    assert sorted(shapely.to_wkb(tiled.polygons).tolist()) == sorted(shapely.to_wkb(whole.polygons).tolist())
    assert not any(seams)


def test_without_squares_one_chain_sees_all_as_printed():
    town = street(200.0)
    alone, squares = (make_detector(f"mpp-printed[iterations=2000,buildings=5,square={side}]") for side in (0, 64))
    one, many = (detector.detect(town, np.random.default_rng(0)) for detector in (alone, squares))
    assert "trace" in one.metadata
    assert many.metadata["squares"] > 1
    assert [step.name for step in squares.steps(town, np.random.default_rng(0))] == ["buildings"]


def test_squares_smaller_than_a_house_are_refused():
    with pytest.raises(ParameterError, match="at least 32 m"):
        make_detector("mpp-printed[square=8]")


#: For each parameter a value other than its default.
OTHER = {
    "heights": "above-ground", "cell": 1.5, "ground_mean": 50.0, "ground_spread": 10.0, "tree_mean": 3.0,
    "tree_spread": 0.5, "length_mean": 25.0, "length_spread": 2.0, "width_mean": 5.0, "width_spread": 1.0,
    "nu_mean": 40.0, "nu_spread": 1.0, "tau_mean": 2.0, "tau_spread": 0.05, "buildings": 1e5, "birth_share": 0.9,
    "match": 0.3, "update": "union", "least_height": 8.0, "prior_limit": 0.3, "overlap_share": 0.0,
    "length_step": 5.0, "width_step": 5.0, "angle_step": 45.0, "nu_step": 3.0, "tau_step": 1.0, "least_side": 8.0,
    "largest_side": 10.0, "false_alarm_ratio": 0.9, "iterations": 4000, "square": 32.0,
}  # fmt: skip


def test_every_parameter_changes_the_result():
    street = make_scene("fairfield-small", seed=5)

    def found(**changes):
        detector = make_detector("mpp-printed", {"iterations": 3000, **changes})
        return detect(street, detector, seed=0).polygons.tolist()

    before = found()
    assert before
    assert set(OTHER) == set(make_detector("mpp-printed").values())
    unchanged = [name for name, value in OTHER.items() if found(**{name: value}) == before]
    assert not unchanged
