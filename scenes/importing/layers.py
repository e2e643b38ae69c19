"""Layers of an import: points, orthoimage, DEM, reference and area brought to one place.

A *place* is the CRS and extent that a new scene is to have, with the log of what was done to get there. Each function
takes what one kind of file gives, checks that it belongs to the place, and notes whatever it had to do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from ...core.errors import InputError
from ..geodata.crs import same_crs
from ..geodata.footprints import Footprints
from ..geodata.las_files import LasHeader, read_points
from ..geodata.points import PointCloud
from ..geodata.raster import Elevation, Grid, Image
from ..geodata.raster_files import RasterHeader, looks_like_values
from ..geodata.raster_mosaic import mosaic_elevation, mosaic_image, resampling_note, warped_extent, warped_size

__all__ = [
    "Extent",
    "ImportLog",
    "Place",
    "area_of_extent",
    "brief",
    "common",
    "dem_of",
    "dem_of_points",
    "image_of",
    "image_of_points",
    "points_of",
    "read_area",
    "read_reference",
    "rectangles_of",
    "reference_of_class",
    "some",
    "text",
]

Extent = tuple[float, float, float, float]
#: ASPRS classes that mark a return as noise: low and high.
_NOISE = (7, 18)
#: Most cells of a raster: 10 km2 at 0.1 m.
_MOST_CELLS = 1e9
#: Heights between which land lies, metres: the shore of the Dead Sea and Mount Everest, with room for any zero.
_LOWEST_LAND, _HIGHEST_LAND = -1000.0, 10000.0
#: ASPRS classes whose points lie on the bare earth: ground and water.
_GROUND, _WATER = 2, 9


class ImportLog:
    """What was done: the notes, and how each derived layer came about."""

    def __init__(self, tell: Callable[[str], None] | None) -> None:
        self.notes: list[str] = []
        self.derived: dict[str, str] = {}
        self._tell = tell

    def note(self, sentence: str) -> None:
        """Keep a sentence and tell it."""
        self.notes.append(sentence)
        if self._tell is not None:
            self._tell(sentence)


@dataclass(frozen=True)
class Place:
    """The CRS and extent, ``(xmin, ymin, xmax, ymax)`` in metres, of a scene in the making, and its log."""

    crs: str
    extent: Extent
    log: ImportLog


def points_of(place: Place, clouds: Sequence[LasHeader], progress: Callable[[int, int], None] | None) -> PointCloud:
    """Return the points of all files in the place, without noise and repeats."""
    cloud = read_points([header.path for header in clouds], window=place.extent, progress=progress)
    names = some([header.path for header in clouds])
    if len(cloud) == 0:
        raise InputError(f"{names} has no points in {text(place.extent)}: choose another extent=")
    _check_bounds(place, cloud, names)
    wild = (cloud.z < _LOWEST_LAND) | (cloud.z > _HIGHEST_LAND)
    if wild.any():
        value = float(cloud.z[wild][0])
        cloud = cloud.take(~wild)
        place.log.note(
            f"{np.count_nonzero(wild)} points at heights such as {value:g} m, where no land is, were left out"
        )
        if len(cloud) == 0:
            raise InputError(f"{names} holds no heights of land: the first is {value:g} m; are they scaled?")
    if cloud.classification is not None:
        noise = np.isin(cloud.classification, _NOISE)
        if noise.any():
            cloud = cloud.take(~noise)
            place.log.note(f"{np.count_nonzero(noise)} points of the classes noise (7 and 18) were left out")
            if len(cloud) == 0:
                raise InputError(f"{names} holds no points but noise (classes 7 and 18)")
    distinct = cloud.distinct()
    if len(distinct) < len(cloud):
        place.log.note(f"{len(cloud) - len(distinct)} points that were there twice were left out")
    return distinct


def image_of(place: Place, images: Sequence[RasterHeader], gsd: float | None, bands: Sequence[str] | None) -> Image:
    """Return the mosaic of orthoimages on the cells of the first, or on cells of `gsd` metres."""
    grid = _grid(place, images[0], gsd)
    _check_size(place, grid.gsd, "gsd")
    _note_resampling(place, images, grid)
    image = mosaic_image(images, grid, crs=place.crs, bands=bands)
    if bands is None and (marked := [header.path for header in images if looks_like_values(header)]):
        place.log.note(
            f"{brief(marked)}: the last band is marked as alpha and was taken for the mask, but holds many values: "
            "if it is near infrared, name the bands: red,green,blue,nir"
        )
    if image.valid is not None and not image.valid.any():
        raise InputError(
            f"{some([header.path for header in images])} has no data in {text(place.extent)}: image and points do not "
            "overlap"
        )
    return _with_gaps_noted(place, image)


def image_of_points(place: Place, points: PointCloud, gsd: float | None, files: Sequence[Path]) -> Image:
    """Return the orthoimage that coloured points give."""
    from .coloured_points import image_from_points

    _check_size(place, gsd or 0.1, "gsd")
    image = image_from_points(points, place.extent, gsd=gsd, source=some(files))
    how = place.log.derived["image"] = f"rastered from the colours of the points, at {image.grid.gsd:g} m"
    place.log.note(f"the orthoimage was {how}")
    return _with_gaps_noted(place, image)


def dem_of(place: Place, models: Sequence[RasterHeader], cell: float | None, points: PointCloud | None) -> Elevation:
    """Return the mosaic of elevation models with its gaps filled, compared with the points."""
    from ..ground.filter import fill_unknown

    files = [header.path for header in models]
    if not any(common(place.extent, warped_extent(model, place.crs)) for model in models):
        raise InputError(
            f"{some(files)} covers {text(warped_extent(models[0], place.crs))} and not the scene, "
            f"{text(place.extent)}: check that they show the same place in the CRS that they name"
        )
    grid = _grid(place, models[0], cell)
    _check_size(place, grid.gsd, "dem_cell")
    _note_resampling(place, models, grid)
    dem = mosaic_elevation(models, grid, crs=place.crs)
    unknown = np.isnan(dem.values)
    wild = ~unknown & ((dem.values < _LOWEST_LAND) | (dem.values > _HIGHEST_LAND))
    if wild.any():
        value = float(dem.values[wild][0])
        raise InputError(
            f"{some(files)} holds heights of {value:g} m, where no land is: if that marks no data, say so with "
            f"gdal_edit.py -a_nodata {value:g}"
        )
    if unknown.all():
        raise InputError(
            f"{some(files)} holds no height in {text(place.extent)} (all NaN or no data): give another DEM, or none, "
            "and it is derived from the points"
        )
    if unknown.any():
        dem = Elevation(fill_unknown(dem.values), grid)
        how = place.log.derived["dem"] = f"{unknown.mean():.1%} of its cells had no height and were interpolated"
        place.log.note(f"{brief(files)}: {how}")
    if points is not None:
        _compare_heights(place, points, dem, brief(files))
    return dem


def dem_of_points(place: Place, points: PointCloud, cell: float | None, ground_filter: str | None) -> Elevation:
    """Return the bare earth that the points give: of those classified as ground, else by a ground filter."""
    from ..ground.filter import elevation_from_points, ground_surface

    _check_size(place, cell or 1.0, "dem_cell")
    classes = points.classification
    if ground_filter == "cloth":
        from ..ground.cloth import cloth_surface

        dem = cloth_surface(points, place.extent, cell=cell)
        how = "by a cloth simulation filter"
    elif ground_filter is None and classes is not None and np.any(classes == _GROUND):
        dem = elevation_from_points(points, place.extent, cell=cell or 1.0, classes=(_GROUND, _WATER))
        how = "from the points of classes 2 (ground) and 9 (water), gaps interpolated"
    else:
        dem = ground_surface(points, place.extent, cell=cell)
        why = ", since no point is classified as ground" if ground_filter is None else ""
        how = f"by a ground filter (progressive opening){why}"
    how = place.log.derived["dem"] = f"{how}, at {dem.grid.gsd:g} m"
    place.log.note(f"the DEM was derived {how}")
    return dem


def read_reference(place: Place, name: str, building_id: str | None) -> Footprints:
    """Read reference footprints, brought to the CRS of the place, those outside left out."""
    from ..geodata.vector_files import read_footprints

    footprints = read_footprints(name, building_id=building_id, to_crs=place.crs)
    file = Path(name).name
    if footprints.repairs:
        count = len(footprints.repairs)
        told = "; ".join(str(repair) for repair in footprints.repairs[:5]) + ("; ..." if count > 5 else "")
        place.log.note(f"{file}: {count} footprint{'s were' if count > 1 else ' was'} mended or left out ({told})")
    if not len(footprints):
        place.log.note(f"{file} holds no footprints: the scene has an empty reference")
        return footprints
    box = shapely.box(*place.extent)
    inside = shapely.area(shapely.intersection(footprints.polygons, box)) > 0
    if not inside.any():
        raise InputError(
            f"{name} covers {text(shapely.total_bounds(footprints.polygons))} and lies outside the scene, "
            f"{text(place.extent)}: check that it shows the same place in the CRS that it names"
        )
    if not inside.all():
        place.log.note(f"{file}: {np.count_nonzero(~inside)} of {len(inside)} footprints lie outside and were left out")
    return footprints.take(inside)


def reference_of_class(place: Place, points: PointCloud, files: Sequence[Path]) -> Footprints:
    """Return the outlines of the points that are classified as building."""
    from .class_outlines import outlines_of_class

    reference = outlines_of_class(points, place.extent, crs=place.crs, source=some(files))
    how = place.log.derived["reference"] = "traced around the points of class 6 (building)"
    place.log.note(f"the reference ({len(reference)} footprints) was {how}")
    return reference


def blocks_of(place: Place, reference: Footprints, gap: float) -> Footprints:
    """Return the reference with footprints joined over gaps below `gap` (m)."""
    blocks = reference.joined(gap)
    _changed_reference(place, f"joined over gaps below {gap:g} m ({len(reference)} footprints, {len(blocks)} blocks)")
    return blocks


def rectangles_of(place: Place, reference: Footprints) -> Footprints:
    """Return the reference as rectangles, with a note on how well they fit."""
    from ..geodata.rectangles import as_rectangles

    rectangles, fit = as_rectangles(reference)
    _changed_reference(
        place,
        f"decomposed into rectangles ({fit.footprints} footprints, {fit.rectangles} rectangles, "
        f"areas agree to {fit.agreement:.1%})",
    )
    if fit.poor:
        ids = ", ".join(map(str, fit.poor[:10])) + (", ..." if len(fit.poor) > 10 else "")
        place.log.note(f"footprints that rectangles do not fit (areas agree below 80%): {ids}")
    return rectangles


def _changed_reference(place: Place, how: str) -> None:
    """Record and tell what was made of the reference."""
    before = place.log.derived.get("reference")
    place.log.derived["reference"] = f"{before}, then {how}" if before else how
    place.log.note(f"the reference was {how}")


def read_area(place: Place, name: str) -> shapely.Geometry:
    """Read the polygons inside which the reference is complete, as one geometry cut to the place."""
    from ..geodata.vector_files import read_footprints

    polygons = read_footprints(name, to_crs=place.crs).polygons
    parts = shapely.get_parts(shapely.intersection(shapely.union_all(polygons), shapely.box(*place.extent)))
    parts = parts[shapely.area(parts) > 0]
    if not len(parts):
        raise InputError(
            f"{name} does not overlap the scene, {text(place.extent)}: "
            "check that it shows the same place in the CRS that it names"
        )
    return shapely.union_all(parts)


def area_of_extent(place: Place, reference: Footprints) -> shapely.Geometry | None:
    """Return the extent as evaluation area when footprints reach beyond it, else None."""
    box = shapely.box(*place.extent)
    beyond = int(np.count_nonzero(~shapely.covers(box, reference.polygons)))
    if not beyond:
        return None
    place.log.derived["area"] = "the extent of the scene, since footprints of the reference reach beyond it"
    place.log.note(f"footprints that reach beyond the scene: {beyond}; its extent was made the evaluation area")
    return box


def _check_bounds(place: Place, cloud: PointCloud, names: str) -> None:
    """Refuse a header whose bounds are far wider than its points: grids of that size would fill the memory."""
    xmin, ymin, xmax, ymax = place.extent
    real = (cloud.x.min(), cloud.y.min(), cloud.x.max(), cloud.y.max())
    share = (real[2] - real[0]) * (real[3] - real[1]) / ((xmax - xmin) * (ymax - ymin))
    if (xmax - xmin) * (ymax - ymin) > 1e7 and share < 0.25:
        raise InputError(
            f"{names}: the header says {text(place.extent)}, but the points lie in {text(real)}: give "
            f"extent=({real[0]:.0f}, {real[1]:.0f}, {real[2]:.0f}, {real[3]:.0f})"
        )


def _check_size(place: Place, cell: float, parameter: str) -> None:
    """Refuse rasters that would fill the memory: a stray point far away, or cells that are too small."""
    xmin, ymin, xmax, ymax = place.extent
    columns, rows = (xmax - xmin) / cell, (ymax - ymin) / cell
    if rows * columns > _MOST_CELLS:
        raise InputError(
            f"the scene, {text(place.extent)}, would have {rows:,.0f} x {columns:,.0f} cells of {cell:g} m: "
            f"cut it by extent=, or choose larger cells by {parameter}="
        )


def _grid(place: Place, header: RasterHeader, size: float | None) -> Grid:
    """Return the grid of a raster's own cells that covers the place, or a new one for another size or CRS."""
    own = header.grid
    straight = header.square and (header.crs is None or same_crs(header.crs, place.crs))
    if not straight or (size is not None and abs(size - own.gsd) > 1e-6 * own.gsd):
        return Grid.covering(place.extent, size if size is not None else warped_size(header, place.crs))
    # Counted from the file's own corner, so that its cells coincide to the last bit.
    xmin, ymin, xmax, ymax = place.extent
    cells = Grid.covering((xmin - own.west, ymin - own.north, xmax - own.west, ymax - own.north), own.gsd)
    return Grid(own.west + cells.west, own.north + cells.north, own.gsd, cells.rows, cells.columns)


def _note_resampling(place: Place, headers: Sequence[RasterHeader], grid: Grid) -> None:
    for header in headers:
        sentence = resampling_note(header, place.crs, grid)
        if sentence:
            place.log.note(sentence)


def _with_gaps_noted(place: Place, image: Image) -> Image:
    if image.valid is not None:
        place.log.note(f"{1 - image.valid.mean():.1%} of the orthoimage has no data")
    return image


def _compare_heights(place: Place, points: PointCloud, dem: Elevation, file: str) -> None:
    """Warn of heights above different zeros: the lowest points should lie on the bare earth."""
    every = slice(None, None, max(1, len(points) // 200_000))
    gap = float(np.percentile(points.z[every] - dem.sample(points.x[every], points.y[every]), 10))
    if abs(gap) > 3.0:
        where = f"{abs(gap):.1f} m {'above' if gap > 0 else 'below'}"
        place.log.note(
            f"warning: the lower points lie {where} {file}: if these are not the same heights (ellipsoid and sea "
            "level, feet and metres), convert one of them"
        )


def some(paths: Sequence[Path]) -> str:
    """Name one file, or the first of several."""
    return str(paths[0]) if len(paths) == 1 else f"{paths[0]} and {len(paths) - 1} more"


def brief(paths: Sequence[Path]) -> str:
    """As `some`, without folders: for notes, which stay with the scene."""
    return some([Path(path.name) for path in paths])


def text(extent: Sequence[float]) -> str:
    """Return an extent for people: x from to, y from to."""
    xmin, ymin, xmax, ymax = extent
    return f"x {xmin:.1f} to {xmax:.1f}, y {ymin:.1f} to {ymax:.1f}"


def common(one: Extent, two: Extent) -> Extent | None:
    """Return what two extents share, or None when they are apart."""
    xmin, ymin = max(one[0], two[0]), max(one[1], two[1])
    xmax, ymax = min(one[2], two[2]), min(one[3], two[3])
    return (xmin, ymin, xmax, ymax) if xmax > xmin and ymax > ymin else None
