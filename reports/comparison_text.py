"""Two results stores compared, as people read it: terminal, Markdown, CSV.

A *row* is one index of one detector over the scenes that both stores have: the mean over scenes in A and in B, and
the mean paired difference B minus A with its 95 % bootstrap interval.
"""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from typing import Literal

from ..evaluators.base import Index
from .tables import format_cell

__all__ = ["ComparedRow", "StoreComparison", "format_comparison"]

_HEADER = ("detector", "index", "A", "B", "B − A", "95 %", "scenes", "reading")


@dataclass(frozen=True, kw_only=True)
class ComparedRow:
    """One index of one detector in both stores; `low` and `high` are None for fewer than two scenes."""

    detector: str
    index: Index
    first: float
    second: float
    difference: float
    low: float | None
    high: float | None
    scenes: int

    @property
    def reading(self) -> str:
        """What the interval says: ``same`` to the last bit, ``unclear`` when it holds zero, else better or worse."""
        if self.difference == 0 and (self.low, self.high) in ((0, 0), (None, None)):
            return "same"
        if self.low is None or self.high is None or self.low <= 0 <= self.high:
            return "unclear"
        if self.index.better == "neither":
            return "different"
        return "better" if (self.difference > 0) == (self.index.better == "higher") else "worse"


@dataclass(frozen=True, kw_only=True)
class StoreComparison:
    """All rows, the names of the stores, and what could not be compared, in words."""

    first: str
    second: str
    evaluator: str
    rows: tuple[ComparedRow, ...]
    notes: tuple[str, ...]


def format_comparison(result: StoreComparison, form: Literal["table", "md", "csv"]) -> str:
    """Return the comparison as text; CSV has fractions and metres, the others percent."""
    if form == "csv":
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["detector", "index", "a", "b", "difference", "low", "high", "scenes", "reading"])
        for row in result.rows:
            numbers = (row.first, row.second, row.difference, row.low, row.high)
            writer.writerow([row.detector, row.index.key, *numbers, row.scenes, row.reading])
        return text.getvalue().rstrip("\n")
    from tabulate import tabulate

    align = ("left", "left", "right", "right", "right", "right", "right", "left")
    rows = [_cells(row) for row in result.rows]
    if form == "md":
        rows = [[cell.replace("\\", "\\\\").replace("|", "\\|").replace("<", "&lt;") for cell in row] for row in rows]
    table = tabulate(
        rows,
        _HEADER,
        tablefmt="pipe" if form == "md" else "simple",
        colalign=align if rows else None,
        disable_numparse=True,
    )
    head = f"A: {result.first}, B: {result.second}; {result.evaluator}; means over the scenes of both, paired."
    notes = [f"- {note}" if form == "md" else note for note in result.notes]
    return "\n".join([head, "", table, *([""] if notes else []), *notes])


def _cells(row: ComparedRow) -> list[str]:
    unit = row.index.unit

    def signed(value: float) -> str:
        text = format_cell(value, unit)
        return text if text.startswith("-") else f"+{text}"

    interval = "" if row.low is None or row.high is None else f"{signed(row.low)} to {signed(row.high)}"
    shown = {"fraction": " %", "ratio": "", "count": ""}.get(unit, f" {unit}")
    name = " ".join(row.detector.split())
    numbers = (format_cell(row.first, unit), format_cell(row.second, unit), signed(row.difference), interval)
    return [name[:60], f"{row.index.title}{shown}", *numbers, str(row.scenes), row.reading]
