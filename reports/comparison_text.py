"""Two results stores compared, as text for terminals, Markdown and CSV."""

from __future__ import annotations

from typing import Literal

from ..benchmark.analysis.results import ComparedRow, StoreComparison
from .format import column_title, interval_text, number_text, shortened
from .tables import Column, Table, escaped_markdown

__all__ = ["format_comparison"]

_DATA = ("detector", "index", "a", "b", "difference", "low", "high", "scenes", "conclusion")


def format_comparison(result: StoreComparison, form: Literal["table", "md", "csv"]) -> str:
    """Return the comparison as text; CSV has fractions and metres, the others percent."""
    if form == "csv":
        data = (
            (r.detector, r.index.key, r.first, r.second, r.difference, r.low, r.high, r.scenes, r.conclusion)
            for r in result.rows
        )
        return Table.of(map(Column, _DATA), data).to_csv().rstrip("\n")
    columns = [
        *(Column(title, "left") for title in ("detector", "index")),
        *(Column(title) for title in ("A", "B", "B − A", "95 %", "scenes")),
        Column("conclusion", "left"),
    ]
    table = Table.of(columns, map(_cells, result.rows))
    head = f"A: {result.first}, B: {result.second}; {result.evaluator}; means over the scenes of both, paired."
    notes = [f"- {escaped_markdown(note)}" if form == "md" else note for note in result.notes]
    body = table.to_markdown() if form == "md" else table.to_text()
    return "\n".join([head, "", body, *([""] if notes else []), *notes])


def _cells(row: ComparedRow) -> list[str]:
    unit = row.index.unit
    return [
        shortened(row.detector, 60),
        column_title(row.index, words=True),
        number_text(row.first, unit),
        number_text(row.second, unit),
        number_text(row.difference, unit, signed=True),
        interval_text(row.low, row.high, unit, signed=True),
        str(row.scenes),
        row.conclusion,
    ]
