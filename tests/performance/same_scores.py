"""Compare two results stores run for run, to the last bit: did a change of the code change a result?

``python -m tests.performance.same_scores OLD.sqlite NEW.sqlite`` prints every difference and a summary. Runs are paired
by scene, detector label and seed; of several runs of one pair the last counts. Compared are the content of the scene,
the status, every index value and every detected polygon. Indices that only NEW has are counted, not treated as
differences. Stores are read by plain SQL, so that they may come from different versions of roofbench.

Exit code 0 when nothing differs, 1 otherwise.
"""

from __future__ import annotations

import argparse
import hashlib
import sqlite3
import struct
from dataclasses import dataclass
from pathlib import Path

Pair = tuple[str, str, int]


@dataclass(frozen=True)
class Run:
    """What a store holds of one run; index values by (evaluator, index)."""

    status: str
    content: str | None
    values: dict[tuple[str, str], float | None]
    detections: str


def read_runs(path: Path) -> dict[Pair, Run]:
    """Return the runs of a store by (scene, detector label, seed)."""
    if not path.is_file():
        raise SystemExit(f"{path}: no such store")
    store = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)
    try:
        rows = store.execute(
            "SELECT runs.id, scenes.name, label, seed, status, content_hash"
            " FROM runs JOIN scenes ON scene_id = scenes.id ORDER BY runs.id"
        )
        return {
            (scene, label, seed): Run(status, content, _values(store, run), _detections(store, run))
            for run, scene, label, seed, status, content in rows.fetchall()
        }
    finally:
        store.close()


def _values(store: sqlite3.Connection, run: int) -> dict[tuple[str, str], float | None]:
    rows = store.execute(
        "SELECT evaluator, index_values.name, value"
        " FROM evaluations JOIN index_values ON evaluation_id = evaluations.id"
        " WHERE run_id = ? ORDER BY evaluations.id",
        (run,),
    )
    return {(evaluator, name): value for evaluator, name, value in rows}


def _detections(store: sqlite3.Connection, run: int) -> str:
    digest = hashlib.sha256()
    for (wkb,) in store.execute("SELECT wkb FROM detections WHERE run_id = ? ORDER BY id", (run,)):
        digest.update(wkb)
    return digest.hexdigest()


def differences(old: dict[Pair, Run], new: dict[Pair, Run]) -> list[str]:
    """Return one line for every difference between two stores."""
    lines = [f"{_name(pair)}: only in OLD" for pair in sorted(old.keys() - new.keys())]
    lines += [f"{_name(pair)}: only in NEW" for pair in sorted(new.keys() - old.keys())]
    for pair in sorted(old.keys() & new.keys()):
        one, two = old[pair], new[pair]
        if one.status != two.status:
            lines.append(f"{_name(pair)}: status {one.status} -> {two.status}")
        if one.content != two.content:
            lines.append(f"{_name(pair)}: the scene has other content")
        if one.detections != two.detections:
            lines.append(f"{_name(pair)}: other footprints")
        for evaluator, index in sorted(one.values):
            if (evaluator, index) not in two.values:
                lines.append(f"{_name(pair)}: {evaluator} {index} is only in OLD")
            elif _bits(one.values[evaluator, index]) != _bits(two.values[evaluator, index]):
                before, after = one.values[evaluator, index], two.values[evaluator, index]
                lines.append(f"{_name(pair)}: {evaluator} {index} {before!r} -> {after!r}")
    return lines


def _name(pair: Pair) -> str:
    scene, label, seed = pair
    return f"{label} on {scene}, seed {seed}"


def _bits(value: float | None) -> bytes | None:
    return None if value is None else struct.pack("<d", value)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("old", type=Path)
    parser.add_argument("new", type=Path)
    parser.add_argument("--label", action="append", help="only detectors of this label, may be repeated")
    chosen = parser.parse_args()
    old, new = (
        {pair: run for pair, run in read_runs(path).items() if not chosen.label or pair[1] in chosen.label}
        for path in (chosen.old, chosen.new)
    )
    found = differences(old, new)
    if found:
        print("\n".join(found))
    shared = old.keys() & new.keys()
    compared = sum(len(old[pair].values) for pair in shared)
    added = {index for pair in shared for index in new[pair].values.keys() - old[pair].values.keys()}
    print(
        f"{len(shared)} runs in both stores, {compared} index values compared, {len(added)} indices only in NEW: "
        f"{len(found)} differences"
    )
    return int(bool(found) or not shared)


if __name__ == "__main__":
    raise SystemExit(main())
