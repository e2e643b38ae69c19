"""What there is to choose from, as data frames for notebooks: ``rb.list_detectors()`` and its like."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..benchmark.catalogue import entries
from .catalogue_text import catalogue_table

if TYPE_CHECKING:
    import pandas as pd

    from ..benchmark.catalogue import Kind

__all__ = ["list_detectors", "list_evaluators", "list_indices", "list_scenes", "list_suites"]


def list_detectors() -> pd.DataFrame:
    """Return one line for each detector: its inputs, whether it is random, and its meaning."""
    return _frame("detectors")


def list_evaluators() -> pd.DataFrame:
    """Return one line for each evaluator: the number of its indices, the one that ranks, and its meaning."""
    return _frame("evaluators")


def list_indices() -> pd.DataFrame:
    """Return one line for each index, those of the default evaluator first: symbol, unit, direction, meaning."""
    return _frame("indices")


def list_scenes() -> pd.DataFrame:
    """Return one line for each scene: shipped ones, presets of the generator, and folders in the current directory."""
    return _frame("scenes")


def list_suites() -> pd.DataFrame:
    """Return one line for each suite that comes with roofbench: its scenes and detectors."""
    return _frame("suites")


def _frame(kind: Kind) -> pd.DataFrame:
    return catalogue_table(entries(kind)).to_frame().set_index("name")
