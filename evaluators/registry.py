"""The evaluators that can be named: built in, installed (entry points ``roofbench.evaluators``) or from a file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..core.errors import ParameterError
from ..core.registry import Registry, nearest_hint, parse_selection
from .base import Evaluator

__all__ = ["ALL", "DEFAULT", "EVALUATORS", "all_evaluators", "make_evaluator"]

#: Name of the evaluator that is used when none is chosen.
DEFAULT = "threshold-free"
#: Stands for every evaluator, where several can be used.
ALL = "all"

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


def make_evaluator(
    selection: str | Evaluator | None = None, parameters: Mapping[str, Any] | None = None, /, **values: Any
) -> Evaluator:
    """Return an evaluator by name, by ``name[parameter=value]`` or by ``file.py:Class``, with parameters.

    Parameters
    ----------
    selection : str or Evaluator, optional
        An evaluator passes through, with changed parameters where some are given; None stands for the `DEFAULT` one.
    parameters : mapping, optional
        Parameters by name; texts are read as on the command line.
    **values
        Parameters by name as well: ``make_evaluator("threshold-free", matching="overlap")``.
    """
    chosen = {**(parameters or {}), **values}
    if isinstance(selection, Evaluator):
        return selection.replaced(chosen) if chosen else selection
    name, selected = parse_selection(selection or DEFAULT)
    evaluator: Evaluator = EVALUATORS.get(name).build({**selected, **chosen})
    return evaluator


def all_evaluators(parameters: Mapping[str, Any] | None = None) -> list[Evaluator]:
    """Return every evaluator, the default one first, each with those of the parameters that it has.

    A choice (such as ``matching="overlap"``) is given to the evaluators that know it.

    Raises
    ------
    ParameterError
        No evaluator has a parameter of that name, or knows that choice.
    """
    names = [DEFAULT, *(name for name in EVALUATORS.names() if name != DEFAULT)]
    kinds = [EVALUATORS.get(name) for name in names]
    chosen: list[dict[str, Any]] = [{} for _ in kinds]
    for name, value in (parameters or {}).items():
        rules = [kind.parameters().get(name) for kind in kinds]
        fitting = [place for place, rule in enumerate(rules) if rule and (not rule.choices or value in rule.choices)]
        if not fitting:
            known = sorted({known for kind in kinds for known in kind.parameters()})
            choices = dict.fromkeys(str(choice) for rule in rules if rule for choice in rule.choices)
            hint = f"; it is one of {', '.join(choices)}" if choices else nearest_hint(name, known)
            raise ParameterError(f"no evaluator has a parameter {name}={value}{hint}; there are {', '.join(known)}")
        for place in fitting:
            chosen[place][name] = value
    return [kind.build(values) for kind, values in zip(kinds, chosen, strict=True)]
