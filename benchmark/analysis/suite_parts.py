"""Parts of a results store whose detectors can be ranked: the suites that were run, and the scenes common to all.

A store that several suites were run into has detectors without a result on many scenes. Over all scenes nothing can be
ranked then, but the scenes of each suite can, and so can those that every detector ran on.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from ..store.records import RunRow

__all__ = ["Part", "suite_parts"]

#: Names of plans that come from scenes on the command line or in Python, which no suite names.
_UNNAMED = ("scenes", "run")
#: Parts of a report at most, and scenes that a title names.
_MOST_PARTS, _MOST_NAMES = 8, 3


class Part(NamedTuple):
    """Runs that are ranked together, with a title."""

    title: str
    rows: list[RunRow]


def suite_parts(rows: Sequence[RunRow], plans: Iterable[Mapping[str, Any]]) -> list[Part]:
    """Return the parts of these runs that can be ranked; none where every detector ran on every scene.

    Parameters
    ----------
    rows : sequence of RunRow
        Of every status.
    plans : iterable of mapping
        Contents of the plans of the store, the newest first: name, and scenes by their names.

    Returns
    -------
    parts : list of Part
        The scenes that all detectors ran on come first, then the suites with most runs. A part holds the detectors
        that ran on each of its scenes; one that repeats the scenes of another is left out.
    """
    ran: dict[str, set[str]] = {}
    for row in rows:
        ran.setdefault(row.scene, set()).add(row.label)
    every = {row.label for row in rows}
    if all(labels == every for labels in ran.values()):
        return []
    found: dict[frozenset[str], Part] = {}
    for plan in plans:
        scenes = frozenset(name for scene in plan.get("scenes", ()) if (name := str(scene["name"])) in ran)
        labels = set.intersection(*(ran[scene] for scene in scenes)) if scenes else set()
        if labels and scenes not in found:
            own = [row for row in rows if row.scene in scenes and row.label in labels]
            found[scenes] = Part(_title(str(plan["name"]), [row.scene for row in own]), own)
    parts = sorted(found.values(), key=lambda part: -len(part.rows))[:_MOST_PARTS]
    common = frozenset(scene for scene, labels in ran.items() if labels == every)
    if common and len(every) > 1 and common not in found:
        own = [row for row in rows if row.scene in common]
        parts.insert(0, Part("Scenes that all detectors ran on", own))
    return parts


def _title(name: str, scenes: Iterable[str]) -> str:
    if name not in _UNNAMED:
        return f"Suite {name}"
    names = list(dict.fromkeys(scenes))
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return f"Scenes {', '.join(names[:_MOST_NAMES])}{more}" if len(names) > 1 else f"Scene {names[0]}"
