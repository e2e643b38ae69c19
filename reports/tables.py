"""One table type, and its writers: text for terminals, Markdown, CSV, JSON and HTML.

A *table* has columns and rows of values. A value is text, a number or None, which is an empty cell (``null`` in JSON).
Tables for people hold numbers that `format` has turned into text; tables for programs hold the numbers themselves.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from .format import cell_width, one_line, shortened

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Column", "Table", "escaped_markdown", "inert_cell"]

Value: TypeAlias = str | int | float | None

#: First characters of texts that spreadsheets take for formulas.
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
#: Characters between the columns of a text table, and the least width to which a long column is cut.
_GAP, _LEAST = 2, 16


def inert_cell(text: str) -> str:
    """Return text for CSV; an apostrophe precedes what a spreadsheet would take for a formula.

    >>> inert_cell("=1+1"), inert_cell("a=b")
    ("'=1+1", 'a=b')
    """
    return f"'{text}" if text.startswith(_FORMULA) else text


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes
    ----------
    title : str
    align : {"left", "right"}
    fixed : bool
        Repeated in every part when a text table is split to fit a terminal.
    head : tuple of str
        The title on several lines, for text tables; the title itself where it is empty.
    """

    title: str
    align: Literal["left", "right"] = "right"
    fixed: bool = False
    head: tuple[str, ...] = ()

    @property
    def lines(self) -> tuple[str, ...]:
        """The title as lines of a text table."""
        return self.head or (self.title,)


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

        The fixed columns are repeated in each of these; a left-aligned one that leaves no room for others is cut.
        """
        cells = [_one_line(column) for column in self._cells()]
        widths = self._widths(cells)
        fixed = [place for place, column in enumerate(self.columns) if column.fixed]
        free = [place for place, column in enumerate(self.columns) if not column.fixed]
        parts = [free]
        if width is not None:
            self._cut(cells, fixed, free, width)
            widths = self._widths(cells)
            parts = [[]]
            for place in free:
                if parts[-1] and _total(widths, [*fixed, *parts[-1], place]) > width:
                    parts.append([])
                parts[-1].append(place)
        return "\n".join(line for part in parts for line in self._lines(cells, widths, [*fixed, *part]))

    def _lines(self, cells: list[list[str]], widths: Sequence[int], places: Sequence[int]) -> Iterator[str]:
        height = max(len(self.columns[p].lines) for p in places)
        heads = {p: [*[""] * (height - len(self.columns[p].lines)), *self.columns[p].lines] for p in places}
        columns = [[*heads[p], "─" * widths[p], *cells[p]] for p in places]
        aligns = [self.columns[p].align for p in places]
        if all("".join(cells[p]).isascii() for p in places):
            # One template for a line: the text of 100 000 lines should appear at once.
            parts = (
                f"{{:{'<' if align == 'left' else '>'}{widths[p]}}}" for p, align in zip(places, aligns, strict=True)
            )
            line = (" " * _GAP).join(parts).format
            yield from (line(*row).rstrip() for row in zip(*columns, strict=True))
            return
        padded = [_padded(c, widths[p], align) for c, p, align in zip(columns, places, aligns, strict=True)]
        yield from (line.rstrip() for line in map((" " * _GAP).join, zip(*padded, strict=True)))

    def _cells(self) -> list[list[str]]:
        """Return the text of the cells, column by column."""
        if not self.rows:
            return [[] for _ in self.columns]
        return [
            ["" if value is None else value if type(value) is str else str(value) for value in column]
            for column in zip(*self.rows, strict=True)
        ]

    def _widths(self, cells: Sequence[Sequence[str]]) -> list[int]:
        return [_width([*column.lines, *texts]) for column, texts in zip(self.columns, cells, strict=True)]

    def _cut(self, cells: list[list[str]], fixed: Sequence[int], free: Sequence[int], width: int) -> None:
        """Shorten cells of left-aligned columns in place, the widest first, until the fixed ones and any other fit."""
        widths = self._widths(cells)
        others = max((widths[place] for place in free), default=0)
        long = sorted((p for p, c in enumerate(self.columns) if c.align == "left"), key=lambda place: -widths[place])
        for place in long:
            excess = _total(widths, [*fixed, *([] if place in fixed else [place])]) - width
            excess += others + _GAP if place in fixed and free else 0
            limit = max(_LEAST, widths[place] - excess)
            if excess > 0 and limit < widths[place]:
                cells[place] = [shortened(text, limit) for text in cells[place]]
                widths = self._widths(cells)

    def to_markdown(self) -> str:
        """Return a Markdown table; what would be markup in a cell is escaped."""
        columns = []
        for column, texts in zip(self.columns, self._cells(), strict=True):
            cells = [escaped_markdown(text) for text in (column.title, *texts)]
            width = max(3, _width(cells))
            rule = f":{'-' * (width - 1)}" if column.align == "left" else f"{'-' * (width - 1)}:"
            head, *body = _padded(cells, width, column.align)
            columns.append([head, rule, *body])
        return "\n".join(f"| {' | '.join(line)} |" for line in zip(*columns, strict=True))

    def to_csv(self, *, header: bool = True) -> str:
        """Return CSV, with a header unless it continues another table; numbers as Python writes them.

        Undefined values are empty. Texts that a spreadsheet would compute begin with an apostrophe (`inert_cell`).
        """
        text = io.StringIO()
        # With this line end the writer quotes texts that hold "\r", too; lines end in "\n" all the same.
        writer = csv.writer(text, lineterminator="\r\n")
        rows = [[column.title for column in self.columns], *self.rows] if header else self.rows
        lines = []
        for row in rows:
            text.seek(0)
            text.truncate()
            writer.writerow([inert_cell(value) if isinstance(value, str) else value for value in row])
            lines.append(text.getvalue().removesuffix("\r\n") + "\n")
        return "".join(lines)

    def to_json(self) -> str:
        """Return a JSON list with one object per row."""
        return json.dumps(self.to_records(), indent=2, ensure_ascii=False, allow_nan=False)

    def to_records(self) -> list[dict[str, Any]]:
        """Return one mapping of column title to value per row."""
        titles = [column.title for column in self.columns]
        return [dict(zip(titles, row, strict=True)) for row in self.rows]

    def to_frame(self) -> pd.DataFrame:
        """Return a pandas data frame with a column for each column."""
        import pandas as pd

        return pd.DataFrame(self.rows, columns=[column.title for column in self.columns])

    def to_html(self) -> str:
        """Return an HTML table for notebooks; everything in it is escaped."""
        import html

        def line(tag: str, texts: Iterable[str]) -> str:
            wraps = "; white-space: nowrap" if tag == "td" else ""  # a number is not separated from its unit
            cells = zip(texts, self.columns, strict=True)
            return "".join(
                f'<{tag} style="text-align: {c.align}{wraps if c.align == "right" else ""}">{html.escape(text)}</{tag}>'
                for text, c in cells
            )

        head = line("th", (column.title for column in self.columns))
        rows = zip(*self._cells(), strict=True)
        body = "".join(f"<tr>{line('td', row)}</tr>" for row in rows)
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def escaped_markdown(text: str) -> str:
    r"""Return text on one line with everything escaped that Markdown would take for markup.

    >>> print(escaped_markdown("a|b <i>*x*</i>"))
    a\|b &lt;i&gt;\*x\*&lt;/i&gt;
    """
    for character in "\\|*[]`":
        text = text.replace(character, f"\\{character}")
    return one_line(text.replace("<", "&lt;").replace(">", "&gt;"))


def _one_line(texts: list[str]) -> list[str]:
    return texts if "".join(texts).isprintable() else [one_line(text) for text in texts]


def _width(texts: Sequence[str]) -> int:
    return max(map(len if "".join(texts).isascii() else cell_width, texts), default=0)


def _padded(texts: Sequence[str], width: int, align: str) -> list[str]:
    spaces = [" " * (width - cell_width(text)) for text in texts]
    return [text + space if align == "left" else space + text for text, space in zip(texts, spaces, strict=True)]


def _total(widths: Sequence[int], places: Sequence[int]) -> int:
    return sum(widths[place] + _GAP for place in places) - _GAP
