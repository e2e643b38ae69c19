"""The gate's result as JSON, written by ``roofbench gate --format json`` and read back for reports and figures."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ..benchmark.analysis.results import CONCLUSIONS, GateResult, IndexConclusion
from ..benchmark.analysis.timing import SPEED
from ..core.errors import InputError
from ..evaluators.base import Index
from ..evaluators.registry import EVALUATORS
from .gate_text import gate_summary

__all__ = ["gate_json", "read_gate"]

_NUMBERS = ("baseline", "candidate", "effect", "low", "high", "p", "seeds_share")
_COUNTS = ("scenes", "scenes_needed", "undefined")


def gate_json(result: GateResult) -> str:
    """Return the result as JSON; indices are written as their keys."""
    content = {
        "baseline": result.baseline,
        "candidate": result.candidate,
        "evaluator": result.evaluator,
        "level": result.level,
        "summary": gate_summary(result),
        "exit_code": result.exit_code,
        "conclusions": [{**asdict(found), "index": found.index.key} for found in result.conclusions],
        "failures": list(result.failures),
    }
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)


def read_gate(path: Path) -> GateResult:
    """Read a result of the gate.

    Raises
    ------
    InputError
        No such file, or not the JSON of a gate.
    """
    try:
        content = json.loads(path.read_text("utf-8"))
        baseline, candidate, evaluator = (str(content[name]) for name in ("baseline", "candidate", "evaluator"))
        return GateResult(
            baseline=baseline,
            candidate=candidate,
            evaluator=evaluator,
            conclusions=tuple(_conclusion(plain, evaluator) for plain in content["conclusions"]),
            failures=tuple(map(str, content["failures"])),
            level=float(content["level"]),
        )
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        missing = f"it has no {error}" if isinstance(error, KeyError) else str(error)
        raise InputError(
            f"{path}: not a result of the gate ({missing}): 'roofbench gate BASELINE --format json' prints one"
        ) from error


def _conclusion(plain: dict[str, Any], evaluator: str) -> IndexConclusion:
    if plain["conclusion"] not in CONCLUSIONS:
        raise ValueError(f"unknown conclusion {plain['conclusion']!r}")
    numbers: dict[str, Any] = {name: None if plain[name] is None else float(plain[name]) for name in _NUMBERS}
    numbers |= {name: int(plain[name]) for name in _COUNTS}
    return IndexConclusion(
        detector=str(plain["detector"]),
        index=_index(str(plain["index"]), evaluator),
        conclusion=plain["conclusion"],
        margin=float(plain["margin"]),
        **numbers,
    )


def _index(key: str, evaluator: str) -> Index:
    """Return the index of a key; run time and those of a plugin that is not loaded have their key alone."""
    if key == SPEED.key:
        return SPEED
    indices: tuple[Index, ...] = EVALUATORS.get(evaluator).indices if evaluator in EVALUATORS.names() else ()
    for index in indices:
        if index.key == key:
            return index
    return Index(
        key=key,
        title=key.rpartition(".")[2].replace("_", " "),
        symbol="",
        better="neither",
        unit="ratio",
        range=(float("-inf"), float("inf")),
        meaning="",
        source="",
    )
