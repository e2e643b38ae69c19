"""The pictures of the steps: one per step, drawn without a warning, for a scene with houses and for an empty one."""

import matplotlib as mpl
import numpy as np
import pytest
from builders.line_scenes import GREEN_ROOF, SceneBuilder, rectangle
from matplotlib.figure import Figure

from roofbench.detectors.registry import make_detector

STEPS = {
    "original": ["01-masks", "02-lines", "03-extended-lines", "04-initial-rectangles", "05-final-rectangles"],
    "improved": [
        "01-masks", "02-lines", "03-extended-lines", "04-initial-rectangles", "05-votes", "06-final-rectangles",
        "07-histograms",
    ],
}  # fmt: skip


@pytest.mark.parametrize("name", ["original", "improved"])
@pytest.mark.parametrize("builder", [SceneBuilder(side=30.0), SceneBuilder().house(rectangle(20, 30, 15, 10, 30))])
def test_every_step_draws_on_an_empty_figure(name, builder, tmp_path):
    scene = builder.house(rectangle(45, 30, 12, 8, 70), GREEN_ROOF).tree(15, 10, 5).build().for_detection()
    steps = list(make_detector(name).steps(scene, np.random.default_rng(0)))
    assert [step.name for step in steps] == STEPS[name]
    with mpl.rc_context({"figure.dpi": 30}):
        for step in steps:
            figure = Figure()
            step.draw(figure)
            figure.savefig(tmp_path / f"{step.name}.png")
            assert step.caption.endswith(".")
