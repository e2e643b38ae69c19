"""Running from Python: `run` returns a leaderboard that shows itself in a notebook and writes itself to files."""

from __future__ import annotations

import functools
import html
from collections.abc import Callable
from dataclasses import fields
from typing import TYPE_CHECKING, ParamSpec, Self

from ..benchmark import session
from ..benchmark.analysis.results import Leaderboard
from ..core.wording import counted
from .format import index_name
from .leaderboard_text import leaderboard_data, leaderboard_markdown, scene_table, summary_caption, summary_table

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Board", "run"]

P = ParamSpec("P")


class Board(Leaderboard):
    """A leaderboard with its table as text, Markdown, CSV, HTML and data frame; fields as of `Leaderboard`."""

    @classmethod
    def of(cls, leaderboard: Leaderboard) -> Self:
        """Return the board of a leaderboard."""
        return cls(**{field.name: getattr(leaderboard, field.name) for field in fields(leaderboard)})

    def to_frame(self) -> pd.DataFrame:
        """Return the table as a DataFrame: fractions 0..1, one row per entry, columns as in the CSV file."""
        return leaderboard_data(self).to_frame()

    def to_csv(self) -> str:
        """Return CSV: fractions 0..1, metres; beside each index its number of scenes and its interval."""
        return leaderboard_data(self).to_csv()

    def to_markdown(self) -> str:
        """Return a Markdown section: caption, table, notes, failures and skips with their reasons."""
        return leaderboard_markdown(self)

    def __str__(self) -> str:
        return f"{summary_table(self).to_text()}\n{summary_caption(self)}."

    def _repr_html_(self) -> str:
        """Return the table for a notebook, with what it is of, its notes, and the values by scene."""
        parts = [f"<b>{html.escape(self.title)}</b>", summary_table(self).to_html()]
        lines = [summary_caption(self), *self.notes]
        lines += [
            f"{run.status}: {run.label} on {run.scene}, seed {run.seed}: {run.reason}" for run in self.unsuccessful
        ]
        parts += [f'<div style="font-size:90%">{html.escape(line)}.</div>' for line in lines]
        if len(self.by_scene) > 1:
            parts.append(f"<details><summary>by scene</summary>{scene_table(self).to_html()}</details>")
        return "".join(parts)

    def __repr__(self) -> str:
        detectors = len(dict.fromkeys(entry.label for entry in self.entries))
        first = next((entry.label for entry in self.entries if entry.rank == 1), None)
        leads = f", {first} first by {index_name(self.rank_by)}" if first else ""
        return f"<Leaderboard {counted(detectors, 'detector')} on {counted(len(self.scenes), 'scene')}{leads}>"


def _shown(compute: Callable[P, Leaderboard]) -> Callable[P, Board]:
    @functools.wraps(compute)
    def shown(*arguments: P.args, **named: P.kwargs) -> Board:
        return Board.of(compute(*arguments, **named))

    return shown


run = _shown(session.run)
