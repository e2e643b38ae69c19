"""Running from Python: `run` returns a leaderboard that shows itself in a notebook and writes itself to files."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import fields
from typing import TYPE_CHECKING, ParamSpec, Self

from ..benchmark import session
from ..benchmark.analysis.results import Leaderboard
from .leaderboard_text import leaderboard_data, leaderboard_markdown, summary_caption, summary_table

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
        """Return the table for a notebook."""
        return summary_table(self).to_html()


def _shown(compute: Callable[P, Leaderboard]) -> Callable[P, Board]:
    @functools.wraps(compute)
    def shown(*arguments: P.args, **named: P.kwargs) -> Board:
        return Board.of(compute(*arguments, **named))

    return shown


run = _shown(session.run)
