"""The gate's result as text: for terminals and as Markdown for a pull request."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from ..benchmark.analysis.results import CONCLUSIONS, GateResult, IndexConclusion
from ..core.wording import counted
from .format import column_title, interval_text, number_text, value_text
from .tables import Column, Table, escaped_markdown

__all__ = ["format_gate", "gate_summary"]

_MARKS = dict(zip(CONCLUSIONS, ("🟢", "🔴", "⚪", "🟡", "⚫"), strict=True))
#: Least share of the variance at which more seeds are worth their time.
_MOST_SHARE = 0.5
_COLUMNS = (
    *(Column(title, "left") for title in ("detector", "index", "conclusion")),
    *(Column(title) for title in ("baseline", "candidate", "change", "95 %", "margin", "p", "scenes")),
)


def gate_summary(result: GateResult) -> str:
    """Return the outcome in one sentence."""
    counts = {name: sum(found.conclusion == name for found in result.conclusions) for name in CONCLUSIONS}
    words = ", ".join(f"{count} {name}" for name, count in counts.items() if count)
    if result.failures:
        words += f", {counted(len(result.failures), 'run')} failed that did not fail before"
    return {0: "passed", 1: "regression", 4: "nothing could be measured"}[result.exit_code] + f": {words}"


def format_gate(result: GateResult, form: Literal["table", "md", "csv"]) -> str:
    """Return the result as text for a terminal, as Markdown for a pull request, or as CSV with plain numbers."""
    if form == "csv":
        return _data(result).to_csv().rstrip("\n")
    table = Table.of(_COLUMNS, (_row(found, mark=form == "md") for found in result.conclusions))
    notes = list(dict.fromkeys(note for found in result.conclusions for note in _notes(found, result.level)))
    how = (
        "Change: mean paired difference over scenes, positive is better; 95 %: its bootstrap interval; p: two-sided, "
        f"Holm over the indices of a detector; level {result.level:g}."
    )
    sides = f"Baseline {result.baseline}, candidate {result.candidate}"
    if form == "md":
        lines = [f"### Gate: {gate_summary(result)}", "", f"{sides}.", "", table.to_markdown(), "", how, ""]
        lines += [f"- {escaped_markdown(note)}" for note in notes]
        lines += [f"- failed: {escaped_markdown(text)}" for text in result.failures]
        return "\n".join(lines).rstrip()
    failures = (f"failed: {text}" for text in result.failures)
    return "\n".join([sides, table.to_text(), how, *notes, *failures, f"Gate {gate_summary(result)}"])


def _data(result: GateResult) -> Table:
    names = (
        "detector",
        "index",
        "conclusion",
        "baseline",
        "candidate",
        "effect",
        "low",
        "high",
        "margin",
        "p",
        "scenes",
    )
    rows = (
        [found.index.key if name == "index" else getattr(found, name) for name in names] for found in result.conclusions
    )
    return Table.of(map(Column, names), rows)


def _notes(found: IndexConclusion, level: float) -> Iterator[str]:
    """Yield what a reader must know of a conclusion."""
    name = f"{found.detector}: {found.index.title}"
    if found.scenes_needed:
        yield (
            f"{name} needs {found.scenes_needed} scenes with a value on both sides for a test at level {level:g}, "
            f"{found.scenes} available"
        )
    if found.undefined:
        yield f"{name} is undefined for the candidate on {counted(found.undefined, 'scene')} where the baseline has it"
    if found.seeds_share is not None and found.seeds_share >= _MOST_SHARE:
        share = value_text(found.seeds_share, "fraction")
        yield f"{name}: seeds cause {share} of the variance of the difference; more seeds narrow the interval"


def _row(found: IndexConclusion, *, mark: bool) -> list[str]:
    unit = found.index.unit
    return [
        found.detector,
        column_title(found.index, words=True),
        f"{_MARKS[found.conclusion]} {found.conclusion}" if mark else found.conclusion,
        number_text(found.baseline, unit, fine=True) or "–",
        number_text(found.candidate, unit, fine=True) or "–",
        number_text(found.effect, unit, fine=True, signed=True) or "–",
        interval_text(found.low, found.high, unit, fine=True, signed=True) or "–",
        number_text(found.margin, unit, fine=True),
        "–" if found.p is None else f"{found.p:.3g}",
        str(found.scenes),
    ]
