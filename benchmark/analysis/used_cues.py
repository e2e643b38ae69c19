"""Which cues the detectors of a leaderboard used: on which scenes each carried information."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from ..store.records import RunRow
from ..store.writer import Store

__all__ = ["UsedCues", "cue_notes", "used_cues"]

#: Detector label to cue to the scenes on which it was used, and under "" those on which the detector named its cues.
UsedCues = Mapping[str, Mapping[str, tuple[str, ...]]]


def used_cues(rows: Sequence[RunRow], store: Store) -> dict[str, dict[str, tuple[str, ...]]]:
    """Return by detector label the scenes on which each cue was used by a run, under ``""`` those of all such runs.

    Detectors that name no cues are absent.

    Examples
    --------
    ``{"ndsm": {"": ("delft", "ign"), "roughness": ("delft", "ign"), "multiple returns": ("delft",)}}``
    """
    found: dict[str, dict[str, dict[str, None]]] = {}
    cues_of = store.run_cues([row.id for row in rows if row.status == "ok"])
    for row in rows:
        if row.id in cues_of:
            own = found.setdefault(row.label, {})
            for cue in ("", *cues_of[row.id]):
                own.setdefault(cue, {})[row.scene] = None
    return {label: {cue: tuple(scenes) for cue, scenes in own.items()} for label, own in found.items()}


def cue_notes(cues: UsedCues) -> Iterator[str]:
    """Yield for each detector a sentence on its cues, those that were used everywhere first.

    >>> list(cue_notes({"ndsm": {"": ("a", "b"), "returns": ("a",), "roughness": ("a", "b")}}))
    ['cues that ndsm used: roughness; returns on 1 of 2 scenes']
    """
    for label, own in cues.items():
        count = len(own[""])
        everywhere = [cue for cue, scenes in own.items() if cue and len(scenes) == count]
        parts = [", ".join(everywhere)] if everywhere else []
        parts += [
            f"{cue} on {len(scenes)} of {count} scenes" for cue, scenes in own.items() if cue and len(scenes) < count
        ]
        yield f"cues that {label} used: {'; '.join(parts) or 'none'}"
