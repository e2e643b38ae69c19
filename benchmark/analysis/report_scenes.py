"""What a report draws of single scenes: overlays of verdicts, the worst objects, and quality by building size."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import shapely
from numpy.typing import NDArray

from ..execution.scene_picture import ScenePicture
from ..store.records import RunRow, StoredScene
from ..store.writer import Store
from .report_data import Error, Overlay, SceneView, Side, SizeBin, SizeCurve

__all__ = ["Drawn", "draw_scenes", "scene_view"]

#: What is drawn at most, so that the page stays small: scenes, detectors on a scene, objects in all overlays together.
_MOST_SCENES, _MOST_OVERLAYS, _MOST_OBJECTS = 48, 8, 65_000
#: Verdicts that can be drawn.
_VERDICTS = {"TP", "MD", "FP", "FN", "left out"}
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
    key: str,
    values: Mapping[int, Mapping[str, float | None]],
    labels: Sequence[str],
) -> Drawn | None:
    """Return what is drawn of good runs; None when their evaluator gives no verdicts of the known kinds.

    Parameters
    ----------
    store : Store
    rows : sequence of RunRow
        Of status ``ok``.
    key : str
        Of the evaluator.
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
        mine = by_scene[scene_id]
        chosen = [mine[label] for label in labels if label in mine][:_MOST_OVERLAYS]
        view = scene_view(store, store.scene(scene_id), chosen, key)
        if view is None:
            continue
        count = sum(len(overlay.ids) + len(view.ids) for overlay in view.overlays)
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
        sizes=_sizes(store, sized, key, labels),
        sampling=tuple(sampling),
    )


def scene_view(store: Store, scene: StoredScene, rows: Iterable[RunRow], key: str) -> SceneView | None:
    """Return a scene with the overlays of some runs; None without reference or verdicts that can be drawn."""
    if scene.reference is None or scene.extent is None:
        return None
    overlays = []
    for row in rows:
        sides = store.verdicts(row.id, key)
        if not {each["verdict"] for side in sides.values() for each in side} <= _VERDICTS:
            continue
        detected = store.detections(row.id)
        if (len(sides["detection"]), len(sides["reference"])) != (len(detected), len(scene.reference)):
            continue
        overlays.append(
            Overlay(
                label=row.label,
                run=row.id,
                seed=row.seed,
                polygons=detected.polygons,
                ids=tuple(detected.ids.tolist()),
                detections=_side(sides["detection"]),
                references=_side(sides["reference"]),
            )
        )
    if not overlays:
        return None
    content = store.scene_picture(scene.id)
    return SceneView(
        name=scene.name,
        group=scene.recipe.group,
        extent=scene.extent,
        picture=None if content is None else ScenePicture.read(content),
        polygons=scene.reference.polygons,
        ids=tuple(scene.reference.ids.tolist()),
        area=scene.area,
        overlays=tuple(overlays),
    )


def _side(rows: Sequence[Mapping[str, Any]]) -> Side:
    def numbers(name: str) -> NDArray[np.float64]:
        found = [row.get(name) for row in rows]
        return np.array([math.nan if value is None else value for value in found], dtype=np.float64)

    return Side(
        verdicts=tuple(row["verdict"] for row in rows),
        reasons=tuple(row["reason"] for row in rows),
        partners=tuple(row.get("partner") for row in rows),
        distances=numbers("distance"),
        overlaps=numbers("overlap_area"),
        ious=numbers("iou"),
        rmses=numbers("rmse"),
    )


def _spread(by_scene: Mapping[int, Mapping[str, RunRow]]) -> list[int]:
    """Return scenes so that the first ones are of as many groups as possible, as seeds of one preset look alike."""
    groups: dict[str, list[int]] = {}
    for scene_id, mine in by_scene.items():
        groups.setdefault(next(iter(mine.values())).scene_group, []).append(scene_id)
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
        reference_areas = shapely.area(view.polygons)
        for number, overlay in enumerate(view.overlays):
            wrong = _wrong_areas(overlay, reference_areas)
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


def _wrong_areas(
    overlay: Overlay, reference_areas: NDArray[np.float64]
) -> dict[Literal["detection", "reference"], NDArray[np.float64]]:
    """Return the area that is wrong about each object, m2; a matched pair is booked on its detection."""
    own = shapely.area(overlay.polygons)
    verdicts = np.array(overlay.detections.verdicts, dtype=object)
    shared = np.nan_to_num(overlay.detections.overlaps)
    ious = overlay.detections.ious
    with np.errstate(divide="ignore", invalid="ignore"):
        differing = np.nan_to_num(shared / ious - shared, posinf=0.0)  # union minus intersection
    detections = np.where(np.isin(verdicts, ("FP", "MD")), own, np.where(verdicts == "TP", differing, 0.0))
    missed = np.array(overlay.references.verdicts, dtype=object) == "FN"
    return {"detection": detections, "reference": np.where(missed, reference_areas, 0.0)}


def _sizes(store: Store, rows: Sequence[RunRow], key: str, labels: Sequence[str]) -> tuple[SizeCurve, ...]:
    """Return the share of right objects by footprint area."""
    shown = labels[:_MOST_OVERLAYS]
    found = {label: np.zeros((2, len(_EDGES) - 1), dtype=np.int64) for label in shown}
    correct = {label: np.zeros((2, len(_EDGES) - 1), dtype=np.int64) for label in shown}
    areas: dict[int, NDArray[np.float64]] = {}
    for row in rows:
        if row.label not in found:
            continue
        if row.scene_id not in areas:
            reference = store.scene(row.scene_id).reference
            areas[row.scene_id] = np.empty(0) if reference is None else reference.areas
        references, detections = store.verdict_words(row.id, key)
        if len(references) == len(areas[row.scene_id]):
            found[row.label] += _binned(areas[row.scene_id], references, wrong="FN")
        correct[row.label] += _binned(store.detections(row.id).areas, detections, wrong="FP")
    curves = tuple(
        SizeCurve(label=label, found=_bins(found[label]), correct=_bins(correct[label]))
        for label in shown
        if found[label].any()
    )
    return curves if any(each.count for curve in curves for each in curve.found) else ()


def _binned(areas: NDArray[np.float64], verdicts: Sequence[str], *, wrong: str) -> NDArray[np.int64]:
    """Return counted and right objects per size; those that are neither TP nor `wrong` are not counted."""
    words = np.array(verdicts, dtype=object)
    if len(words) != len(areas):
        return np.zeros((2, len(_EDGES) - 1), dtype=np.int64)
    right = words == "TP"
    counted = right | (words == wrong)
    return np.array([np.histogram(areas[mask], _EDGES)[0] for mask in (counted, right)], dtype=np.int64)


def _bins(counts: NDArray[np.int64]) -> tuple[SizeBin, ...]:
    return tuple(
        SizeBin(low, high, int(count), int(right))
        for low, high, count, right in zip(_EDGES[:-1], _EDGES[1:], counts[0], counts[1], strict=True)
    )
