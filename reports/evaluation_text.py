"""One evaluation as text: table for people, Markdown, CSV and JSON.

Fractions are printed as percent; an undefined index (0/0) as a dash in tables and as an empty field in CSV.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from typing import Literal

from ..evaluators.base import Evaluation, Index
from .format import value_text
from .tables import Column, Table, escaped_markdown

__all__ = ["described", "evaluation_table", "format_evaluation", "format_evaluations"]


def format_evaluation(evaluation: Evaluation, form: Literal["table", "json", "csv", "md"], *, title: str = "") -> str:
    """Return the evaluation as ``table``, ``json``, ``csv`` or ``md`` (Markdown)."""
    if form == "json":
        return json.dumps(evaluation.to_dict(), indent=2, ensure_ascii=False, allow_nan=False)
    indices = evaluation.evaluator.indices
    if form == "csv":
        data = ((i.key, i.title, i.symbol, evaluation.values[i.key], i.unit) for i in indices)
        columns = map(Column, ("key", "index", "symbol", "value", "unit"))
        return Table.of(columns, data).to_csv().rstrip("\n")
    markdown = form == "md"

    def written(chosen: Iterable[Index]) -> str:
        table = evaluation_table(evaluation, chosen)
        return table.to_markdown() if markdown else table.to_text()

    lines = [f"### {escaped_markdown(title)}" if markdown else title] if title else []
    lines += [_counts_line(evaluation), "", described(evaluation), ""]
    lines.append(written(index for index in indices if index.main))
    variants = [index for index in indices if not index.main and evaluation.values[index.key] is not None]
    if variants:
        lines += ["", "Variants", "", written(variants)]
    lines += [""] if evaluation.notes else []
    lines += [f"- {escaped_markdown(note)}" if markdown else f"Note: {note}" for note in evaluation.notes]
    return "\n".join(lines)


def format_evaluations(
    evaluations: Sequence[Evaluation], form: Literal["table", "json", "csv", "md"], *, title: str = ""
) -> str:
    """Return several evaluations of the same footprints below each other: one table of their main indices."""
    if form == "json":
        content = {evaluation.evaluator.name: evaluation.to_dict() for evaluation in evaluations}
        return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    if form == "csv":
        data = (
            (evaluation.evaluator.name, i.key, i.title, i.symbol, evaluation.values[i.key], i.unit)
            for evaluation in evaluations
            for i in evaluation.evaluator.indices
        )
        heads = map(Column, ("evaluator", "key", "index", "symbol", "value", "unit"))
        return Table.of(heads, data).to_csv().rstrip("\n")
    rows = []
    for evaluation in evaluations:
        main = [index for index in evaluation.evaluator.indices if index.main]
        for place, (name, symbol, value) in enumerate(evaluation_table(evaluation, main).rows):
            rows.append(("" if place else evaluation.evaluator.name, name, symbol, value))
    columns = (Column("evaluator", "left"), Column("index", "left"), Column("symbol", "left"), Column("value"))
    table = Table.of(columns, rows)
    markdown = form == "md"
    lines = [f"### {escaped_markdown(title)}" if markdown else title, ""] if title else []
    lines += [table.to_markdown() if markdown else table.to_text(), ""]
    notes = dict.fromkeys(note for evaluation in evaluations for note in evaluation.notes)
    return "\n".join([*lines, *(f"- {escaped_markdown(note)}" if markdown else f"Note: {note}" for note in notes)])


def evaluation_table(evaluation: Evaluation, indices: Iterable[Index]) -> Table:
    """Return one row per index: title, symbol and value with its unit."""
    return Table.of(
        (Column("index", "left"), Column("symbol", "left"), Column("value")),
        ((i.title, i.symbol, value_text(evaluation.values[i.key], i.unit, fine=True)) for i in indices),
    )


def described(evaluation: Evaluation) -> str:
    """Return the evaluator and its parameters in words: ``NAME: matching nearest, area exact``."""
    how = ", ".join(f"{name} {value}" for name, value in evaluation.evaluator.values().items() if value)
    return f"{evaluation.evaluator.name}: {how}" if how else evaluation.evaluator.name


def _counts_line(evaluation: Evaluation) -> str:
    """Return the objects behind the figures."""
    counts = {key: value for key, value in evaluation.tallies.to_dict().items() if key.startswith("counts.")}
    return " · ".join(f"{value:,} {key.removeprefix('counts.').replace('_', ' ')}" for key, value in counts.items())
