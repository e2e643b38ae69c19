"""Evaluation of two files or sets in parts: what the other rooms need of the evaluator that can do it.

The evaluator that is the default one compares files of any size; the others need both sets as a whole.
"""

from __future__ import annotations

from .overlay.file_stores import FileStores
from .threshold_free.evaluator import ThresholdFree
from .threshold_free.files import FileComparison, evaluate_files
from .threshold_free.sets_in_parts import evaluate_sets
from .threshold_free.verdicts import SideVerdicts

__all__ = ["FileComparison", "FileStores", "SideVerdicts", "ThresholdFree", "evaluate_files", "evaluate_sets"]
