"""Tallies add up, survive JSON, and are resampled like sums; histograms have the median of their values."""

import json
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from roofbench.core.errors import InputError
from roofbench.evaluators.tally import Histogram, Tallies, histogram

values = st.lists(st.floats(0, 1), max_size=40)


@dataclass(frozen=True, kw_only=True)
class Inner(Tallies):
    count: int = 0
    area: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Outer(Tallies):
    inner: Inner = field(default_factory=Inner)
    iou: Histogram = field(default_factory=histogram(low=0.0, high=1.0, bins=50))


def outer(count, area, iou):
    return Outer(inner=Inner(count=count, area=area), iou=Outer().iou.filled(iou))


@given(values, values)
def test_histograms_add_up_to_the_histogram_of_all_values(one, two):
    both = Outer().iou.filled(one) + Outer().iou.filled(two)
    together = Outer().iou.filled(one + two)
    assert np.array_equal(both.counts, together.counts)
    np.testing.assert_allclose(both.sums, together.sums, rtol=1e-12)


@given(values)
def test_the_median_is_off_by_less_than_a_bin(some):
    found = Histogram.of(some, low=0, high=1, bins=50).median
    assert (found is None) == (not some)
    if some:
        assert abs(found - np.median(some)) <= 1 / 50


@pytest.mark.parametrize("some", [[0.37], [1.0, 1.0, 1.0], [0.0], [0.2, 0.9], [0.1, 0.5, 0.7, 0.95]])
def test_the_median_is_exact_where_the_middle_values_have_bins_of_their_own(some):
    assert Histogram.of(some, low=0, high=1, bins=50).median == np.median(some)


def test_values_beyond_the_bins_count_in_the_outer_ones_and_nan_nowhere():
    found = Histogram.of([-3.0, 7.0, np.nan], low=0, high=1, bins=4)
    assert found.counts.tolist() == [1, 0, 0, 1]
    assert (found.total, found.mean, found.edges.tolist()) == (2, 2.0, [0, 0.25, 0.5, 0.75, 1])


@given(st.integers(0, 10**12), st.floats(0, 1e12), values)
def test_tallies_come_back_from_json_as_they_were(count, area, iou):
    tallies = outer(count, area, iou)
    stored = json.loads(json.dumps(tallies.to_dict(), allow_nan=False))
    again = Outer.from_dict(stored)
    assert again == tallies
    assert isinstance(again.inner.count, int)


def test_tallies_of_version_0_1_are_read_with_their_samples():
    again = Outer.from_dict({"inner.count": 3.0, "inner.area": 2, "iou": [0.25, 0.75, 0.75]})
    assert again == outer(3, 2.0, [0.25, 0.75, 0.75])
    assert isinstance(again.inner.count, int)


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"inner.count": None}, "cannot be read"),
        ({"inner.count": 1.5}, "not a count"),
        ({"inner.area": "much"}, "cannot be read"),
        ({"iou": {"bins": 7, "bin": [], "count": [], "sum": []}}, "7 bins instead of 50"),
        ({"iou": {"bins": 50, "bin": [99], "count": [1], "sum": [1]}}, "cannot be read"),
        ({"iou": 5}, "cannot be read"),
        ({"more": 1}, "unknown entry 'more'"),
    ],
)
def test_stored_tallies_of_another_layout_are_refused_with_a_remedy(change, what):
    with pytest.raises(InputError, match=what) as refused:
        Outer.from_dict({**outer(1, 1.0, []).to_dict(), **change})
    assert "roofbench score" in str(refused.value)


def test_a_missing_tally_is_named():
    with pytest.raises(InputError, match=r"it has no 'inner\.area'"):
        Outer.from_dict({"inner.count": 1, "iou": []})


def test_resampled_tallies_are_the_weighted_sums():
    rng = np.random.default_rng(0)
    every = [outer(int(rng.integers(9)), rng.random(), rng.random(5)) for _ in range(4)]
    weights = rng.integers(0, 4, (6, 4))
    for row, found in zip(weights, Outer.resampled(every, weights), strict=True):
        expected = Outer()
        for tallies, times in zip(every, row, strict=True):
            for _ in range(times):
                expected = expected + tallies
        assert found.inner.count == expected.inner.count
        assert found.inner.area == pytest.approx(expected.inner.area)
        assert np.array_equal(found.iou.counts, expected.iou.counts)
        assert isinstance(found.inner.count, int)
