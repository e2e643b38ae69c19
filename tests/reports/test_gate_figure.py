"""A gate's result, read back and drawn."""

import pytest

from roofbench.core.errors import InputError
from roofbench.evaluators.threshold_free.indices import INDICES
from roofbench.reports.gate_figure import gate_figure
from roofbench.reports.gate_json import read_gate
from roofbench.reports.gate_text import GateResult, IndexVerdict, format_gate

VERDICTS = ("better", "worse", "equal", "undecided", "not measurable")


@pytest.fixture
def result():
    effects = (0.03, -0.03, 0.001, 0.004, None)
    verdicts = tuple(
        IndexVerdict(
            detector=detector,
            index=index,
            verdict=verdict,
            baseline=0.8,
            candidate=None if effect is None else 0.8 + effect,
            effect=effect,
            low=None if effect is None else effect - 0.003,
            high=None if effect is None else effect + 0.003,
            p=0.01 if verdict in ("better", "worse") else None,
            margin=0.005,
            scenes=30,
        )
        for detector in ("original", "improved")
        for index, verdict, effect in zip(INDICES[:5], VERDICTS, effects, strict=True)
    )
    return GateResult(
        baseline="0.1 (a)", candidate="0.1 (b)", verdicts=verdicts, failures=("original on x",), level=0.05
    )


def test_the_json_of_a_gate_is_read_back(result, tmp_path):
    path = tmp_path / "gate.json"
    path.write_text(format_gate(result, "json"), encoding="utf-8")
    assert read_gate(path) == result


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"baseline": 1, "candidate": 2, "verdicts": [{}]}', "\x00"])
def test_anything_else_is_refused(content, tmp_path):
    path = tmp_path / "gate.json"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match="no result of the gate"):
        read_gate(path)


def test_every_index_has_a_line_with_its_verdict(result):
    figure = gate_figure(result)
    for axes in figure.axes:
        words = [label.get_text() for label in axes.get_yticklabels()]
        assert [word.rpartition(": ")[2] for word in words] == list(VERDICTS)
        assert "n = 30 paired scenes" in axes.get_title(loc="left")
