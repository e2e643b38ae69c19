from dataclasses import replace

import pandas as pd
import pytest
from typer.testing import CliRunner

from roofbench.benchmark.analysis.sweep import Axis, axis_of, break_downs, make_sweep, run_sweep
from roofbench.benchmark.execution.executors import Execution
from roofbench.benchmark.identity.recipes import SceneRecipe
from roofbench.benchmark.store.writer import Store
from roofbench.benchmark.suite import DetectorEntry, Suite
from roofbench.cli.main import app
from roofbench.core.errors import ParameterError
from roofbench.detectors.registry import make_detector
from roofbench.evaluators.registry import make_evaluator
from roofbench.reports.sweep_text import break_down_text

HERE = Execution(jobs=0)


@pytest.fixture
def suite(misbehaving):
    scenes = tuple(SceneRecipe.of_preset("hamlet", seed=seed) for seed in (1, 2, 3))
    return Suite("s", scenes, (DetectorEntry(make_detector(misbehaving), (0, 1)),), (make_evaluator("threshold-free"),))


@pytest.fixture
def store(tmp_path):
    with Store(tmp_path / "a.sqlite") as opened:
        yield opened


def test_axes_are_lists_or_ranges():
    assert axis_of("ground_tile=400, 450,500").values == (400, 450, 500)
    assert axis_of("scene.slope=0:1:0.25").values == (0, 0.25, 0.5, 0.75, 1.0)
    assert axis_of("mode=good,raises").values == ("good", "raises")
    for wrong in ("slope", "slope=", "slope=0:5:0", "slope=5:0:1", "slope=1,1"):
        with pytest.raises(ParameterError, match=r"vary|NAME=VALUE"):
            axis_of(wrong)


def test_one_axis_at_a_time_shares_the_default_point(suite, store):
    sweep = make_sweep(suite, [axis_of("side=6,8,10"), axis_of("seconds=0,0.001")], store)
    assert len(sweep.points) == 5
    assert len(sweep.plan.runs) == 4 * 3 * 2  # side=8 and seconds=0 are the same runs
    table, rows = run_sweep(sweep, store, execution=HERE)
    assert len(rows) == 24
    quality = table[table["index"] == "pixel.quality"]
    assert list(quality["axis"]) == ["side"] * 3 + ["seconds"] * 2
    assert (quality["scenes"] == 3).all()
    assert (quality["low"] <= quality["mean"]).all()
    assert (quality["mean"] <= quality["high"]).all()
    assert quality["mean"].iloc[1] == quality["mean"].iloc[3]


def test_a_grid_varies_all_axes_together(suite, store):
    sweep = make_sweep(suite, [axis_of("side=6,8"), axis_of("seconds=0,0.001")], store, grid=True)
    assert [dict(point.values) for point, _, _ in sweep.points] == [
        {"side": side, "seconds": seconds} for side in (6, 8) for seconds in (0, 0.001)
    ]


def test_a_sweep_runs_only_what_is_new(suite, store):
    run_sweep(make_sweep(suite, [axis_of("side=6,8")], store), store, execution=HERE)
    wider = make_sweep(suite, [axis_of("side=6,8,10")], store)
    assert wider.plan.counts() == {"nothing": 12, "detect": 6}


def test_failures_are_counted_and_not_averaged(suite, store):
    axes = [axis_of("mode=good,raises")]
    table, _ = run_sweep(make_sweep(suite, axes, store), store, execution=HERE)
    quality = table[table["index"] == "pixel.quality"].set_index("mode")
    good, bad = quality.loc["good"], quality.loc["raises"]
    assert (good["failed"], good["scenes"]) == (0, 3)
    assert (bad["failed"], bad["scenes"], bad["runs"]) == (6, 0, 6)
    assert pd.isna(bad["mean"])


def test_an_axis_that_nothing_has_is_answered_with_the_nearest(suite, store):
    with pytest.raises(ParameterError, match=r"no parameter 'sied' \(did you mean 'side'\?\)"):
        make_sweep(suite, [axis_of("sied=3")], store)
    with pytest.raises(ParameterError, match="no scene of 's' is synthetic"):
        make_sweep(suite, [axis_of("scene.slope=3")], store)
    with pytest.raises(ParameterError, match=r"side must be at least 0.1 m"):
        make_sweep(suite, [axis_of("side=-3")], store)
    with pytest.raises(ParameterError, match="nothing is varied"):
        make_sweep(suite, [], store)


def test_a_generator_axis_makes_other_scenes(suite, store):
    synthetic = replace(suite, scenes=(SceneRecipe.of_preset("knox-small", seed=1), *suite.scenes))
    sweep = make_sweep(synthetic, [axis_of("scene.tree_density=0,20")], store)
    assert {run.identity.scene.name for run in sweep.plan.runs} == {
        "knox-small-1[tree_density=0]",
        "knox-small-1[tree_density=20]",
    }
    with pytest.raises(ParameterError, match="tree_densty"):
        make_sweep(synthetic, [axis_of("scene.tree_densty=0,20")], store)


def table_of(index, values):
    rows = [{"detector": "d", "axis": "x", "x": x, "index": index.key, "mean": mean} for x, mean in values]
    return pd.DataFrame(rows)


def test_the_break_down_is_interpolated_between_points():
    indices = {index.key: index for index in make_evaluator("threshold-free").indices}
    quality, rmse = indices["object.quality"], indices["geometric.rmse"]
    axis = [Axis("x", (0, 10, 20))]
    (found,) = break_downs(table_of(quality, [(0, 0.9), (10, 0.7), (20, 0.2)]), axis, quality, 0.8)
    assert found.value == pytest.approx(5)
    (found,) = break_downs(table_of(rmse, [(0, 1.0), (10, 3.0), (20, 5.0)]), axis, rmse, 2.5)
    assert found.value == pytest.approx(7.5)
    (found,) = break_downs(table_of(quality, [(0, 0.9), (10, 0.85)]), axis, quality, 0.8)
    assert found.value is None
    (found,) = break_downs(table_of(quality, [(0, 0.5), (10, 0.85)]), axis, quality, 0.8)
    assert found.at_start
    assert break_down_text(found) == "d: quality (Q_l) is below 80.0 % already at the first value of x, 0"


def test_the_command_writes_a_tidy_table(misbehaving, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["sweep", misbehaving, "hamlet", "--vary", "side=3,9", "--index", "pixel.quality", "-j", "0"]
    for name, read in (("t.csv", pd.read_csv), ("t.parquet", pd.read_parquet)):
        result = CliRunner().invoke(app, [*words, "--seeds", "2", "-o", name, "--level", "0.3"])
        assert result.exit_code == 0, result.output
        assert "misbehaving: " in result.stdout
        table = read(tmp_path / name)
        assert list(table["side"].unique()) == [3, 9]
        assert set(table["scenes"]) <= {0, 1, 2}
