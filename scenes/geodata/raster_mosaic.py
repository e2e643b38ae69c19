"""Mosaics: orthoimages and elevation models of several files, cell sizes and CRS brought to one grid.

Files whose cells coincide with those of the grid are copied, others are resampled: averaged when their cells are much
smaller, else bilinear. Where files overlap the first that has data wins.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import CRSError, InputError
from .colour_depth import UNDOUBTED, scaled_to_16_bit
from .crs import crs_label, same_crs
from .image_bands import alpha_of, band_names, require_image_type
from .opened_rasters import opened
from .raster import Elevation, Grid, Image
from .raster_files import data_mask
from .raster_headers import RasterHeader

__all__ = [
    "largest_value",
    "mosaic_bands",
    "mosaic_elevation",
    "mosaic_image",
    "raster_sources",
    "resampling_note",
    "warped_extent",
    "warped_size",
]

#: Largest mean difference of two images of one place that are copies of each other, as a share of the largest value.
_SAME_IMAGE = 0.05


@dataclass
class _Overlap:
    """How much of an image lies under those before it, and how much it differs from them.

    Attributes
    ----------
    cells, shared : int
        Cells with data, and those of them that have a value already.
    difference : float
        Sum of the absolute differences over the shared cells, mean over the bands, as a share of the largest value.
    """

    cells: int = 0
    shared: int = 0
    difference: float = 0.0

    def add(
        self, has_data: NDArray[np.bool_], known: NDArray[np.bool_], before: NDArray[Any], block: NDArray[Any]
    ) -> None:
        self.cells += int(has_data.sum())
        self.shared += int(known.sum())
        if known.any():
            one, two = before[:, known].astype(np.float32), block[:, known].astype(np.float32)
            self.difference += float(np.abs(one - two).mean(axis=0).sum() / max(1.0, one.max(), two.max()))

    @property
    def is_whole(self) -> bool:
        return self.cells > 0 and self.shared >= 0.98 * self.cells

    @property
    def is_another_image(self) -> bool:
        return self.is_whole and self.difference > _SAME_IMAGE * self.shared


def raster_sources(path: Path) -> tuple[Path, ...]:
    """Return the files that a virtual raster (VRT) shows; none where it cannot be read."""
    try:
        with opened(path) as source:
            return tuple(Path(name).resolve() for name in source.files if Path(name).resolve() != path.resolve())
    except InputError:
        return ()


def mosaic_image(
    headers: Sequence[RasterHeader],
    grid: Grid,
    *,
    crs: str,
    bands: Sequence[str] | None = None,
    depths: Sequence[int] | None = None,
    note: Callable[[str], None] | None = None,
) -> Image:
    """Bring one or several orthoimages to `grid` in `crs`; a file that has no CRS is taken to be in it.

    Files whose cells coincide with those of `grid` are copied, others resampled: averaged when their cells are much
    smaller, else bilinear. Of `depths` in bits, one for each file, those below 16 are scaled to 16. A file of which
    nothing is used, since others cover it, is reported by `note`.

    Raises
    ------
    InputError
        Images of different bands or depths, or a file of which nothing would be used though it differs from the
        others by more than 5 % of the largest value: infrared beside RGB.
    """
    named = [band_names(header, bands) for header in headers]
    kept = tuple(name for name in named[0] if name != "-")
    for header, names in zip(headers, named, strict=True):
        if set(names) - {"-"} != set(kept):
            raise InputError(
                f"{header.path} has the bands {', '.join(names)} but {headers[0].path} {', '.join(kept)}: "
                "images of one scene must have the same; give near infrared of the same place by nir="
            )
        require_image_type(header)
        if header.dtype != headers[0].dtype:
            raise InputError(
                f"{header.path} is {header.dtype} but {headers[0].path} {headers[0].dtype}: convert one of them, "
                "for instance with gdal_translate -ot"
            )
    values = np.zeros((len(kept), *grid.shape), dtype=headers[0].dtype)
    valid = np.zeros(grid.shape, dtype=bool)
    for header, names, depth in zip(headers, named, depths or [16] * len(headers), strict=True):
        indexes = [names.index(name) + 1 for name in kept]
        shared = _Overlap()
        for rows, columns, block, has_data in _warped(header, indexes, grid, crs, alpha=alpha_of(header, names)):
            if values.dtype == np.uint16:
                block = scaled_to_16_bit(block, depth)
            fresh = has_data & ~valid[rows, columns]
            shared.add(has_data, has_data & ~fresh, values[:, rows, columns], block)
            values[:, rows, columns][:, fresh] = block[:, fresh]
            valid[rows, columns] |= fresh
        if shared.is_another_image:
            raise InputError(
                f"{header.path} shows the same place as other images of the scene, with other values: nothing of it "
                "would be used. Give one of them; if one is near infrared, give it by nir="
            )
        if shared.is_whole and note is not None:
            note(f"{header.path.name} is not used: other images have data in all of its cells")
    return Image(values, kept, grid, None if valid.all() else valid)


def largest_value(header: RasterHeader, grid: Grid, *, crs: str, bands: Sequence[str] | None = None) -> int:
    """Return the largest value of an image where it has data on a grid, or the first that only 16 bit hold."""
    names = band_names(header, bands)
    indexes = [index for index, name in enumerate(names, start=1) if name != "-"]
    largest = 0
    for _, _, block, has_data in _warped(header, indexes, grid, crs, alpha=alpha_of(header, names)):
        largest = max(largest, int(block[:, has_data].max(initial=0)))
        if largest > UNDOUBTED:
            break
    return largest


def mosaic_bands(
    headers: Sequence[RasterHeader], names: Sequence[str], grid: Grid, *, crs: str, bands: Sequence[str] | None = None
) -> NDArray[np.float32]:
    """Bring some bands of images of any type to `grid` in `crs`, shape (names, rows, columns); NaN without data.

    Scale and offset that a file names are applied. Where files overlap the first that has data wins. `bands`: names of
    the bands of files that do not name them.
    """
    values = np.full((len(names), *grid.shape), np.nan, dtype=np.float32)
    for header in headers:
        own = band_names(header, bands)
        indexes = [own.index(name) + 1 for name in names]
        for rows, columns, block, has_data in _warped(header, indexes, grid, crs, alpha=alpha_of(header, own)):
            part = values[:, rows, columns]
            fresh = has_data & np.isfinite(block).all(axis=0) & np.isnan(part[0])
            part[:, fresh] = block[:, fresh] * np.float32(header.scale) + np.float32(header.offset)
    return values


def mosaic_elevation(headers: Sequence[RasterHeader], grid: Grid, *, crs: str) -> Elevation:
    """Bring one or several elevation models to `grid` in `crs`; cells without data are NaN."""
    values = np.full(grid.shape, np.nan, dtype=np.float32)
    for header in headers:
        if header.band_count != 1:
            raise InputError(f"{header.path} has {header.band_count} bands, expected an elevation model of one band")
        if header.dtype.startswith("complex"):
            raise InputError(f"{header.path} has complex numbers, expected heights: give their real part")
        if header.height_unit is not None:
            raise CRSError(
                f"{header.path}: its heights are in {header.height_unit}, metres are needed: convert them, for "
                "instance with gdal_calc.py"
            )
        for rows, columns, block, has_data in _warped(header, [1], grid, crs):
            fresh = has_data & np.isfinite(block[0]) & np.isnan(values[rows, columns])
            values[rows, columns][fresh] = block[0][fresh] * header.scale + header.offset
    return Elevation(values, grid)


def warped_extent(header: RasterHeader, crs: str) -> tuple[float, float, float, float]:
    """Return the extent of a raster, ``(xmin, ymin, xmax, ymax)``, in another CRS."""
    if header.crs is None or same_crs(header.crs, crs):
        return header.grid.extent
    from rasterio.errors import RasterioError
    from rasterio.warp import transform_bounds

    cause: RasterioError | None = None
    try:
        bounds: tuple[float, float, float, float] = transform_bounds(header.crs, crs, *header.grid.extent)
    except RasterioError as error:
        bounds, cause = (np.inf,) * 4, error
    if not np.isfinite(bounds).all():
        raise CRSError(
            f"{header.path} cannot be transformed from {crs_label(header.crs)} to {crs_label(crs)}: "
            "it is probably in another CRS than it names, set it with gdal_edit.py -a_srs"
        ) from cause
    return bounds


def warped_size(header: RasterHeader, crs: str) -> float:
    """Return the cell size in metres, to two digits, that keeps the detail of a raster in another CRS."""
    if header.crs is None or same_crs(header.crs, crs):
        return header.grid.gsd
    from rasterio.warp import calculate_default_transform

    grid = header.grid
    transform, _, _ = calculate_default_transform(header.crs, crs, grid.columns, grid.rows, *grid.extent)
    return float(f"{transform.a:.2g}")


def _warped(
    header: RasterHeader, indexes: list[int], grid: Grid, crs: str, *, alpha: bool | None = None
) -> Iterator[tuple[slice, slice, NDArray[Any], NDArray[np.bool_]]]:
    """Yield (rows, columns, values, has data) of the part of `grid` that a file covers, by bands of rows."""
    from rasterio import Affine
    from rasterio.enums import Resampling
    from rasterio.vrt import WarpedVRT

    warp = header.crs is not None and not same_crs(header.crs, crs)
    bounds = warped_extent(header, crs)
    columns = _span(bounds[0], bounds[2], grid.west, grid.gsd, grid.columns)
    rows = _span(-bounds[3], -bounds[1], -grid.north, grid.gsd, grid.rows)
    if columns is None or rows is None:
        return
    with opened(header.path, alpha=alpha) as source:
        ratio = grid.gsd / header.grid.gsd
        resampling = Resampling.average if ratio > 1.5 else Resampling.bilinear
        if not warp and header.square and _same_cells(grid, header.grid):
            resampling = Resampling.nearest
        for start in range(rows.start, rows.stop, 1024):
            stop = min(start + 1024, rows.stop)
            corner = grid.to_world(start, columns.start)
            with WarpedVRT(
                source,
                src_crs=header.crs if warp else crs,
                crs=crs,
                transform=Affine(grid.gsd, 0, float(corner[0]), 0, -grid.gsd, float(corner[1])),
                width=columns.stop - columns.start,
                height=stop - start,
                resampling=resampling,
                add_alpha=source.nodata is None and not _has_alpha(source),
            ) as view:
                block = view.read(indexes)
                has_data = data_mask(view)
            yield slice(start, stop), columns, block, has_data


def _has_alpha(source: Any) -> bool:
    return any(colour.name == "alpha" for colour in source.colorinterp)


def _span(low: float, high: float, origin: float, gsd: float, count: int) -> slice | None:
    """Return the cells of one axis of a grid that a file's range meets, or None."""
    first = max(0, int(np.floor((low - origin) / gsd + 1e-6)))
    last = min(count, int(np.ceil((high - origin) / gsd - 1e-6)))
    return slice(first, last) if last > first else None


def _same_cells(one: Grid, two: Grid) -> bool:
    """Return whether the cells of two grids coincide."""
    shift = np.array([(one.west - two.west) / one.gsd, (one.north - two.north) / one.gsd])
    return abs(one.gsd - two.gsd) <= 1e-6 * one.gsd and bool((abs(shift - np.round(shift)) < 1e-3).all())


def resampling_note(header: RasterHeader, crs: str, grid: Grid) -> str | None:
    """Return a note on how a file is resampled to the grid of a scene; None when its cells are copied."""
    reasons = []
    if header.crs is not None and not same_crs(header.crs, crs):
        reasons.append(f"from {crs_label(header.crs)} to {crs_label(crs)}")
    if not header.square or abs(header.grid.gsd - grid.gsd) > 1e-6 * grid.gsd:
        reasons.append(f"to cells of {grid.gsd:g} m")
    elif not reasons and not _same_cells(grid, header.grid):
        reasons.append("by a fraction of a cell")
    return f"{header.path.name} was resampled {' and '.join(reasons)}" if reasons else None
