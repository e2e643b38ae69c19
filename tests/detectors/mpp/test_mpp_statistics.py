"""Rectangle statistics by prefix sums are those of the cells, one by one."""

import math

import numpy as np
import pytest
import shapely
from harness.effort import examples
from hypothesis import given
from hypothesis import strategies as st
from naive import mpp as naive

from roofbench.detectors.mpp.energy import Model, configuration_energy, energy_below, least_energy, rectangle_energy
from roofbench.detectors.mpp.rectangle_sums import scan, scan_halves
from roofbench.detectors.mpp.rectangles import corners, overlap_area
from roofbench.detectors.mpp.roofs import KINDS, Roof, RoofRules, fit_roof
from roofbench.detectors.mpp.tables import LONGEST, MILLI, TALLEST, make_tables, part_sums

ROWS, COLUMNS = 40, 50
NONE = np.empty((0, 5))
RULES = RoofRules(price=3.0, least_tau=0.15, least_height=2.5, cell=0.5)


def field(seed=0):
    """Heights, high cells and scores of a random scene."""
    rng = np.random.default_rng(seed)
    height = rng.integers(0, 3000, (ROWS, COLUMNS)).astype(np.int32)
    high = rng.random((ROWS, COLUMNS)) < 0.7
    score = np.round(rng.normal(0, 2000, (ROWS, COLUMNS))).astype(np.int16)
    return height, high, score


def random_rectangles(rng, n):
    return np.column_stack(
        [
            rng.uniform(5, COLUMNS - 5, n),
            rng.uniform(5, ROWS - 5, n),
            rng.uniform(2, 25, n),
            rng.uniform(2, 25, n),
            rng.uniform(0, np.pi, n),
        ]
    )


def model(**changes):
    values = {
        "weight": 0.25,
        "price": 20.0,
        "overlap": 5.0,
        "roof_price": 3.0,
        "least_tau": 0.15,
        "ground_error": 0.0,
        "least_height": 2.5,
        "cell": 0.5,
        "void_price": 0.3,
        "least_side": 2.0,
        "largest_side": 60.0,
        "fit_weight": 0.3,
    }
    return Model(**{**values, **changes})


def test_moments_are_sums_over_cells():
    height, high, score = field()
    tables = make_tables(height, high, score)
    for rectangle in random_rectangles(np.random.default_rng(1), 200):
        total, outside, *moments = scan(tables, rectangle)
        inside = naive.cells_inside(rectangle, ROWS, COLUMNS)
        assert total == pytest.approx(score[inside].sum() / MILLI)
        bigger = naive.cells_inside(rectangle + np.array([50, 50, 0, 0, 0]), ROWS + 100, COLUMNS + 100)
        assert outside == bigger.sum() - inside.sum()
        u, v = naive.frame(rectangle, ROWS, COLUMNS)
        held = inside & high
        a, b, h = u[held], v[held], 0.01 * height[held]
        sums = [held.sum(), a, b, a * a, a * b, b * b, h, a * h, b * h, h * h]
        np.testing.assert_allclose(moments, [np.sum(values) for values in sums], rtol=1e-9, atol=1e-7)
        right, upper = a > 0, b > 0
        np.testing.assert_allclose(
            scan_halves(tables, rectangle),
            [a[right].sum(), (a * h)[right].sum(), b[upper].sum(), (b * h)[upper].sum()],
            rtol=1e-9,
            atol=1e-7,
        )


def test_sums_are_exact_far_from_the_left_border_where_running_sums_pass_32_bits():
    wide = 12000
    rng = np.random.default_rng(2)
    height = rng.integers(0, TALLEST + 1, (3, wide)).astype(np.int32)
    high = rng.random(height.shape) < 0.7
    tables = make_tables(height, high, np.full(height.shape, -3000, np.int16))
    for first, last in ((0, LONGEST), (5000, 5000 + LONGEST), (wide - LONGEST, wide)):
        x0 = (first + last) // 2
        x, held = np.arange(first, last) - x0, high[1, first:last]
        h = height[1, first:last].astype(np.int64)
        expected = [np.sum(values[held]) for values in (held, x, x * x, h, x * h, h * h)]
        assert list(part_sums(tables, 1, first, last, np.int64(x0))) == expected


def test_an_energy_that_is_not_below_the_limit_is_given_up_and_one_below_is_exact():
    tables = make_tables(*field(8))
    rng = np.random.default_rng(9)
    given_up = 0
    for rectangle in random_rectangles(rng, 300):
        exact = rectangle_energy(tables, rectangle, model())
        assert least_energy(tables, rectangle, model()) <= exact
        limit = exact + rng.normal(0, 50)
        found = energy_below(tables, rectangle, model(), limit)
        assert found == exact if exact < limit else found >= limit - 1e-9 * abs(limit)
        given_up += found == math.inf
    assert 0 < given_up < 300


@pytest.mark.parametrize("kind", list(Roof))
def test_the_true_roof_is_found_with_its_spread(kind):
    rng = np.random.default_rng(kind)
    rectangle = np.array([25.3, 20.2, 26.0, 14.0, 0.4])
    u, v = naive.frame(rectangle, ROWS, COLUMNS)
    surface = {
        Roof.FLAT: 0 * u,
        Roof.PLANE: 0.1 * u - 0.15 * v,
        Roof.GABLE_U: -0.3 * np.abs(v),
        Roof.GABLE_V: -0.3 * np.abs(u),
        Roof.HIP: -0.4 * np.maximum(np.abs(v), np.abs(u) - 6),
    }[kind]
    height = np.round(100 * (9 + surface + rng.normal(0, 0.2, u.shape))).astype(np.int32)
    tables = make_tables(height, np.ones(u.shape, bool), np.zeros(u.shape, np.int16))
    fit = fit_roof(tables, rectangle, RULES, 0.0)
    inside = naive.cells_inside(rectangle, ROWS, COLUMNS)
    residuals = naive.roof_residuals(0.01 * height[inside], u[inside], v[inside], 26.0, 14.0)
    assert KINDS[fit.kind] == KINDS[kind]
    assert fit.cells == inside.sum()
    assert fit.tau == pytest.approx(math.sqrt(residuals[kind] / inside.sum()), rel=1e-6)
    price = 3.0 * {Roof.FLAT: 0, Roof.PLANE: 2}.get(kind, 1)
    assert fit.likelihood == pytest.approx(naive.log_normal_sum(residuals[kind], inside.sum(), 0.15) - price, rel=1e-9)


def test_a_flat_roof_below_the_least_height_is_measured_from_it():
    tables = make_tables(
        np.full((ROWS, COLUMNS), 220, np.int32), np.ones((ROWS, COLUMNS), bool), np.zeros((ROWS, COLUMNS), np.int16)
    )
    fit = fit_roof(tables, np.array([20.0, 20.0, 10.0, 10.0, 0.0]), RULES, 0.0)
    assert fit.tau == pytest.approx(0.3)
    assert fit.likelihood == pytest.approx(naive.log_normal_sum(100 * 0.3**2, 100, 0.15))


def test_common_area_is_that_of_the_polygons():
    rng = np.random.default_rng(3)
    rectangles = random_rectangles(rng, 120)
    polygons = shapely.polygons(corners(rectangles))
    for i in range(0, 120, 2):
        exact = shapely.area(shapely.intersection(polygons[i], polygons[i + 1]))
        assert overlap_area(rectangles[i], rectangles[i + 1]) == pytest.approx(exact, abs=1e-9)


def test_a_nested_rectangle_shares_its_whole_area_and_touching_ones_nothing():
    outer, inner = np.array([10.0, 10, 8, 6, 0.3]), np.array([10.5, 9.8, 2, 1, 1.2])
    assert overlap_area(outer, inner) == pytest.approx(2.0)
    assert overlap_area(outer, outer) == pytest.approx(48.0)
    assert overlap_area(np.array([0.0, 0, 4, 4, 0]), np.array([4.0, 0, 4, 4, 0])) == pytest.approx(0, abs=1e-12)


@examples(25)
@given(seed=st.integers(0, 2**32 - 1), down=st.integers(0, 7), right=st.integers(0, 9))
def test_energy_does_not_change_with_shift_by_cells_quarter_turn_or_mirror(seed, down, right):
    rng = np.random.default_rng(seed)
    height, high, score = field(seed)
    rectangles = random_rectangles(rng, 4)

    def energy(height, high, score, rectangles):
        tables = make_tables(height, high, score)
        return configuration_energy(tables, rectangles, len(rectangles), NONE, model(void_price=0))

    expected = energy(height, high, score, rectangles)
    pad = ((down, 3), (right, 2))
    shifted = [np.pad(array, pad) for array in (height, high, score)]
    assert energy(*shifted, rectangles + np.array([right, down, 0, 0, 0])) == pytest.approx(expected, rel=1e-12)

    def turned(array):
        return np.ascontiguousarray(np.rot90(array, -1))

    quarter = rectangles.copy()
    quarter[:, 0], quarter[:, 1] = ROWS - rectangles[:, 1], rectangles[:, 0]
    quarter[:, 4] = (rectangles[:, 4] + np.pi / 2) % np.pi
    assert energy(turned(height), turned(high), turned(score), quarter) == pytest.approx(expected, rel=1e-9)

    mirror = rectangles.copy()
    mirror[:, 0], mirror[:, 4] = COLUMNS - rectangles[:, 0], (np.pi - rectangles[:, 4]) % np.pi
    flipped = [np.ascontiguousarray(array[:, ::-1]) for array in (height, high, score)]
    assert energy(*flipped, mirror) == pytest.approx(expected, rel=1e-9)


def test_both_descriptions_of_one_shape_have_one_energy():
    tables = make_tables(*field(5))
    for rectangle in random_rectangles(np.random.default_rng(6), 20):
        other = rectangle[[0, 1, 3, 2, 4]]
        other[4] = (other[4] + np.pi / 2) % np.pi
        first = rectangle_energy(tables, rectangle, model())
        assert rectangle_energy(tables, other, model()) == pytest.approx(first, rel=1e-9)
