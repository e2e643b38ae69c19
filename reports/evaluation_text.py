"""One evaluation as text: table for people, Markdown, CSV and JSON.

Fractions are printed as percent; an undefined index (0/0) as a dash in tables and as an empty field in CSV.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from ..core.wording import counted
from ..evaluators.base import Evaluation, Index
from .format import interval_text, value_text
from .tables import Column, Table, escaped_markdown

if TYPE_CHECKING:  # an evaluation without intervals must not wait for sparse matrices
    from ..evaluators.uncertainty.summary import Uncertainty

__all__ = ["described", "evaluation_table", "format_evaluation", "format_evaluations"]


Form: TypeAlias = Literal["table", "json", "csv", "md"]

_DATA = ("key", "index", "symbol", "value", "unit")


def format_evaluation(
    evaluation: Evaluation, form: Form, *, title: str = "", uncertainty: Uncertainty | None = None
) -> str:
    """Return the evaluation as ``table``, ``json``, ``csv`` or ``md`` (Markdown)."""
    if form == "json":
        return json.dumps(_content(evaluation, uncertainty), indent=2, ensure_ascii=False, allow_nan=False)
    indices = evaluation.evaluator.indices
    if form == "csv":
        columns = map(Column, (*_DATA, *_doubt_names(uncertainty)))
        return Table.of(columns, _data(evaluation, uncertainty)).to_csv().rstrip("\n")
    markdown = form == "md"

    def written(chosen: Iterable[Index]) -> str:
        table = evaluation_table(evaluation, chosen, uncertainty)
        return table.to_markdown() if markdown else table.to_text()

    lines = [f"### {escaped_markdown(title)}" if markdown else title] if title else []
    lines += [_counts_line(evaluation), "", described(evaluation), ""]
    lines.append(written(index for index in indices if index.main))
    variants = [index for index in indices if not index.main and evaluation.values[index.key] is not None]
    if variants:
        lines += ["", "Variants", "", written(variants)]
    notes = [*evaluation.notes, *_doubt_notes(uncertainty)]
    lines += [""] if notes else []
    lines += [f"- {escaped_markdown(note)}" if markdown else f"Note: {note}" for note in notes]
    return "\n".join(lines)


def format_evaluations(
    evaluations: Sequence[Evaluation],
    form: Form,
    *,
    title: str = "",
    uncertainties: Sequence[Uncertainty | None] = (),
) -> str:
    """Return several evaluations of the same footprints below each other: one table of their main indices."""
    pairs = list(zip(evaluations, uncertainties or [None] * len(evaluations), strict=True))
    first = pairs[0][1] if pairs else None
    if form == "json":
        content = {evaluation.evaluator.name: _content(evaluation, doubt) for evaluation, doubt in pairs}
        return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    if form == "csv":
        data = ((one.evaluator.name, *row) for one, doubt in pairs for row in _data(one, doubt))
        heads = map(Column, ("evaluator", *_DATA, *_doubt_names(first)))
        return Table.of(heads, data).to_csv().rstrip("\n")
    rows: list[tuple[str | int | float | None, ...]] = []
    for evaluation, doubt in pairs:
        main = [index for index in evaluation.evaluator.indices if index.main]
        for place, row in enumerate(evaluation_table(evaluation, main, doubt).rows):
            rows.append(("" if place else evaluation.evaluator.name, *row))
    table = Table.of((Column("evaluator", "left"), *_columns(first)), rows)
    markdown = form == "md"
    lines = [f"### {escaped_markdown(title)}" if markdown else title, ""] if title else []
    lines += [table.to_markdown() if markdown else table.to_text(), ""]
    notes = dict.fromkeys(note for evaluation in evaluations for note in evaluation.notes)
    notes |= dict.fromkeys(_doubt_notes(first))
    return "\n".join([*lines, *(f"- {escaped_markdown(note)}" if markdown else f"Note: {note}" for note in notes)])


def evaluation_table(evaluation: Evaluation, indices: Iterable[Index], uncertainty: Uncertainty | None = None) -> Table:
    """Return one row per index: title, symbol and value with its unit, then its uncertainty where there is one."""
    return Table.of(
        _columns(uncertainty),
        (
            (
                i.title,
                i.symbol,
                value_text(evaluation.values[i.key], i.unit, fine=True),
                *_doubts_in_words(i, uncertainty),
            )
            for i in indices
        ),
    )


def _columns(uncertainty: Uncertainty | None) -> list[Column]:
    columns = [Column("index", "left"), Column("symbol", "left"), Column("value")]
    if uncertainty and uncertainty.intervals:
        columns.append(Column(f"{uncertainty.intervals.level:g} %"))
    if uncertainty and uncertainty.redraws:
        columns.append(Column(f"reference ±{uncertainty.redraws.error:g} m"))
    return columns


def _doubts_in_words(index: Index, uncertainty: Uncertainty | None) -> list[str]:
    cells = []
    if uncertainty and uncertainty.intervals:
        low, high = uncertainty.intervals.ends[index.key] or (None, None)
        cells.append(interval_text(low, high, index.unit, fine=True))
    if uncertainty and uncertainty.redraws:
        change = uncertainty.redraws.changes[index.key]
        cells.append("" if change is None else f"±{value_text(change, index.unit, fine=True)}")
    return cells


def _doubt_names(uncertainty: Uncertainty | None) -> list[str]:
    names = ["low", "high"] if uncertainty and uncertainty.intervals else []
    return [*names, "reference_change"] if uncertainty and uncertainty.redraws else names


def _data(evaluation: Evaluation, uncertainty: Uncertainty | None) -> Iterator[tuple[str | float | None, ...]]:
    """Yield one row of numbers per index."""
    for index in evaluation.evaluator.indices:
        doubts: list[float | None] = []
        if uncertainty and uncertainty.intervals:
            doubts += uncertainty.intervals.ends[index.key] or (None, None)
        if uncertainty and uncertainty.redraws:
            doubts.append(uncertainty.redraws.changes[index.key])
        yield index.key, index.title, index.symbol, evaluation.values[index.key], index.unit, *doubts


def _content(evaluation: Evaluation, uncertainty: Uncertainty | None) -> dict[str, Any]:
    content = evaluation.to_dict()
    if uncertainty is not None:
        content["uncertainty"] = uncertainty.to_dict()
    return content


def _doubt_notes(uncertainty: Uncertainty | None) -> Iterator[str]:
    """Yield how intervals and changes were found, in words."""
    if uncertainty and uncertainty.intervals:
        found = uncertainty.intervals
        if found.blocks < 2:
            yield "no intervals: they need two connected groups of footprints or more"
        else:
            yield (
                f"{found.level:g} % intervals: bootstrap of {counted(found.blocks, 'block')} of "
                f"{counted(found.groups, 'connected group')}, {counted(found.resamples, 'resample')}"
            )
    if uncertainty and uncertainty.redraws:
        redrawn = uncertainty.redraws
        yield (
            f"reference ±{redrawn.error:g} m: the change that 95 % of {counted(redrawn.redraws, 'redraw')} of the "
            "reference do not exceed; a smaller difference between two detections is not reliable"
        )


def described(evaluation: Evaluation) -> str:
    """Return the evaluator and its parameters in words: ``NAME: matching nearest, area exact``."""
    how = ", ".join(f"{name} {value}" for name, value in evaluation.evaluator.values().items() if value)
    return f"{evaluation.evaluator.name}: {how}" if how else evaluation.evaluator.name


def _counts_line(evaluation: Evaluation) -> str:
    """Return the objects behind the figures."""
    counts = {key: value for key, value in evaluation.tallies.to_dict().items() if key.startswith("counts.")}
    return " · ".join(_count(value, key.removeprefix("counts.").replace("_", " ")) for key, value in counts.items())


def _count(value: int, nouns: str) -> str:
    return counted(value, nouns.removesuffix("s"), nouns)
