"""Reading a gate's result back from the JSON that ``roofbench gate --format json`` prints."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ..core.errors import InputError
from ..evaluators.base import Index
from ..evaluators.registry import EVALUATORS
from .gate_text import GateResult, IndexVerdict

__all__ = ["read_gate"]

_NUMBERS = ("baseline", "candidate", "effect", "low", "high", "p")
_WORDS = ("better", "worse", "equal", "undecided", "not measurable")


def read_gate(path: Path) -> GateResult:
    """Read a result of the gate.

    Raises
    ------
    InputError
        No such file, or not the JSON of a gate.
    """
    try:
        content = json.loads(path.read_text("utf-8"))
        return GateResult(
            baseline=str(content["baseline"]),
            candidate=str(content["candidate"]),
            verdicts=tuple(_verdict(plain) for plain in content["verdicts"]),
            failures=tuple(map(str, content["failures"])),
            level=float(content["level"]),
        )
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        missing = f"it has no {error}" if isinstance(error, KeyError) else str(error)
        raise InputError(
            f"{path}: no result of the gate ({missing}): 'roofbench gate BASELINE --format json' prints one"
        ) from error


def _verdict(plain: dict[str, Any]) -> IndexVerdict:
    if plain["verdict"] not in _WORDS:
        raise ValueError(f"unknown verdict {plain['verdict']!r}")
    return IndexVerdict(
        detector=str(plain["detector"]),
        index=_index(str(plain["index"])),
        verdict=plain["verdict"],
        margin=float(plain["margin"]),
        scenes=int(plain["scenes"]),
        note=str(plain.get("note", "")),
        **{name: None if plain[name] is None else float(plain[name]) for name in _NUMBERS},
    )


def _index(key: str) -> Index:
    """Return the index of that key; one of a plugin that is not here by its key alone."""
    for name in EVALUATORS.names():
        indices: tuple[Index, ...] = EVALUATORS.get(name).indices
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
