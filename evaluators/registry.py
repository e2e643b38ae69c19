"""The evaluators that can be named: built in, installed (entry points ``roofbench.evaluators``) or from a file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..core.registry import Registry, parse_selection
from .base import Evaluator

__all__ = ["DEFAULT", "EVALUATORS", "make_evaluator"]

#: Name of the evaluator that is used when none is chosen.
DEFAULT = "threshold-free"

EVALUATORS = Registry(
    "evaluator",
    "roofbench.evaluators",
    Evaluator,
    {
        DEFAULT: "evaluators.threshold_free.evaluator:ThresholdFree",
        "boundary": "evaluators.boundary:Boundary",
        "iou": "evaluators.iou:IoU",
        "mobj0": "evaluators.mobj0:Mobj0",
        "rutzinger": "evaluators.rutzinger:Rutzinger",
        "shan-lee": "evaluators.shan_lee:ShanLee",
        "shufelt": "evaluators.shufelt:Shufelt",
        "song-haithcoat": "evaluators.song_haithcoat:SongHaithcoat",
    },
)


def make_evaluator(selection: str | Evaluator | None = None, parameters: Mapping[str, Any] | None = None) -> Evaluator:
    """Return an evaluator by name, by ``name[parameter=value]`` or by ``file.py:Class``.

    An evaluator passes through; None stands for the `DEFAULT` one.
    """
    if isinstance(selection, Evaluator):
        return selection
    name, values = parse_selection(selection or DEFAULT)
    evaluator: Evaluator = EVALUATORS.get(name).build({**values, **(parameters or {})})
    return evaluator
