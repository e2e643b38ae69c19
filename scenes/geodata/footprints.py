"""Footprints: the outlines of buildings seen from above, detected or of reference.

Nouns
-----
footprint (entity)
    One polygon or multipolygon, with or without holes, in metres of a projected CRS, axis order x (east), y (north).
building id
    Label shared by the footprints that are parts of one building (L, T, U, C shapes).
centre
    Of a convex quadrilateral without holes: the intersection of its diagonals; of anything else: the area centroid.
repair
    What was changed or dropped to make a footprint usable; nothing is changed silently.

Source of the definitions: Awrangjeb, Ravanbakhsh & Fraser (2010), section 4.1.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from ...core.errors import InputError
from .crs import crs_label
from .ring_measures import centres_of, quadrilaterals_of
from .vector_columns import labels_of

__all__ = ["Footprints", "Repair", "polygonal_part"]

#: Widest gap that is closed between footprints, metres: no two houses so far apart are one block.
_WIDEST_GAP = 100.0
#: Coordinates of no system on earth, metres; squares of such numbers are not finite.
_FARTHEST = 1e9

#: Geometries that a thread tests at a time, and number from which on compiled code tests them first.
_CHUNK, _MANY = 1 << 14, 50_000

#: Stands for "number the rows from 0".
_UNNUMBERED: NDArray[np.int64] = np.empty(0, dtype=np.int64)


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


@dataclass(frozen=True, eq=False)
class Footprints:
    """A set of footprints with a common CRS.

    Build it by `Footprints.of`, which repairs and checks; the constructor takes what is already clean.

    Attributes
    ----------
    polygons : ndarray of shapely geometries, shape (n,)
        Valid, non-empty Polygons and MultiPolygons in metres.
    building_ids : ndarray, shape (n,), optional
        Integers or texts; None when every polygon is its own building.
    crs : str, optional
        Authority code or WKT; None when not known.
    ids : ndarray of int64, shape (n,)
        Row of each polygon in its source, to name it in messages and verdicts.
    attributes : mapping of str to ndarray, shape (n,)
        Further columns, for instance a detector's score or roof height.
    metadata : mapping
        Facts of the whole set that JSON can hold, for instance a sampler's energy trace.
    repairs : tuple of Repair
        What was repaired or left out on the way in.
    source : str
        File or maker, for messages.
    """

    polygons: NDArray[np.object_]
    building_ids: NDArray[Any] | None = None
    crs: str | None = None
    ids: NDArray[np.int64] = field(default_factory=lambda: _UNNUMBERED)
    attributes: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    metadata: Mapping[str, Any] = field(default_factory=dict)
    repairs: tuple[Repair, ...] = ()
    source: str = "footprints"

    def __post_init__(self) -> None:
        if self.ids is _UNNUMBERED:
            object.__setattr__(self, "ids", np.arange(len(self.polygons), dtype=np.int64))

    @classmethod
    def of(
        cls,
        polygons: Iterable[Any],
        *,
        building_ids: ArrayLike | None = None,
        crs: str | None = None,
        attributes: Mapping[str, ArrayLike] | None = None,
        metadata: Mapping[str, Any] | None = None,
        source: str = "footprints",
    ) -> Footprints:
        """Build from any geometries: repairs invalid ones, leaves out unusable ones, and reports both.

        Building ids may be numbers or texts; a polygon without one (None, NaN) is its own building.

        Invalid geometry is replaced by the polygonal part of its `make_valid`, overlapping parts joined. None, empty,
        zero-area, non-finite and non-polygonal geometries are left out. Z and M are dropped; a multipolygon of one
        part becomes a polygon.

        Examples
        --------
        >>> bow_tie = shapely.Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])
        >>> footprints = Footprints.of([bow_tie, shapely.Polygon(), shapely.box(0, 0, 1, 1)])
        >>> len(footprints), [str(repair) for repair in footprints.repairs]
        (2, ['feature 0: Self-intersection[1 1]: repaired', 'feature 1: empty: left out'])
        """
        geometries = _as_geometry_array(polygons)
        clean, repairs, kept = _repaired(geometries)
        columns = {}
        for name, column in (attributes or {}).items():
            values = column if isinstance(column, np.ndarray) else np.asarray(column)  # keeps the mask of a masked one
            if len(values) != len(geometries):
                raise InputError(
                    f"{source}: attribute {name!r} has {len(values)} values for {len(geometries)} polygons"
                )
            columns[name] = values[kept]
        labels = None
        if building_ids is not None:
            given = building_ids if isinstance(building_ids, np.ndarray) else _as_column(building_ids)
            if given.shape != geometries.shape:
                raise InputError(f"{source}: {given.size} building ids for {len(geometries)} polygons: give one each")
            labels = labels_of(given)[kept]
        return cls(
            polygons=clean,
            building_ids=labels,
            crs=crs,
            ids=np.flatnonzero(kept).astype(np.int64),
            attributes=columns,
            metadata=dict(metadata or {}),
            repairs=repairs,
            source=source,
        )

    @classmethod
    def from_rectangles(
        cls, corners: ArrayLike, *, crs: str | None = None, building_ids: ArrayLike | None = None, **more: Any
    ) -> Footprints:
        """Build from an array of four corners each, shape (n, 4, 2), in metres, in ring order."""
        array = np.asarray(corners, dtype=np.float64).reshape(-1, 4, 2)
        polygons = shapely.polygons(np.concatenate([array, array[:, :1]], axis=1))
        return cls.of(polygons, crs=crs, building_ids=building_ids, **more)

    @classmethod
    def empty(cls, *, crs: str | None = None, source: str = "footprints") -> Footprints:
        """Return a set of no footprints: a valid result."""
        return cls(polygons=np.empty(0, dtype=object), crs=crs, source=source)

    def __len__(self) -> int:
        return len(self.polygons)

    def __repr__(self) -> str:
        return f"<Footprints {len(self)} polygons, {crs_label(self.crs)}, {self.source}>"

    def take(self, index: NDArray[Any]) -> Footprints:
        """Return the footprints at `index` (integers or a mask)."""
        return Footprints(
            polygons=self.polygons[index],
            building_ids=None if self.building_ids is None else self.building_ids[index],
            crs=self.crs,
            ids=self.ids[index],
            attributes={name: column[index] for name, column in self.attributes.items()},
            metadata=self.metadata,
            repairs=self.repairs,
            source=self.source,
        )

    def joined(self, gap: float) -> Footprints:
        """Return blocks: footprints that are closer than `gap` (m) are joined into one, building ids are dropped.

        A register cuts rows into houses; joined over party walls, its blocks can be compared with detections that
        cannot see those. Outlines stay where they are but for gaps and notches narrower than `gap`.

        Examples
        --------
        >>> row = Footprints.of([shapely.box(0, 0, 5, 9), shapely.box(5.02, 0, 10, 9), shapely.box(20, 0, 25, 9)])
        >>> [round(area, 1) for area in row.joined(0.1).areas]
        [90.0, 45.0]
        """
        if not 0 < gap <= _WIDEST_GAP:
            raise InputError(
                f"{self.source}: footprints are joined over gaps of more than 0 and up to {_WIDEST_GAP:g} m, "
                f"not {gap:g} m"
            )
        grown = shapely.union_all(shapely.buffer(self.polygons, gap / 2, join_style="mitre"))
        blocks = shapely.get_parts(shapely.buffer(grown, -gap / 2, join_style="mitre"))
        return Footprints.of(blocks, crs=self.crs, source=f"{self.source} (joined over gaps below {gap:g} m)")

    @cached_property
    def areas(self) -> NDArray[np.float64]:
        """Area of each footprint, m2, shape (n,)."""
        return np.asarray(shapely.area(self.polygons), dtype=np.float64)

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """Bounds xmin, ymin, xmax, ymax of each footprint, m, shape (n, 4)."""
        return np.asarray(shapely.bounds(self.polygons), dtype=np.float64).reshape(-1, 4)

    @cached_property
    def building_codes(self) -> NDArray[np.int64]:
        """Building of each footprint as integers from 0, shape (n,)."""
        if self.building_ids is None:
            return np.arange(len(self), dtype=np.int64)
        return np.unique(self.building_ids, return_inverse=True)[1].astype(np.int64)

    @cached_property
    def quadrilaterals(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Indices (m,) and corners (m, 4, 2), counter-clockwise, of the convex quadrilaterals without holes."""
        return quadrilaterals_of(*self.rings)

    @cached_property
    def rings(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Start of each footprint in the rows of points, shape (n + 1,), and points, shape (m, 2), metres.

        The rings of a footprint are closed and follow each other, separated by a row of NaN. Where there are several,
        exteriors run counter-clockwise and holes clockwise; a single one runs as it was given. An empty polygon, which
        clipping may leave, has no points.
        """
        single = (shapely.get_type_id(self.polygons) == 3) & (shapely.get_num_interior_rings(self.polygons) == 0)
        counts = shapely.get_num_coordinates(self.polygons).astype(np.int64)
        if single.all():
            start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
            return start, shapely.get_coordinates(self.polygons)
        several: dict[int, NDArray[np.float64]] = {}
        gap = np.full((1, 2), np.nan)
        for row in np.flatnonzero(~single).tolist():
            rings = shapely.get_rings(shapely.get_parts(shapely.orient_polygons(self.polygons[row])))
            pieces = [part for ring in rings for part in (gap, shapely.get_coordinates(ring))]
            several[row] = np.concatenate(pieces[1:]) if pieces else np.empty((0, 2))
            counts[row] = len(several[row])
        start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        points = np.empty((start[-1], 2))
        of_single = np.ones(len(points), dtype=bool)
        for row, rows in several.items():
            points[start[row] : start[row + 1]] = rows
            of_single[start[row] : start[row + 1]] = False
        points[of_single] = shapely.get_coordinates(self.polygons[single])
        return start, points

    @cached_property
    def centres(self) -> NDArray[np.float64]:
        """Centre of each footprint, shape (n, 2), metres (2010 paper, section 4.1)."""
        return centres_of(*self.rings, self.quadrilaterals)


def _as_geometry_array(polygons: Iterable[Any]) -> NDArray[np.object_]:
    if isinstance(polygons, shapely.Geometry) or (isinstance(polygons, np.ndarray) and polygons.ndim != 1):
        raise InputError("footprints are built from a sequence of polygons, one dimension: put a single one in a list")
    items = polygons if isinstance(polygons, np.ndarray) else list(polygons)
    array = np.empty(len(items), dtype=object)
    array[:] = items
    if not (shapely.is_geometry(array) | shapely.is_missing(array)).all():
        wrong = next(item for item in array if item is not None and not shapely.is_geometry(item))
        raise InputError(f"footprints are shapely polygons, not {type(wrong).__name__}")
    return array


def _as_column(values: Any) -> NDArray[Any]:
    """Return a list as an array that keeps texts and numbers apart."""
    items = list(values)
    plain = all(isinstance(item, str) for item in items) or all(isinstance(item, int | np.integer) for item in items)
    return np.array(items) if plain and items else np.array(items, dtype=object)


def _repaired(
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
    polygonal = np.isin(shapely.get_type_id(geometries), (3, 6, 7))
    for row in np.flatnonzero(kept & ~polygonal):
        repairs.append(Repair(int(row), f"not a polygon: {geometries[row].geom_type}", "left out"))
    kept &= polygonal
    bounds = shapely.bounds(geometries)
    finite = np.isfinite(bounds).all(axis=1)
    with np.errstate(over="ignore", invalid="ignore"):
        finite[kept] &= np.isfinite(shapely.area(geometries[kept]))
    leave_out(~finite, "coordinates that are not finite")
    leave_out(finite & (np.abs(bounds) > _FARTHEST).any(axis=1), f"coordinates beyond {_FARTHEST:g} m")

    suspect = np.flatnonzero(kept)[~_are_valid(geometries[kept])]
    suspect = np.union1d(suspect, np.flatnonzero(kept & (shapely.get_type_id(geometries) == 7)))
    for row in suspect:
        collection = geometries[row].geom_type == "GeometryCollection"
        problem = "a collection of geometries" if collection else shapely.is_valid_reason(geometries[row])
        # "structure" joins overlapping parts; "linework" would make holes where they overlap.
        repaired = shapely.make_valid(geometries[row], method="structure", keep_collapsed=False)
        geometries[row] = polygonal_part(repaired)
        usable = not geometries[row].is_empty
        repairs.append(Repair(int(row), problem, "repaired" if usable else "left out"))
        kept[row] = usable
    single = kept & (shapely.get_type_id(geometries) == 6) & (shapely.get_num_geometries(geometries) == 1)
    geometries[single] = shapely.get_geometry(geometries[single], 0)
    flat = np.zeros(len(geometries), dtype=bool)
    flat[kept] = ~(shapely.area(geometries[kept]) > 0)
    leave_out(flat, "zero area")
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
