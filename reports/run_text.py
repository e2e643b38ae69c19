"""A stored run as text: what it depends on, what it cost, and what has changed since."""

from __future__ import annotations

import json

from ..benchmark.analysis.leaderboard import repeat_command
from ..benchmark.plan import differences, identity_now
from ..benchmark.store.records import RunRow
from ..benchmark.store.writer import Store
from ..core.errors import RoofbenchError
from ..core.wording import counted
from .format import one_line

__all__ = ["format_run"]


def format_run(store: Store, row: RunRow) -> str:
    """Return everything that is known of a stored run, in lines."""
    code, machine = store.code(row.id), store.machine(row.id)
    lines = [
        f"run {row.id}, key {row.key}",
        f"  status     {row.status}{': ' + row.reason if row.reason else ''}",
        f"  detector   {row.detector}  {json.dumps(row.parameters)}",
        f"  scene      {row.scene}, key {row.scene_key[:16]}",
        *(f"  note       {one_line(str(note))}" for note in store.run_notes([row.id]).get(row.id, ())),
        *_cues(store, row),
        *_evaluations(store, row),
        f"  seed       {row.seed}",
        f"  code       roofbench {row.version}, {counted(len(code.modules), 'module')}, digest {code.digest[:16]}",
        f"  benchmark  {'not recorded' if row.benchmark is None else f'version {row.benchmark}'}",
        f"  packages   {', '.join(f'{name} {version}' for name, version in code.packages.items())}",
        f"  cost       {row.seconds:.3f} s, CPU {row.cpu_seconds:.3f} s, {row.peak_memory / 1e6:.0f} MB",
        f"  machine    {', '.join(f'{name} {value}' for name, value in machine.items()) or 'not known'}",
        f"  finished   {row.finished}",
        f"  repeat     {repeat_command(row)}",
        _changes(store, row),
    ]
    if row.traceback:
        lines += ["", row.traceback.rstrip()]
    return "\n".join(lines)


def _cues(store: Store, row: RunRow) -> list[str]:
    """Return a line with the cues that the detector used, where it names them."""
    used = store.metadata(row.id).get("cues")
    return [f"  cues       {one_line(', '.join(map(str, used)))}"] if isinstance(used, list) and used else []


def _evaluations(store: Store, row: RunRow) -> list[str]:
    """Return a line for each evaluator that failed on the run, with its reason and what to do."""
    lines = []
    for name, parameters, reason in store.failed_evaluators(row.id):
        what = f"{one_line(name)}  {parameters}" if name else "one that is not recorded"
        lines.append(f"  evaluator  {what} failed: {one_line(reason)}")
    if lines:
        lines.append("             the detections are stored: correct the evaluator, then run 'roofbench score'")
    return lines


def _changes(store: Store, row: RunRow) -> str:
    """Return in words whether the run would be executed again."""
    try:
        changes = differences(store, row.id, identity_now(row))
    except RoofbenchError as error:
        return f"It cannot be repeated here: {error}"
    if changes:
        return "It would be run again: " + "; ".join(changes) + "."
    if row.status == "failed":
        return "Nothing that it depends on has changed; failures are tried again."
    return "Nothing that it depends on has changed: it would not be run again."
