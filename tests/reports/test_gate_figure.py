"""A gate's result, read back and drawn."""

import pytest

from roofbench.benchmark.analysis.results import CONCLUSIONS, GateResult, IndexConclusion
from roofbench.core.errors import InputError
from roofbench.evaluators.threshold_free.evaluator import ThresholdFree
from roofbench.reports.gate_figure import gate_figure
from roofbench.reports.gate_json import gate_json, read_gate


@pytest.fixture
def result():
    effects = (0.03, -0.03, 0.001, 0.004, None)
    conclusions = tuple(
        IndexConclusion(
            detector=detector,
            index=index,
            conclusion=conclusion,
            baseline=0.8,
            candidate=None if effect is None else 0.8 + effect,
            effect=effect,
            low=None if effect is None else effect - 0.003,
            high=None if effect is None else effect + 0.003,
            p=0.01 if conclusion in ("better", "worse") else None,
            margin=0.005,
            scenes=30,
        )
        for detector in ("original", "improved")
        for index, conclusion, effect in zip(ThresholdFree.indices[:5], CONCLUSIONS, effects, strict=True)
    )
    return GateResult(
        baseline="0.1 (a)",
        candidate="0.1 (b)",
        evaluator="threshold-free",
        conclusions=conclusions,
        failures=("original on x",),
        level=0.05,
    )


def test_the_json_of_a_gate_is_read_back(result, tmp_path):
    path = tmp_path / "gate.json"
    path.write_text(gate_json(result), encoding="utf-8")
    assert read_gate(path) == result


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"baseline": 1, "candidate": 2, "conclusions": [{}]}', "\x00"])
def test_anything_else_is_refused(content, tmp_path):
    path = tmp_path / "gate.json"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match="not a result of the gate"):
        read_gate(path)


def test_every_index_has_a_line_with_its_verdict(result):
    figure = gate_figure(result)
    for axes in figure.axes:
        words = [label.get_text() for label in axes.get_yticklabels()]
        assert [word.rpartition(": ")[2] for word in words] == list(CONCLUSIONS)
        assert "n = 30 paired scenes" in axes.get_title(loc="left")
