"""Footprints: the outlines of buildings seen from above, detected or of reference.

Nouns
-----
footprint (entity)
    One polygon or multipolygon, with or without holes, in metres of a projected CRS, axis order x (east), y (north).
building id
    Label shared by the footprints that are parts of one building (L, T, U, C shapes).
centre
    Of a convex quadrilateral without holes: the intersection of its diagonals; of anything else: the area centroid.

Source of the definitions: Awrangjeb, Ravanbakhsh & Fraser (2010), section 4.1.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, overload

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray

from ...core.display import Displayed
from ...core.errors import InputError
from ...core.registry import nearest_hint
from ...core.wording import counted
from .corner_strips import connected
from .crs import crs_label, file_crs, named_crs
from .polygon_repair import Repair, repaired
from .ring_measures import centres_of, quadrilaterals_of
from .vector_columns import labels_of

if TYPE_CHECKING:
    import geopandas as gpd
    from matplotlib.axes import Axes

__all__ = ["Footprints", "stacked"]

#: Widest gap that is closed between footprints, metres: no two houses so far apart are one block.
_WIDEST_GAP = 100.0
#: Stands for "number the rows from 0".
_UNNUMBERED: NDArray[np.int64] = np.empty(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Footprints(Displayed):
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

    shown_by = "reports.notebook_view:footprints_view"

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
        clean, repairs, kept = repaired(geometries)
        columns = {}
        for name, column in (attributes or {}).items():
            values = column if isinstance(column, np.ndarray) else np.asarray(column)  # keeps the mask of a masked one
            if len(values) != len(geometries):
                numbers = f"{counted(len(values), 'value')} for {counted(len(geometries), 'polygon')}"
                raise InputError(f"{source}: attribute {name!r} has {numbers}")
            columns[name] = values[kept]
        labels = None
        if building_ids is not None:
            given = building_ids if isinstance(building_ids, np.ndarray) else _as_column(building_ids)
            if given.shape != geometries.shape:
                numbers = f"{counted(given.size, 'building id')} for {counted(len(geometries), 'polygon')}"
                raise InputError(f"{source}: {numbers}: give one each")
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
    def from_geopandas(
        cls,
        frame: gpd.GeoDataFrame | gpd.GeoSeries,
        *,
        building_id: str | None = None,
        crs: str | None = None,
        source: str = "geopandas",
    ) -> Footprints:
        """Build from a GeoDataFrame or GeoSeries; CRS and columns are kept.

        Parameters
        ----------
        frame : GeoDataFrame or GeoSeries
        building_id : str, optional
            Column whose equal values mark the parts of one building; a column called ``building_id`` is used where
            there is one.
        crs : str, optional
            CRS to assign where the frame has none or a wrong one; coordinates are not changed.
        source : str
            Name for messages.
        """
        try:
            geometry = frame.geometry
        except AttributeError:
            raise InputError(f"{source}: the frame has no active geometry: choose it by set_geometry") from None
        names = [name for name in getattr(frame, "columns", ()) if name != geometry.name]
        columns = {str(name): frame[name].to_numpy() for name in names}
        if building_id is None and "building_id" in columns:
            building_id = "building_id"
        if building_id is not None and building_id not in columns:
            raise InputError(
                f"{source}: no column {building_id!r}{nearest_hint(building_id, columns)}; "
                f"it has {', '.join(columns) or 'none'}"
            )
        own = None if frame.crs is None else file_crs(frame.crs, source)
        return cls.of(
            geometry.to_numpy(),
            building_ids=None if building_id is None else columns[building_id],
            crs=own if crs is None else named_crs(crs),
            attributes=columns,
            source=source,
        )

    @classmethod
    def empty(cls, *, crs: str | None = None, source: str = "footprints") -> Footprints:
        """Return a set of no footprints: a valid result."""
        return cls(polygons=np.empty(0, dtype=object), crs=crs, source=source)

    def __len__(self) -> int:
        return len(self.polygons)

    def __repr__(self) -> str:
        plural = "s" * (len(self) != 1)
        return f"<Footprints {len(self)} polygon{plural}, {crs_label(self.crs)}, {PurePath(self.source).name}>"

    def __iter__(self) -> Iterator[shapely.Geometry]:
        return iter(self.polygons)

    @overload
    def __getitem__(self, index: int) -> shapely.Geometry: ...

    @overload
    def __getitem__(self, index: slice | NDArray[Any] | list[Any]) -> Footprints: ...

    def __getitem__(self, index: int | slice | NDArray[Any] | list[Any]) -> shapely.Geometry | Footprints:
        """Return the polygon at an integer, or the footprints of a slice, mask or list of integers.

        Examples
        --------
        >>> pair = Footprints.of([shapely.box(0, 0, 1, 1), shapely.box(2, 0, 4, 1)])
        >>> pair[1].area, pair[:1], pair[pair.areas > 5]
        (2.0, <Footprints 1 polygon, no CRS, footprints>, <Footprints 0 polygons, no CRS, footprints>)
        """
        if isinstance(index, int | np.integer):
            return self.polygons[index]
        return self.take(np.arange(len(self))[index])

    def to_geopandas(self) -> gpd.GeoDataFrame:
        """Return a GeoDataFrame with CRS, the attributes as columns, and ``building_id`` where there are any."""
        from .frames import geo_frame

        own = {} if self.building_ids is None else {"building_id": self.building_ids}
        return geo_frame({**own, **self.attributes}, self.polygons, self.crs)

    def plot(self, ax: Axes | None = None, **style: Any) -> Axes:
        """Draw the outlines with matplotlib and return the axes; `style` is that of `GeoDataFrame.plot`."""
        look = {"facecolor": "#0072B255", "edgecolor": "#0072B2", "linewidth": 0.8, **style}
        axes: Axes = self.to_geopandas().plot(ax=ax, **look)
        axes.set_aspect("equal")
        return axes

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
        cannot see those. Outlines stay where they are but for gaps and notches narrower than `gap`; neighbours that
        meet at a corner are connected by a strip of 2 cm.

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
        parts = shapely.buffer(self.polygons, gap / 2, join_style="mitre")
        grown = shapely.union_all(parts)
        # The union of many at once can lose one that touches others (GEOS 3.14).
        shapely.prepare(grown)
        lost = ~shapely.intersects(grown, shapely.point_on_surface(parts))
        grown = reduce(shapely.union, parts[lost], grown)
        blocks = connected(shapely.get_parts(shapely.buffer(grown, -gap / 2, join_style="mitre")), gap)
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


def stacked(parts: Sequence[Footprints]) -> Footprints:
    """Return the footprints of several sets with the same columns, one after the other; the rest is of the first."""
    columns = {name: np.concatenate([part.attributes[name] for part in parts]) for name in parts[0].attributes}
    labels = None
    if parts[0].building_ids is not None:
        labels = np.concatenate([np.asarray(part.building_ids) for part in parts])
    polygons = np.concatenate([part.polygons for part in parts])
    ids = np.concatenate([part.ids for part in parts])
    return replace(parts[0], polygons=polygons, building_ids=labels, attributes=columns, ids=ids)
