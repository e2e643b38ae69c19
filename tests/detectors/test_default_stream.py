"""A detector called without a generator draws from the stream of seed 0, as `roofbench.detect` does."""

from dataclasses import dataclass

import numpy as np
import shapely

import roofbench as rb
from roofbench.detectors.streams import random_stream
from roofbench.scenes.builtin import hamlet


@dataclass(frozen=True, kw_only=True)
class Dice(rb.Detector):
    """One square at a place that is drawn."""

    name = "dice"
    stochastic = True
    side: float = rb.parameter(8.0, unit="m", minimum=1, doc="side of the square")

    def detect(self, scene, rng):
        x, y = scene.extent[:2] + rng.uniform(0, 40, 2)
        return rb.Footprints.of([shapely.box(x, y, x + self.side, y + self.side)], crs=scene.crs)

    def steps(self, scene, rng):
        yield rng.uniform()


def bounds(footprints):
    return footprints.bounds.tolist()


def test_the_stream_is_that_of_seed_0():
    scene, detector = hamlet(1), Dice()
    found = bounds(detector.detect(scene))
    assert found == bounds(detector.detect(scene)) == bounds(rb.detect(scene, detector))
    assert found == bounds(detector.detect(scene, random_stream(0, scene.name, "dice")))
    assert found != bounds(rb.detect(scene, detector, seed=1))
    assert list(detector.steps(scene)) == list(detector.steps(scene, random_stream(0, scene.name, "dice")))


def test_a_given_generator_is_used():
    scene = hamlet(1)
    one = Dice().detect(scene, np.random.default_rng(5))
    assert bounds(one) == bounds(Dice().detect(scene, rng=np.random.default_rng(5)))
    assert bounds(one) != bounds(Dice().detect(scene))


def test_make_detector_takes_parameters_by_name():
    assert rb.make_detector("ndsm", height=3) == rb.make_detector("ndsm[height=3]")
    assert rb.make_detector("ndsm[height=3]", height="2").height == 2.0
    changed = rb.make_detector(Dice(side=3), side=4)
    assert changed == Dice(side=4)
    assert rb.make_evaluator("threshold-free", matching="overlap").matching == "overlap"
    assert rb.make_evaluator(rb.make_evaluator(), matching="overlap").matching == "overlap"
