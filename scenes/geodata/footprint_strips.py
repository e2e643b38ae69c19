"""Footprints written strip by strip: as many as a country has, a part of them in memory at a time."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from ...core.errors import OutputError
from ...core.output import whole_file
from ...core.plain_paths import plain_target
from .footprints import Footprints, stacked
from .ogr_layers import quiet
from .vector_columns import storable_columns
from .vector_files import layer_name, output_driver, require_writable_crs, table_of, write_footprints, write_ogr

__all__ = ["write_strips"]

#: Formats to which OGR appends without reading what is there.
_APPENDED = ("GPKG", "ESRI Shapefile")
#: Fewest rows that are appended at once.
_ROWS = 20_000


def write_strips(
    strips: Iterable[Footprints],
    path: str | os.PathLike[str],
    *,
    crs: str | None,
    types: Iterable[int],
    overwrite: bool = False,
) -> int:
    """Write footprints that arrive in strips as one file, in their order, and return their number.

    GeoPackages and Shapefiles grow strip by strip; GeoJSON and FlatGeobuf are converted from a temporary GeoPackage as
    a stream. GeoParquet, and columns that hold any objects, whose type only all their values tell, need all footprints
    in memory.

    Parameters
    ----------
    strips : iterable of Footprints
        With the same columns.
    path : str or path
        The file appears whole or not at all.
    crs : str, optional
    types : iterable of int
        Geometry types of all footprints, as shapely numbers them.
    overwrite : bool

    Raises
    ------
    OutputError
        As for `write_footprints`.
    """
    file = Path(path)
    driver = output_driver(file)
    require_writable_crs(crs, driver, file)
    batches = _batches(strips)
    first = next(batches, None)
    if first is None or driver == "Parquet" or any(column.dtype == object for column in first.attributes.values()):
        whole = Footprints.empty(crs=crs) if first is None else stacked([first, *batches])
        write_footprints(dataclasses.replace(whole, crs=crs), file, overwrite=overwrite)
        return len(whole)
    kinds = sorted(types)
    with whole_file(file, overwrite=overwrite) as scratch, plain_target(scratch) as plain:
        grown = plain if driver in _APPENDED else plain.with_name("strips.gpkg")
        count = 0
        while first is not None:
            columns = storable_columns(table_of(first), driver, file)
            form = driver if driver in _APPENDED else "GPKG"
            write_ogr(grown, form, layer_name(file), first.polygons, columns, crs, append=count > 0, types=kinds)
            count += len(first)
            first = next(batches, None)
        if grown != plain:
            _convert(grown, plain, driver, layer_name(file))
            grown.unlink()
    return count


def _batches(strips: Iterable[Footprints]) -> Iterator[Footprints]:
    """Yield strips together, so that each batch has many rows; the last may have few."""
    waiting: list[Footprints] = []
    for strip in strips:
        if len(strip):
            waiting.append(strip)
        if sum(map(len, waiting)) >= _ROWS:
            yield stacked(waiting)
            waiting = []
    if waiting:
        yield stacked(waiting)


def _convert(grown: Path, file: Path, driver: str, layer: str) -> None:
    """Convert the only layer of a GeoPackage, in batches of Arrow."""
    import pyogrio.raw
    from pyogrio.errors import DataLayerError, DataSourceError, FeatureError, FieldError

    try:
        with quiet(), pyogrio.raw.open_arrow(grown, use_pyarrow=False) as (facts, stream):
            pyogrio.raw.write_arrow(
                stream,
                file,
                layer=layer,
                driver=driver,
                geometry_name=facts["geometry_name"] or "wkb_geometry",
                geometry_type=facts["geometry_type"],
                crs=facts["crs"],
                # The index of FlatGeobuf would put the rows into another order.
                **({"SPATIAL_INDEX": "NO"} if driver == "FlatGeobuf" else {}),
            )
    except (DataSourceError, DataLayerError, FeatureError, FieldError) as error:
        raise OutputError(f"{file.name} cannot be written: {error}") from error
