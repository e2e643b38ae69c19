"""Tables: index values as people read them, and the leaderboard for terminals, Markdown and CSV.

A *leaderboard* has one entry per detector and way of pooling: ``pooled`` (counts and areas of all scenes added, then
the ratio) and ``mean`` (mean over scenes of the scenes' values). Fractions are printed in percent. An undefined value
is an empty cell; a mean that leaves scenes out, because the index is undefined there, carries their number as (n).
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ..core.output import whole_file
from ..evaluators.base import Index

if TYPE_CHECKING:
    import pandas as pd
    from rich.console import Console
    from rich.table import Table

__all__ = [
    "Cell",
    "Entry",
    "Incident",
    "Leaderboard",
    "column_title",
    "format_cell",
    "print_incidents",
    "write_leaderboards",
]

_DECIMALS = {"fraction": 1, "ratio": 3, "m": 2, "px": 1, "count": 0}
_UNITS = {"fraction": "%", "ratio": "", "m": "m", "px": "px", "count": ""}


def format_cell(value: float | None, unit: str) -> str:
    """Return a value as printed: fractions in percent, empty where undefined.

    >>> format_cell(0.9283, "fraction"), format_cell(1.234, "m"), format_cell(None, "m")
    ('92.8', '1.23', '')
    """
    if value is None:
        return ""
    return f"{value * 100 if unit == 'fraction' else value:.{_DECIMALS.get(unit, 3)}f}"


def column_title(index: Index) -> str:
    """Return symbol and unit: ``Q_l %``."""
    return f"{index.symbol or index.title} {_UNITS.get(index.unit, index.unit)}".strip()


@dataclass(frozen=True)
class Cell:
    """One index of one entry.

    Attributes
    ----------
    value : float, optional
        None where undefined.
    scenes : int
        Over how many scenes it is.
    low, high : float, optional
        Bootstrap interval over scenes (95 %), where there are enough of them.
    """

    value: float | None
    scenes: int
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One line of a leaderboard.

    Attributes
    ----------
    label, detector : str
        Name with changed parameters, and name alone.
    parameters : mapping
    pooling : {"pooled", "mean"}
    rank : int, optional
        By the leaderboard's index; None for a detector that was not measured on every scene.
    group : str
        Letters shared by detectors that cannot be told apart; empty where that was not tested.
    scenes, runs, failed, skipped : int
        Scenes with a result, and runs by status.
    detected, reference : int
        Objects behind the figures, over all runs.
    cpu_seconds : float, optional
        Median processor time of a run.
    peak_memory : int, optional
        Highest of all runs, bytes.
    cells : mapping of str to Cell
        By index key.
    """

    label: str
    detector: str
    parameters: Mapping[str, Any]
    pooling: Literal["pooled", "mean"]
    rank: int | None
    group: str
    scenes: int
    runs: int
    failed: int
    skipped: int
    detected: int
    reference: int
    cpu_seconds: float | None
    peak_memory: int | None
    cells: Mapping[str, Cell]


@dataclass(frozen=True, kw_only=True)
class Incident:
    """A run that failed or was skipped, with its reason and the command that repeats it."""

    status: str
    label: str
    scene: str
    seed: int
    reason: str
    command: str


@dataclass(frozen=True, kw_only=True)
class Leaderboard:
    """Detectors compared by one evaluator over common scenes.

    Attributes
    ----------
    title : str
    evaluator : str
        Name with the parameters that decide the figures, such as the matching.
    rank_by : Index
    indices : tuple of Index
        The columns.
    entries : tuple of Entry
        Both poolings of every detector, in the order of rank.
    scenes : tuple of str
    notes : tuple of str
    incidents : tuple of Incident
    """

    title: str
    evaluator: str
    rank_by: Index
    indices: tuple[Index, ...]
    entries: tuple[Entry, ...]
    scenes: tuple[str, ...]
    notes: tuple[str, ...] = ()
    incidents: tuple[Incident, ...] = field(default=())

    def caption(self) -> str:
        """Return in words what the figures are of."""
        shown = ", ".join(self.scenes[:4]) + (f" and {len(self.scenes) - 4} more" if len(self.scenes) > 4 else "")
        count = f"{len(self.scenes)} scene{'s' if len(self.scenes) != 1 else ''}"
        return (
            f"{count} ({shown}); {self.evaluator}; ranked by {self.rank_by.title} "
            f"({self.rank_by.symbol}, pooled); pooled: counts added over scenes, then the ratio; mean: mean over "
            "scenes, (n) where it is defined in n of them only; empty: undefined"
        )

    def to_frame(self) -> pd.DataFrame:
        """Return the table as a DataFrame: fractions 0..1, one row per entry, columns as in the CSV file."""
        import pandas as pd

        header, *rows = self._rows()
        return pd.DataFrame(rows, columns=header)

    def to_csv(self) -> str:
        """Return CSV: fractions 0..1, metres; beside each index, over how many scenes it is, and its interval."""
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows(self._rows())
        return text.getvalue()

    def _rows(self) -> list[list[Any]]:
        columns = ["rank", "group", "detector", "parameters", "pooling", "scenes", "runs", "failed", "skipped"]
        columns += ["detected", "reference", "cpu_seconds", "peak_memory"]
        keys = [index.key for index in self.indices]
        rows: list[list[Any]] = [
            [*columns, *keys, *(f"{key}:{part}" for key in keys for part in ("scenes", "low", "high")), "evaluator"]
        ]
        for entry in self.entries:
            parameters = ",".join(f"{name}={value}" for name, value in entry.parameters.items())
            cells = [entry.cells[key] for key in keys]
            rows.append(
                [
                    entry.rank,
                    entry.group,
                    entry.detector,
                    parameters,
                    entry.pooling,
                    entry.scenes,
                    entry.runs,
                    entry.failed,
                    entry.skipped,
                    entry.detected,
                    entry.reference,
                    entry.cpu_seconds,
                    entry.peak_memory,
                    *(cell.value for cell in cells),
                    *(part for cell in cells for part in (cell.scenes, cell.low, cell.high)),
                    self.evaluator,
                ]
            )
        return rows

    def to_markdown(self) -> str:
        """Return a Markdown section: caption, table, notes, failures and skips with their reasons."""
        from tabulate import tabulate

        header, rows = self._printed()
        right = ["left" if name in _LEFT else "right" for name in header]
        escaped = [[_escaped(cell) for cell in row] for row in rows]
        parts = [f"## {_escaped(self.title)}", self.caption() + "."]
        parts.append(
            tabulate(
                escaped, [_escaped(name) for name in header], tablefmt="pipe", colalign=right, disable_numparse=True
            )
        )
        parts += [f"- {_escaped(note)}" for note in self.notes]
        parts += [
            f"- {incident.status}: {_escaped(incident.label)} on {_escaped(incident.scene)}, seed {incident.seed}: "
            f"{_escaped(incident.reason)}. Repeat: `{incident.command}`"
            for incident in self.incidents
        ]
        return "\n\n".join(parts[:3]) + "\n" + "".join(f"\n{part}" for part in parts[3:]) + ("\n" if parts[3:] else "")

    def print(self, console: Console) -> None:
        """Print to a terminal; the columns are spread over as many tables as its width needs."""
        from rich.text import Text

        console.print(Text(self.title, style="bold"))
        for table in self._tables(console.width):
            console.print(table)
        console.print(Text(self.caption() + "."))
        for note in self.notes:
            console.print(Text(note))

    def _tables(self, width: int) -> list[Table]:
        from rich import box
        from rich.table import Table
        from rich.text import Text

        header, rows = self._printed()
        fixed = [i for i, name in enumerate(header) if name in _FIXED]
        free = [i for i, name in enumerate(header) if name not in _FIXED]
        widths = [max([len(name), *(len(row[i]) for row in rows)]) + _GAP for i, name in enumerate(header)]
        chunks: list[list[int]] = [[]]
        for i in free:
            if chunks[-1] and sum(widths[j] for j in (*fixed, *chunks[-1], i)) > width:
                chunks.append([])
            chunks[-1].append(i)
        tables = []
        for chunk in chunks:
            table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0), show_edge=False)
            for i in (*fixed, *chunk):
                justify: Literal["left", "right"] = "left" if header[i] in _LEFT else "right"
                table.add_column(Text(header[i]), justify=justify, no_wrap=True, overflow="ellipsis")
            for row in rows:
                table.add_row(*(Text(row[i]) for i in (*fixed, *chunk)))
            tables.append(table)
        return tables

    def _printed(self) -> tuple[list[str], list[list[str]]]:
        grouped = any(entry.group for entry in self.entries)
        header = ["rank", *(["group"] if grouped else []), "detector", "over", "scenes"]
        header += [column_title(index) for index in self.indices]
        header.append(f"{self.rank_by.symbol or self.rank_by.title} 95 %")
        header += ["objects", "CPU s", "MB"]
        rows = []
        for entry in self.entries:
            scenes = f"{entry.scenes}" if entry.scenes == len(self.scenes) else f"{entry.scenes} of {len(self.scenes)}"
            row = ["-" if entry.rank is None else str(entry.rank), *([entry.group] if grouped else [])]
            row += [entry.label, entry.pooling, scenes]
            for index in self.indices:
                cell = entry.cells[index.key]
                text = format_cell(cell.value, index.unit)
                partial = entry.pooling == "mean" and cell.scenes < entry.scenes
                row.append(f"{text} ({cell.scenes})".strip() if partial else text)
            ranked = entry.cells[self.rank_by.key]
            bounds = [format_cell(bound, self.rank_by.unit) for bound in (ranked.low, ranked.high)]
            row.append("–".join(bounds) if ranked.low is not None else "")
            row.append(f"{entry.detected}/{entry.reference}")
            row.append("" if entry.cpu_seconds is None else f"{entry.cpu_seconds:.2f}")
            row.append("" if not entry.peak_memory else f"{entry.peak_memory / 1e6:.0f}")
            rows.append(row)
        return header, rows


#: Characters between columns of a terminal table.
_GAP = 2
_FIXED = ("rank", "group", "detector", "over", "scenes")
_LEFT = ("group", "detector", "over")


def _escaped(text: str) -> str:
    """Escape what Markdown would take for markup in a table cell."""
    for character in ("\\", "|", "*", "<", ">", "[", "]", "`"):
        text = text.replace(
            character, f"\\{character}" if character not in "<>" else {"<": "&lt;", ">": "&gt;"}[character]
        )
    return " ".join(text.split())


def print_incidents(incidents: Sequence[Incident], console: Console) -> None:
    """Print failures and skips, a reason and a command for each."""
    from rich.text import Text

    for incident in incidents:
        style = "red" if incident.status == "failed" else "yellow"
        console.print(
            Text.assemble(
                (incident.status, style),
                f" {incident.label} on {incident.scene}, seed {incident.seed}: {incident.reason}\n",
                (f"  repeat: {incident.command}", "dim"),
            ),
            soft_wrap=True,
        )


def write_leaderboards(folder: Path, boards: Sequence[Leaderboard]) -> None:
    """Write one CSV and one Markdown file; a further evaluator gets files with its own name."""
    for number, board in enumerate(boards):
        name = "leaderboard" if number == 0 else f"leaderboard-{board.evaluator.partition(' ')[0]}"
        for ending, text in (("csv", board.to_csv()), ("md", board.to_markdown())):
            with whole_file(folder / f"{name}.{ending}", overwrite=True) as scratch:
                scratch.write_text(text, encoding="utf-8")
