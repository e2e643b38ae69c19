"""Two detections of one place, paired, as text: table for people, Markdown, CSV and JSON."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Literal, TypeAlias

from ..core.wording import counted
from ..evaluators.uncertainty.paired import Difference, Fate, PairedComparison
from .evaluation_text import described
from .format import column_title, interval_text, number_text, value_text
from .tables import Column, Table, escaped_markdown

__all__ = ["FATE_WORDS", "Form", "differences_table", "fates_table", "format_pair", "objects_line"]

Form: TypeAlias = Literal["table", "json", "csv", "md"]

#: What happens to a reference, in the words of tables and legends.
FATE_WORDS: dict[Fate, str] = {
    "both": "found by both",
    "only A": "only A finds it",
    "only B": "only B finds it",
    "neither": "found by neither",
    "left out": "left out",
}


def format_pair(found: PairedComparison, form: Form, *, names: tuple[str, str, str]) -> str:
    """Return the comparison as ``table``, ``json``, ``csv`` or ``md`` (Markdown).

    Parameters
    ----------
    found : PairedComparison
    form : {"table", "json", "csv", "md"}
    names : tuple of str
        Of A, of B and of the reference.
    """
    if form == "json":
        content = {**dict(zip(("a", "b", "reference"), names, strict=True)), **found.to_dict()}
        return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    if form == "csv":
        heads = ["key", "index", "a", "b", "difference", "low", "high", "conclusion"]
        changes = {} if found.redrawn is None else found.redrawn.changes
        heads += ["redrawn"] if changes else []
        rows = (
            (d.index.key, d.index.title, d.first, d.second, d.difference, *(d.ends or (None, None)), d.conclusion)
            + ((changes[d.index.key],) if changes else ())
            for d in found.differences
        )
        return Table.of(map(Column, heads), rows).to_csv().rstrip("\n")
    markdown = form == "md"

    def written(table: Table) -> str:
        return table.to_markdown() if markdown else table.to_text()

    sources = [f"{letter}: {name}" for letter, name in zip(("A", "B", "reference"), names, strict=True)]
    lines = [", ".join(escaped_markdown(head) if markdown else head for head in sources), described(found.first), ""]
    if found.objects:
        lines += [written(fates_table(found)), "", objects_line(found), ""]
    main = [difference for difference in found.differences if difference.index.main]
    lines += [written(differences_table(found, main)), "", *_notes(found, markdown=markdown)]
    return "\n".join(lines)


def objects_line(found: PairedComparison) -> str:
    """Return what McNemar's test says, in words."""
    if found.p_value is None:
        return found.conclusion
    return (
        f"McNemar's exact test of the objects found by only one of the two: p = {found.p_value:.2g}, {found.conclusion}"
    )


def fates_table(found: PairedComparison) -> Table:
    """Return how many references both find, only one, or neither."""
    total = sum(number for fate, number in found.objects.items() if fate != "left out")
    rows = []
    for fate, number in found.objects.items():
        if fate != "left out":
            rows.append((FATE_WORDS[fate], f"{number:,}", value_text(number / total if total else None, "fraction")))
        elif number:
            rows.append((FATE_WORDS[fate], f"{number:,}", ""))
    return Table.of((Column("references", "left"), Column("number"), Column("share")), rows)


def differences_table(found: PairedComparison, chosen: Iterable[Difference]) -> Table:
    """Return the value of each index in A and in B, and the difference with its interval."""
    columns = [
        Column("index", "left"),
        *(Column(title) for title in ("A", "B", "B − A", f"{found.level:g} %")),
        *([] if found.redrawn is None else [Column(f"redrawn ±{found.redrawn.error:g} m")]),
        Column("conclusion", "left"),
    ]
    rows = []
    for one in chosen:
        unit = one.index.unit
        low, high = one.ends or (None, None)
        rows.append(
            (
                column_title(one.index, words=True),
                *(number_text(value, unit, fine=True) for value in (one.first, one.second)),
                number_text(one.difference, unit, fine=True, signed=True),
                interval_text(low, high, unit, fine=True, signed=True),
                *(
                    []
                    if found.redrawn is None
                    else [number_text(found.redrawn.changes[one.index.key], unit, fine=True)]
                ),
                one.conclusion,
            )
        )
    return Table.of(columns, rows)


def _notes(found: PairedComparison, *, markdown: bool) -> list[str]:
    how = (
        f"{found.level:g} % intervals of B − A: paired bootstrap of {counted(found.blocks, 'block')} of "
        f"{counted(found.groups, 'connected group')}, {counted(found.resamples, 'resample')}"
        if found.blocks > 1
        else "no intervals: they need two connected groups of footprints or more"
    )
    redrawn = (
        ()
        if found.redrawn is None
        else (
            f"redrawn: 95 % of {found.redrawn.redraws} redraws of the reference, its corners moved by "
            f"±{found.redrawn.error:g} m, change the difference by no more than this; "
            "a smaller difference is not reliable",
        )
    )
    evaluations = (("A", found.first), ("B", found.second))
    notes = [how, *redrawn, *(f"{name}: {note}" for name, evaluation in evaluations for note in evaluation.notes)]
    return [f"- {escaped_markdown(note)}" if markdown else f"Note: {note}" for note in notes]
