"""Scene views as compact JSON for the script of the report.

Coordinates become whole decimetres from the upper left corner of the extent, y downwards, written as SVG path data with
relative moves: a rectangle takes some 30 characters. Objects are parallel arrays, so that names are not repeated. A
reason is the number of its phrase and the numbers that stand in it, since most reasons differ by these only.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ..benchmark.analysis.report_data import Error, Overlay, Report, SceneView
from ..benchmark.execution.scene_picture import ScenePicture
from ..evaluators.verdict_table import Side, Verdicts
from .verdict_style import ROLE_STYLE

__all__ = ["data_uri", "path_data", "report_json"]

#: Maximum size of all scene pictures of a report together and of one, bytes before base64.
_ALL_PICTURES, _ONE_PICTURE = 3_000_000, 400_000
_PICTURE_SIDES = (1600, 1200, 900, 700, 500, 350)
#: Side of a picture in the gallery, pixels, and the surroundings it shows, as a fraction of the object.
_CARD, _MARGIN = 220, 0.6
_LEAST_CARD = 24.0  # m
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


def report_json(report: Report) -> dict[str, Any]:
    """Return the data for the script, as plain lists, numbers and text."""
    share = _ALL_PICTURES // max(len(report.scenes), 1)
    phrases = _Phrases()
    return {
        **_vocabulary(report),
        "scenes": [_scene(view, min(share, _ONE_PICTURE), phrases) for view in report.scenes],
        "errors": [_error(error, report.scenes[error.scene]) for error in report.errors],
        "phrases": phrases.known(),
    }


def _vocabulary(report: Report) -> dict[str, Any]:
    """Return the verdict kinds and measures that the evaluator declares, with their colours."""
    verdicts = next((overlay.verdicts for view in report.scenes for overlay in view.overlays), None)
    kinds, measures = ((), ()) if verdicts is None else (verdicts.kinds, verdicts.measures)
    return {
        "kinds": [
            {
                "key": kind.key,
                "side": f"{kind.side}s",
                "legend": kind.legend,
                "colour": ROLE_STYLE[kind.role].colour,
                "opacity": ROLE_STYLE[kind.role].in_viewer,
                "hatched": ROLE_STYLE[kind.role].hatch is not None,
                "filled": kind.role != "outline",
                "hidden": kind.counts_as == "neutral",
                "correct": kind.counts_as == "correct",
                "error": kind.is_error,
            }
            for kind in kinds
        ],
        "measures": [
            {
                "title": measure.title,
                "unit": {"fraction": "", "m2": "m²", "count": ""}.get(measure.unit, measure.unit),
                "decimals": measure.decimals,
            }
            for measure in measures
        ],
    }


class _Phrases:
    """Reasons without their numbers: ``found reference 12, shifted 1.8 m`` is ``"0 12 1.8"``."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}

    def known(self) -> list[list[str]]:
        """Return the text between the numbers of each phrase."""
        return [phrase.split("\0") for phrase in self._numbers]

    def short(self, reason: str) -> str:
        reason = reason.replace("\0", " ")
        phrase = self._numbers.setdefault(_NUMBER.sub("\0", reason), len(self._numbers))
        return " ".join([str(phrase), *_NUMBER.findall(reason)])


def data_uri(picture: ScenePicture) -> str:
    """Return a picture as ``data:`` address."""
    return "data:image/webp;base64," + base64.b64encode(picture.content).decode()


def path_data(polygons: Iterable[Any], extent: tuple[float, float, float, float]) -> list[str]:
    """Return SVG path data of each polygon, holes included; empty for an empty one."""
    shapes = np.asarray(list(polygons), dtype=object)
    parts, owners = shapely.get_parts(shapes, return_index=True)
    rings, part_of_ring = shapely.get_rings(parts, return_index=True)
    coordinates, ring_of_point = shapely.get_coordinates(rings, return_index=True)
    pixels = np.rint((coordinates - [extent[0], extent[3]]) * [10.0, -10.0]).astype(np.int64)
    bounds = np.searchsorted(ring_of_point, np.arange(len(rings) + 1))
    steps = np.diff(pixels, axis=0, prepend=[[0, 0]])
    paths = [""] * len(shapes)
    owner_of_ring = owners[part_of_ring]
    plain_pixels, plain_steps = pixels.tolist(), steps.tolist()
    for ring, owner in enumerate(owner_of_ring.tolist()):
        start, end = int(bounds[ring]), int(bounds[ring + 1]) - 1  # the last point repeats the first
        x, y = plain_pixels[start]
        moves = " ".join(f"{dx} {dy}" for dx, dy in plain_steps[start + 1 : end])
        paths[owner] += f"M{x} {y}l{moves}z"
    return paths


def _scene(view: SceneView, budget: int, phrases: _Phrases) -> dict[str, Any]:
    xmin, ymin, xmax, ymax = view.extent
    picture = None if view.picture is None else _within(view.picture, budget)
    return {
        "name": view.name,
        "width": round(10 * (xmax - xmin)),
        "height": round(10 * (ymax - ymin)),
        "picture": None if picture is None else data_uri(picture),
        "shows": "" if picture is None else picture.shows,
        "ids": view.reference.ids.tolist(),
        "paths": path_data(view.reference.polygons, view.extent),
        "areas": _rounded(view.reference.areas, 1),
        "border": None if view.area is None else path_data([view.area], view.extent)[0],
        "overlays": [_overlay(overlay, view, phrases) for overlay in view.overlays],
    }


def _within(picture: ScenePicture, budget: int) -> ScenePicture:
    """Return the largest version of a picture with at most `budget` bytes, or the smallest version."""
    if len(picture.content) <= budget:
        return picture
    smaller = picture
    for side in _PICTURE_SIDES:
        # The size grows with the number of pixels: versions far over the budget are not tried.
        pixels = (side / max(picture.width, picture.height)) ** 2
        if side == _PICTURE_SIDES[-1] or 0.6 * len(picture.content) * min(pixels, 1) <= budget:
            smaller = picture.at_most(side)
            if len(smaller.content) <= budget:
                break
    return smaller


def _overlay(overlay: Overlay, view: SceneView, phrases: _Phrases) -> dict[str, Any]:
    verdicts = overlay.verdicts
    return {
        "label": overlay.label,
        "run": overlay.run,
        "seed": overlay.seed,
        "ids": verdicts.detected.ids.tolist(),
        "paths": path_data(verdicts.detected.polygons, view.extent),
        "areas": _rounded(verdicts.detected.areas, 1),
        "detections": _side(verdicts, "detection", phrases),
        "references": _side(verdicts, "reference", phrases),
    }


def _side(verdicts: Verdicts, side: Side, phrases: _Phrases) -> dict[str, Any]:
    table = verdicts.table(side)
    number = {(kind.side, kind.key): place for place, kind in enumerate(verdicts.kinds)}
    return {
        "verdicts": [number[side, key] for key in table.verdicts.tolist()],
        "reasons": [phrases.short(reason) for reason in table.reasons],
        "partners": [None if partner < 0 else partner for partner in table.partner.tolist()],
        "measures": [_rounded(table.measure(measure.key), measure.decimals) for measure in verdicts.measures],
    }


def _rounded(values: NDArray[np.float64], decimals: int) -> list[float | None]:
    return [None if value != value else value for value in np.round(values, decimals).tolist()]


def _error(error: Error, view: SceneView) -> dict[str, Any]:
    """Return a card of the gallery: a part of the picture with the object in the middle."""
    overlay = view.overlays[error.overlay]
    polygons = overlay.verdicts.footprints(error.side).polygons
    xmin, ymin, xmax, ymax = shapely.bounds(polygons[error.position])
    width, height = view.extent[2] - view.extent[0], view.extent[3] - view.extent[1]
    longest = max(xmax - xmin, ymax - ymin)
    half = max(longest * (0.5 + _MARGIN), _LEAST_CARD / 2)
    half = max(min(half, width / 2, height / 2), longest / 2)
    west, north = (xmin + xmax) / 2 - half - view.extent[0], view.extent[3] - (ymin + ymax) / 2 - half
    # Moved into the picture where it is large enough.
    west, north = min(max(west, 0.0), max(width - 2 * half, west)), min(max(north, 0.0), max(height - 2 * half, north))
    picture = None
    if view.picture is not None:
        scale = view.picture.width / (view.extent[2] - view.extent[0])
        box = (west * scale, north * scale, (west + 2 * half) * scale, (north + 2 * half) * scale)
        picture = data_uri(view.picture.cut(box, _CARD))
    return {
        "scene": error.scene,
        "overlay": error.overlay,
        "side": error.side,
        "position": error.position,
        "wrong": round(error.wrong),
        "box": [round(10 * west), round(10 * north), round(20 * half)],
        "picture": picture,
    }
