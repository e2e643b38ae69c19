"""Vector files read in batches: footprints that are too many for the memory.

GeoParquet is read by pyarrow, FlatGeobuf, GeoPackage and the other formats by OGR as a stream of Arrow batches; both
need the optional dependency ``parquet``.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import InputError, UnsupportedError
from ...core.inputs import require_file
from ...core.plain_paths import plain_path
from .crs import file_crs, named_crs, require_metric
from .damaged_outlines import refuse_damaged
from .degrees import refuse_degrees
from .footprints import Footprints
from .ogr_layers import quiet
from .outline_batch import OutlineBatch
from .vector_files import DRIVERS, building_column, named_or_none, readable_layer, split_layer
from .wkb import geometries_of_wkb

__all__ = ["FootprintStream", "open_stream", "wkb_buffers"]

#: Features of a batch, and those that are looked at before the first.
_BATCH, _SAMPLE = 1 << 17, 1000


@dataclass(frozen=True)
class FootprintStream:
    """A vector file that is read in batches, from the first feature to the last, as often as one likes.

    Attributes
    ----------
    file : Path
    layer : str or None
        None of a GeoParquet file.
    crs : str or None
    count : int
        Number of features.
    schema : pyarrow.Schema
        All columns, the geometry included.
    geometry : str
        Name of the geometry column (WKB).
    building_id : str or None
        Column whose equal values mark the parts of one building.
    """

    file: Path
    layer: str | None
    crs: str | None
    count: int
    schema: Any
    geometry: str
    building_id: str | None

    def batches(self, columns: list[str]) -> Iterator[Any]:
        """Yield `pyarrow.RecordBatch` of the geometry and these columns."""
        found = self._batches(columns)
        while True:
            try:
                batch = next(found, None)
            except OSError as error:  # what Arrow says of a file that ends early
                raise InputError(f"{self.file} is truncated or broken ({error}): copy or download it again") from error
            if batch is None:
                return
            yield batch

    def _batches(self, columns: list[str]) -> Iterator[Any]:
        if self.layer is None:
            import pyarrow.parquet

            # Without pre_buffer=False pyarrow keeps what it has read of a file until the end.
            with plain_path(self.file) as path, pyarrow.parquet.ParquetFile(path, pre_buffer=False) as source:
                yield from source.iter_batches(_BATCH, columns=[self.geometry, *columns])
            return
        import pyogrio.raw

        with (
            readable_layer(self.file, self.layer) as (path, layer),
            quiet(),
            pyogrio.raw.open_arrow(path, layer=layer, columns=columns, batch_size=_BATCH, use_pyarrow=True) as found,
        ):
            yield from found[1]

    def outlines(self) -> Iterator[tuple[OutlineBatch, Any]]:
        """Yield clean outlines, and their values in the column `building_id` (None without one).

        Ids and repairs count the features of the file. The outlines and repairs are those of `Footprints.of`.
        """
        from .simple_rings import plain_outlines  # loading the compiled code takes a moment

        first = 0
        missing: list[NDArray[np.int64]] = []
        for batch in self.batches([] if self.building_id is None else [self.building_id]):
            column = self.wkb(batch)
            if column.null_count:
                missing.append(first + np.flatnonzero(column.is_null().to_numpy(zero_copy_only=False)))
            plain = plain_outlines(*wkb_buffers(column))
            rest = np.ones(len(column), dtype=bool)
            rest[plain.rows] = False
            rows = np.flatnonzero(rest)
            geometries, closed = geometries_of_wkb(
                column.take(_arrow().array(rows)).to_numpy(zero_copy_only=False), self.file
            )
            found = Footprints.of(geometries, crs=self.crs, source=str(self.file))
            reported = {repair.id for repair in found.repairs}
            repairs = [*found.repairs, *(repair for repair in closed if repair.id not in reported)]
            numbered = tuple(replace(repair, id=int(rows[repair.id])) for repair in repairs)
            outlines = OutlineBatch.joined(plain, replace(found, ids=rows[found.ids], repairs=numbered), first)
            labels = None
            if self.building_id is not None:
                labels = batch.column(batch.schema.get_field_index(self.building_id))
                labels = labels.take(_arrow().array(outlines.ids - first))
            yield outlines, labels
            first += len(batch)
        if self.layer is not None:
            rows = np.concatenate(missing) if missing else np.empty(0, dtype=np.int64)
            refuse_damaged(self.file, self.layer, rows, first)
        if first < self.count:
            raise InputError(
                f"{self.file} is truncated: {first} of the {self.count} features that its header announces are there; "
                "copy or download it again"
            )

    def wkb(self, batch: Any) -> Any:
        """Return the geometries of a batch as a `pyarrow.Array` of WKB."""
        column = batch.column(batch.schema.get_field_index(self.geometry))
        return getattr(column, "storage", column)


def wkb_buffers(column: Any) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
    """Return offsets, shape (n + 1,), and bytes of a `pyarrow.Array` of binary values; missing ones have no bytes."""
    column = column.cast(_arrow().large_binary())
    _, offsets, data = column.buffers()
    if data is None:
        return np.zeros(len(column) + 1, dtype=np.int64), np.empty(0, dtype=np.uint8)
    every = np.frombuffer(offsets, dtype=np.int64)[column.offset : column.offset + len(column) + 1]
    return every, np.frombuffer(data, dtype=np.uint8)


def open_stream(
    path: str | os.PathLike[str], *, building_id: str | None = None, crs: str | None = None
) -> FootprintStream:
    """Open a vector file to read its footprints in batches; the parameters are those of `read_footprints`.

    Raises
    ------
    InputError, CRSError
        As `read_footprints`; GeoJSON, which is read as a whole only.
    UnsupportedError
        pyarrow is not installed.
    """
    _arrow()
    file, layer = split_layer(path)
    driver = DRIVERS.get(file.suffix.lower())
    if driver == "GeoJSON":
        raise InputError(
            f"{file}: GeoJSON is not read in parts: convert it to FlatGeobuf, GeoPackage or GeoParquet, for instance "
            "with ogr2ogr"
        )
    own_crs, layer, count, schema, geometry = _parquet_parts(file) if driver == "Parquet" else _ogr_parts(file, layer)
    known = named_crs(crs) if crs is not None else own_crs
    if count:
        require_metric(known, str(file), heights=False)
    names = [name for name in schema.names if name != geometry]
    stream = FootprintStream(file, layer, known, count, schema, geometry, building_column(file, names, building_id))
    for batch in stream.batches([]):
        first = stream.wkb(batch).slice(0, _SAMPLE).to_numpy(zero_copy_only=False)
        refuse_degrees(geometries_of_wkb(first, file)[0], str(file))
        break
    return stream


def _arrow() -> Any:
    try:
        import pyarrow
    except ImportError as missing:
        raise UnsupportedError("reading files in parts needs pyarrow: pip install pyarrow") from missing
    return pyarrow


def _parquet_parts(file: Path) -> tuple[str | None, str | None, int, Any, str]:
    """Return CRS, layer, number of features, schema and geometry column of a GeoParquet file."""
    import pyarrow.parquet
    import pyproj

    require_file(file, "a vector file, for instance .gpkg or .geojson")
    try:
        with plain_path(file) as path, pyarrow.parquet.ParquetFile(path) as source:
            schema, count = source.schema_arrow, source.metadata.num_rows
        described = json.loads((schema.metadata or {})[b"geo"])
        geometry = str(described["primary_column"])
        column = described["columns"][geometry]
        encoding, crs = column["encoding"], column.get("crs", "OGC:CRS84")
        parsed = None if crs is None else pyproj.CRS.from_user_input(crs)
    except (OSError, ValueError, LookupError, TypeError, pyproj.exceptions.CRSError) as error:
        raise InputError(f"{file} cannot be read as GeoParquet: {' '.join(str(error).split())}") from error
    if encoding != "WKB":
        raise InputError(
            f"{file}: its geometry is encoded as {encoding}, and only WKB is read in parts: rewrite it as WKB"
        )
    return None if parsed is None else file_crs(parsed, str(file)), None, count, schema, geometry


def _ogr_parts(file: Path, layer: str | None) -> tuple[str | None, str | None, int, Any, str]:
    """Return CRS, layer, number of features, schema and geometry column of a file of OGR."""
    import pyogrio
    import pyogrio.raw

    with readable_layer(file, layer) as (path, name), quiet():
        try:
            count = int(pyogrio.read_info(path, layer=name, force_feature_count=True)["features"])
        except UnboundLocalError as error:  # see ogr_layers
            raise InputError(f"{file}: its CRS cannot be read: set it with ogr2ogr -a_srs EPSG:...") from error
        with pyogrio.raw.open_arrow(path, layer=name, use_pyarrow=True) as (meta, reader):
            schema = reader.schema
    geometry = meta["geometry_name"] or "wkb_geometry"
    if geometry not in schema.names:
        raise InputError(f"{file}: no polygons: the layer {name!r} has no geometry")
    return None if meta["crs"] is None else named_or_none(meta["crs"], str(file)), name, count, schema, geometry
