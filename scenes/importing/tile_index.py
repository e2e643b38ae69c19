"""Index of tiles: a folder of point files, images and elevation models becomes a scene, and no file is copied.

Of each file the header is read and the checksum is computed; bounds and checksum go into the manifest, and the bounds
of the chunks of large point files beside it (`geodata.point_chunks`). Rasters of 8 or 16 bit without sign are images,
all others elevation models, except files that say that they are near infrared, which becomes a band of the images in
colour (`infrared_tiles`); those that a VRT shows are read through it. ``reference.gpkg`` and ``area.gpkg`` in the
folder belong to the scene.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.errors import CRSError, InputError, RoofbenchError
from ...core.wording import counted
from ..folder import FILES, MANIFEST, open_scene, read_manifest, write_manifest
from ..geodata.colour_depth import common_depths, depth_note
from ..geodata.crs import crs_label, named_crs, require_metric, same_crs
from ..geodata.image_bands import IMAGE_TYPES, band_names, require_infrared, sampled_largest
from ..geodata.las_files import read_chunks, read_las_header
from ..geodata.point_chunks import read_chunk_index, write_chunk_index
from ..geodata.raster import Grid
from ..geodata.raster_headers import RasterHeader, read_raster_header
from ..geodata.raster_mosaic import raster_sources
from ..scene import Scene
from ..tile_layers import checksum
from .infrared_tiles import infrared_entry, measured_gain

__all__ = ["IndexedFolder", "index_folder"]

_POINTS, _RASTERS = (".las", ".laz"), (".tif", ".tiff", ".jp2", ".vrt")
#: Largest shift between the cells of two rasters that still coincide, cells.
_SAME_CELLS = 1e-3
#: Number of points from which the chunks of a file are indexed.
_LARGE = 200_000


class IndexedFolder(NamedTuple):
    """A scene of tiles, one sentence for each file that is no part of it, and notes on what was assumed."""

    scene: Scene
    problems: tuple[str, ...]
    notes: tuple[str, ...] = ()


class _Tile(NamedTuple):
    """An entry of the manifest, the CRS that the file names, and what a raster says of itself."""

    entry: dict[str, Any]
    crs: str | None
    raster: RasterHeader | None

    @property
    def grid(self) -> Grid | None:
        return None if self.raster is None else self.raster.grid


def index_folder(
    folder: str | os.PathLike[str],
    *,
    crs: str | None = None,
    name: str | None = None,
    facts: dict[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> IndexedFolder:
    """Write the manifest of a folder of tiles, or write it anew, and open the scene.

    Parameters
    ----------
    folder : path
    crs : str, optional
        CRS of files that name none; by default that of the first file that names one.
    name : str, optional
        Of the scene; by default as before, else that of the folder.
    facts : dict, optional
        Further entries for the head of the manifest: source, licence, derived.
    progress : callable, optional
        Called with (files read, files in all).

    Raises
    ------
    InputError, CRSError
        No folder, or no file in it that can be used; no CRS at all.
    """
    home = Path(folder)
    if not home.is_dir():
        raise InputError(f"{home}: no such folder; name the folder that holds the tiles")
    before = read_manifest(home)[1] if (home / MANIFEST).is_file() else {}
    files = _files(home, before)
    if not files:
        raise InputError(f"{home} holds no tiles: expected point files ({', '.join(_POINTS)}) or rasters below it")
    tiles, problems = [], []
    chunks: dict[str, NDArray[np.float64]] = {}
    known = read_chunk_index(home)
    for number, file in enumerate(files, start=1):
        try:
            tile = _tile(home, file, crs)
            _add_chunks(file, tile.entry, known, chunks)
            tiles.append(tile)
        except (RoofbenchError, OSError) as error:
            problems.append(f"{file.relative_to(home)} is left out: {error}")
        if progress is not None:
            progress(number, len(files))
    chosen = crs if crs is not None else next((tile.crs for tile in tiles if tile.crs is not None), before.get("crs"))
    if chosen is None:
        if not tiles:
            raise InputError(f"{home} holds no tile that can be used; {problems[0]}")
        raise CRSError(f"{home}: no tile names its CRS: set crs=, such as EPSG:25832")
    chosen = named_crs(chosen)
    require_metric(chosen, str(home), remedy="give tiles in a projected CRS in metres")
    sound = _of_one_place(_with_colours(tiles, problems), chosen, problems)
    if not sound:
        raise InputError(f"{home} holds no tile that can be used; {problems[0]}")
    manifest: dict[str, Any] = {
        "format": 1,
        "name": name or before.get("name") or home.resolve().name,
        "crs": chosen,
        "units": "metre",
        "extent": _extent(sound),
        **{key: before[key] for key in ("source", "licence", "derived", "facts") if key in before},
        **(facts or {}),
    }
    if problems:
        manifest["left_out"] = problems
    listed = {
        kind: {"file": FILES[kind], "sha256": checksum(home / FILES[kind])}
        for kind in ("reference", "area")
        if (home / FILES[kind]).is_file()
    }
    if listed:
        manifest["files"] = listed
    notes = (*_add_depths(sound), *_add_gains(sound, chosen))
    manifest["tiles"] = [tile.entry for tile in sound]
    write_chunk_index(home, chunks)
    write_manifest(home, manifest)
    return IndexedFolder(open_scene(home), tuple(problems), notes)


def _files(home: Path, manifest: dict[str, Any]) -> list[Path]:
    if manifest.get("files") and not manifest.get("tiles") and {"points", "image", "dem"} & set(manifest["files"]):
        raise InputError(f"{home} is a scene of single files already: name a folder of tiles")
    found = [path for path in home.rglob("*") if path.suffix.lower() in (*_POINTS, *_RASTERS) and path.is_file()]
    # What a virtual raster shows is read through it.
    shown = {source for path in found if path.suffix.lower() == ".vrt" for source in raster_sources(path)}
    found = [path for path in found if path.resolve() not in shown]
    return sorted(path for path in found if not any(part.startswith(".") for part in path.relative_to(home).parts))


def _tile(home: Path, file: Path, crs: str | None) -> _Tile:
    entry: dict[str, Any] = {"layer": "points", "file": file.relative_to(home).as_posix()}
    if file.suffix.lower() in _POINTS:
        header = read_las_header(file, fallback=crs)
        entry["bounds"] = [*header.bounds[:2], *header.bounds[3:5]]
        entry["sha256"] = checksum(file)
        return _Tile(entry, header.crs, None)
    raster = read_raster_header(file)
    if not raster.square:
        raise InputError(f"{file}: its cells are not square: warp it, for instance with gdalwarp -tr")
    entry["layer"] = "image" if raster.dtype in IMAGE_TYPES else "dem"
    entry["bounds"], entry["gsd"] = list(raster.grid.extent), raster.grid.gsd
    if (infrared := infrared_entry(raster)) is not None:
        entry |= infrared
    elif entry["layer"] == "image":
        entry["bands"] = list(band_names(raster, None))
        require_infrared(raster, None)
    else:
        _require_heights(raster)
    entry["sha256"] = checksum(file)
    return _Tile(entry, raster.crs, raster)


def _add_chunks(
    file: Path, entry: dict[str, Any], known: Mapping[str, NDArray[np.float64]], chunks: dict[str, NDArray[np.float64]]
) -> None:
    """Add the chunks of a large point file, which is read once for that."""
    if entry["layer"] != "points" or read_las_header(file, crs="").count < _LARGE:
        return
    found = known.get(entry["sha256"])
    found = read_chunks(file) if found is None else found
    if found is not None:
        chunks[entry["sha256"]] = found


def _add_depths(tiles: Sequence[_Tile]) -> tuple[str, ...]:
    """Add the bits of the values of images of 16 bit to their entries, and return a note where they are fewer."""
    images = [tile for tile in tiles if tile.raster is not None and tile.raster.dtype == "uint16"]
    images = [tile for tile in images if tile.entry["layer"] == "image"]
    depths = dict.fromkeys((tile.entry["file"] for tile in images), 16)
    unnamed = []
    for tile in images:
        assert tile.raster is not None
        if tile.raster.depth is None:
            unnamed.append((tile.entry["file"], sampled_largest(tile.raster, tile.entry["bands"])))
        else:
            depths[tile.entry["file"]] = tile.raster.depth
    depths |= zip((file for file, _ in unnamed), common_depths([value for _, value in unnamed]), strict=True)
    for tile in images:
        if depths[tile.entry["file"]] < 16:
            tile.entry["depth"] = depths[tile.entry["file"]]
    found = sorted(set(depths.values()) - {16})
    return tuple(f"{counted(list(depths.values()).count(depth), 'image')}: {depth_note(depth)}" for depth in found)


def _with_colours(tiles: Sequence[_Tile], problems: list[str]) -> list[_Tile]:
    """Return the tiles; files of near infrared are images by themselves where no others show red, green and blue."""
    if any({"red", "green", "blue"} == set(tile.entry.get("bands", ())) for tile in tiles):
        return list(tiles)
    kept = []
    for tile in tiles:
        if tile.entry["layer"] == "infrared":
            assert tile.raster is not None
            if tile.raster.dtype not in IMAGE_TYPES:
                problems.append(f"{tile.entry['file']} is left out: it is near infrared, and no image has red and blue")
                continue
            tile.entry.update(layer="image", bands=list(band_names(tile.raster, None)))
            require_infrared(tile.raster, None)
        kept.append(tile)
    return kept


def _add_gains(tiles: Sequence[_Tile], crs: str) -> tuple[str, ...]:
    """Add the scale of near infrared to its entries, and return a note on it; none without infrared."""
    infrared = [tile for tile in tiles if tile.entry["layer"] == "infrared"]
    if not infrared:
        return ()
    images = [
        (tile.raster, tile.entry.get("depth", 16))
        for tile in tiles
        if tile.entry["layer"] == "image" and tile.raster is not None
    ]
    headers = [tile.raster for tile in infrared if tile.raster is not None]
    gain, note = measured_gain(headers, infrared[0].entry["bands"], images, crs)
    for tile in infrared:
        tile.entry["gain"] = gain
    return (f"{counted(len(infrared), 'image')}: {note}",)


def _require_heights(raster: RasterHeader) -> None:
    if raster.band_count != 1:
        raise InputError(f"{raster.path} has {raster.band_count} bands, expected an elevation model of one band")
    if raster.height_unit is not None:
        raise CRSError(f"{raster.path}: its heights are in {raster.height_unit}, metres are needed: convert them")


def _of_one_place(tiles: Sequence[_Tile], crs: str, problems: list[str]) -> list[_Tile]:
    """Return the tiles of one CRS and, in each layer, of one grid; add a sentence for each of the others."""
    sound: list[_Tile] = []
    first: dict[str, _Tile] = {}
    for tile in tiles:
        entry = tile.entry
        if tile.crs is not None and not same_crs(tile.crs, crs):
            problems.append(
                f"{entry['file']} is left out: it is in {crs_label(tile.crs)}, the scene in {crs_label(crs)}: bring "
                "all tiles to one CRS"
            )
            continue
        model = first.setdefault(entry["layer"], tile)
        if tile.grid is not None and model.grid is not None and not _fits(tile.grid, model.grid):
            problems.append(
                f"{entry['file']} is left out: its cells of {tile.grid.gsd:g} m do not coincide with those of "
                f"{model.entry['file']}: resample them to one grid"
            )
            continue
        if entry.get("bands") != model.entry.get("bands"):
            problems.append(f"{entry['file']} is left out: it has other bands than {model.entry['file']}")
            continue
        sound.append(tile)
    return sound


def _fits(one: Grid, two: Grid) -> bool:
    shift = np.array([(one.west - two.west) / two.gsd, (one.north - two.north) / two.gsd])
    return abs(one.gsd - two.gsd) <= 1e-6 * two.gsd and bool((abs(shift - np.round(shift)) < _SAME_CELLS).all())


def _extent(tiles: Sequence[_Tile]) -> list[float]:
    """Return the extent of the points, in whole metres; of the rasters where there are no points."""
    points = [tile.entry["bounds"] for tile in tiles if tile.entry["layer"] == "points"]
    bounds = np.array(points or [tile.entry["bounds"] for tile in tiles])
    return [*np.floor(bounds[:, :2].min(axis=0)).tolist(), *np.ceil(bounds[:, 2:].max(axis=0)).tolist()]
