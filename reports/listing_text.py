"""Listings of stored runs as text, CSV or JSON, in pieces: there may be 100 000 runs."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, Literal

from ..benchmark.store.listing import Listing, Sizes
from ..core.wording import counted
from .format import number_text
from .tables import Column, Table

__all__ = ["format_listing"]

_PRINTED = (
    Column("run"),
    Column("key", "left"),
    Column("status", "left"),
    Column("detector", "left"),
    Column("scene", "left"),
    *(Column(title) for title in ("seed", "found", "seconds", "CPU s", "MB", "benchmark")),
    Column("reason", "left"),
)
_KEY = 8  # characters of a key
#: Characters of the columns besides detector and scene: finding the widest of 100 000 numbers takes too long.
_WIDTHS = (6, _KEY, 7, 4, 6, 8, 8, 6, 9, 6)


def format_listing(listing: Listing, form: Literal["table", "csv", "json"]) -> Iterator[str]:
    """Yield stored runs as aligned columns, CSV, or a JSON list of objects; the text ends with a newline."""
    yield from {"table": _table, "csv": _csv, "json": _json}[form](listing)


def _table(listing: Listing) -> Iterator[str]:
    sizes = listing.sizes()
    yield from _lines(listing, sizes) if sizes.ascii else _cells(listing)
    yield f"{sizes.count} of {counted(listing.total, 'run')} in {listing.path}\n"


def _lines(listing: Listing, sizes: Sizes) -> Iterator[str]:
    """Yield the table as SQLite prints it; characters that could change the state of a terminal become spaces."""
    detector, scene = max(len("detector"), sizes.label), max(len("scene"), sizes.scene)
    widths = (*_WIDTHS[:3], detector, scene, *_WIDTHS[3:])
    heading = zip(_PRINTED, widths, strict=True)
    cells = [f"{column.title:{'<' if column.align == 'left' else '>'}{width}}" for column, width in heading]
    yield "  ".join(cells) + "\n" + "  ".join("─" * width for width in widths) + "\n"
    run, key, status, _, _, seed, found, seconds, cpu, memory, benchmark, _ = widths
    numbers = f"%{seed}d  %{found}s  %{seconds}.2f  %{cpu}.2f  %{memory}.0f  %{benchmark}s"
    template = f"%{run}d  %-{key}.{key}s  %-{status}s  %-{detector}s  %-{scene}s  {numbers}  %s"
    for lines in listing.lines(template):
        if not "".join(lines).isprintable():
            lines = ["".join(c if c.isprintable() else " " for c in line).rstrip() for line in lines]
        yield "".join(f"{line}\n" for line in lines)


def _cells(listing: Listing) -> Iterator[str]:
    """Yield the table cell by cell, as wide characters need it."""
    rows = [_row(*row) for _, rows in listing.chunks("few") for row in rows]
    yield Table.of(_PRINTED, rows).to_text() + "\n"


def _row(number: int, key: str, status: str, label: str, scene: str, seed: int, *others: Any) -> tuple[Any, ...]:
    detected, seconds, cpu_seconds, memory, _, benchmark, _, reason = others
    costs = number_text(seconds, "s"), number_text(cpu_seconds, "s"), number_text(memory, "bytes")
    return (
        number,
        key[:_KEY],
        status,
        label,
        scene,
        seed,
        detected,
        *costs,
        "?" if benchmark is None else benchmark,
        reason,
    )


def _csv(listing: Listing) -> Iterator[str]:
    for place, (columns, rows) in enumerate(listing.chunks("few")):
        yield Table(tuple(map(Column, columns)), tuple(rows)).to_csv(header=place == 0)


def _json(listing: Listing) -> Iterator[str]:
    opened = "["
    for columns, rows in listing.chunks("all"):
        # A field a line; `indent` would make the encoder several times slower.
        text = json.dumps([dict(zip(columns, row, strict=True)) for row in rows], separators=(",\n", ": "))
        yield opened + text[1:-1]
        opened = ",\n"
    yield "]\n"
