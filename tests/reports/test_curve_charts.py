"""Reports draw the curves of evaluators, pooled over the scenes that all detectors have a result on."""

import pytest
from harness.command_line import roofbench

from roofbench.benchmark.analysis.pooled_curves import pooled_curves
from roofbench.benchmark.analysis.report_contents import newest_runs, stored_evaluators
from roofbench.benchmark.store.writer import Store
from roofbench.reports.curve_charts import curves_figure


@pytest.fixture
def store(tmp_path, misbehaving):
    small, large = (("-d", f"{misbehaving}[side={side}]") for side in (4, 9))
    options = ("-e", "shufelt", "-j", 0, "--no-report")
    roofbench("run", "hamlet", *small, *large, *options, folder=tmp_path)
    roofbench("run", "hamlet[seed=2]", *small, *options, folder=tmp_path)
    return tmp_path / "roofbench.sqlite"


def test_curves_are_pooled_over_common_scenes_and_drawn_for_each_detector(store, tmp_path):
    with Store(store) as opened:
        rows = newest_runs(opened)
        (keyed,) = stored_evaluators(opened, rows)
        labels = sorted({row.label for row in rows})
        found = pooled_curves(opened, rows, keyed, labels)
        alone = pooled_curves(opened, [row for row in rows if "side=4" in row.label], keyed, labels)
    assert found.scenes == ("hamlet-1",)
    assert list(found.pooled) == labels
    assert alone.scenes == ("hamlet-1", "hamlet-2")
    drawn = [axes for axes in curves_figure(found).axes if axes.get_visible()]
    assert len(drawn) == len(keyed.evaluator.curves) == 2
    assert [line.get_label() for line in drawn[0].lines] == labels
    assert "required overlap" in drawn[0].get_xlabel()
    roofbench("report", "roofbench.sqlite", folder=tmp_path)
    assert '<section id="curves">' in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_an_evaluator_without_curves_and_detectors_without_a_common_scene_have_none(store):
    with Store(store) as opened:
        rows = newest_runs(opened)
        (keyed,) = stored_evaluators(opened, rows)
        labels = sorted({row.label for row in rows})
        apart = [row for row in rows if (row.scene == "hamlet-2") == ("side=4" in row.label)]
        assert len(apart) == 2
        assert pooled_curves(opened, apart, keyed, labels) is None
        assert pooled_curves(opened, [], keyed, labels) is None
