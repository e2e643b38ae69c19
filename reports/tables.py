"""One table type, and its writers: text for terminals, Markdown, CSV, JSON and HTML.

A *table* has columns and rows of values. A value is text, a number or None, which is an empty cell (``null`` in JSON).
Tables for people hold numbers that `format` has turned into text; tables for programs hold the numbers themselves.
"""

from __future__ import annotations

import csv
import html
import io
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from .format import cell_width, one_line, shortened

__all__ = ["Column", "Table", "escaped_markdown"]

Value: TypeAlias = str | int | float | None

#: Characters between the columns of a text table, and the least width to which a long column is cut.
_GAP, _LEAST = 2, 16


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes
    ----------
    title : str
    align : {"left", "right"}
    fixed : bool
        Repeated in every part when a text table is split to fit a terminal.
    """

    title: str
    align: Literal["left", "right"] = "right"
    fixed: bool = False


@dataclass(frozen=True)
class Table:
    """Columns, and rows with one value per column.

    Examples
    --------
    >>> table = Table((Column("detector", "left"), Column("Q_l %")), (("ndsm", "49.2"), ("mpp", None)))
    >>> print(table.to_text())
    detector  Q_l %
    ────────  ─────
    ndsm       49.2
    mpp
    >>> print(table.to_markdown())
    | detector | Q_l % |
    | :------- | ----: |
    | ndsm     |  49.2 |
    | mpp      |       |
    """

    columns: tuple[Column, ...]
    rows: tuple[tuple[Value, ...], ...]

    @classmethod
    def of(cls, columns: Iterable[Column], rows: Iterable[Iterable[Value]]) -> Table:
        """Return a table of any iterables."""
        return cls(tuple(columns), tuple(tuple(row) for row in rows))

    def to_text(self, width: int | None = None) -> str:
        """Return aligned columns; where they are wider than `width`, several tables below each other.

        The fixed columns stand in each of these; a left-aligned one that leaves no room for others is cut.
        """
        cells = [[one_line(_text(value)) for value in row] for row in self.rows]
        widths = [
            max([cell_width(column.title), *(cell_width(row[place]) for row in cells)])
            for place, column in enumerate(self.columns)
        ]
        fixed = [place for place, column in enumerate(self.columns) if column.fixed]
        free = [place for place, column in enumerate(self.columns) if not column.fixed]
        parts = [free]
        if width is not None:
            self._cut(cells, widths, fixed, free, width)
            parts = [[]]
            for place in free:
                if parts[-1] and _total(widths, [*fixed, *parts[-1], place]) > width:
                    parts.append([])
                parts[-1].append(place)
        return "\n".join(self._part(cells, widths, [*fixed, *part]) for part in parts)

    def _cut(
        self, cells: list[list[str]], widths: list[int], fixed: Sequence[int], free: Sequence[int], width: int
    ) -> None:
        """Shorten left-aligned columns, the widest first, until the fixed ones and any other fit."""
        others = max((widths[place] for place in free), default=0)
        long = sorted((p for p, c in enumerate(self.columns) if c.align == "left"), key=lambda place: -widths[place])
        for place in long:
            excess = _total(widths, [*fixed, *([] if place in fixed else [place])]) - width
            excess += others + _GAP if place in fixed and free else 0
            limit = max(_LEAST, widths[place] - excess)
            if excess > 0 and limit < widths[place]:
                for row in cells:
                    row[place] = shortened(row[place], limit)
                titled = cell_width(self.columns[place].title)
                widths[place] = max([titled, *(cell_width(row[place]) for row in cells)])

    def _part(self, cells: list[list[str]], widths: Sequence[int], places: Sequence[int]) -> str:
        lines = [[self.columns[place].title for place in places], ["─" * widths[place] for place in places]]
        lines += [[row[place] for place in places] for row in cells]
        aligned = (
            [_padded(cell, widths[place], self.columns[place].align) for cell, place in zip(line, places, strict=True)]
            for line in lines
        )
        return "\n".join((" " * _GAP).join(line).rstrip() for line in aligned)

    def to_markdown(self) -> str:
        """Return a Markdown table; what would be markup in a cell is escaped."""
        lines = [[escaped_markdown(column.title) for column in self.columns]]
        lines += [[escaped_markdown(_text(value)) for value in row] for row in self.rows]
        widths = [max(3, *(cell_width(line[place]) for line in lines)) for place in range(len(self.columns))]
        rule = [f":{'-' * (w - 1)}" if c.align == "left" else f"{'-' * (w - 1)}:" for c, w in self._with(widths)]
        padded = [
            [_padded(cell, width, column.align) for cell, (column, width) in zip(line, self._with(widths), strict=True)]
            for line in lines
        ]
        return "\n".join(f"| {' | '.join(line)} |" for line in [padded[0], rule, *padded[1:]])

    def _with(self, widths: Sequence[int]) -> list[tuple[Column, int]]:
        return list(zip(self.columns, widths, strict=True))

    def to_csv(self) -> str:
        """Return CSV with a header; numbers as Python writes them, empty where undefined."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow([column.title for column in self.columns])
        writer.writerows(self.rows)
        return text.getvalue()

    def to_json(self) -> str:
        """Return a JSON list with one object per row."""
        return json.dumps(self.to_records(), indent=2, ensure_ascii=False, allow_nan=False)

    def to_records(self) -> list[dict[str, Any]]:
        """Return one mapping of column title to value per row."""
        titles = [column.title for column in self.columns]
        return [dict(zip(titles, row, strict=True)) for row in self.rows]

    def to_html(self) -> str:
        """Return an HTML table for notebooks; everything in it is escaped."""

        def line(tag: str, texts: Iterable[str]) -> str:
            cells = zip(texts, self.columns, strict=True)
            return "".join(f'<{tag} style="text-align: {c.align}">{html.escape(text)}</{tag}>' for text, c in cells)

        head = line("th", (column.title for column in self.columns))
        body = "".join(f"<tr>{line('td', map(_text, row))}</tr>" for row in self.rows)
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def escaped_markdown(text: str) -> str:
    r"""Return text on one line with everything escaped that Markdown would take for markup.

    >>> print(escaped_markdown("a|b <i>*x*</i>"))
    a\|b &lt;i&gt;\*x\*&lt;/i&gt;
    """
    for character in "\\|*[]`":
        text = text.replace(character, f"\\{character}")
    return one_line(text.replace("<", "&lt;").replace(">", "&gt;"))


def _text(value: Value) -> str:
    return "" if value is None else str(value)


def _padded(text: str, width: int, align: str) -> str:
    space = " " * (width - cell_width(text))
    return text + space if align == "left" else space + text


def _total(widths: Sequence[int], places: Sequence[int]) -> int:
    return sum(widths[place] + _GAP for place in places) - _GAP
