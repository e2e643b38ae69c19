"""Vector layers written batch by batch: columns of results beside the features of files, in bounded memory.

Nouns
-----
streamed layer
    The footprints of one file in its order, with columns of results before the columns of the file itself.
rows
    What yields the results of a layer: given a slice of footprints, the columns as Arrow arrays.
"""

from __future__ import annotations

import json
import os
import queue
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from ..core.errors import OutputError
from ..core.output import whole_file
from ..core.plain_paths import plain_target
from ..scenes.geodata.crs import parse_crs
from ..scenes.geodata.footprint_stream import FootprintStream, wkb_buffers
from ..scenes.geodata.footprints import Footprints
from ..scenes.geodata.layer_styles import add_layer_styles
from ..scenes.geodata.vector_files import output_driver
from ..scenes.geodata.wkb import geometries_of_wkb

__all__ = ["Rows", "StreamedLayer", "check_streamed_output", "write_streamed"]

#: Names that GDAL keeps for itself.
_TAKEN = ("fid", "geom", "geometry", "wkb_geometry", "ogc_fid", "id")
#: Batches that are prepared before they are written.
_AHEAD = 2


class Rows(NamedTuple):
    """Results of the footprints of one side.

    Attributes
    ----------
    ids : ndarray of int64, shape (n,)
        Row of each footprint in its file, ascending.
    columns : callable
        Takes a slice of footprints; returns Arrow arrays by name.
    """

    ids: NDArray[np.int64]
    columns: Callable[[slice], Mapping[str, Any]]


@dataclass(frozen=True, eq=False)
class StreamedLayer:
    """One side to be written.

    Attributes
    ----------
    name : str
        Of the layer in a GeoPackage.
    side : str
        Value of the column ``side`` in files of one layer.
    stream : FootprintStream
    repaired : frozenset of int
        Features of the file whose outlines were repaired.
    fields : mapping of str to Arrow type
        Columns of the results, without ``source_id`` and ``side``.
    rows : callable
        Returns the `Rows`; called when the layer is written, so that one side at a time is in memory.
    """

    name: str
    side: str
    stream: FootprintStream
    repaired: frozenset[int]
    fields: Mapping[str, Any]
    rows: Callable[[], Rows]

    @property
    def attributes(self) -> list[str]:
        """Columns of the file that are carried along."""
        own = (*self.fields, "source_id", "side", *_TAKEN)
        return [name for name in self.stream.schema.names if name != self.stream.geometry and name.lower() not in own]

    @property
    def schema(self) -> Any:
        """Arrow schema of the layer."""
        import pyarrow

        own = {"source_id": pyarrow.int64(), **self.fields, "side": pyarrow.string()}
        fields = [pyarrow.field(name, kind) for name, kind in own.items()]
        fields += [self.stream.schema.field(name).with_nullable(True).remove_metadata() for name in self.attributes]
        outline = {"ARROW:extension:name": "geoarrow.wkb"}
        return pyarrow.schema([*fields, pyarrow.field("geometry", pyarrow.binary(), metadata=outline)])

    def batches(self, schema: Any) -> Iterator[Any]:
        """Yield the rows in the order of the file; columns that the layer does not have are missing values."""
        import pyarrow

        rows, attributes = self.rows(), self.attributes
        begin, first = 0, 0
        for batch in self.stream.batches(attributes):
            end = begin + int(np.searchsorted(rows.ids[begin : begin + len(batch)], first + len(batch)))
            ids = rows.ids[begin:end]
            kept = pyarrow.array(ids - first)
            columns: dict[str, Any] = {
                "source_id": pyarrow.array(ids),
                **rows.columns(slice(begin, end)),
                "side": pyarrow.repeat(self.side, end - begin),
                "geometry": _outlines(self, batch, ids - first, first),
            }
            for name in attributes:
                columns[name] = batch.column(batch.schema.get_field_index(name)).take(kept)
            nothing = {field.name: pyarrow.nulls(end - begin, field.type) for field in schema}
            yield pyarrow.record_batch(
                [(nothing | columns)[field.name].cast(field.type) for field in schema], schema=schema
            )
            begin, first = end, first + len(batch)


def check_streamed_output(path: str | os.PathLike[str]) -> None:
    """Raise `OutputError` where verdicts cannot be written in batches to a file of that name."""
    if output_driver(path) not in ("GPKG", "FlatGeobuf", "Parquet"):
        raise OutputError(
            f"{path}: verdicts of a comparison in parts are written as GeoPackage (.gpkg), FlatGeobuf (.fgb) or "
            "GeoParquet (.parquet): name such a file"
        )


def write_streamed(
    layers: Iterable[StreamedLayer],
    path: str | os.PathLike[str],
    *,
    layer: str,
    styles: Mapping[str, str],
    overwrite: bool = False,
    scratch: Path | None = None,
) -> None:
    """Write layers one after the other; the file appears whole or not at all.

    A GeoPackage gets each layer under its name; other formats, which hold one layer, get all in one, distinguished by
    the column ``side``.

    Parameters
    ----------
    layers : iterable of StreamedLayer
    path : str or path
    layer : str
        Name of the only layer of a FlatGeobuf file.
    styles : mapping of str to str
        Of QGIS, by layer of a GeoPackage.
    overwrite : bool
    scratch : Path, optional
        Folder for the unfinished file, on the file system of `path`; by default beside it.
    """
    import pyarrow

    check_streamed_output(path)
    driver, sides = output_driver(path), list(layers)
    crs = next((side.stream.crs for side in reversed(sides) if side.stream.crs is not None), None)
    with whole_file(path, overwrite=overwrite, scratch=scratch) as target, plain_target(target) as file:
        if driver == "GPKG":
            for side in sides:
                schema = side.schema.remove(side.schema.get_field_index("side"))
                batches = _ahead(side.batches(schema))
                _write_ogr(pyarrow.RecordBatchReader.from_batches(schema, batches), file, driver, side.name, crs)
            add_layer_styles(file, styles)
            return
        try:
            joined = pyarrow.unify_schemas([side.schema for side in sides], promote_options="permissive")
        except pyarrow.ArrowTypeError as error:
            raise OutputError(
                f"{path}: columns of one name hold different types in the two files ({error}): write a GeoPackage, "
                "which has a layer for each"
            ) from error
        outline = joined.get_field_index("geometry")
        joined = joined.remove(outline).append(joined.field(outline))
        every = _ahead(batch for side in sides for batch in side.batches(joined))
        if driver == "Parquet":
            _write_parquet(every, joined, file, crs)
        else:
            _write_ogr(pyarrow.RecordBatchReader.from_batches(joined, every), file, driver, layer, crs)


def _ahead(items: Iterator[Any]) -> Iterator[Any]:
    """Yield items that another thread prepares while earlier ones are written."""
    ready: queue.Queue[Any] = queue.Queue(_AHEAD)
    stopped = threading.Event()
    end = object()

    def put(item: Any) -> bool:
        while not stopped.is_set():
            try:
                ready.put(item, timeout=0.1)
            except queue.Full:
                continue
            return True
        return False

    def prepare() -> None:
        try:
            for item in items:
                if not put((item, None)):
                    return
            put((end, None))
        except BaseException as error:  # raised where the items are taken
            put((end, error))

    thread = threading.Thread(target=prepare, daemon=True)
    thread.start()
    try:
        while True:
            item, error = ready.get()
            if error is not None:
                raise error
            if item is end:
                return
            yield item
    finally:
        stopped.set()
        thread.join()


def _outlines(layer: StreamedLayer, batch: Any, rows: NDArray[np.int64], first: int) -> Any:
    """Return the WKB of outlines as they were evaluated: repaired, without Z."""
    import pyarrow

    column = layer.stream.wkb(batch)
    if len(rows) < len(column):
        column = column.take(pyarrow.array(rows))
    offsets, data = wkb_buffers(column)
    # Bytes 0 to 4 of WKB are the order of bytes and the type, 3 of a plain polygon.
    plain = (data[offsets[:-1, None] + np.arange(5)] == (1, 3, 0, 0, 0)).all(axis=1)
    if layer.repaired:
        plain &= ~np.isin(rows + first, list(layer.repaired))
    others = np.flatnonzero(~plain)
    if not len(others):
        return column.cast(pyarrow.binary())
    wkb = column.to_numpy(zero_copy_only=False).copy()
    geometries, _ = geometries_of_wkb(wkb[others], layer.stream.file)
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
