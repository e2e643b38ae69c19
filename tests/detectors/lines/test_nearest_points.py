import numpy as np
import pytest
from naive import lines as naive_lines

from roofbench.detectors.lines import nearest_points
from roofbench.detectors.lines.nearest_points import nearest_kind


def points(shape, share, seed):
    return (np.random.default_rng(seed).random(shape) < share).astype(np.uint8)


@pytest.mark.parametrize(
    ("shape", "share", "reach"),
    [((40, 50), 0.05, 3.2), ((1, 30), 0.1, 4.0), ((30, 1), 0.1, 2.5), ((3, 9000), 0.01, 9.0)],
)
def test_the_nearest_kind_equals_the_one_by_distances_that_are_shortened_step_by_step(shape, share, reach):
    low, high = points(shape, share, 1), points(shape, share, 2)
    high[:, : shape[1] // 2] = 0
    found, expected = (kind(low, high, reach, 4 * reach) for kind in (nearest_kind, naive_lines.nearest_kind))
    for one, other in zip(found, expected, strict=True):
        assert np.array_equal(one, other)


def test_bands_change_nothing(monkeypatch):
    low, high = points((90, 30), 0.02, 3), points((90, 30), 0.02, 4)
    whole = nearest_kind(low, high, 4.0, 16.0)
    monkeypatch.setattr(nearest_points, "_BAND", 7)
    assert np.array_equal(nearest_kind(low, high, 4.0, 16.0), whole)


def test_without_high_points_all_is_low_and_without_low_ones_what_is_near_is_high():
    none, one = np.zeros((9, 9), np.uint8), np.zeros((9, 9), np.uint8)
    one[4, 4] = 1
    assert nearest_kind(one, none, 2.0, 8.0)[0].all()
    is_low, is_high = nearest_kind(none, one, 2.0, 8.0)
    assert not is_low.any()
    assert is_high.sum() == 13  # steps of 1, 1.4 and 2 pixels
    assert nearest_kind(none, one, 1e6, 4e6)[1].all()
