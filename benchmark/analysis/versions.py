"""Runs of different versions of the benchmark, which are not ranked together.

The version of the benchmark stands for the definitions of the indices, the suites and the generator, see
`core.package`. Runs of stores that did not record it have an unknown version, which counts as the oldest.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ..store.records import RunRow

__all__ = ["UNKNOWN", "comparable_runs", "version_names"]

UNKNOWN = "unknown"


def version_names(rows: Iterable[RunRow]) -> list[str]:
    """Return the versions of these runs as text, the newest first; `UNKNOWN` is last."""
    found = {row.benchmark for row in rows}
    known = sorted((version for version in found if version is not None), reverse=True)
    return [*map(str, known), *([UNKNOWN] if None in found else [])]


def comparable_runs(rows: Sequence[RunRow], *, all_versions: bool = False) -> tuple[list[RunRow], list[str]]:
    """Return the runs of the newest version of the benchmark, and notes on the others.

    Parameters
    ----------
    rows : sequence of RunRow
    all_versions : bool
        Keep the runs of all versions; a note says so.
    """
    versions = version_names(rows)
    if len(versions) < 2:
        return list(rows), []
    if all_versions:
        counted = ", ".join(f"{_labels(rows, version)} ({version})" for version in versions)
        return list(rows), [f"Runs of different versions of the benchmark are ranked together: {counted}"]
    kept = [row for row in rows if _name(row) == versions[0]]
    others = "; ".join(
        f"version {version}: {sum(_name(row) == version for row in rows)} of {_labels(rows, version)}"
        for version in versions[1:]
    )
    return kept, [
        f"Ranked are the runs of version {versions[0]} of the benchmark; left out are those of other versions "
        f"({others}): run them again, or rank all together by 'roofbench score --all-versions'"
    ]


def _name(row: RunRow) -> str:
    return UNKNOWN if row.benchmark is None else str(row.benchmark)


def _labels(rows: Iterable[RunRow], version: str) -> str:
    labels = list(dict.fromkeys(row.label for row in rows if _name(row) == version))
    return ", ".join(labels[:5]) + (f" and {len(labels) - 5} more" if len(labels) > 5 else "")
