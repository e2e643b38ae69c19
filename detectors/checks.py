"""Checks of the footprints that a detector returns, before anything uses them."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import shapely

from ..core.errors import InputError
from ..core.wording import counted
from ..scenes.geodata.crs import crs_label, same_crs
from ..scenes.geodata.footprints import Footprints
from ..scenes.scene import Scene

__all__ = ["checked_output"]

#: Largest distance of a detection beyond the extent, metres: roofs cut by the border are often completed.
_REACH = 50.0


def checked_output(detected: Any, scene: Scene, detector: str) -> Footprints:
    """Return the detector's footprints in the scene's CRS.

    Footprints without a CRS get that of the scene.

    Raises
    ------
    InputError
        Not `Footprints` of valid, non-empty, finite polygons in the scene's CRS, inside its extent or at most 50 m
        beyond it.
    """
    if not isinstance(detected, Footprints):
        raise InputError(f"{detector} returned {type(detected).__name__}, not Footprints: build them by Footprints.of")
    polygons = detected.polygons
    kinds = shapely.get_type_id(polygons)
    wrong = np.flatnonzero(~np.isin(kinds, (3, 6)) | shapely.is_empty(polygons))
    if len(wrong):
        one, several = "footprint that is empty or not a polygon", "footprints that are empty or not polygons"
        raise InputError(
            f"{detector} returned {counted(len(wrong), one, several)}, the first is number {wrong[0]}: build "
            "them by Footprints.of, which reports and drops such footprints"
        )
    wrong = np.flatnonzero(~np.isfinite(shapely.bounds(polygons)).all(axis=-1))
    if len(wrong):
        raise InputError(f"{detector} returned coordinates that are not finite, first in footprint {wrong[0]}")
    wrong = np.flatnonzero(~shapely.is_valid(polygons))
    if len(wrong):
        reason = shapely.is_valid_reason(polygons[wrong[0]])
        raise InputError(
            f"{detector} returned {counted(len(wrong), 'invalid polygon')}, the first is number {wrong[0]} ({reason}): "
            "build them by Footprints.of, which repairs them"
        )
    if detected.crs is not None and scene.crs is not None and not same_crs(detected.crs, scene.crs):
        raise InputError(
            f"{detector} returned footprints in {crs_label(detected.crs)}, but scene {scene.name!r} is in "
            f"{crs_label(scene.crs)}: return them in the CRS of the scene"
        )
    if len(polygons):
        xmin, ymin, xmax, ymax = scene.extent
        near = shapely.box(xmin - _REACH, ymin - _REACH, xmax + _REACH, ymax + _REACH)
        wrong = np.flatnonzero(~shapely.covers(near, polygons))
        if len(wrong):
            found = ", ".join(f"{value:.1f}" for value in shapely.bounds(polygons[wrong[0]]))
            raise InputError(
                f"{detector} returned {counted(len(wrong), 'footprint')} outside the extent of scene {scene.name!r}, "
                f"the first is number {wrong[0]} at [{found}]: return map coordinates, not pixels"
            )
    return dataclasses.replace(detected, crs=scene.crs)
