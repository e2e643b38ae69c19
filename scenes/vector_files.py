"""Vector files: footprints read from and written to GeoJSON, GeoPackage, Shapefile, FlatGeobuf and GeoParquet.

A layer of a file with several is named as QGIS does, ``city.gpkg|layername=roofs``, or by ``layer=``.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from .crs import common_crs, crs_label, parse_crs, require_metric, same_crs
from .errors import CRSError, InputError, OutputError
from .footprints import Footprints
from .names import nearest_hint
from .output import whole_file

__all__ = ["DRIVERS", "read_footprints", "read_polygon", "split_layer", "write_footprints", "write_layers"]

#: File ending to GDAL driver; GeoParquet is read and written by geopandas (extra ``parquet``).
DRIVERS: Mapping[str, str] = {
    ".geojson": "GeoJSON",
    ".json": "GeoJSON",
    ".gpkg": "GPKG",
    ".shp": "ESRI Shapefile",
    ".fgb": "FlatGeobuf",
    ".parquet": "Parquet",
    ".geoparquet": "Parquet",
}


def split_layer(path: str | os.PathLike[str]) -> tuple[Path, str | None]:
    """Split QGIS's ``file|layername=NAME``.

    >>> split_layer("city.gpkg|layername=roofs")
    (PosixPath('city.gpkg'), 'roofs')
    """
    text, bar, layer = os.fspath(path).partition("|layername=")
    return Path(text), layer if bar else None


def read_footprints(
    path: str | os.PathLike[str],
    *,
    layer: str | None = None,
    building_id: str | None = None,
    crs: str | None = None,
    to_crs: str | None = None,
) -> Footprints:
    """Read footprints from a vector file.

    Parameters
    ----------
    path : path
        File, with ``|layername=NAME`` where it has several layers.
    layer : str, optional
        Layer name; not needed for a file of one layer.
    building_id : str, optional
        Column that tells which footprints are parts of one building. Without it a column called ``building_id`` is
        used where there is one, else every polygon is its own building. A row with no value is its own building.
    crs : str, optional
        CRS to assign, for files that have none or the wrong one; coordinates are not changed.
    to_crs : str, optional
        CRS to transform to; a file of unknown CRS is taken to be in it already.

    Notes
    -----
    A GeoJSON file that names no CRS is in degrees by RFC 7946. When its coordinates cannot be degrees, its CRS is
    taken as not known.

    Raises
    ------
    InputError
        Missing or unreadable file, unknown layer or column, no polygons.
    CRSError
        Geographic CRS or one that is not in metres.
    """
    file, named = split_layer(path)
    layer = layer or named
    if not file.exists():
        raise InputError(f"{file}: no such file")
    if crs is not None:
        parse_crs(crs)
    if DRIVERS.get(file.suffix.lower()) == "Parquet":
        geometries, columns, own_crs = _read_parquet(file)
    else:
        geometries, columns, own_crs = _read_ogr(file, layer)
    if crs is None and not _in_degrees_at_most(file, own_crs, geometries):
        own_crs = None
    crs = crs or own_crs
    if to_crs is not None:
        geometries, crs = _transformed(file, geometries, crs or to_crs, to_crs), to_crs
    if len(geometries):
        require_metric(crs, str(file))
    identifiers = _building_ids(file, columns, building_id)
    footprints = Footprints.of(geometries, building_ids=identifiers, crs=crs, attributes=columns, source=str(file))
    if len(geometries) and not len(footprints):
        kinds = sorted({repair.problem for repair in footprints.repairs})
        raise InputError(f"{file}: no polygons among {len(geometries)} features ({'; '.join(kinds[:3])})")
    return footprints


def read_polygon(
    path: str | os.PathLike[str], *, crs: str | None = None, common_with: Footprints | None = None
) -> shapely.Geometry:
    """Read an area: the union of all polygons of a file.

    Parameters
    ----------
    path : path
    crs : str, optional
        CRS to assign.
    common_with : Footprints, optional
        Set whose CRS the file must share.
    """
    footprints = read_footprints(path, crs=crs)
    if not len(footprints):
        raise InputError(f"{path}: no polygons: an evaluation area needs at least one")
    if common_with is not None and len(common_with):
        common_crs(footprints.crs, common_with.crs, (footprints.source, common_with.source))
    return shapely.union_all(footprints.polygons)


def write_footprints(
    footprints: Footprints,
    path: str | os.PathLike[str],
    *,
    layer: str | None = None,
    overwrite: bool = False,
) -> None:
    """Write footprints, their building ids and attributes; the file appears whole or not at all.

    Raises
    ------
    OutputError
        Unknown file ending, file that exists already, folder that is missing or read-only.
    """
    columns = dict(footprints.attributes)
    if footprints.building_ids is not None:
        columns["building_id"] = footprints.building_ids
    file = Path(path)
    name = layer or file.stem
    write_layers({name: (footprints.polygons, columns)}, file, crs=footprints.crs, overwrite=overwrite)


def write_layers(
    layers: Mapping[str, tuple[NDArray[np.object_], Mapping[str, NDArray[Any]]]],
    path: str | os.PathLike[str],
    *,
    crs: str | None,
    overwrite: bool = False,
) -> None:
    """Write named layers of (geometries, columns) into one file; only GeoPackage takes more than one.

    Lines and polygons may be mixed between layers, not within one.
    """
    file = Path(path)
    driver = DRIVERS.get(file.suffix.lower())
    if driver is None:
        raise OutputError(
            f"{file}: unknown file ending {file.suffix!r}{nearest_hint(file.suffix, DRIVERS)}; "
            f"roofbench writes {', '.join(DRIVERS)}"
        )
    if len(layers) > 1 and driver != "GPKG":
        raise OutputError(f"{file}: {len(layers)} layers ({', '.join(layers)}) need a GeoPackage: name it .gpkg")
    with whole_file(file, overwrite=overwrite) as scratch:
        for number, (layer, (geometries, columns)) in enumerate(layers.items()):
            if driver == "Parquet":
                _write_parquet(scratch, geometries, columns, crs)
            else:
                _write_ogr(scratch, driver, layer, geometries, columns, crs, append=number > 0)


def _read_ogr(file: Path, layer: str | None) -> tuple[NDArray[np.object_], dict[str, NDArray[Any]], str | None]:
    import pyogrio.raw
    from pyogrio.errors import DataLayerError, DataSourceError

    try:
        names = [str(name) for name in pyogrio.list_layers(file)[:, 0]]
        if layer is None and len(names) > 1:
            raise InputError(
                f"{file} has {len(names)} layers ({', '.join(names)}): name one as '{file}|layername={names[0]}'"
            )
        if layer is not None and layer not in names:
            raise InputError(f"{file} has no layer {layer!r}{nearest_hint(layer, names)}; it has {', '.join(names)}")
        meta, _, wkb, fields = pyogrio.raw.read(file, layer=layer)
    except (DataSourceError, DataLayerError) as error:
        raise InputError(f"{file} cannot be read as a vector file: {error}") from error
    if wkb is None:
        raise InputError(f"{file}: no polygons: the layer {layer or names[0]!r} has no geometry")
    geometries = np.asarray(shapely.from_wkb(wkb), dtype=object)
    return geometries, dict(zip(map(str, meta["fields"]), fields, strict=True)), meta["crs"]


def _read_parquet(file: Path) -> tuple[NDArray[np.object_], dict[str, NDArray[Any]], str | None]:
    geopandas = _parquet_support(file, InputError)
    try:
        frame = geopandas.read_parquet(file)
    except (ValueError, OSError) as error:
        raise InputError(f"{file} cannot be read as GeoParquet: {error}") from error
    columns = {str(name): frame[name].to_numpy() for name in frame.columns if name != frame.geometry.name}
    return np.asarray(frame.geometry.array, dtype=object), columns, _crs_text(frame.crs)


def _write_ogr(
    file: Path,
    driver: str,
    layer: str,
    geometries: NDArray[np.object_],
    columns: Mapping[str, NDArray[Any]],
    crs: str | None,
    *,
    append: bool,
) -> None:
    import pyogrio
    import pyogrio.raw
    from pyogrio.errors import DataSourceError

    kinds = {str(kind) for kind in np.unique([shape.geom_type for shape in geometries])} or {"Polygon"}
    kind = kinds.pop() if len(kinds) == 1 else "Multi" + min(kinds, key=len)
    values = {name: _storable(column) for name, column in columns.items()}
    # A GeoPackage stores when it was written; a fixed date makes equal content equal bytes, which scenes rely on.
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": "2000-01-01T00:00:00.000Z"})
    try:
        with warnings.catch_warnings():
            # A set without CRS is written without one; that is no surprise to whoever made it.
            warnings.filterwarnings("ignore", message="'crs' was not provided")
            pyogrio.raw.write(
                file,
                geometry=shapely.to_wkb(geometries, flavor="iso"),
                field_data=list(values.values()),
                fields=np.array(list(values), dtype=object),
                layer=None if driver == "GeoJSON" and not layer else layer,
                driver=driver,
                geometry_type=kind,
                promote_to_multi=kind.startswith("Multi"),
                field_mask=[np.ma.getmaskarray(column) for column in columns.values()] if columns else None,
                crs=crs,
                append=append,
                **({"SPATIAL_INDEX": "NO"} if driver == "FlatGeobuf" and not len(geometries) else {}),
            )
    except DataSourceError as error:
        raise OutputError(f"{file.name} cannot be written: {error}") from error
    finally:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": None})


def _write_parquet(
    file: Path, geometries: NDArray[np.object_], columns: Mapping[str, NDArray[Any]], crs: str | None
) -> None:
    geopandas = _parquet_support(file, OutputError)
    frame = geopandas.GeoDataFrame(dict(columns), geometry=list(geometries), crs=crs)
    frame.to_parquet(file)


def _parquet_support(file: Path, error: type[InputError] | type[OutputError]) -> Any:
    try:
        import geopandas
        import pyarrow.parquet  # noqa: F401
    except ImportError as missing:
        raise error(f"{file.name}: GeoParquet needs pyarrow: pip install 'roofbench[parquet]'") from missing
    return geopandas


def _crs_text(crs: Any) -> str | None:
    if crs is None:
        return None
    authority = crs.to_authority()
    return ":".join(authority) if authority else str(crs.to_wkt())


def _storable(column: NDArray[Any]) -> NDArray[Any]:
    """Return a column of a type that GDAL knows: text as objects, all integers as int64."""
    values = np.ma.getdata(column)
    if values.dtype.kind in "US":
        return values.astype(object)
    if values.dtype.kind == "O":
        return np.array([None if value is None else str(value) for value in values], dtype=object)
    if values.dtype.kind in "iub" and values.dtype.kind != "b":
        return values.astype(np.int64)
    return values


def _building_ids(file: Path, columns: Mapping[str, NDArray[Any]], name: str | None) -> NDArray[Any] | None:
    """Return the building of each row; rows without a value get one of their own."""
    if name is None:
        if "building_id" not in columns:
            return None
        name = "building_id"
    if name not in columns:
        raise InputError(
            f"{file} has no column {name!r}{nearest_hint(name, columns)}; it has {', '.join(columns) or 'none'}"
        )
    labels = columns[name]
    if labels.dtype.kind in "iu":
        return labels
    lacking = np.array([value is None or value != value or value == "" for value in labels], dtype=bool)
    if labels.dtype.kind == "f" and not lacking.any():
        return labels
    texts = np.array([str(value) for value in labels], dtype=object)
    texts[lacking] = [f"(row {row})" for row in np.flatnonzero(lacking)]
    return texts.astype(str)


def _in_degrees_at_most(file: Path, crs: str | None, geometries: NDArray[np.object_]) -> bool:
    """Return False for a GeoJSON whose CRS is the WGS 84 of RFC 7946 but whose coordinates cannot be degrees."""
    if crs != "EPSG:4326" or DRIVERS.get(file.suffix.lower()) != "GeoJSON" or not len(geometries):
        return True
    xmin, ymin, xmax, ymax = shapely.total_bounds(geometries)
    return not (max(abs(xmin), abs(xmax)) > 360 or max(abs(ymin), abs(ymax)) > 90)


def _transformed(file: Path, geometries: NDArray[np.object_], crs: str, to_crs: str) -> NDArray[np.object_]:
    """Return the geometries in another CRS, without Z, axis order x, y on both sides."""
    import pyproj

    if same_crs(crs, to_crs):
        return geometries
    transformer = pyproj.Transformer.from_crs(parse_crs(crs), parse_crs(to_crs), always_xy=True)
    flat = shapely.force_2d(geometries)
    moved = shapely.transform(flat, lambda points: np.column_stack(transformer.transform(*points.T)))
    if (np.isfinite(shapely.get_coordinates(flat)) & ~np.isfinite(shapely.get_coordinates(moved))).any():
        raise CRSError(
            f"{file}: its coordinates cannot be transformed from {crs_label(crs)} to {crs_label(to_crs)}: "
            "it is probably in another CRS, name it"
        )
    return np.asarray(moved, dtype=object)
