"""What cells say: how large they are, and how their scores hold each other back."""

import naive_mpp as naive
import numpy as np
import pytest

from roofbench.detectors.mpp.background import restrain
from roofbench.detectors.mpp.cells import HIGH, LOW, VOID, cell_size


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
