"""Vector files: footprints read from and written to GeoJSON, GeoPackage, Shapefile, FlatGeobuf and GeoParquet.

A layer of a file with several is named as QGIS does, ``city.gpkg|layername=roofs``, or by ``layer=``.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.errors import CRSError, InputError, OutputError
from ...core.inputs import require_file
from ...core.output import whole_file
from ...core.plain_paths import plain_path, plain_target
from ...core.registry import nearest_hint
from ...core.wording import counted
from .crs import common_crs, crs_label, file_crs, is_geographic, named_crs, parse_crs, require_metric, same_crs
from .damaged_outlines import refuse_damaged
from .degrees import JSON_SYSTEMS, json_means_degrees, refuse_degrees
from .footprints import Footprints
from .label_images import ENDINGS, read_labels
from .layer_styles import add_layer_styles
from .ogr_layers import layer_names, quiet, read_layer
from .parquet_files import read_parquet, write_parquet
from .polygon_repair import Repair
from .shapefile_parts import refuse_broken_parts
from .vector_columns import storable_columns
from .wkb import geometries_of_wkb

__all__ = [
    "DRIVERS",
    "building_column",
    "layer_name",
    "named_or_none",
    "output_driver",
    "read_footprints",
    "read_polygon",
    "readable_layer",
    "require_writable_crs",
    "split_layer",
    "table_of",
    "write_footprints",
    "write_layers",
    "write_ogr",
]
#: Geometry type of shapely to that of OGR.
_KINDS = {1: "LineString", 3: "Polygon", 5: "MultiLineString", 6: "MultiPolygon", 0: "Point", 4: "MultiPoint"}
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
    """Read footprints from a vector file, or from a label image or mask (see `label_images`).

    Parameters
    ----------
    path : path
        File, with ``|layername=NAME`` where it has several layers.
    layer : str, optional
        Layer name; not needed for a file of one layer.
    building_id : str, optional
        Column whose equal values mark the parts of one building. Without it a column called ``building_id`` is
        used where there is one, else every polygon is its own building. A row with no value is its own building.
    crs : str, optional
        CRS to assign, for files that have none or the wrong one; coordinates are not changed.
    to_crs : str, optional
        CRS to transform to; a file of unknown CRS is taken to be in it already.

    Notes
    -----
    A GeoJSON file that has no CRS is in degrees by RFC 7946. When its coordinates cannot be degrees, its CRS is
    taken as not known.

    Raises
    ------
    InputError
        Missing or unreadable file, unknown layer or column, no polygons.
    CRSError
        Geographic CRS, one that is not in metres, or coordinates that can only be degrees.
    """
    file, named = split_layer(path)
    layer = layer or named
    if crs is not None:
        crs = named_crs(crs)
    closed: list[Repair] = []
    if file.suffix.lower() in ENDINGS:
        geometries, columns, own_crs = read_labels(file)
    elif DRIVERS.get(file.suffix.lower()) == "Parquet":
        geometries, columns, own_crs, closed = read_parquet(file, needs_crs=crs is None)
    else:
        geometries, columns, own_crs, closed = _read_ogr(file, layer)
    if crs is None and own_crs in JSON_SYSTEMS and not json_means_degrees(file, geometries):
        own_crs = None
    crs = crs or own_crs
    if not is_geographic(crs):
        refuse_degrees(geometries, str(file))
    if to_crs is not None:
        geometries, crs = _transformed(file, geometries, crs or to_crs, to_crs), to_crs
    if len(geometries):
        require_metric(crs, str(file), heights=False)
    column = building_column(file, columns, building_id)
    identifiers = None if column is None else columns[column]
    footprints = Footprints.of(geometries, building_ids=identifiers, crs=crs, attributes=columns, source=str(file))
    reported = {repair.id for repair in footprints.repairs}
    more = [repair for repair in closed if repair.id not in reported]
    if more:
        repairs = sorted([*footprints.repairs, *more], key=lambda repair: repair.id)
        footprints = dataclasses.replace(footprints, repairs=tuple(repairs))
    if len(geometries) and not len(footprints):
        kinds = sorted({repair.problem for repair in footprints.repairs})
        raise InputError(f"{file}: no polygons among {counted(len(geometries), 'feature')} ({'; '.join(kinds[:3])})")
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
    file = Path(path)
    table = footprints.polygons, table_of(footprints)
    write_layers({layer or layer_name(file): table}, file, crs=footprints.crs, overwrite=overwrite)


def table_of(footprints: Footprints) -> dict[str, NDArray[Any]]:
    """Return the columns that a file of footprints has: attributes, and building ids where there are any."""
    columns = dict(footprints.attributes)
    if footprints.building_ids is not None:
        columns["building_id"] = footprints.building_ids
    return columns


def layer_name(file: Path) -> str:
    """Return the name of the layer of a file with one; names of files need not be UTF-8, those of layers are."""
    return file.stem.encode(errors="backslashreplace").decode()


def output_driver(path: str | os.PathLike[str]) -> str:
    """Return the GDAL driver that the ending of a file to be written names, or raise `OutputError`."""
    file = Path(path)
    driver = DRIVERS.get(file.suffix.lower())
    if driver is None:
        raise OutputError(
            f"{file}: unknown file ending {file.suffix!r}{nearest_hint(file.suffix, DRIVERS)}; "
            f"roofbench writes {', '.join(DRIVERS)}"
        )
    return driver


def write_layers(
    layers: Mapping[str, tuple[NDArray[np.object_], Mapping[str, NDArray[Any]]]],
    path: str | os.PathLike[str],
    *,
    crs: str | None,
    styles: Mapping[str, str] | None = None,
    overwrite: bool = False,
) -> None:
    """Write named layers of (geometries, columns) into one file; only GeoPackage takes more than one.

    Lines and polygons may be mixed between layers, not within one. `styles` are those of QGIS by layer
    (`layer_styles`); only a GeoPackage takes them.
    """
    file = Path(path)
    driver = output_driver(file)
    if len(layers) > 1 and driver != "GPKG":
        raise OutputError(f"{file}: {len(layers)} layers ({', '.join(layers)}) need a GeoPackage: name it .gpkg")
    require_writable_crs(crs, driver, file)
    with whole_file(file, overwrite=overwrite) as scratch, plain_target(scratch) as plain:
        for number, (layer, (geometries, table)) in enumerate(layers.items()):
            columns = storable_columns(table, driver, file)
            if driver == "Parquet":
                write_parquet(plain, geometries, columns, crs)
            else:
                write_ogr(plain, driver, layer, geometries, columns, crs, append=number > 0)
        if styles and driver == "GPKG":
            add_layer_styles(plain, styles)


def require_writable_crs(crs: str | None, driver: str, file: Path) -> None:
    """Raise `OutputError` for a CRS that the format cannot name."""
    if crs is not None:
        known = parse_crs(crs)
        if driver == "GeoJSON" and known.to_authority(min_confidence=100) is None:
            raise OutputError(
                f"{file}: GeoJSON names a CRS by its EPSG code, and {known.name!r} has none: write a GeoPackage (.gpkg)"
            )


@contextmanager
def readable_layer(file: Path, layer: str | None) -> Iterator[tuple[Path, str]]:
    """Yield the path by which OGR reads a file, and the layer that is named or the only one.

    Errors of OGR inside the block become one sentence.
    """
    from pyogrio.errors import DataLayerError, DataSourceError

    if not (file.is_dir() and file.suffix.lower() == ".gdb"):
        require_file(file, "a vector file, for instance .gpkg or .geojson")
    if file.suffix.lower() == ".shp":
        refuse_broken_parts(file)
    if file.suffix.lower() == ".fgb":
        _refuse_cut_header(file)
    with plain_path(file) as path:
        try:
            names = layer_names(path)
            if not names:
                raise InputError(f"{file} has no layers: give a file with polygons")
            if layer is None and len(names) > 1:
                raise InputError(
                    f"{file} has {len(names)} layers ({', '.join(names)}): name one as '{file}|layername={names[0]}'"
                )
            if layer is not None and layer not in names:
                raise InputError(
                    f"{file} has no layer {layer!r}{nearest_hint(layer, names)}; it has {', '.join(names)}"
                )
            yield path, layer or names[0]
        except (DataSourceError, DataLayerError) as error:
            reason = " ".join(str(error).partition("; It might help")[0].replace(str(path), str(file)).split())
            raise InputError(
                f"{file} cannot be read as a vector file: {reason.rstrip('.')}; copy or download it again, or write "
                "it as a GeoPackage (.gpkg)"
            ) from error


def _refuse_cut_header(file: Path) -> None:
    """Raise `InputError` when a FlatGeobuf file ends inside its header; OGR says that it has no layers."""
    with file.open("rb") as stream:
        head = stream.read(12)
    size, needed = file.stat().st_size, 12 + int.from_bytes(head[8:12], "little")
    if head[:3] == b"fgb" and (len(head) < 12 or size < needed):
        raise InputError(
            f"{file} is truncated: it has {size} bytes and ends inside its header; copy or download it again"
        )


def _read_ogr(
    file: Path, layer: str | None
) -> tuple[NDArray[np.object_], dict[str, NDArray[Any]], str | None, list[Repair]]:
    with readable_layer(file, layer) as (path, name):
        found = read_layer(path, name)
    if found.wkb is None:
        raise InputError(f"{file}: no polygons: the layer {name!r} has no geometry")
    refuse_damaged(file, name, np.flatnonzero([one is None for one in found.wkb]), len(found.wkb))
    columns = dict(found.columns)
    if file.suffix.lower() == ".shp" and "building_i" in columns:
        columns["building_id"] = columns.pop("building_i")  # a Shapefile keeps ten letters of a name
    geometries, closed = geometries_of_wkb(found.wkb, file)
    return geometries, columns, None if found.crs is None else named_or_none(found.crs, str(file)), closed


def named_or_none(crs: str, where: str) -> str | None:
    """Return the CRS of a file as it is; None for a local or undefined one."""
    return crs if crs.upper().startswith("EPSG:") else crs if file_crs(parse_crs(crs), where) is not None else None


def write_ogr(
    file: Path,
    driver: str,
    layer: str,
    geometries: NDArray[np.object_],
    columns: Mapping[str, NDArray[Any]],
    crs: str | None,
    *,
    append: bool,
    types: Iterable[int] | None = None,
) -> None:
    """Write or append a layer as it is given; a layer of parts names the geometry types of all of them."""
    import pyogrio
    import pyogrio.raw
    from pyogrio.errors import DataLayerError, DataSourceError, FeatureError, FieldError

    # GDAL keeps some beginnings for itself, and takes no sign as the first letter.
    if driver == "GPKG" and (layer.lower().startswith(("gpkg", "sqlite")) or not layer[:1].isalnum()):
        layer = f"layer_{layer}"
    kind = _layer_kind(np.unique(shapely.get_type_id(geometries)) if types is None else types)
    # A GeoPackage stores when it was written; a fixed date makes equal content equal bytes, which scenes rely on.
    pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": "2000-01-01T00:00:00.000Z"})
    try:
        with quiet():
            pyogrio.raw.write(
                file,
                geometry=shapely.to_wkb(geometries, flavor="iso"),
                field_data=[np.ma.getdata(column) for column in columns.values()],
                fields=np.array(list(columns), dtype=object),
                layer=layer,
                driver=driver,
                geometry_type=kind,
                promote_to_multi=kind.startswith("Multi"),
                field_mask=[np.ma.getmaskarray(column) for column in columns.values()] if columns else None,
                crs=crs,
                append=append,
                # The index of FlatGeobuf would put the rows into another order.
                **({"SPATIAL_INDEX": "NO"} if driver == "FlatGeobuf" else {}),
            )
    except (DataSourceError, DataLayerError, FeatureError, FieldError) as error:
        raise OutputError(f"{file.name} cannot be written: {error}") from error
    finally:
        pyogrio.set_gdal_config_options({"OGR_CURRENT_DATE": None})
    if driver == "GeoJSON" and crs is None:
        _say_no_crs(file)


def _layer_kind(types: Iterable[int]) -> str:
    """Return the geometry type of a layer of geometries of some types, as shapely numbers them."""
    kinds = [_KINDS.get(int(number), "Unknown") for number in types] or ["Polygon"]
    return kinds[0] if len(kinds) == 1 else "Multi" + min(kinds, key=len)


def _say_no_crs(file: Path) -> None:
    """Add ``"crs": null``, without which a GeoJSON file would say that it is in degrees."""
    start = '"type": "FeatureCollection",'
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace(start, f'{start}\n"crs": null,', 1), encoding="utf-8")


def building_column(file: Path, columns: Iterable[str], name: str | None) -> str | None:
    """Return the column of building ids: the one that is named, or ``building_id`` where there is one."""
    known = list(columns)
    if name is None:
        # A Shapefile keeps ten letters of a name.
        usual = ("building_id", "building_i") if file.suffix.lower() == ".shp" else ("building_id",)
        return next((column for column in usual if column in known), None)
    if name not in known and file.suffix.lower() == ".shp" and name[:10] in known:
        name = name[:10]
    if name not in known:
        raise InputError(
            f"{file} has no column {name!r}{nearest_hint(name, known)}; it has {', '.join(known) or 'none'}"
        )
    return name


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
