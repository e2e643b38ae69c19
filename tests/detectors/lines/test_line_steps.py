"""The steps of the line detectors: one for each stage of the papers, for a scene with houses and for an empty one."""

import numpy as np
import pytest
import shapely
from builders.line_scenes import GREEN_ROOF, SceneBuilder, rectangle

from roofbench.detectors.registry import make_detector

STEPS = {
    "original": ["masks", "lines", "extended-lines", "initial-rectangles", "final-rectangles"],
    "improved": ["masks", "lines", "extended-lines", "initial-rectangles", "final-rectangles"],
    "improved[voting=true,texture=tests]": [
        "masks", "lines", "extended-lines", "initial-rectangles", "votes", "final-rectangles", "histograms",
    ],
}  # fmt: skip


@pytest.mark.parametrize("name", list(STEPS))
@pytest.mark.parametrize("builder", [SceneBuilder(side=30.0), SceneBuilder().house(rectangle(20, 30, 15, 10, 30))])
def test_the_steps_end_with_the_rectangles_that_are_detected(name, builder):
    scene = builder.house(rectangle(45, 30, 12, 8, 70), GREEN_ROOF).tree(15, 10, 5).build().for_detection()
    detector, rng = make_detector(name), np.random.default_rng(0)
    steps = {step.name: step for step in detector.steps(scene, rng)}
    assert list(steps) == STEPS[name]
    assert all(step.caption.endswith(".") for step in steps.values())
    (panel,) = steps["final-rectangles"].panels
    (buildings,) = [layer for layer in panel.layers if getattr(layer, "label", "") == "building"]
    detected = detector.detect(scene, rng).polygons
    assert len(buildings.polygons) == len(detected)
    assert np.all(shapely.area(shapely.symmetric_difference(buildings.polygons, detected)) < 1e-6)
