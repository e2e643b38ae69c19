"""Verdicts of a comparison in parts as vector layers, written batch by batch beside the features of the files."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ..core.errors import OutputError
from ..core.output import whole_file
from ..core.plain_paths import plain_target
from ..evaluators.in_parts import FileComparison
from ..evaluators.verdict_table import VerdictTable
from ..scenes.geodata.crs import parse_crs
from ..scenes.geodata.footprint_stream import FootprintStream, wkb_buffers
from ..scenes.geodata.footprints import Footprints
from ..scenes.geodata.vector_files import output_driver
from ..scenes.geodata.wkb import geometries_of_wkb

__all__ = ["check_streamed_output", "write_verdict_stream"]

_OWN = ("source_id", "verdict", "partner", "distance", "overlap_area", "iou", "rmse", "reason", "side")
#: Names that GDAL keeps for itself.
_TAKEN = ("fid", "geom", "geometry", "wkb_geometry", "ogc_fid", "id")


def check_streamed_output(path: str | os.PathLike[str]) -> None:
    """Raise `OutputError` where verdicts cannot be written in batches to a file of that name."""
    if output_driver(path) not in ("GPKG", "FlatGeobuf", "Parquet"):
        raise OutputError(
            f"{path}: verdicts of a comparison in parts are written as GeoPackage (.gpkg), FlatGeobuf (.fgb) or "
            "GeoParquet (.parquet): name such a file"
        )


def write_verdict_stream(comparison: FileComparison, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write one row per object with verdict, partner and reason; the file appears whole or not at all.

    A GeoPackage gets the layers ``detections`` and ``references``; other formats, which hold one layer, get both in
    one, distinguished by the column ``side``.
    """
    import pyarrow

    check_streamed_output(path)
    driver = output_driver(path)
    sides = list(
        zip(("detection", "reference"), comparison.streams, comparison.verdicts(), comparison.repaired, strict=True)
    )
    crs = comparison.streams[1].crs or comparison.streams[0].crs
    schemas = [_schema(stream) for stream in comparison.streams]
    with whole_file(path, overwrite=overwrite) as target, plain_target(target) as scratch:
        if driver == "GPKG":
            for (side, stream, table, repaired), schema in zip(sides, schemas, strict=True):
                schema = schema.remove(schema.get_field_index("side"))
                rows = _rows(side, stream, table, repaired, schema)
                _write_ogr(pyarrow.RecordBatchReader.from_batches(schema, rows), scratch, driver, f"{side}s", crs)
            return
        try:
            joined = pyarrow.unify_schemas(schemas, promote_options="permissive")
        except pyarrow.ArrowTypeError as error:
            raise OutputError(
                f"{path}: columns of one name hold different types in the two files ({error}): write a GeoPackage, "
                "which has a layer for each"
            ) from error
        outline = joined.get_field_index("geometry")
        joined = joined.remove(outline).append(joined.field(outline))
        every = (batch for side in sides for batch in _rows(*side, joined))
        if driver == "Parquet":
            _write_parquet(every, joined, scratch, crs)
        else:
            _write_ogr(pyarrow.RecordBatchReader.from_batches(joined, every), scratch, driver, "verdicts", crs)


def _schema(stream: FootprintStream) -> Any:
    import pyarrow

    own = {
        "source_id": pyarrow.int64(),
        "verdict": pyarrow.string(),
        "partner": pyarrow.int64(),
        **dict.fromkeys(("distance", "overlap_area", "iou", "rmse"), pyarrow.float64()),
        "reason": pyarrow.string(),
        "side": pyarrow.string(),
    }
    fields = [pyarrow.field(name, kind) for name, kind in own.items()]
    fields += [stream.schema.field(name).with_nullable(True).remove_metadata() for name in _attributes(stream)]
    outline = {"ARROW:extension:name": "geoarrow.wkb"}
    return pyarrow.schema([*fields, pyarrow.field("geometry", pyarrow.binary(), metadata=outline)])


def _attributes(stream: FootprintStream) -> list[str]:
    """Return the columns of the input that are carried along."""
    return [name for name in stream.schema.names if name != stream.geometry and name.lower() not in (*_OWN, *_TAKEN)]


def _rows(
    side: str, stream: FootprintStream, table: VerdictTable, repaired: frozenset[int], schema: Any
) -> Iterator[Any]:
    """Yield the rows of one side in the order of its file."""
    import pyarrow

    words = pyarrow.array([*table.kinds])
    attributes = _attributes(stream)
    begin, first = 0, 0
    for batch in stream.batches(attributes):
        end = begin + int(np.searchsorted(table.ids[begin : begin + len(batch)], first + len(batch)))
        part = slice(begin, end)
        ids, partner = table.ids[part], table.partner[part]
        kept = pyarrow.array(ids - first)
        columns: dict[str, Any] = {
            "source_id": pyarrow.array(ids),
            "verdict": words.take(pyarrow.array(table.kind[part])),
            "partner": pyarrow.array(partner, mask=partner < 0),
            "reason": pyarrow.array(table.reasons[part], pyarrow.string()),
            "side": pyarrow.repeat(side, end - begin),
            "geometry": _outlines(stream, batch, ids - first, first, repaired),
        }
        for name, values in table.measures.items():
            columns[name] = pyarrow.array(values[part], mask=np.isnan(values[part]))
        for name in attributes:
            columns[name] = batch.column(batch.schema.get_field_index(name)).take(kept)
        nothing = {field.name: pyarrow.nulls(end - begin, field.type) for field in schema}
        yield pyarrow.record_batch(
            [(nothing | columns)[field.name].cast(field.type) for field in schema], schema=schema
        )
        begin, first = end, first + len(batch)


def _outlines(
    stream: FootprintStream, batch: Any, rows: NDArray[np.int64], first: int, repaired: frozenset[int]
) -> Any:
    """Return the WKB of outlines as they were evaluated: repaired, without Z."""
    import pyarrow

    column = stream.wkb(batch)
    if len(rows) < len(column):
        column = column.take(pyarrow.array(rows))
    offsets, data = wkb_buffers(column)
    # Bytes 0 to 4 of WKB are the order of bytes and the type, 3 of a plain polygon.
    plain = (data[offsets[:-1, None] + np.arange(5)] == (1, 3, 0, 0, 0)).all(axis=1)
    if repaired:
        plain &= ~np.isin(rows + first, list(repaired))
    others = np.flatnonzero(~plain)
    if not len(others):
        return column.cast(pyarrow.binary())
    wkb = column.to_numpy(zero_copy_only=False).copy()
    geometries, _ = geometries_of_wkb(wkb[others], stream.file)
    wkb[others] = shapely.to_wkb(Footprints.of(geometries).polygons, flavor="iso")
    return pyarrow.array(wkb, pyarrow.binary())


def _write_parquet(batches: Iterator[Any], schema: Any, file: Path, crs: str | None) -> None:
    import pyarrow.parquet

    outline: dict[str, Any] = {
        "encoding": "WKB",
        "geometry_types": [],
        "crs": None if crs is None else parse_crs(crs).to_json_dict(),
    }
    described = {"version": "1.0.0", "primary_column": "geometry", "columns": {"geometry": outline}}
    plain = schema.set(len(schema) - 1, pyarrow.field("geometry", pyarrow.binary()))
    plain = plain.with_metadata({"geo": json.dumps(described)})
    with pyarrow.parquet.ParquetWriter(file, plain) as writer:
        for batch in batches:
            writer.write_batch(pyarrow.record_batch(batch.columns, schema=plain))


def _write_ogr(reader: Any, file: Path, driver: str, layer: str, crs: str | None) -> None:
    import pyogrio
    import pyogrio.raw
    from pyogrio.errors import DataLayerError, DataSourceError, FeatureError, FieldError

    # A GeoPackage stores when it was written; a fixed date makes equal content equal bytes.
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": "2000-01-01T00:00:00.000Z"})
    try:
        pyogrio.raw.write_arrow(
            reader,
            file,
            layer=layer,
            driver=driver,
            geometry_name="geometry",
            geometry_type="Unknown",
            crs=crs,
            append=file.exists(),
            # The index of FlatGeobuf would put the rows into another order.
            **({"SPATIAL_INDEX": "NO"} if driver == "FlatGeobuf" else {}),
        )
    except (DataSourceError, DataLayerError, FeatureError, FieldError) as error:
        raise OutputError(f"{file.name} cannot be written: {error}") from error
    finally:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": None})
