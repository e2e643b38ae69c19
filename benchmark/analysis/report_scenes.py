"""What a report draws of single scenes: overlays of verdicts, the worst objects, and quality by building size."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...evaluators.verdict_table import Side, Verdicts
from ...scenes.geodata.footprints import Footprints
from ..execution.scene_picture import ScenePicture
from ..plan import KeyedEvaluator
from ..store.records import RunRow, StoredScene
from ..store.stored_verdicts import stored_verdicts
from ..store.writer import Store
from .report_data import Error, Overlay, SceneView, SizeBin, SizeCurve

__all__ = ["Drawn", "draw_scenes", "scene_view"]

#: What is drawn at most, so that the page stays small: scenes, detectors on a scene, objects in all overlays together.
_MOST_SCENES, _MOST_OVERLAYS, _MOST_OBJECTS = 48, 8, 65_000
#: Runs that sizes are counted over at most.
_MOST_SIZED = 600
_ERRORS_PER_DETECTOR, _ERRORS_PER_SCENE, _MOST_ERRORS = 6, 2, 36
_EDGES = (0.0, 25.0, 50.0, 100.0, 200.0, 400.0, 1000.0, math.inf)  # m2


@dataclass(frozen=True)
class Drawn:
    """Scenes with overlays, the worst objects on them, quality by size, and what was left out."""

    scenes: tuple[SceneView, ...]
    errors: tuple[Error, ...]
    sizes: tuple[SizeCurve, ...]
    sampling: tuple[str, ...]


def draw_scenes(
    store: Store,
    rows: Sequence[RunRow],
    keyed: KeyedEvaluator,
    values: Mapping[int, Mapping[str, float | None]],
    labels: Sequence[str],
) -> Drawn | None:
    """Return what is drawn of good runs; None when no verdicts of their evaluator are stored.

    Parameters
    ----------
    store : Store
    rows : sequence of RunRow
        Of status ``ok``.
    keyed : KeyedEvaluator
    values : mapping of int to mapping
        Index values by run.
    labels : sequence of str
        Detectors, the most interesting first.
    """
    evaluated = [row for row in rows if row.id in values]
    by_scene: dict[int, dict[str, RunRow]] = {}
    for row in sorted(evaluated, key=lambda row: row.seed):
        by_scene.setdefault(row.scene_id, {}).setdefault(row.label, row)  # the lowest seed of each detector
    views: list[SceneView] = []
    objects = 0
    order = _spread(by_scene)
    for scene_id in order:
        own = by_scene[scene_id]
        chosen = [own[label] for label in labels if label in own][:_MOST_OVERLAYS]
        view = scene_view(store, store.scene(scene_id), chosen, keyed)
        if view is None:
            continue
        count = sum(len(table) for overlay in view.overlays for _, table, _ in overlay.verdicts.sides)
        if views and objects + count > _MOST_OBJECTS:
            break
        objects += count
        views.append(view)
        if len(views) == _MOST_SCENES:
            break
    if not views:
        return None
    sized = _evenly(evaluated, _MOST_SIZED)
    sampling = []
    if len(views) < len(order):
        sampling.append(
            f"Maps show {len(views)} of {len(order)} scenes, spread over their kinds, to keep the file small."
        )
    hidden = len(labels) - _MOST_OVERLAYS
    if hidden > 0:
        sampling.append(f"Maps show the {_MOST_OVERLAYS} detectors that rank highest; {hidden} more are in the store.")
    if len({row.seed for row in evaluated}) > 1:
        sampling.append("Maps show the lowest seed of each detector.")
    if len(sized) < len(evaluated):
        sampling.append(f"Building sizes are counted over {len(sized)} of {len(evaluated)} runs, evenly spread.")
    return Drawn(
        scenes=tuple(views),
        errors=_worst(views),
        sizes=_sizes(store, sized, keyed, labels),
        sampling=tuple(sampling),
    )


def scene_view(store: Store, scene: StoredScene, rows: Iterable[RunRow], keyed: KeyedEvaluator) -> SceneView | None:
    """Return a scene with the overlays of some runs; None without reference or stored verdicts."""
    if scene.reference is None or scene.extent is None:
        return None
    overlays = []
    for row in rows:
        verdicts = stored_verdicts(store, row.id, keyed.evaluator, keyed.key, reference=scene.reference)
        if verdicts is not None:
            overlays.append(Overlay(label=row.label, run=row.id, seed=row.seed, verdicts=verdicts))
    if not overlays:
        return None
    content = store.scene_picture(scene.id)
    return SceneView(
        name=scene.name,
        group=scene.recipe.group,
        extent=scene.extent,
        picture=None if content is None else ScenePicture.read(content),
        reference=scene.reference,
        area=scene.area,
        overlays=tuple(overlays),
    )


def _spread(by_scene: Mapping[int, Mapping[str, RunRow]]) -> list[int]:
    """Return scenes so that the first ones are of as many groups as possible, as seeds of one preset look alike."""
    groups: dict[str, list[int]] = {}
    for scene_id, own in by_scene.items():
        groups.setdefault(next(iter(own.values())).scene_group, []).append(scene_id)
    first = {scene_id: place for members in groups.values() for place, scene_id in enumerate(members)}
    return sorted(first, key=first.__getitem__)  # stable: groups stay in their order


def _evenly(rows: Sequence[RunRow], most: int) -> list[RunRow]:
    if len(rows) <= most:
        return list(rows)
    return [rows[round(place)] for place in np.linspace(0, len(rows) - 1, most)]


def _worst(views: Sequence[SceneView]) -> tuple[Error, ...]:
    """Return for each detector the objects with the largest area that is wrong, few of one scene."""
    candidates: dict[str, list[Error]] = {}
    for place, view in enumerate(views):
        for number, overlay in enumerate(view.overlays):
            wrong = _wrong_areas(overlay.verdicts)
            found = [
                Error(scene=place, overlay=number, side=side, position=int(position), wrong=float(areas[position]))
                for side, areas in wrong.items()
                for position in np.argsort(-areas, kind="stable")[:_ERRORS_PER_SCENE]
                if areas[position] >= 1.0
            ]
            found.sort(key=lambda error: -error.wrong)
            candidates.setdefault(overlay.label, []).extend(found[:_ERRORS_PER_SCENE])
    chosen = [
        error
        for errors in candidates.values()
        for error in sorted(errors, key=lambda error: -error.wrong)[:_ERRORS_PER_DETECTOR]
    ]
    return tuple(chosen[:_MOST_ERRORS])


def _wrong_areas(verdicts: Verdicts) -> dict[Side, NDArray[np.float64]]:
    """Return the area that is wrong about each object, m2; a matched pair is assigned to its detection."""
    wrong = {}
    for side, table, footprints in verdicts.sides:
        kinds = verdicts.kinds_of(side)
        errors = table.where(*(kind.key for kind in kinds if kind.is_error))
        wrong[side] = np.where(errors, footprints.areas, 0.0)
    table = verdicts.detection_table
    shared, iou = np.nan_to_num(table.measure("overlap_area")), table.measure("iou")
    with np.errstate(divide="ignore", invalid="ignore"):
        differing = np.nan_to_num(shared / iou - shared, posinf=0.0)  # union minus intersection
    correct = table.where(*(kind.key for kind in verdicts.kinds_of("detection") if kind.counts_as == "correct"))
    wrong["detection"] = np.where(correct, differing, wrong["detection"])
    return wrong


def _sizes(store: Store, rows: Sequence[RunRow], keyed: KeyedEvaluator, labels: Sequence[str]) -> tuple[SizeCurve, ...]:
    """Return the share of right objects by footprint area."""
    shown = labels[:_MOST_OVERLAYS]
    found = {label: np.zeros((2, len(_EDGES) - 1), dtype=np.int64) for label in shown}
    correct = {label: np.zeros((2, len(_EDGES) - 1), dtype=np.int64) for label in shown}
    references: dict[int, Footprints | None] = {}
    for row in rows:
        if row.label not in found:
            continue
        if row.scene_id not in references:
            references[row.scene_id] = store.scene(row.scene_id).reference
        reference = references[row.scene_id]
        if reference is None:
            continue
        verdicts = stored_verdicts(store, row.id, keyed.evaluator, keyed.key, reference=reference)
        if verdicts is not None:
            found[row.label] += _binned(verdicts, "reference")
            correct[row.label] += _binned(verdicts, "detection")
    curves = tuple(
        SizeCurve(label=label, found=_bins(found[label]), correct=_bins(correct[label]))
        for label in shown
        if found[label].any()
    )
    return curves if any(each.count for curve in curves for each in curve.found) else ()


def _binned(verdicts: Verdicts, side: Side) -> NDArray[np.int64]:
    """Return counted and correct objects per size; those that enter no rate are not counted."""
    table, areas = verdicts.table(side), verdicts.footprints(side).areas
    kinds = verdicts.kinds_of(side)
    right, wrong = (
        table.where(*(kind.key for kind in kinds if kind.counts_as == what)) for what in ("correct", "wrong")
    )
    return np.array([np.histogram(areas[mask], _EDGES)[0] for mask in (right | wrong, right)], dtype=np.int64)


def _bins(counts: NDArray[np.int64]) -> tuple[SizeBin, ...]:
    return tuple(
        SizeBin(low, high, int(count), int(right))
        for low, high, count, right in zip(_EDGES[:-1], _EDGES[1:], counts[0], counts[1], strict=True)
    )
