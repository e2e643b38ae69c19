"""``roofbench evaluate``: compare two footprint files."""

from __future__ import annotations


def evaluate() -> None:
    """Compare detected with reference footprints."""
