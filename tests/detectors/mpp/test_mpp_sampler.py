"""The chain samples what it claims to sample."""

import math
from itertools import product

import numpy as np
import pytest
from scipy import stats

from roofbench.detectors.mpp.births import birth_density, make_births, propose_birth
from roofbench.detectors.mpp.energy import Model, configuration_energy, rectangle_energies
from roofbench.detectors.mpp.local_search import local_search
from roofbench.detectors.mpp.moves import Move, birth_log_ratio
from roofbench.detectors.mpp.random_stream import gaussian, stream, uniform
from roofbench.detectors.mpp.sampler import ChainSchedule, Trace, run_chain
from roofbench.detectors.mpp.tables import NO_TABLES, make_tables
from roofbench.detectors.mpp.windows import Window, window_energy

NONE, NO_ENERGIES = np.empty((0, 5)), np.empty(0)
WINDOW = (0.0, 0.0, 40.0, 40.0)
SIDES = (2.0, 12.0)
BOXES = np.array([[10.0, 12.0, 6.0, 4.0, 0.2], [11.0, 12.5, 6.5, 4.2, 0.22], [30.0, 25.0, 8.0, 8.0, 3.13]])


def model(**changes):
    values = {
        "weight": 0.25,
        "price": 5.0,
        "overlap": 5.0,
        "roof_price": 3.0,
        "least_tau": 0.15,
        "ground_error": 0.0,
        "least_height": 2.5,
        "cell": 0.5,
        "void_price": 0.3,
        "least_side": SIDES[0],
        "largest_side": SIDES[1],
        "fit_weight": 0.3,
    }
    return Model(**{**values, **changes})


def houses():
    """Three flat roofs on flat ground, and their tables."""
    height = np.zeros((40, 40), np.int32)
    for top, left, bottom, right, level in ((5, 5, 17, 13, 600), (5, 13, 17, 22, 750), (24, 22, 36, 32, 400)):
        height[top:bottom, left:right] = level
    high = height > 0
    rng = np.random.default_rng(0)
    height[high] += rng.integers(-15, 16, high.sum())
    return make_tables(height, high, np.where(high, 3000, -3000).astype(np.int16))


def window(tables=NO_TABLES, energy=None, fixed=NONE, edges=WINDOW):
    return Window(tables, energy or model(), np.array(edges), fixed)


def births_of(boxes=NONE, share=0.0):
    return make_births(window(), boxes, np.ones(len(boxes)), share)


def chain(tables, births, proposals, seed=0, start=NONE, energy=None, **changes):
    values = {
        "proposals": proposals,
        "hot": 1.0,
        "cold": 1.0,
        "intensity": 3 / 1600,
        "jump_share": 0.4,
        "stride": 50,
    }
    return run_chain(window(tables, energy), births, start, ChainSchedule(**{**values, **changes}), 200, stream([seed]))


def test_random_numbers_are_uniform_normal_and_reproducible():
    state = stream([1, 2, 3])
    draws = np.array([uniform(state) for _ in range(20000)])
    assert stats.kstest(draws, "uniform").pvalue > 0.01
    assert stats.kstest([gaussian(state) for _ in range(20000)], "norm").pvalue > 0.01
    assert uniform(stream([1, 2, 3])) == draws[0] != uniform(stream([1, 2, 4]))


def test_detailed_balance_of_births_and_deaths_over_all_subsets_of_four_rectangles():
    """16 states: the target and the kernel written out; the ratios are those that the sampler uses."""
    rng = np.random.default_rng(0)
    tables = houses()
    rectangles = np.array([[9.0, 11, 8, 12, 0], [17.5, 11, 9, 12, 0], [14.0, 12, 10, 8, 0.3], [27.0, 30, 10, 12, 0]])
    birth = rng.dirichlet(np.ones(4))
    density, temperature, log_birth, log_death = 0.7, 40.0, math.log(0.25), math.log(0.15)
    states = list(product((0, 1), repeat=4))

    def energy(state):
        held = rectangles[np.array(state, bool)]
        return configuration_energy(tables, held, len(held), NONE, model())

    def target(state):
        return density ** sum(state) * math.exp(-energy(state) / temperature)

    def accept(ratio):
        return min(1.0, math.exp(ratio))

    total = sum(target(state) for state in states)
    checked = 0
    for state in states:
        for i in range(4):
            if state[i]:
                continue
            grown = tuple(1 if k == i else state[k] for k in range(4))
            count = sum(state)
            delta = energy(grown) - energy(state)
            ratio = birth_log_ratio(delta, temperature, density, count, birth[i], log_birth, log_death)
            forth = target(state) / total * math.exp(log_birth) * birth[i] * accept(ratio)
            back = target(grown) / total * math.exp(log_death) / (count + 1) * accept(-ratio)
            assert forth == pytest.approx(back, rel=1e-12)
            checked += 1
    assert checked == 32


def test_births_are_drawn_with_the_density_that_deaths_use():
    """Importance sampling: the mean of 1/q over draws is the volume of all allowed rectangles."""
    births = make_births(window(), BOXES, np.array([1.0, 2.0, 3.0]), 0.5)
    state = stream([7])
    rectangle = np.empty(5)
    weights = []
    for _ in range(40000):
        propose_birth(births, state, rectangle)
        allowed = all(low <= x <= high for x, (low, high) in zip(rectangle, [(0, 40)] * 2 + [SIDES] * 2, strict=False))
        weights.append(1 / birth_density(births, rectangle) if allowed else 0.0)
    volume = 40.0**2 * 10.0**2 * math.pi
    assert np.mean(weights) == pytest.approx(volume, rel=4 * np.std(weights) / volume / math.sqrt(len(weights)))
    # Draws of the kernels alone fall where their density is.
    near = np.abs(BOXES[0] + np.array([0.5, 0.5, 0, 0, 0.01]))
    assert birth_density(births, near) > 100 * birth_density(births, np.array([35.0, 5, 5, 5, 1.0]))


@pytest.mark.parametrize("births", [births_of(), births_of(BOXES, 0.5)])
def test_without_data_the_prior_comes_back(births):
    """Flat likelihood: Poisson number of buildings, uniform marks; with all moves, with and without boxes."""
    tables = houses()
    flat = model(weight=0.0, price=0.0, overlap=0.0)
    counts, marks = [], []
    state = NONE
    for block in range(1500):
        _, state, _, _ = chain(tables, births, 200, block, state, flat, stride=200)
        counts.append(len(state))
        marks.append(state)
    counts = np.array(counts[20:])
    independent = len(counts) / 4
    assert counts.mean() == pytest.approx(3.0, abs=4 * math.sqrt(3 / independent))
    assert counts.var() == pytest.approx(3.0, abs=4 * 3 * math.sqrt(2.4 / independent))
    marks = np.concatenate(marks[20::4])
    for column, (low, high) in enumerate(((0, 40), (0, 40), SIDES, SIDES, (0, math.pi))):
        assert stats.kstest((marks[:, column] - low) / (high - low), "uniform").pvalue > 1e-3


def test_the_energy_that_the_chain_adds_up_is_that_of_its_state():
    tables = houses()
    births = births_of(BOXES, 0.6)
    for seed in range(5):
        best, last, trace, best_energy = chain(tables, births, 5000, seed, hot=20.0, cold=0.5, stride=5000)
        fresh = [window_energy(window(tables), state) for state in (best, last)]
        assert best_energy == pytest.approx(fresh[0], abs=1e-6)
        assert trace[-1, Trace.ENERGY] == pytest.approx(fresh[1], abs=1e-6)
        assert trace[-1, Trace.BUILDINGS] == len(last)
        assert trace[:, Trace.TRIED : Trace.ACCEPTED].sum() == 5000
        assert (trace[:, Trace.ACCEPTED :] <= trace[:, Trace.TRIED : Trace.ACCEPTED]).all()
        assert len(Move) == Trace.ACCEPTED - Trace.TRIED == Trace.COLUMNS - Trace.ACCEPTED


def test_annealing_finds_three_roofs_with_the_party_wall_between_two():
    tables = houses()
    best, _, _, _ = chain(tables, births_of(), 120000, 3, hot=20.0, cold=0.1)
    rectangles, gained = local_search(window(tables), best, NONE, NO_ENERGIES, 50, 10)
    assert gained >= 0
    assert len(rectangles) == 3
    order = np.argsort(rectangles[:, 0])
    np.testing.assert_allclose(rectangles[order, 0], [9, 17.5, 27], atol=0.8)
    np.testing.assert_allclose(rectangles[order, 1], [11, 11, 30], atol=0.8)


def test_local_search_never_raises_the_energy_and_returns_by_how_much_it_fell():
    tables = houses()
    rng = np.random.default_rng(4)
    for _ in range(10):
        n = int(rng.integers(0, 8))
        start = np.column_stack(
            [rng.uniform(5, 35, n), rng.uniform(5, 35, n), rng.uniform(2, 12, (n, 2)), rng.uniform(0, math.pi, n)]
        )
        fixed = np.array([[17.0, 11.0, 6.0, 6.0, 0.3]])
        energies = rectangle_energies(tables, BOXES, model())
        end, gained = local_search(window(tables, fixed=fixed), start, BOXES, energies, 50, 6)
        before, after = (window_energy(window(tables, fixed=fixed), state) for state in (start, end))
        assert after <= before + 1e-9
        assert before - after == pytest.approx(gained, abs=1e-6)


def hall():
    """A roof of 30 m x 24 m with a row of sheds, cells of a metre, and their tables."""
    height = np.zeros((60, 60), np.int32)
    height[10:34, 10:40] = 900
    height[36:42, 10:40] = 400
    return make_tables(height, height > 0, np.where(height > 0, 3000, -5000).astype(np.int16))


def test_a_hall_absorbs_its_pieces_and_the_gain_is_the_fall_of_the_energy():
    tables, large = hall(), model(cell=1.0, weight=1.0, overlap=20.0, price=20.0, largest_side=60.0)
    rng = np.random.default_rng(5)
    fixed = np.array([[42.0, 20.0, 6.0, 10.0, 0.1]])
    joined = 0
    for _ in range(10):
        n = 12
        start = np.column_stack(
            [rng.uniform(10, 40, n), rng.uniform(10, 42, n), rng.uniform(3, 25, (n, 2)), rng.uniform(-0.1, 0.1, n)]
        )
        place = window(tables, large, fixed, (0.0, 0.0, 60.0, 60.0))
        end, gained = local_search(place, start, NONE, NO_ENERGIES, 50, 6)
        before, after = (window_energy(place, state) for state in (start, end))
        assert before - after == pytest.approx(gained, abs=1e-6)
        joined += (end[:, 2] * end[:, 3] > 600).any()
    assert joined > 0
