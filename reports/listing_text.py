"""Listings of stored runs as text, CSV or JSON."""

from __future__ import annotations

import json
from typing import Literal

from ..benchmark.store.listing import Listing
from .format import number_text
from .tables import Column, Table

__all__ = ["format_listing"]

_PRINTED = (
    Column("run"),
    Column("key", "left"),
    Column("status", "left"),
    Column("detector", "left"),
    Column("scene", "left"),
    *(Column(title) for title in ("seed", "found", "seconds", "CPU s", "MB")),
    Column("reason", "left"),
)


def format_listing(listing: Listing, form: Literal["table", "csv", "json"]) -> str:
    """Return stored runs as aligned columns, CSV, or a JSON list of objects; the text ends with a newline."""
    if form == "csv":
        return Table.of(map(Column, listing.columns), listing.rows).to_csv()
    if form == "json":
        records = [dict(zip(listing.columns, row, strict=True)) for row in listing.rows]
        # A field a line; `indent` would make the encoder several times slower.
        return json.dumps(records, separators=(",\n", ": ")) + "\n"
    rows = [
        (
            number,
            key[:8],
            status,
            label,
            scene,
            seed,
            detected,
            number_text(seconds, "s"),
            number_text(cpu_seconds, "s"),
            number_text(peak_memory, "bytes"),
            reason,
        )
        for number, key, status, label, scene, seed, detected, seconds, cpu_seconds, peak_memory, _, _, reason in (
            listing.rows
        )
    ]
    return f"{Table.of(_PRINTED, rows).to_text()}\n{len(rows)} of {listing.total} runs in {listing.path}\n"
