"""What an import is asked for: input files, how to read them, and what to derive from them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...core.errors import ParameterError
from .place import Extent

__all__ = ["ImportRequest"]

_Path = str | os.PathLike[str]
_Paths = Sequence[_Path] | _Path


@dataclass(frozen=True, kw_only=True)
class ImportRequest:
    """Input files and options of an import.

    Attributes
    ----------
    points : path or sequence of path
        LAS, LAZ or COPC files in one projected CRS in metres.
    dsm : path or sequence of path
        Digital surface models (DSM, GeoTIFF) instead of points: each cell with a height becomes a point.
    ortho : path or sequence of path
        Orthoimages (GeoTIFF), mosaicked; those in another CRS or of another cell size are resampled. Those that say
        that they are near infrared become its band ``nir``.
    nir : path or sequence of path
        Near infrared of the place of `ortho`, alone or as colour infrared (near infrared, red, green), of any type.
    dem : path or sequence of path
        Bare-earth elevation (GeoTIFF); narrow gaps are interpolated, wide ones derived from the points. Without it, the
        DEM is derived: from points of classes 2 (ground) and 9 (water), else by a ground filter.
    reference : path, optional
        Footprints in any vector format; transformed when in another CRS.
    area : path, optional
        Polygons inside which the reference is complete.
    crs : str, optional
        CRS of files whose CRS is missing or wrong.
    bands : sequence of str, optional
        Names of the image's bands in order: ``red``, ``green``, ``blue``, ``nir``, ``grey``, ``-`` to skip one.
    gsd : float, optional
        Cell size of the orthoimage, metres; by default that of the first file, or one that suits the points.
    dem_cell : float, optional
        Cell size of the DEM, metres; by default that of the file, 1 m when derived (more for sparse points).
    ground_filter : str, optional
        ``"opening"`` or ``"cloth"`` (extra ``ground``): derive the DEM by this filter even from classified points.
    building_id : str, optional
        Column of the reference whose equal values mark the parts of one building.
    reference_from_class : bool
        Derive the reference from the points of class 6 (building).
    ortho_from_points : bool
        Derive the orthoimage from coloured points.
    as_rectangles : bool
        Decompose the reference into rectangles that share a building id.
    join_gaps : float, optional
        Join footprints of the reference over gaps below this, metres: the houses of a row become blocks.
    extent : sequence of float, optional
        ``(xmin, ymin, xmax, ymax)``, metres: what to keep.
    name, source, licence : str, optional
        For the manifest; the default name is that of the folder.

    Raises
    ------
    ParameterError
        Options exclude each other, lack the input they need, or are out of range.
    """

    points: _Paths = ()
    dsm: _Paths = ()
    ortho: _Paths = ()
    nir: _Paths = ()
    dem: _Paths = ()
    reference: _Path | None = None
    area: _Path | None = None
    crs: str | None = None
    bands: Sequence[str] | None = None
    gsd: float | None = None
    dem_cell: float | None = None
    ground_filter: str | None = None
    building_id: str | None = None
    reference_from_class: bool = False
    ortho_from_points: bool = False
    as_rectangles: bool = False
    join_gaps: float | None = None
    extent: Sequence[float] | None = None
    name: str | None = None
    source: str | None = None
    licence: str | None = None

    def __post_init__(self) -> None:
        self._check_inputs()
        if self.ground_filter not in (None, "opening", "cloth"):
            raise ParameterError(f"ground_filter= must be opening or cloth, not {self.ground_filter!r}")
        for name, length in (("gsd", self.gsd), ("dem_cell", self.dem_cell)):
            if length is not None and not 0.01 <= length <= 100:
                raise ParameterError(f"{name}= must be from 0.01 to 100 m, not {length:g}")
        if self.name is not None and not self.name.strip():
            raise ParameterError("name= must not be empty: leave it out for the name of the folder")
        if self.extent is not None:
            _checked_extent(self.extent)

    @property
    def point_files(self) -> tuple[Path, ...]:
        """Point files; none of them twice."""
        return _paths(self.points)

    @property
    def surface_files(self) -> tuple[Path, ...]:
        """Surface models; none of them twice."""
        return _paths(self.dsm)

    @property
    def infrared_files(self) -> tuple[Path, ...]:
        """Infrared images; none of them twice."""
        return _paths(self.nir)

    @property
    def image_files(self) -> tuple[Path, ...]:
        """Orthoimages; none of them twice."""
        return _paths(self.ortho)

    @property
    def dem_files(self) -> tuple[Path, ...]:
        """Elevation models; none of them twice."""
        return _paths(self.dem)

    @property
    def wanted_extent(self) -> Extent | None:
        """The extent to keep, as floats."""
        return None if self.extent is None else _checked_extent(self.extent)

    def _check_inputs(self) -> None:
        """Refuse options that exclude each other or lack their input."""
        points, ortho, dem = self.point_files, self.image_files, self.dem_files
        if not points and not ortho and not self.surface_files:
            raise ParameterError("a scene needs points, a surface model or an orthoimage: give points=, dsm= or ortho=")
        if points and self.surface_files:
            raise ParameterError("give points= or dsm=, not both: a surface model takes the place of points")
        if self.infrared_files and not ortho:
            raise ParameterError("nir= is a band of an orthoimage: give ortho=")
        for given, file, derived, option in (
            (self.reference, "reference", self.reference_from_class, "reference_from_class"),
            (ortho, "ortho", self.ortho_from_points, "ortho_from_points"),
        ):
            if given and derived:
                raise ParameterError(f"give {file}= or {option}=True, not both")
            if derived and not points:
                raise ParameterError(f"{option}=True needs points: give points=")
        for chosen, option in (
            (self.as_rectangles, "as_rectangles=True"),
            (self.join_gaps is not None, "join_gaps="),
        ):
            if chosen and not (self.reference or self.reference_from_class):
                raise ParameterError(f"{option} needs a reference: give reference= or reference_from_class=True")
        if self.building_id and not self.reference:
            raise ParameterError("building_id= names a column of the reference: give reference=")
        if self.ground_filter is not None and dem:
            raise ParameterError("give dem= or ground_filter=, not both")
        if self.bands is not None and not ortho:
            raise ParameterError("bands= names the bands of an image: give ortho=")


def _paths(value: _Paths) -> tuple[Path, ...]:
    paths = (Path(value),) if isinstance(value, str | os.PathLike) else tuple(map(Path, value))
    seen: set[str] = set()
    for path in paths:
        place = os.path.realpath(path)
        if place in seen:
            raise ParameterError(f"{path} is given twice: its points or pixels would count double")
        seen.add(place)
    return paths


def _checked_extent(extent: Sequence[float]) -> Extent:
    if len(extent) != 4 or not np.isfinite(extent).all() or extent[2] <= extent[0] or extent[3] <= extent[1]:
        raise ParameterError(f"extent= must be xmin ymin xmax ymax, metres, of an area, not {tuple(extent)}")
    xmin, ymin, xmax, ymax = map(float, extent)
    return xmin, ymin, xmax, ymax
