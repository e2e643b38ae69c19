"""Intervals of one comparison cover what they promise, and say where there is none."""

import numpy as np
import pytest
import shapely

import roofbench as rb
from roofbench.core.errors import ParameterError
from roofbench.core.resampling import resampling_weights
from roofbench.evaluators.uncertainty.blocks import spatial_blocks
from roofbench.evaluators.uncertainty.intervals import block_intervals, block_tallies, resampled_values


def houses(count):
    return rb.Footprints.of(
        [shapely.box(30 * (k % 20), 30 * (k // 20), 30 * (k % 20) + 10, 30 * (k // 20) + 10) for k in range(count)]
    )


def simulated(rng, reference, share):
    """Return detections of a share of the houses, found or missed together in runs of five neighbours."""
    found = np.repeat(rng.random(-(-len(reference) // 5)) < share, 5)[: len(reference)]
    kept = reference.polygons[found]
    shift = rng.normal(0, 0.8, (len(kept), 2))
    moved = [
        shapely.transform(polygon, lambda xy, step=step: xy + step) for polygon, step in zip(kept, shift, strict=True)
    ]
    return rb.Footprints.of(moved)


def covered(reference, draw, seeds):
    """Return how often the interval of the share of references found covers 0.7, and the mean width."""
    ends = [
        block_intervals(draw(np.random.default_rng(seed)), reference, evaluator="mobj0", resamples=200).ends[
            "mobj0.paired"
        ]
        for seed in range(seeds)
    ]
    return sum(low <= 0.7 <= high for low, high in ends), np.mean([high - low for low, high in ends])


def test_intervals_cover_the_truth_of_independent_objects():
    reference = houses(100)
    hits, width = covered(reference, lambda rng: reference.take(rng.random(100) < 0.7), 50)
    assert hits >= 43
    # 2 x 1.96 standard errors of a share of 0.7 among 100.
    assert width == pytest.approx(2 * 1.96 * np.sqrt(0.7 * 0.3 / 100), rel=0.25)


def test_intervals_are_wider_where_neighbours_are_alike():
    reference = houses(400)
    hits, width = covered(reference, lambda rng: simulated(rng, reference, 0.7), 30)
    assert hits >= 23
    assert width > 1.5 * 2 * 1.96 * np.sqrt(0.7 * 0.3 / 400), "an interval of independent objects"


def test_resampling_adds_tallies_as_evaluating_copies_does():
    """The oracle: a resample is a scene in which the drawn blocks lie beside each other, as often as drawn."""
    rng = np.random.default_rng(4)
    reference = houses(12)
    detected = simulated(rng, reference, 0.6)
    evaluation = rb.evaluate(detected, reference)
    blocks = spatial_blocks([detected, reference])
    every = block_tallies(evaluation.evaluator, (detected, reference), (0, 1), blocks)
    values = resampled_values(evaluation, every, 5)
    for place, weights in enumerate(resampling_weights(blocks.count, 5)):
        copies = [[], []]
        for block, times in enumerate(weights):
            for copy in range(times):
                far = [2000.0 * (copy + 1), 0.0]
                for side, own in enumerate((detected, reference)):
                    chosen = own.polygons[blocks.labels[side] == block]
                    copies[side] += [shapely.transform(polygon, lambda xy, far=far: xy + far) for polygon in chosen]
        again = rb.evaluate(*map(rb.Footprints.of, copies))
        for key, value in again.values.items():
            assert values[key][place] == pytest.approx(
                np.nan if value is None else value, rel=1e-6, abs=1e-6, nan_ok=True
            ), key


def test_the_same_input_gives_the_same_interval():
    detected = simulated(np.random.default_rng(1), houses(40), 0.6)
    one, two = (block_intervals(detected, houses(40)) for _ in range(2))
    assert one.ends == two.ends


def test_a_wider_level_gives_a_wider_interval():
    detected = simulated(np.random.default_rng(1), houses(100), 0.6)
    narrow, wide = (block_intervals(detected, houses(100), level=level).ends["pixel.quality"] for level in (80, 99))
    assert wide[0] < narrow[0] < narrow[1] < wide[1]


def test_one_group_and_means_over_scenes_have_no_interval():
    one = block_intervals(houses(1), houses(1))
    assert set(one.ends.values()) == {None}
    many = block_intervals(houses(9).take(np.arange(6)), houses(9), evaluator="boundary")
    assert many.ends["complexity.n_ratio"] is not None
    assert block_intervals(houses(9), rb.Footprints.empty()).ends["object.completeness"] is None


@pytest.mark.parametrize("level", [0, 100, 150, float("nan")])
def test_a_level_that_is_no_percentage_is_refused(level):
    with pytest.raises(ParameterError, match="not a level in percent"):
        block_intervals(houses(3), houses(3), level=level)
