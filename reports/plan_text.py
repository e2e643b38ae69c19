"""A plan as text: what would run, and why the rest would not."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

from ..benchmark.plan import Plan
from ..core.wording import counted
from .tables import Column, Table

__all__ = ["format_plan"]

_WORDS = {"detect": "run", "evaluate": "evaluate", "nothing": "stored"}


def format_plan(plan: Plan, form: Literal["table", "csv", "md", "json"] = "table") -> str:
    """Return one line for each run with its reason; text ends with the numbers."""
    rows = list(_rows(plan))
    if form == "table":
        lines = [f"{word:9}{detector}  {scene}  seed {seed}: {why}" for word, detector, scene, seed, why in rows]
        return "\n".join([*lines, _numbers(plan)])
    table = Table.of(map(Column, ("what", "detector", "scene", "seed", "why")), rows)
    return {"csv": table.to_csv, "md": table.to_markdown, "json": table.to_json}[form]().rstrip("\n")


def _rows(plan: Plan) -> Iterator[tuple[str, str, str, int, str]]:
    for run in plan.runs:
        identity, word, why = run.identity, _WORDS[run.todo], run.why
        if run.skip:
            word, why = "skip", f"{why}; {run.skip}"
        elif run.stored is None and run.todo == "nothing":
            word = "left out"
        yield word, identity.label, identity.scene.name, identity.seed, why


def _numbers(plan: Plan) -> str:
    counts, left_out = plan.counts(), len(plan.left_out)
    skipped = sum(bool(run.skip) for run in plan.runs)
    parts = [
        f"{counts['detect'] - skipped} to run",
        f"{counts['evaluate']} to evaluate",
        f"{counts['nothing'] - left_out} left as stored",
        *([f"{skipped} to skip"] if skipped else []),
        *([f"{left_out} left out"] if left_out else []),
    ]
    return f"{counted(len(plan.runs), 'run')}: {', '.join(parts)}"
