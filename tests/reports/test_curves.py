"""Curves are drawn from the declaration of an evaluator."""

import pytest
import shapely
from matplotlib.figure import Figure

import roofbench as rb
from roofbench.evaluators.registry import EVALUATORS
from roofbench.reports.curves import curve_panels, draw_curves
from roofbench.reports.verdict_map import verdict_figure

HOUSES = rb.Footprints.of([shapely.box(0, 0, 10, 10), shapely.box(30, 0, 42, 9)])
SHIFTED = rb.Footprints.of([shapely.box(2, 0, 12, 10)])


def drawn(name):
    evaluation = rb.evaluate(SHIFTED, HOUSES, evaluator=name)
    panels = curve_panels(evaluation)
    axes = Figure().subplots(max(len(panels), 1), squeeze=False)[:, 0]
    for panel, curves in zip(axes, panels, strict=False):
        draw_curves(panel, evaluation, curves)
    return axes, panels


def test_lines_of_one_unit_share_a_panel_with_a_legend():
    axes, panels = drawn("shufelt")
    assert len(panels) == 1
    one, two = axes[0].get_lines()
    assert one.get_linestyle() != two.get_linestyle()
    assert one.get_ydata()[50] == pytest.approx(50), "one of two references is covered to 80 %"
    assert axes[0].get_xlabel() == "required overlap (%)"
    assert len(axes[0].get_legend().get_texts()) == 2


def test_lines_over_thresholds_and_over_recall_have_a_panel_each():
    axes, panels = drawn("iou")
    assert [len(panel) for panel in panels] == [3, 2]
    assert [panel.get_xlabel() for panel in axes] == ["IoU threshold (%)", "recall (%)"]


def test_histograms_stand_alone():
    axes, panels = drawn("shan-lee")
    assert len(panels) == 5
    assert [panel.get_xlabel() for panel in axes] == [
        "overlap (%)",
        "fitness (%)",
        "underlap (%)",
        "extralap",
        "crosslap",
    ]


@pytest.mark.parametrize("name", EVALUATORS.names())
def test_the_map_of_every_evaluator_can_be_drawn(name, tmp_path):
    evaluation = rb.evaluate(SHIFTED, HOUSES, evaluator=name)
    figure = verdict_figure(evaluation, title=name)
    figure.savefig(tmp_path / "map.png", dpi=40)
    assert (tmp_path / "map.png").stat().st_size > 0
