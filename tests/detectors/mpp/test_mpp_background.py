"""The size of cells, the classes of their textures, and their scores."""

import math

import numpy as np
import pytest
from naive import mpp as naive

from roofbench.detectors.mpp.background import Background, estimate_background, tally_textures
from roofbench.detectors.mpp.cells import HIGH, LOW, VOID, Cells, cell_size
from roofbench.detectors.mpp.rectangles import inside_any
from roofbench.detectors.mpp.scores import Weights, fitted_cells, mean_evidence, restrain
from roofbench.detectors.mpp.textures import OPENNESS_BINS, ROUGHNESS_BINS
from roofbench.detectors.mpp.threads import started_threads
from roofbench.scenes.geodata.raster import Grid

WEIGHTS = Weights(fit=0.2, texture=1.0, limit=3.0, low=5.0, void=0.1)


@pytest.mark.parametrize(
    ("density", "cell"), [(60, 0.5), (15, 0.5), (3, 0.5), (2, 0.75), (1, 0.75), (0.5, 1.0), (0.25, 1.25), (0.02, 2.0)]
)
def test_a_cell_is_half_the_point_spacing_and_a_little(density, cell):
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 300, (2, round(density * 300**2)))
    assert cell_size(x, y, (0, 0, 300, 300)) == cell


@pytest.mark.parametrize("reach", [1, 2, 4])
def test_a_score_of_a_high_cell_is_at_most_the_mean_around_it(reach):
    rng = np.random.default_rng(reach)
    score = rng.integers(-3000, 3000, (40, 50)).astype(np.int16)
    state = rng.choice([HIGH, LOW, VOID], (40, 50), p=[0.7, 0.2, 0.1])
    found = np.empty_like(score)
    for first, last in ((0, 17), (17, 40)):
        restrain(score, state, reach, first, last, found)
    np.testing.assert_array_equal(found, naive.restrained(score, state == HIGH, reach))
    assert (found < score).any()


def test_without_openness_textures_are_rated_by_roughness_alone():
    counts = np.zeros((ROUGHNESS_BINS, OPENNESS_BINS), dtype=np.int64)
    counts[4:8, 0], counts[14:18, :] = 900, 100
    tally = np.stack([counts.ravel(), 600 * counts.ravel(), 360_000 * counts.ravel()], axis=1)
    both, alone = (np.array(estimate_background(tally, 0.5, openness=known).evidence) for known in (True, False))
    assert np.ptp(both, axis=1).max() > 1
    np.testing.assert_allclose(np.ptp(alone, axis=1), 0, atol=1e-12)
    assert alone[5, 0] > 0 > alone[16, 0]


def test_the_openness_of_crowns_is_that_of_the_rough_windows():
    counts = np.zeros((ROUGHNESS_BINS, OPENNESS_BINS), dtype=np.int64)
    counts[4:8, 0], counts[15:18, 2], counts[15:18, 6] = 100_000, 100_000, 300_000
    tally = np.stack([counts.ravel(), 600 * counts.ravel(), 360_000 * counts.ravel()], axis=1)
    # The middles of the two bins are 2.5 and 6.5 eighths; pseudo-counts are a tenth of the cells.
    assert estimate_background(tally, 0.5).crown_openness == pytest.approx((2.5 + 3 * 6.5) / 32, abs=0.05)
    assert math.isnan(estimate_background(tally, 0.5, openness=False).crown_openness)


@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_classes_and_fitted_cells_are_those_of_the_evidence_for_any_number_of_threads(count):
    rng = np.random.default_rng(0)
    grid = Grid(0.0, 30.0, 0.5, 60, 70)
    state = np.kron(rng.choice([HIGH, LOW], (12, 14), p=[0.8, 0.2]), np.ones((5, 5), np.uint8))
    height = np.kron(rng.integers(300, 1500, (12, 14)), np.ones((5, 5))) + rng.integers(0, 8, state.shape)
    rough = np.kron(rng.random((12, 14)) < 0.4, np.ones((5, 5), bool))
    height[rough] += rng.integers(0, 300, np.count_nonzero(rough))
    openness = np.where(rough, rng.integers(0, 256, state.shape), 3).astype(np.uint8)
    cells = Cells(grid, np.where(state == HIGH, height, 0).astype(np.int32), state, openness)
    tally, bins = tally_textures(cells)
    alone = estimate_background(tally, grid.gsd)
    with started_threads(count) as threads:
        counted, same = tally_textures(cells, threads=threads)
        background = estimate_background(counted, grid.gsd)
        fitted = fitted_cells(cells, bins, background, WEIGHTS, threads=threads)
    assert background == alone
    np.testing.assert_array_equal(same, bins)
    evidence = np.array(background.evidence).ravel()
    assert {np.sign(evidence[b]) for b in bins[bins >= 0]} == {-1.0, 1.0}
    for place in np.ndindex(state.shape):
        assert fitted[place] == (state[place] == HIGH and bins[place] >= 0 and evidence[bins[place]] >= 0)


def test_the_mean_evidence_is_that_of_the_high_cells_inside_without_the_height_in_crowns():
    rng = np.random.default_rng(1)
    state = rng.choice([HIGH, LOW, VOID], (30, 40), p=[0.8, 0.1, 0.1])
    score = rng.integers(-3000, 3000, state.shape).astype(np.int16)
    height = rng.integers(250, 2500, state.shape).astype(np.uint16)
    crowns = Background(8.0, 3.0, 0.3, 0.05, 0.4, 0.8, (), 0)
    rectangles = np.array([[20.0, 15.0, 12.0, 7.0, 0.6], [2.0, 2.0, 9.0, 5.0, 2.0], [200.0, 15.0, 5.0, 5.0, 0.0]])
    found = mean_evidence(rectangles, height, state, score, crowns, WEIGHTS)
    density = np.log(np.exp(-0.5 * ((height / 100 - 8) / 3) ** 2) / (3 * np.sqrt(2 * np.pi)))
    evidence = score / 1000 + np.where(score > 0, 0.2 * np.maximum(density, -5), 0)
    for rectangle, mean in zip(rectangles, found, strict=True):
        inside = inside_any(rectangle[None], state.shape) & (state == HIGH)
        assert mean == pytest.approx(evidence[inside].mean() if inside.any() else 0.0)
