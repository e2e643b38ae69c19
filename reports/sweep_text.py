"""A sweep as text: its table, and where detectors break down."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..benchmark.analysis.break_down import BreakDown
from ..core.errors import OutputError
from ..core.output import check_target, whole_file
from ..core.parameter_rules import parameter_text
from ..evaluators.base import Index
from .format import column_title, index_name, interval_text, number_text, value_text
from .tables import Column, Table, inert_cell

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["break_down_text", "check_sweep_table", "sweep_records", "sweep_table", "write_sweep_table"]


def check_sweep_table(path: Path, overwrite: bool) -> None:
    """Raise `OutputError` when a table cannot be written to a file of that name; call it before long work."""
    if path.suffix.lower() not in (".csv", ".parquet"):
        raise OutputError(f"{path}: unknown file ending {path.suffix!r}: name it .csv or .parquet")
    check_target(path, overwrite)


def write_sweep_table(table: pd.DataFrame, path: Path, *, overwrite: bool) -> None:
    """Write a tidy table as CSV or Parquet, whole or not at all."""
    with whole_file(path, overwrite=overwrite) as scratch:
        if path.suffix.lower() == ".csv":
            texts = table.select_dtypes(include=["object", "string"]).columns
            cells = {name: [inert_cell(v) if isinstance(v, str) else v for v in table[name]] for name in texts}
            table.assign(**cells).to_csv(scratch, index=False)
            return
        try:
            table.to_parquet(scratch, index=False)
        except ImportError as error:
            raise OutputError(f"{path}: Parquet needs pyarrow: pip install pyarrow") from error


def break_down_text(found: BreakDown) -> str:
    """Return where a detector breaks down, in one sentence."""
    index, level = found.index, value_text(found.level, found.index.unit)
    what, axis = f"{found.detector}: {index_name(index)}", found.axis.removeprefix("scene.").replace("_", " ")
    beyond, moves = ("below", "falls below") if index.better == "higher" else ("above", "rises above")
    if found.value is None:
        return f"{what} is never {beyond} {level} along {axis}"
    if found.at_start:
        return f"{what} is {beyond} {level} already at the first value of {axis}, {found.value:.4g}"
    return f"{what} {moves} {level} at {axis} = {found.value:.4g}"


def sweep_table(table: pd.DataFrame, axes: Sequence[str], index: Index) -> Table:
    """Return one row per detector and point: the mean of an index with its interval.

    Parameters
    ----------
    table : DataFrame
        As `benchmark.analysis.sweep.run_sweep` returns it, of one evaluator.
    axes : sequence of str
        Columns of the varied parameters.
    index : Index
    """
    columns = [
        Column("detector", "left", fixed=True),
        *(Column(name) for name in (*axes, column_title(index), "95 %", "scenes", "failed", "skipped")),
    ]
    rows = []
    for row in table[table["index"] == index.key].to_dict("records"):
        mean, low, high = (_known(row[name]) for name in ("mean", "low", "high"))
        values = ["" if _known(row[name]) is None else parameter_text(row[name]) for name in axes]
        shown = [number_text(mean, index.unit), interval_text(low, high, index.unit)]
        rows.append([row["detector"], *values, *shown, *(row[name] for name in ("scenes", "failed", "skipped"))])
    return Table.of(columns, rows)


def sweep_records(table: pd.DataFrame) -> Table:
    """Return the tidy table for programs: every index of every evaluator, numbers as they are, None where undefined."""
    rows = ([_known(value) for value in row] for row in table.astype(object).itertuples(index=False))
    return Table.of(map(Column, table.columns), rows)


def _known(value: Any) -> Any:
    """Return None for what pandas writes where there is no value."""
    return None if value is None or value != value else value
