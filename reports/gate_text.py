"""The gate's verdicts as people read them: terminal, Markdown for a pull request, JSON.

One *index verdict* says whether a detector became better or worse in one index, by the paired differences of the same
scenes. Differences are signed so that positive is better.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Literal

from ..evaluators.base import Index

__all__ = ["GateResult", "IndexVerdict", "Verdict", "format_gate"]

Verdict = Literal["better", "worse", "equal", "undecided", "not measurable"]
_MARKS = {"better": "🟢", "worse": "🔴", "equal": "⚪", "undecided": "🟡", "not measurable": "⚫"}


@dataclass(frozen=True, kw_only=True)
class IndexVerdict:
    """One index of one detector.

    Attributes
    ----------
    detector : str
    index : Index
    verdict : {"better", "worse", "equal", "undecided", "not measurable"}
    baseline, candidate : float, optional
        Means over the paired scenes.
    effect : float, optional
        Mean paired difference, positive is better.
    low, high : float, optional
        Its 95 % bootstrap interval.
    p : float, optional
        Holm-adjusted, of the test against the margin that the mean difference exceeds; None where it exceeds none.
    margin : float
        Differences up to this are taken as none.
    scenes : int
        Pairs.
    note : str
        What else must be known, in words.
    """

    detector: str
    index: Index
    verdict: Verdict
    baseline: float | None
    candidate: float | None
    effect: float | None
    low: float | None
    high: float | None
    p: float | None
    margin: float
    scenes: int
    note: str = ""


@dataclass(frozen=True, kw_only=True)
class GateResult:
    """All verdicts of a gate.

    Attributes
    ----------
    baseline, candidate : str
        What was compared: version with commit.
    verdicts : tuple of IndexVerdict
    failures : tuple of str
        Runs that the candidate failed where the baseline had a result.
    level : float
    """

    baseline: str
    candidate: str
    verdicts: tuple[IndexVerdict, ...]
    failures: tuple[str, ...]
    level: float

    @property
    def exit_code(self) -> int:
        """1 for a regression, 4 when no index of quality could be measured, else 0."""
        if self.failures or any(verdict.verdict == "worse" for verdict in self.verdicts):
            return 1
        quality = [verdict for verdict in self.verdicts if not verdict.index.key.startswith("cost.")]
        return 4 if all(verdict.verdict == "not measurable" for verdict in quality) else 0

    def summary(self) -> str:
        """Return the outcome in one sentence."""
        counts = {name: sum(v.verdict == name for v in self.verdicts) for name in _MARKS}
        told = ", ".join(f"{count} {name}" for name, count in counts.items() if count)
        if self.failures:
            told += f", {len(self.failures)} runs failed that did not fail before"
        return {0: "passed", 1: "regression", 4: "nothing could be measured"}[self.exit_code] + f": {told}"


def format_gate(result: GateResult, form: Literal["table", "md", "json"]) -> str:
    """Return the result as text for a terminal, Markdown for a pull request, or JSON."""
    if form == "json":
        return _as_json(result)
    header = ["detector", "index", "verdict", "baseline", "candidate", "change", "95 %", "margin", "p", "scenes"]
    rows = [_row(verdict, mark=form == "md") for verdict in result.verdicts]
    notes = list(dict.fromkeys(verdict.note for verdict in result.verdicts if verdict.note))
    how = (
        f"Change: mean paired difference over scenes, positive is better; 95 %: its bootstrap interval; p: two-sided, "
        f"Holm over the indices of a detector; level {result.level:g}."
    )
    if form == "md":
        lines = [f"### Gate: {result.summary()}", "", f"Baseline {result.baseline}, candidate {result.candidate}.", ""]
        lines += [f"| {' | '.join(header)} |", "|" + "|".join([":--", ":--", ":--", *["--:"] * 7]) + "|"]
        lines += [f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in row)} |" for row in rows]
        lines += ["", how]
        lines += ["", *(f"- {note}" for note in notes), *(f"- failed: {text}" for text in result.failures)]
        return "\n".join(lines).rstrip()
    lines = [f"Baseline {result.baseline}, candidate {result.candidate}", *_aligned([header, *rows]), how]
    lines += [*notes, *(f"failed: {text}" for text in result.failures), f"Gate {result.summary()}"]
    return "\n".join(lines)


def _row(verdict: IndexVerdict, *, mark: bool) -> list[str]:
    unit = verdict.index.unit

    def number(value: float | None, *, signed: bool = False) -> str:
        if value is None:
            return "–"
        shown = value * 100 if unit == "fraction" else value
        return f"{shown:+.2f}" if signed else f"{shown:.2f}"

    interval = "–"
    if verdict.low is not None:
        interval = f"{number(verdict.low, signed=True)} to {number(verdict.high, signed=True)}"
    name = f"{verdict.index.title} {'%' if unit == 'fraction' else unit if unit != 'ratio' else ''}".strip()
    return [
        verdict.detector,
        name,
        f"{_MARKS[verdict.verdict]} {verdict.verdict}" if mark else verdict.verdict,
        number(verdict.baseline),
        number(verdict.candidate),
        number(verdict.effect, signed=True),
        interval,
        number(verdict.margin),
        "–" if verdict.p is None else f"{verdict.p:.3g}",
        str(verdict.scenes),
    ]


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = []
    for row in rows:
        pairs = list(zip(row, widths, strict=True))
        cells = [*(cell.ljust(width) for cell, width in pairs[:3]), *(cell.rjust(width) for cell, width in pairs[3:])]
        lines.append("  ".join(cells).rstrip())
    return lines


def _as_json(result: GateResult) -> str:
    verdicts = []
    for verdict in result.verdicts:
        plain = asdict(verdict)
        plain["index"] = verdict.index.key
        verdicts.append(plain)
    content = {
        "baseline": result.baseline,
        "candidate": result.candidate,
        "level": result.level,
        "summary": result.summary(),
        "exit_code": result.exit_code,
        "verdicts": verdicts,
        "failures": list(result.failures),
    }
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
