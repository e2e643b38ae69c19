"""The grids of raster layers: whose cells they take, and how large they may be."""

from __future__ import annotations

from collections.abc import Sequence

from ...core.errors import InputError
from ..geodata.crs import same_crs
from ..geodata.raster import Grid
from ..geodata.raster_headers import RasterHeader
from ..geodata.raster_mosaic import resampling_note, warped_size
from .place import Place, extent_text

__all__ = ["check_size", "grid_of", "note_resampling"]

#: Most cells of a raster: 10 km2 at 0.1 m.
_MOST_CELLS = 1e9


def check_size(place: Place, cell: float, parameter: str) -> None:
    """Refuse rasters that would fill the memory: a stray point far away, or cells that are too small."""
    xmin, ymin, xmax, ymax = place.extent
    columns, rows = (xmax - xmin) / cell, (ymax - ymin) / cell
    if rows * columns > _MOST_CELLS:
        raise InputError(
            f"the scene, {extent_text(place.extent)}, would have {rows:,.0f} x {columns:,.0f} cells of {cell:g} m: "
            f"cut it by extent=, or choose larger cells by {parameter}="
        )


def grid_of(place: Place, header: RasterHeader, size: float | None) -> Grid:
    """Return the grid of a raster's own cells that covers the place, or a new one for another size or CRS."""
    own = header.grid
    straight = header.square and (header.crs is None or same_crs(header.crs, place.crs))
    if not straight or (size is not None and abs(size - own.gsd) > 1e-6 * own.gsd):
        return Grid.covering(place.extent, size if size is not None else warped_size(header, place.crs))
    # Counted from the file's own corner, so that its cells coincide to the last bit.
    xmin, ymin, xmax, ymax = place.extent
    cells = Grid.covering((xmin - own.west, ymin - own.north, xmax - own.west, ymax - own.north), own.gsd)
    return Grid(own.west + cells.west, own.north + cells.north, own.gsd, cells.rows, cells.columns)


def note_resampling(place: Place, headers: Sequence[RasterHeader], grid: Grid) -> None:
    """Note which files are transformed or resampled to the grid."""
    for header in headers:
        sentence = resampling_note(header, place.crs, grid)
        if sentence:
            place.log.note(sentence)
