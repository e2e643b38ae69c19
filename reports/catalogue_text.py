"""The catalogue as text: a table of each kind, and a page for one entry."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill

from ..benchmark.catalogue import Entry
from ..core.parameter_rules import Parameter, parameter_text
from .tables import Column, Table

__all__ = ["catalogue_table", "format_entries", "format_entry"]

#: Facts that the page of an entry shows and the table of its kind does not.
_LONG = ("source", "evaluators", "paper", "range")


def catalogue_table(entries: Sequence[Entry]) -> Table:
    """Return one row for each entry: name, facts, meaning."""
    titles = dict.fromkeys(title for entry in entries for title in entry.facts if title not in _LONG)
    columns = [Column("name", "left"), *(Column(title, "left") for title in titles), Column("meaning", "left")]
    rows = [[entry.name, *(entry.facts.get(title, "") for title in titles), entry.meaning] for entry in entries]
    return Table.of(columns, rows)


def format_entries(entries: Sequence[Entry], width: int) -> str:
    """Return a line for each entry with all facts where `width` has room, else its whole meaning beside or below it."""
    text = catalogue_table(entries).to_text()
    if max(map(len, text.splitlines())) <= width:
        return text
    longest = max(len(entry.name) for entry in entries)
    if 2 * longest > width:
        return "\n".join(f"{entry.name}\n{_indented(entry.meaning, width)}" for entry in entries)
    return "\n".join(
        fill(f"{entry.name:<{longest}}  {entry.meaning}", width, subsequent_indent=" " * (longest + 2))
        for entry in entries
    )


def format_entry(entry: Entry, width: int = 80) -> str:
    """Return everything that is known of an entry, in lines of at most `width` where words allow it."""
    kind = "index" if entry.kind == "indices" else entry.kind.removesuffix("s")
    parts = [f"{entry.name} ({kind})"]
    parts += [_filled(paragraph, width) for paragraph in (entry.description or entry.meaning).split("\n\n")]
    facts = {title: value for title, value in entry.facts.items() if value}
    if facts:
        longest = max(map(len, facts))
        parts.append("\n".join(f"{title:<{longest}}  {value}" for title, value in facts.items()))
    readings = tuple(rule for rule in entry.parameters if rule.is_reading)
    others = tuple(rule for rule in entry.parameters if not rule.is_reading)
    groups = (("Parameters", others), ("Readings of what the source leaves open", readings))
    for title, rules in (*groups, ("Execution options", entry.options)):
        if rules:
            parts.append("\n".join([title, *(_parameter(rule, width) for rule in rules)]))
    if entry.indices:
        lines = (
            f"  {index.key} ({index.symbol or index.title}), {index.unit}\n{_indented(index.meaning, width)}"
            for index in entry.indices
        )
        parts.append("\n".join(["Indices", *lines]))
    if entry.example:
        parts.append(f"Example: {entry.example}")
    return "\n\n".join(parts)


def _parameter(rule: Parameter, width: int) -> str:
    default = "none" if rule.default is None else f"{parameter_text(rule.default)} {rule.unit}".rstrip()
    lines = [f"  {rule.name} [{default}], {rule.range_text}", _indented(rule.doc, width)]
    if rule.source:
        lines.append(_indented(f"Source: {rule.source}", width))
    return "\n".join(lines)


def _indented(text: str, width: int) -> str:
    return fill(text, width, initial_indent=" " * 6, subsequent_indent=" " * 6)


def _filled(paragraph: str, width: int) -> str:
    """Return a paragraph filled to the width; lists and headings of a docstring keep their lines."""
    lines = paragraph.splitlines()
    kept = any(line[:1] in (" ", "-", "*", "=") for line in lines)
    return paragraph if kept else fill(" ".join(lines), width)
