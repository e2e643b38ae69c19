"""Geometries of any source turned into usable polygons: what was repaired or left out on the way is reported.

A *repair* is what was changed or dropped to make a footprint usable; nothing is changed silently.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

__all__ = ["Repair", "polygonal_part", "repaired"]

#: Coordinates of no system on earth, metres; squares of such numbers are not finite.
_FARTHEST = 1e9
#: Geometries that a thread tests at a time, and number from which on compiled code tests them first.
_CHUNK, _MANY = 1 << 14, 50_000


@dataclass(frozen=True)
class Repair:
    """One footprint that was repaired or left out on the way in.

    Attributes
    ----------
    id : int
        Row of the footprint in its source, from 0.
    problem : str
        What was wrong: ``"Self-intersection at (3, 4)"``, ``"empty"``, ``"zero area"``, ``"not a polygon: Point"``.
    action : str
        ``"repaired"`` or ``"left out"``.
    """

    id: int
    problem: str
    action: str

    def __str__(self) -> str:
        return f"feature {self.id}: {self.problem}: {self.action}"


def repaired(
    geometries: NDArray[np.object_],
) -> tuple[NDArray[np.object_], tuple[Repair, ...], NDArray[np.bool_]]:
    """Return clean polygons, the repairs, and the mask of rows that were kept."""
    if shapely.has_z(geometries).any() or shapely.has_m(geometries).any():
        geometries = shapely.force_2d(geometries)
    else:
        geometries = geometries.copy()
    repairs: list[Repair] = []
    kept = np.ones(len(geometries), dtype=bool)

    def leave_out(rows: NDArray[np.bool_], problem: str) -> None:
        for row in np.flatnonzero(rows & kept):
            repairs.append(Repair(int(row), problem, "left out"))
        kept[rows] = False

    leave_out(shapely.is_missing(geometries), "no geometry")
    leave_out(shapely.is_empty(geometries), "empty")
    types = shapely.get_type_id(geometries)
    polygonal = np.isin(types, (3, 6, 7))
    for row in np.flatnonzero(kept & ~polygonal):
        repairs.append(Repair(int(row), f"not a polygon: {geometries[row].geom_type}", "left out"))
    kept &= polygonal
    bounds = shapely.bounds(geometries)
    finite = np.isfinite(bounds).all(axis=1)
    areas = np.zeros(len(geometries))
    with np.errstate(over="ignore", invalid="ignore"):
        areas[kept] = shapely.area(geometries[kept])
        finite &= np.isfinite(areas)
    leave_out(~finite, "coordinates that are not finite")
    leave_out(finite & (np.abs(bounds) > _FARTHEST).any(axis=1), f"coordinates beyond {_FARTHEST:g} m")

    suspect = np.flatnonzero(kept)[~_are_valid(geometries[kept])]
    suspect = np.union1d(suspect, np.flatnonzero(kept & (types == 7)))
    for row in suspect:
        collection = geometries[row].geom_type == "GeometryCollection"
        problem = "a collection of geometries" if collection else shapely.is_valid_reason(geometries[row])
        # "structure" joins overlapping parts; "linework" would make holes where they overlap.
        made_valid = shapely.make_valid(geometries[row], method="structure", keep_collapsed=False)
        geometries[row] = polygonal_part(made_valid)
        usable = not geometries[row].is_empty
        repairs.append(Repair(int(row), problem, "repaired" if usable else "left out"))
        kept[row] = usable
        types[row], areas[row] = shapely.get_type_id(geometries[row]), shapely.area(geometries[row])
    several = np.flatnonzero(kept & (types == 6))
    single = several[shapely.get_num_geometries(geometries[several]) == 1]
    geometries[single] = shapely.get_geometry(geometries[single], 0)
    leave_out(~(areas > 0), "zero area")
    repairs.sort(key=lambda repair: repair.id)
    return geometries[kept], tuple(repairs), kept


def _are_valid(geometries: NDArray[np.object_]) -> NDArray[np.bool_]:
    """Return which polygons are valid; many of them are tested by several threads.

    Of very many, those that compiled code recognises as valid need no test by GEOS.
    """
    if len(geometries) <= _CHUNK:
        return np.asarray(shapely.is_valid(geometries))
    valid = np.zeros(len(geometries), dtype=bool)
    if len(geometries) > _MANY:
        from .simple_rings import clearly_simple  # loading the compiled code takes a moment

        single = (shapely.get_type_id(geometries) == 3) & (shapely.get_num_interior_rings(geometries) == 0)
        start = np.concatenate([[0], np.cumsum(shapely.get_num_coordinates(geometries[single]))]).astype(np.int64)
        valid[single] = clearly_simple(start, shapely.get_coordinates(geometries[single]))
    rest = np.flatnonzero(~valid)
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        parts = pool.map(shapely.is_valid, np.array_split(geometries[rest], len(rest) // _CHUNK + 1))
        valid[rest] = np.concatenate(list(parts))
    return valid


def polygonal_part(geometry: shapely.Geometry, *, grid_size: float | None = None) -> shapely.Geometry:
    """Return what has area in a geometry; an empty multipolygon where nothing has.

    Parameters
    ----------
    geometry : shapely.Geometry
    grid_size : float, optional
        Grid of the coordinates, m, for results of overlays on a grid.

    Examples
    --------
    >>> mixed = shapely.GeometryCollection([shapely.box(0, 0, 1, 1), shapely.LineString([(1, 1), (2, 2)])])
    >>> polygonal_part(mixed).geom_type, polygonal_part(shapely.Point(0, 0)).wkt
    ('Polygon', 'MULTIPOLYGON EMPTY')
    """
    parts = shapely.get_parts(geometry)
    while (shapely.get_type_id(parts) > 3).any():  # multipolygons and collections, nested to any depth
        parts = shapely.get_parts(parts)
    polygons = parts[shapely.get_type_id(parts) == 3]
    return shapely.union_all(polygons, grid_size=grid_size) if len(polygons) else shapely.MultiPolygon()
