import csv
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import roofbench as rb
from roofbench.benchmark.analysis.baseline import Baseline, BaselineScene, Measured
from roofbench.benchmark.analysis.gate import compare, different_scenes, margins_of
from roofbench.benchmark.identity import provenance
from roofbench.benchmark.identity.provenance import CodeVersion
from roofbench.benchmark.identity.recipes import PluginRecipe, SceneRecipe
from roofbench.cli.main import app
from roofbench.core.errors import RoofbenchError
from roofbench.evaluators.registry import make_evaluator
from roofbench.reports.gate_text import format_gate

EVALUATOR = make_evaluator("threshold-free")
INDICES = EVALUATOR.gated_indices()
MARGINS = margins_of([], INDICES)


def measured(values, *, seeds=(0,), noise=0.0, shift=0.0, rng=None):
    """Values (scenes,) of all gated indices, with noise per run and a shift for the worse."""
    runs = {}
    noises = np.broadcast_to(noise, len(values))
    for number, value in enumerate(values):
        for seed in seeds:
            noisy = value + (rng.normal(0, noises[number]) if rng is not None else 0.0)
            runs[f"s-{number}", seed] = {
                index.key: noisy - shift if index.better == "higher" else 1 - noisy + shift for index in INDICES
            }
    return Measured(PluginRecipe("d", {}), seeds, runs)


def baseline(found, count):
    return Baseline(
        suite="gate",
        version=CodeVersion("1", "abcdef", False),
        created="2026-01-01T00:00:00+00:00",
        evaluator=PluginRecipe("threshold-free", EVALUATOR.values()),
        scenes={f"s-{n}": BaselineScene(SceneRecipe.of_preset("hamlet", seed=n), f"hash{n}") for n in range(count)},
        detectors={"d": found},
    )


def gate(before, after, count, **more):
    options = {"indices": INDICES, "margins": MARGINS, **more}
    return compare(baseline(before, count), baseline(after, count), **options)


@pytest.fixture
def values():
    return np.random.default_rng(3).uniform(0.6, 0.95, 16)


def conclusions(result):
    return {conclusion.conclusion for conclusion in result.conclusions}


def test_the_same_results_are_equal_fifty_times_of_fifty():
    for repeat in range(50):
        values = np.random.default_rng(repeat).uniform(0.6, 0.95, 12)
        result = gate(measured(values), measured(values), 12)
        assert conclusions(result) == {"equal"}
        assert result.exit_code == 0


@pytest.mark.parametrize("seeds", [1, 5])
def test_a_stochastic_detector_with_fresh_seeds_passes_fifty_times_of_fifty(seeds):
    for repeat in range(50):
        rng = np.random.default_rng(repeat)
        values = rng.uniform(0.6, 0.95, 12)
        noise = rng.choice([0, 0.01, 0.08], 12)  # steady on some scenes, wild on others
        before, after = (
            measured(values, seeds=tuple(range(start, start + seeds)), noise=noise, rng=rng) for start in (0, seeds)
        )
        assert gate(before, after, 12).exit_code == 0


def test_a_certain_improvement_of_an_index_does_not_make_the_others_worse():
    rng = np.random.default_rng(4)

    def noise():
        return {(f"s-{n}", 0): {index.key: rng.normal() for index in INDICES} for n in range(12)}

    alarms = 0
    for _ in range(300):
        before, after = (Measured(PluginRecipe("d", {}), (0,), noise()) for _ in range(2))
        for run in after.runs.values():
            run["object.completeness"] += 5
        alarms += gate(before, after, 12, margins=dict.fromkeys(MARGINS, 0.0), level=0.2).exit_code == 1
    assert alarms <= 1.4 * 300 * 0.2 / 2


def test_scatter_over_seeds_is_separated_from_scatter_over_scenes(values):
    rng = np.random.default_rng(6)
    before, after = (measured(values, seeds=seeds, noise=0.05, rng=rng) for seeds in ((0, 1, 2), (3, 4, 5)))
    result = gate(before, after, 16)
    assert conclusions(result) == {"undecided"}
    assert all(conclusion.seeds_share > 0.5 for conclusion in result.conclusions)
    assert "d: completeness: seeds cause " in format_gate(result, "table")
    steady = rng.normal(0, 0.05, 16)  # the change works differently on every scene, seeds hardly matter
    before = measured(values, seeds=(0, 1, 2), noise=0.001, rng=rng)
    after = measured(values + steady, seeds=(3, 4, 5), noise=0.001, rng=rng)
    assert all((conclusion.seeds_share or 0) < 0.5 for conclusion in gate(before, after, 16).conclusions)


def test_a_planted_drop_is_found(values):
    result = gate(measured(values), measured(values, shift=0.03), 16)
    assert conclusions(result) == {"worse"}
    assert result.exit_code == 1
    assert all(conclusion.effect == pytest.approx(-0.03) for conclusion in result.conclusions)


def test_csv_holds_plain_numbers_by_key(values):
    result = gate(measured(values), measured(values, shift=0.03), 16)
    rows = list(csv.DictReader(format_gate(result, "csv").splitlines()))
    assert [row["index"] for row in rows] == [found.index.key for found in result.conclusions]
    assert [float(row["effect"]) for row in rows] == [found.effect for found in result.conclusions]
    assert {row["conclusion"] for row in rows} == {"worse"}


def test_a_gain_is_better_and_passes(values):
    result = gate(measured(values, shift=0.03), measured(values), 16)
    assert (conclusions(result), result.exit_code) == ({"better"}, 0)


def test_a_drop_within_the_margin_is_none(values):
    result = gate(measured(values), measured(values, shift=0.004), 16)
    assert (conclusions(result), result.exit_code) == ({"equal"}, 0)


def test_noise_that_allows_both_is_undecided(values):
    noisy = measured(values, noise=0.1, rng=np.random.default_rng(5))
    assert "undecided" in conclusions(gate(measured(values), noisy, 16))


def test_five_scenes_are_not_measurable_and_exit_4(values):
    result = gate(measured(values[:5]), measured(values[:5], shift=0.5), 5)
    assert (conclusions(result), result.exit_code) == ({"not measurable"}, 4)
    assert {conclusion.scenes_needed for conclusion in result.conclusions} == {10}
    assert "completeness needs 10 scenes with a value on both sides for a test at level 0.01, 5 available" in (
        format_gate(result, "table")
    )


def test_a_run_that_fails_now_is_a_regression(values):
    before = measured(values)
    after = replace(before, runs={**before.runs, ("s-3", 0): None})
    result = gate(before, after, 16)
    assert (result.failures, result.exit_code) == (("d on s-3, seed 0",), 1)


def test_an_index_that_became_undefined_is_noted(values):
    before = measured(values)
    lost = {**before.runs["s-2", 0], "geometric.rmse": None}
    result = gate(before, replace(before, runs={**before.runs, ("s-2", 0): lost}), 16)
    (conclusion,) = [conclusion for conclusion in result.conclusions if conclusion.index.key == "geometric.rmse"]
    assert conclusion.scenes == 15
    assert conclusion.undefined == 1
    assert "is undefined for the candidate on 1 scene where the baseline has it" in format_gate(result, "md")


def test_holm_makes_one_chance_finding_among_many_harmless(values):
    rng = np.random.default_rng(1)
    wrong = 0
    for _ in range(100):
        before = measured(values)
        runs = {
            run: {key: value + rng.normal(0, 0.02) for key, value in found.items()}
            for run, found in before.runs.items()
        }
        margins = dict.fromkeys(MARGINS, 0.0)
        wrong += gate(before, replace(before, runs=runs), 16, margins=margins).exit_code == 1
    assert wrong <= 10


def test_other_scenes_cannot_be_compared(values):
    one, two = baseline(measured(values), 16), baseline(measured(values), 16)
    assert different_scenes(one, two) == []
    changed = replace(two, scenes={**two.scenes, "s-1": replace(two.scenes["s-1"], content_hash="other")})
    assert different_scenes(one, changed) == ["scene s-1 has changed since the baseline"]
    assert different_scenes(one, baseline(measured(values), 15)) == ["scene s-15 is only in the baseline"]


def test_a_baseline_is_read_as_it_was_written_and_diffs_by_line(values, tmp_path):
    one = baseline(measured(values, seeds=(0, 1)), 16)
    one.save(tmp_path / "b.json")
    assert Baseline.load(tmp_path / "b.json") == one
    runs = {**one.detectors["d"].runs, ("s-3", 1): None}
    other = replace(one, detectors={"d": replace(one.detectors["d"], runs=runs)})
    before, after = one.to_json().splitlines(), other.to_json().splitlines()
    assert sum(a != b for a, b in zip(before, after, strict=True)) == 1


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": 99}', '{"format": 1, "scenes": 3}'])
def test_a_file_that_is_no_baseline_is_one_sentence(tmp_path, text):
    (tmp_path / "b.json").write_text(text)
    with pytest.raises(RoofbenchError, match=r"b\.json"):
        Baseline.load(tmp_path / "b.json")


def test_margins_are_read_by_index():
    assert margins_of(["pixel.correctness=0.01"], INDICES)["pixel.correctness"] == 0.01
    for wrong in ("pixel.corectness=0.01", "pixel.correctness=much", "pixel.correctness=-1"):
        with pytest.raises(RoofbenchError, match=r"margin|NAME=VALUE"):
            margins_of([wrong], INDICES)


@pytest.fixture
def cli(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(provenance, "_git", lambda *arguments: None)
    provenance.code_version.cache_clear()

    def call(*words):
        result = CliRunner().invoke(app, [str(word) for word in words])
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        return result

    yield call
    provenance.code_version.cache_clear()


def suite_text(misbehaving, seeds):
    return (
        f'name = "little"\n[[scenes]]\npreset = "hamlet"\nseeds = {seeds}\n'
        f'[[detectors]]\nuse = "{misbehaving}"\n[[evaluators]]\nuse = "threshold-free"\narea = "exact"\n'
    )


def test_the_command_line_exits_0_1_and_4(cli, misbehaving, tmp_path):
    (tmp_path / "little.toml").write_text(suite_text(misbehaving, 10))
    saved = cli("baseline", "save", "-o", "b.json", "--suite", "little.toml", "-j", 0)
    assert saved.exit_code == 0, saved.output
    same = cli("gate", "b.json", "-j", 0)
    assert same.exit_code == 0
    assert "passed: 5 equal" in same.stdout
    shrunk = cli("gate", "b.json", "-d", f"{misbehaving}[side=7.0]", "-j", 0, "-f", "md", "-o", "gate.md")
    assert shrunk.exit_code == 1
    assert "🔴 worse" in shrunk.stdout
    assert (tmp_path / "gate.md").read_text() == shrunk.stdout
    few = json.loads((tmp_path / "b.json").read_text())
    assert len(few["scenes"]) == 10
    part = cli("gate", "b.json", "--scenes", "hamlet-[1-5]", "-j", 0)
    assert part.exit_code == 4
    assert "needs 10 scenes with a value on both sides for a test at level 0.01, 5 available" in part.stdout

    written = suite_text(misbehaving, 5).replace("[[evaluators]]", "side = 8.0\n[[evaluators]]")
    (tmp_path / "few.toml").write_text(written)
    cli("baseline", "save", "-o", "few.json", "--suite", "few.toml", "-j", 0)
    # A later change of the default would not change a value that is written.
    chosen = [
        json.loads((tmp_path / name).read_text())["detectors"]["misbehaving"]["chosen"]
        for name in ("b.json", "few.json")
    ]
    assert chosen == [[], ["side"]]
    assert cli("gate", "few.json", "-d", f"{misbehaving}[side=7.0]", "-j", 0).exit_code == 4
    with pytest.raises(RoofbenchError, match="the same content"):
        cli("gate", "b.json", "b.json")
    other = cli("gate", "b.json", "few.json")
    assert other.exit_code == 4
    assert "Not comparable: scene hamlet-6 is only in the baseline" in other.stderr


def test_a_changed_default_is_a_change_that_the_gate_measures(cli, misbehaving, tmp_path):
    plugin = tmp_path / "shifting.py"
    text = Path(misbehaving.rpartition(":")[0]).read_text()
    before, after = "side: float = rb.parameter(8.0", "side: float = rb.parameter(7.0"
    assert text.count(before) == 1
    plugin.write_text(text)
    (tmp_path / "little.toml").write_text(suite_text(f"{plugin}:Misbehaving", 10))
    assert cli("baseline", "save", "-o", "b.json", "--suite", "little.toml", "-j", 0).exit_code == 0
    plugin.write_text(text.replace(before, after))
    # In another process: this one has imported the file already.
    environment = {**os.environ, "PYTHONPATH": str(Path(rb.__file__).parents[1])}
    gate = [sys.executable, "-m", "roofbench", "gate", "b.json", "-j", "0"]
    changed = subprocess.run(gate, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert changed.returncode == 1, changed.stdout + changed.stderr


def test_the_self_test_prints_how_often_identical_code_is_called_worse(cli, misbehaving, tmp_path):
    (tmp_path / "little.toml").write_text(suite_text(misbehaving, 10))
    assert cli("baseline", "save", "-o", "b.json", "--suite", "little.toml", "-j", 0).exit_code == 0
    words = ["gate", "b.json", "-j", 0, "--self-test", "--comparisons", 7]
    result = cli(*words, "--format", "json", "-o", "rates.md")
    assert result.exit_code == 0, result.output
    rows = json.loads(result.stdout)["rows"]
    assert {(row["comparisons"], row["alarms"], row["runs_differ"]) for row in rows} == {(7, 0, True)}
    assert (tmp_path / "rates.md").read_text().startswith("### Self-test of the gate: passed")
    with pytest.raises(RoofbenchError, match=r"leave out the candidate file, (--against|against=) and (--time|time=)"):
        cli(*words, "--time")


@pytest.mark.slow
def test_the_gate_suite_cut_to_five_scenes_is_not_measurable(cli):
    saved = cli("baseline", "save", "-o", "b.json", "-d", "ndsm", "--scenes", "knox-small-[1-5]", "-j", 0)
    assert saved.exit_code == 0, saved.output
    assert len(json.loads(Path("b.json").read_text())["scenes"]) == 5
    result = cli("gate", "b.json", "-d", "ndsm[height=8]", "-j", 0)
    assert result.exit_code == 4
    assert result.stdout.count("not measurable") == 6  # five indices and the summary
    assert "Gate nothing could be measured" in result.stdout


@pytest.mark.slow
def test_only_the_detectors_that_are_named_are_compared(cli, misbehaving, tmp_path):
    (tmp_path / "little.toml").write_text(
        suite_text(misbehaving, 10) + '[[detectors]]\nuse = "ndsm"\n[[detectors]]\nuse = "ndsm"\nheight = 2\n'
    )
    assert cli("baseline", "save", "-o", "b.json", "--suite", "little.toml", "-j", 0).exit_code == 0
    one = cli("gate", "b.json", "-d", "ndsm", "-j", 0)
    assert one.exit_code == 0
    assert "misbehaving" not in one.stdout
    with pytest.raises(RoofbenchError, match="has no detector 'original'; it has misbehaving, ndsm, "):
        cli("gate", "b.json", "-d", "original", "-j", 0)
    with pytest.raises(RoofbenchError, match=r"has no detector 'nsdm'.*did you mean 'ndsm'"):
        cli("gate", "b.json", "-d", "original", "--against", "nsdm", "-j", 0)
    other = cli("gate", "b.json", "-d", "original", "--against", "ndsm", "-j", 0)
    assert other.stdout.count("\nndsm ") == 5
    sides = [f"{misbehaving}[side={side}]" for side in (7, 9)]
    with pytest.raises(RoofbenchError, match="can be compared with one only"):
        cli("gate", "b.json", "-d", sides[0], "-d", sides[1], "-j", 0)


def test_a_dirty_tree_cannot_become_a_baseline(cli, monkeypatch):
    answers = {"rev-parse": str(provenance.FOLDER), "status": " M gate.py"}
    monkeypatch.setattr(provenance, "_git", lambda *arguments: answers[arguments[0]])
    provenance.code_version.cache_clear()
    with pytest.raises(RoofbenchError, match="uncommitted changes"):
        cli("baseline", "save", "-o", "b.json")


def test_every_default_index_exists():
    assert [index.key for index in INDICES] == list(EVALUATOR.gated_by)


def test_a_baseline_of_version_0_1_is_compared_with_what_is_measured_now(cli):
    path = Path(__file__).parents[2] / "data" / "baseline-0.1.json"
    old = Baseline.load(path)
    assert old.version.version == "0.1.0"
    for values in old.detectors["ndsm"].runs.values():
        known = {index.key for index in EVALUATOR.indices}
        assert set(values) < known
        assert {key.partition(".")[0] for key in known - set(values)} == {"pixel_literal"}, "added since"
    result = cli("gate", str(path), "-j", 0)
    assert result.exit_code == 4, "two scenes are too few for a conclusion"
    assert result.stdout.count("not measurable") == 6
    assert "completeness %" in result.stdout


@pytest.mark.parametrize(
    ("ratios", "conclusion"),
    [
        ([1.3, 1.4, 1.25, 1.5, 1.35, 1.45], "worse"),
        ([0.7] * 6, "better"),
        ([1.0, 1.01] * 3, "equal"),
        ([1.3], "not measurable"),
    ],
)
def test_run_time_has_verdicts_of_its_own(ratios, conclusion):
    from roofbench.benchmark.analysis import timing

    found = timing._conclusion("d", [np.log(ratio) for ratio in ratios], 0.1, 0.05)
    assert found.conclusion == conclusion
    assert found.candidate == pytest.approx(np.exp(np.mean(np.log(ratios))))
