"""Leaderboards as text: for terminals, Markdown files and CSV files.

Two tables for people: the *summary* has one line per detector (pooled over scenes) with the indices that matter most,
and fits a terminal of 80 columns; the *wide* table has every main index, and the mean over scenes beside the pooled
value.

An undefined value is an empty cell. A mean that leaves scenes out, because the index is undefined there, is followed by
the number of its scenes as (n).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from ..benchmark.analysis.results import Entry, Leaderboard, UnsuccessfulRun
from ..core.output import whole_file
from ..core.wording import counted
from .format import column_head, column_title, index_name, interval_text, number_text, unit_text
from .tables import Column, Table, escaped_markdown

if TYPE_CHECKING:
    from rich.console import Console

__all__ = [
    "leaderboard_caption",
    "leaderboard_data",
    "leaderboard_markdown",
    "leaderboard_table",
    "leaderboards_text",
    "print_leaderboard",
    "print_unsuccessful",
    "scene_table",
    "show_leaderboards",
    "summary_caption",
    "summary_table",
    "write_leaderboards",
]

_FACTS = ("rank", "group", "detector", "parameters", "pooling", "scenes", "runs", "failed", "skipped")
#: Scenes of a leaderboard up to which the terminal shows them one by one.
_MOST_SCENES = 12
_COSTS = ("detected", "reference", "cpu_seconds", "peak_memory")


def summary_table(board: Leaderboard) -> Table:
    """Return the table with one line per detector: rank, group, the most important indices, median seconds of a run."""
    grouped = any(entry.group for entry in board.entries)
    spread = _has_intervals(board)
    columns = [
        Column("rank", fixed=True),
        *([Column("group", "left", fixed=True)] if grouped else []),
        Column("detector", "left", fixed=True),
    ]
    for index in board.summary:
        columns.append(Column(column_title(index, words=True), head=column_head(index)))
        if index == board.rank_by and spread:
            columns.append(Column("95 %"))
    columns.append(Column("CPU s", head=("CPU", "s")))
    rows = []
    for entry in board.entries:
        if entry.pooling != "pooled":
            continue
        row = ["-" if entry.rank is None else str(entry.rank), *([entry.group] if grouped else []), entry.label]
        for index in board.summary:
            cell = entry.cells[index.key]
            row.append(number_text(cell.value, index.unit))
            if index == board.rank_by and spread:
                row.append(interval_text(cell.low, cell.high, index.unit, coarse=True))
        rows.append([*row, number_text(entry.cpu_seconds, "s")])
    return Table.of(columns, rows)


def scene_table(board: Leaderboard) -> Table:
    """Return the index that ranks, one line per scene and one column per detector; "-" without a result."""
    labels = list(dict.fromkeys(entry.label for entry in board.entries))
    title = f"{board.rank_by.title} {unit_text(board.rank_by.unit)}".strip()
    columns = [Column(f"{title} on", "left", fixed=True), *(Column(label) for label in labels)]
    rows = [
        [scene, *(number_text(found[label], board.rank_by.unit) if label in found else "-" for label in labels)]
        for scene, found in board.by_scene.items()
    ]
    return Table.of(columns, rows)


def leaderboard_table(board: Leaderboard) -> Table:
    """Return the wide table for people: values with few decimals, fractions in percent."""
    grouped = any(entry.group for entry in board.entries)
    columns = [
        Column("rank", fixed=True),
        *([Column("group", "left", fixed=True)] if grouped else []),
        Column("detector", "left", fixed=True),
        Column("over", "left", fixed=True),
        Column("scenes", fixed=True),
        *(Column(column_title(index)) for index in board.indices),
        Column(f"{board.rank_by.symbol or board.rank_by.title} 95 %"),
        *(Column(title) for title in ("objects", "CPU s", "MB")),
    ]
    return Table.of(columns, (_printed(board, entry, grouped=grouped) for entry in board.entries))


def _printed(board: Leaderboard, entry: Entry, *, grouped: bool) -> list[str]:
    scenes = str(entry.scenes) if entry.scenes == len(board.scenes) else f"{entry.scenes} of {len(board.scenes)}"
    row = ["-" if entry.rank is None else str(entry.rank), *([entry.group] if grouped else [])]
    row += [entry.label, entry.pooling, scenes]
    for index in board.indices:
        cell = entry.cells[index.key]
        text = number_text(cell.value, index.unit)
        partial = entry.pooling == "mean" and cell.scenes < entry.scenes
        row.append(f"{text} ({cell.scenes})".strip() if partial else text)
    ranked = entry.cells[board.rank_by.key]
    row.append(interval_text(ranked.low, ranked.high, board.rank_by.unit))
    row.append(f"{entry.detected}/{entry.reference}")
    row += [number_text(entry.cpu_seconds, "s"), number_text(entry.peak_memory or None, "bytes")]
    return row


def leaderboard_data(board: Leaderboard) -> Table:
    """Return the table for programs: fractions 0..1, metres; for each index its number of scenes and its interval."""
    keys = [index.key for index in board.indices]
    parts = [f"{key}:{part}" for key in keys for part in ("scenes", "low", "high")]
    rows = []
    for entry in board.entries:
        cells = [entry.cells[key] for key in keys]
        facts = {**vars(entry), "parameters": ",".join(f"{name}={value}" for name, value in entry.parameters.items())}
        rows.append(
            [
                *(facts[name] for name in (*_FACTS, *_COSTS)),
                *(cell.value for cell in cells),
                *(part for cell in cells for part in (cell.scenes, cell.low, cell.high)),
                board.evaluator,
                entry.benchmark,
            ]
        )
    return Table.of((Column(name) for name in (*_FACTS, *_COSTS, *keys, *parts, "evaluator", "benchmark")), rows)


def leaderboard_caption(board: Leaderboard) -> str:
    """Return what the values of the wide table are of: scenes, evaluator, index that ranks, and what columns mean."""
    shown = ", ".join(board.scenes[:4]) + (f" and {len(board.scenes) - 4} more" if len(board.scenes) > 4 else "")
    return (
        f"{counted(len(board.scenes), 'scene')} ({shown}); {board.evaluator}; ranked by {board.rank_by.title} "
        f"({board.rank_by.symbol}, pooled); pooled: counts added over scenes, then the ratio; mean: mean over "
        "scenes, (n) where it is defined in n of them only; empty: undefined"
    )


def _has_intervals(board: Leaderboard) -> bool:
    return any(entry.cells[board.rank_by.key].low is not None for entry in board.entries)


def summary_caption(board: Leaderboard) -> str:
    """Return what the values of the summary are of."""
    objects = max((entry.reference for entry in board.entries), default=0)
    return (
        f"{counted(len(board.scenes), 'scene')}, {counted(objects, 'reference footprint')}; {board.evaluator}; ranked "
        f"by {index_name(board.rank_by)}; counts are added over scenes, then the ratio"
        + ("; 95 %: interval over resampled scenes" if _has_intervals(board) else "")
    )


def leaderboard_markdown(board: Leaderboard, *, wide: bool = True) -> str:
    """Return a Markdown section: caption, table, notes, failures and skips with their reasons."""
    head = [
        f"## {escaped_markdown(board.title)}",
        f"{leaderboard_caption(board) if wide else summary_caption(board)}.",
        (leaderboard_table(board) if wide else summary_table(board)).to_markdown(),
    ]
    notes = [f"- {escaped_markdown(note)}" for note in board.notes]
    notes += [
        f"- {run.status}: {escaped_markdown(run.label)} on {escaped_markdown(run.scene)}, seed {run.seed}: "
        f"{escaped_markdown(run.reason)}. Repeat: `{run.command}`"
        for run in board.unsuccessful
    ]
    return "\n".join(["\n\n".join(head), *(["", *notes] if notes else []), ""])


def print_leaderboard(board: Leaderboard, console: Console, *, wide: bool = False) -> None:
    """Print a leaderboard to a terminal; its columns are spread over as many tables as the width needs."""
    from rich.text import Text

    table = leaderboard_table(board) if wide else summary_table(board)
    console.print(Text(board.title, style="bold"))
    console.print(Text(table.to_text(console.width)), soft_wrap=True)
    console.print(Text(f"{leaderboard_caption(board) if wide else summary_caption(board)}."))
    for note in board.notes:
        console.print(Text(f"{note}."))
    if not wide and 1 < len(board.by_scene) <= _MOST_SCENES:
        console.print()
        console.print(Text(scene_table(board).to_text(console.width)), soft_wrap=True)


def show_leaderboards(
    boards: Sequence[Leaderboard], form: Literal["table", "csv", "md", "json"], console: Console, *, wide: bool = False
) -> None:
    """Print leaderboards to a terminal, or write them to its output in another format."""
    if form != "table":
        console.file.write(leaderboards_text(boards, form, wide=wide))
        return
    for number, board in enumerate(boards):
        if number:
            console.print()
        print_leaderboard(board, console, wide=wide)


def leaderboards_text(boards: Sequence[Leaderboard], form: Literal["csv", "md", "json"], *, wide: bool = False) -> str:
    """Return leaderboards for programs and documents.

    CSV and JSON hold every index, with fractions 0..1, and both poolings. Several leaderboards are several CSV tables
    with an empty line between them, since their columns differ.
    """
    if form == "md":
        return "\n".join(leaderboard_markdown(board, wide=wide) for board in boards)
    if form == "csv":
        return "\n".join(leaderboard_data(board).to_csv() for board in boards)
    content = [
        {
            "title": board.title,
            "evaluator": board.evaluator,
            "rank_by": board.rank_by.key,
            "scenes": list(board.scenes),
            "entries": leaderboard_data(board).to_records(),
            "by_scene": board.by_scene,
            "cues": {label: {cue: scenes for cue, scenes in own.items() if cue} for label, own in board.cues.items()},
            "notes": list(board.notes),
            "unsuccessful": [vars(run) for run in board.unsuccessful],
        }
        for board in boards
    ]
    return json.dumps({"leaderboards": content}, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def print_unsuccessful(runs: Sequence[UnsuccessfulRun], console: Console) -> None:
    """Print failures and skips, each with its reason; failures with the command that repeats them."""
    from rich.text import Text

    for run in runs:
        console.print(
            Text.assemble(
                (run.status, "yellow" if run.status == "skipped" else "red"),
                f" {run.label} on {run.scene}, seed {run.seed}: {run.reason}",
                *([] if run.status == "skipped" else [(f"\n  repeat: {run.command}", "dim")]),
            ),
            soft_wrap=True,
        )


def write_leaderboards(folder: Path, boards: Sequence[Leaderboard]) -> None:
    """Write one CSV and one Markdown file; a further evaluator gets files with its own name."""
    for number, board in enumerate(boards):
        name = "leaderboard" if number == 0 else f"leaderboard-{board.evaluator.partition(' ')[0]}"
        for ending, text in (("csv", leaderboard_data(board).to_csv()), ("md", leaderboard_markdown(board))):
            with whole_file(folder / f"{name}.{ending}", overwrite=True) as scratch:
                scratch.write_text(text, encoding="utf-8")
