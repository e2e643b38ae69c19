"""The gate's self-test as text, Markdown, CSV and JSON."""

from __future__ import annotations

import json
from typing import Any, Literal

from ..benchmark.analysis.self_test import FalseAlarms, SelfTest
from .format import interval_text, number_text
from .tables import Column, Table

__all__ = ["format_self_test"]

_OUTCOMES = {0: "passed", 1: "failed: a rate is above its bound", 4: "nothing could be measured: too few scenes"}


def format_self_test(result: SelfTest, form: Literal["table", "csv", "md", "json"]) -> str:
    """Return the rates of false alarms; CSV and JSON have fractions, the others percent."""
    if form == "json":
        content = {
            "version": result.version,
            "evaluator": result.evaluator,
            "level": result.level,
            "scenes": result.scenes,
            "outcome": _OUTCOMES[result.exit_code],
            "exit_code": result.exit_code,
            "rows": [_plain(row) for row in result.rows],
        }
        return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    if form == "csv":
        plain = [_plain(row) for row in result.rows]
        return Table.of(map(Column, plain[0]), (row.values() for row in plain)).to_csv().rstrip("\n")
    columns = [Column("detector", "left"), Column("runs differ", "left"), Column("margins", "left")]
    columns += [Column(title) for title in ("called worse", "of", "rate %", "95 %", "at most %")]
    table = Table.of(columns, map(_cells, result.rows))
    head = f"Null comparisons of identical code, {result.version}, over {result.scenes} scenes drawn with replacement"
    how = (
        "Called worse: false alarms; 95 %: Wilson's interval of the rate over random deals of the runs of each scene; "
        f"at most: half of the level {result.level:g} for each detector whose runs differ. Margins none: the test "
        "alone."
    )
    outcome = _OUTCOMES[result.exit_code]
    if form == "md":
        return "\n".join([f"### Self-test of the gate: {outcome}", "", f"{head}.", "", table.to_markdown(), "", how])
    return "\n".join([head, table.to_text(), how, f"Self-test {outcome}"])


def _plain(row: FalseAlarms) -> dict[str, Any]:
    low, high = row.interval
    return {
        "detector": row.detector,
        "runs_differ": row.differ,
        "margins": row.margins,
        "alarms": row.alarms,
        "comparisons": row.comparisons,
        "rate": row.rate,
        "low": low,
        "high": high,
        "bound": row.bound,
    }


def _cells(row: FalseAlarms) -> list[str]:
    return [
        row.detector,
        "yes" if row.differ else "no",
        row.margins,
        str(row.alarms),
        str(row.comparisons),
        number_text(row.rate, "fraction", fine=True),
        interval_text(*row.interval, "fraction", fine=True),
        number_text(row.bound, "fraction", fine=True),
    ]
