"""One evaluation as text: table for people, Markdown, CSV and JSON.

Fractions are printed as percent; an undefined index (0/0) as a dash in tables and as an empty field in CSV.
"""

from __future__ import annotations

import csv
import io
import json

from ..evaluators.base import Evaluation, Index

__all__ = ["FORMATS", "described", "format_evaluation", "format_value"]

FORMATS = ("table", "json", "csv", "md")


def format_value(value: float | None, unit: str) -> str:
    """Return a value with its unit: ``93.1 %``, ``1.92 m``; a dash where it is undefined."""
    if value is None:
        return "–"
    if unit == "fraction":
        return f"{100 * value:.2f} %"
    if unit == "count":
        return f"{value:,.0f}"
    return f"{value:.3f} {unit}".removesuffix(" ratio")


def format_evaluation(evaluation: Evaluation, form: str, *, title: str = "") -> str:
    """Return the evaluation as ``table``, ``json``, ``csv`` or ``md`` (Markdown)."""
    if form == "json":
        return json.dumps(evaluation.to_dict(), indent=2, ensure_ascii=False, allow_nan=False)
    indices = evaluation.evaluator.indices
    if form == "csv":
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["key", "index", "symbol", "value", "unit"])
        for index in indices:
            value = evaluation.values[index.key]
            writer.writerow([index.key, index.title, index.symbol, "" if value is None else repr(value), index.unit])
        return text.getvalue().rstrip("\n")
    markdown = form == "md"
    lines = [f"### {title}" if markdown else title] if title else []
    lines += [_counts_line(evaluation), "", described(evaluation), ""]
    lines += _table([index for index in indices if index.main], evaluation, markdown)
    variants = [index for index in indices if not index.main and evaluation.values[index.key] is not None]
    if variants:
        lines += ["", "Variants", ""]
        lines += _table(variants, evaluation, markdown)
    lines += [""] if evaluation.notes else []
    lines += [f"{'- ' if markdown else 'Note: '}{note}" for note in evaluation.notes]
    return "\n".join(lines)


def described(evaluation: Evaluation) -> str:
    """Return the evaluator and its parameters in words: ``threshold-free: matching nearest, area exact``."""
    how = ", ".join(f"{name} {value}" for name, value in evaluation.evaluator.values().items() if value)
    return f"{evaluation.evaluator.name}: {how}" if how else evaluation.evaluator.name


def _counts_line(evaluation: Evaluation) -> str:
    """Return the objects behind the figures."""
    counts = {key: int(value) for key, value in evaluation.tallies.items() if key.startswith("counts.")}
    return " · ".join(f"{value:,} {key.removeprefix('counts.').replace('_', ' ')}" for key, value in counts.items())


def _table(indices: list[Index], evaluation: Evaluation, markdown: bool) -> list[str]:
    rows = [(index.title, index.symbol, format_value(evaluation.values[index.key], index.unit)) for index in indices]
    heads = ("index", "symbol", "value")
    widths = [max(len(row[column]) for row in [heads, *rows]) for column in range(3)]
    cells = [[heads[0].ljust(widths[0]), heads[1].ljust(widths[1]), heads[2].rjust(widths[2])]]
    cells += [[row[0].ljust(widths[0]), row[1].ljust(widths[1]), row[2].rjust(widths[2])] for row in rows]
    rule = ["-" * widths[0], "-" * widths[1], "-" * (widths[2] - 1) + (":" if markdown else "-")]
    cells.insert(1, rule)
    if markdown:
        return [f"| {' | '.join(row)} |" for row in cells]
    return ["  ".join(row).rstrip() for row in cells]
