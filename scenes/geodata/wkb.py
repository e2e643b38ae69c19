"""Geometries of WKB, as files store them; rings that are not closed are closed and reported."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.errors import InputError
from .footprints import Repair

__all__ = ["geometries_of_wkb"]


def geometries_of_wkb(wkb: NDArray[np.object_], file: Path) -> tuple[NDArray[np.object_], list[Repair]]:
    """Return geometries of WKB; rings that end elsewhere than they began are closed and reported."""
    closed = []
    with np.errstate(invalid="ignore"):  # coordinates that are NaN: left out and reported by Footprints.of
        geometries = np.asarray(shapely.from_wkb(wkb, on_invalid="ignore"), dtype=object)
        unread = [row for row in np.flatnonzero(shapely.is_missing(geometries)) if wkb[row] is not None]
        for row in unread:
            geometries[row] = shapely.from_wkb(wkb[row], on_invalid="fix")
            if geometries[row] is None:
                raise InputError(
                    f"{file}: the geometry of feature {row} is damaged, or a surface of triangles (multipatch, TIN): "
                    "copy the file again, or convert it, for instance with ogr2ogr -nlt MULTIPOLYGON"
                )
            closed.append(Repair(int(row), "a ring that is not closed", "repaired"))
    return geometries, closed
