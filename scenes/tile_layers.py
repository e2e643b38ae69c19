"""Layers of many files: the points, images or elevation models of a scene that lies in tiles.

Nouns
-----
tile file
    One file of a layer. The manifest of the scene lists it with its bounds and checksum, so that a window opens only
    the files that it meets.

Tile files may overlap: points that are there twice are left out, of rasters the first file with data wins. Points that
no scene uses (`scenes.usable_points`) are left out, since tile files are read as their makers left them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import InputError
from .geodata.point_chunks import read_chunk_index
from .geodata.points import PointCloud
from .geodata.raster import Grid, Image
from .remote import fetch_into_copy

__all__ = ["TILED_LAYERS", "TileFile", "TiledLayer", "checksum", "tile_problem", "tiled_layers"]

#: Layers that may lie in tiles; infrared becomes a band of the image.
TILED_LAYERS = ("points", "image", "dem", "infrared")

_Extent = tuple[float, float, float, float]


@dataclass(frozen=True, kw_only=True)
class TileFile:
    """A file of a layer.

    Attributes
    ----------
    layer : str
        One of `TILED_LAYERS`.
    file : str
        Path below the scene folder, with slashes.
    bounds : tuple of float
        ``(xmin, ymin, xmax, ymax)``, metres.
    sha256 : str
    gsd : float, optional
        Cell size of a raster, metres.
    bands : tuple of str
        Of an image, in the order of the file; ``-`` skips one.
    depth : int
        Bits of the values of an image of 16 bit; fewer are scaled to 16.
    gain : float
        Factor from the values of infrared to shares of the white of the image.
    """

    layer: str
    file: str
    bounds: _Extent
    sha256: str
    gsd: float | None = None
    bands: tuple[str, ...] = ()
    depth: int = 16
    gain: float = 1.0

    def meets(self, extent: _Extent) -> bool:
        """Return whether the file may hold something inside an extent."""
        xmin, ymin, xmax, ymax = self.bounds
        return xmin <= extent[2] and xmax >= extent[0] and ymin <= extent[3] and ymax >= extent[1]


@dataclass(frozen=True)
class TiledLayer:
    """A layer in tile files, read when it is called or by window; of an image with infrared in files of its own."""

    layer: str
    folder: Path
    files: tuple[TileFile, ...]
    crs: str
    infrared: TiledLayer | None = None

    def __call__(self) -> Any:
        """Read the whole layer."""
        bounds = np.array([file.bounds for file in self.files])
        return self.window((*bounds[:, :2].min(axis=0).tolist(), *bounds[:, 2:].max(axis=0).tolist()))

    def window(self, extent: _Extent) -> Any:
        """Read the part inside an extent; files that changed since they were indexed are refused."""
        met = self._met(extent)
        paths = [self._sound(file) for file in met]
        if self.layer == "points":
            return _points(paths, extent, self._chunks(met))
        if not met:
            return None
        from .geodata.raster_headers import read_raster_header
        from .geodata.raster_mosaic import mosaic_elevation, mosaic_image

        part = self._grid.part(extent)
        if part is None:
            return None
        grid, headers = self._grid.cut(*part), [read_raster_header(path) for path in paths]
        if self.layer == "image":
            depths = [file.depth for file in met]
            image = mosaic_image(headers, grid, crs=self.crs, bands=met[0].bands, depths=depths)
            return image if self.infrared is None else self.infrared._added_to(image)
        return mosaic_elevation(headers, grid, crs=self.crs)

    def digest(self, extent: _Extent) -> str:
        """Return the checksums of the files that an extent meets."""
        own = f"{self.layer} {' '.join(file.sha256 for file in self._met(extent))}"
        return own if self.infrared is None else f"{own} {self.infrared.digest(extent)} {self.infrared.files[0].gain}"

    def meets(self, extent: _Extent) -> bool:
        """Return whether a file may hold something inside an extent."""
        return any(file.meets(extent) for file in self.files)

    def _added_to(self, image: Image) -> Image:
        """Return an image with the near infrared of these files; pixels without it have no data."""
        from .geodata.infrared_scale import band_of_shares
        from .geodata.raster_headers import read_raster_header
        from .geodata.raster_mosaic import mosaic_bands

        met = self._met(image.grid.extent)
        headers = [read_raster_header(self._sound(file)) for file in met]
        bands = self.files[0].bands
        values = mosaic_bands(headers, ("nir",), image.grid, crs=self.crs, bands=bands)[0]
        known = np.isfinite(values)
        if image.valid is not None:
            known &= image.valid
        band = band_of_shares(values * np.float32(self.files[0].gain), image.values.dtype.name)
        both = np.concatenate([image.values, band[None]])
        return Image(both, (*image.bands, "nir"), image.grid, None if known.all() else known)

    def _met(self, extent: _Extent) -> list[TileFile]:
        return [file for file in self.files if file.meets(extent)]

    @property
    def _grid(self) -> Grid:
        """The grid that the cells of all files belong to."""
        gsd = self.files[0].gsd
        assert gsd is not None
        bounds = np.array([file.bounds for file in self.files])
        west, south = bounds[:, :2].min(axis=0).tolist()
        east, north = bounds[:, 2:].max(axis=0).tolist()
        return Grid(west, north, gsd, round((north - south) / gsd), round((east - west) / gsd))

    def _chunks(self, files: Sequence[TileFile]) -> dict[Path, NDArray[np.float64]]:
        known = read_chunk_index(self.folder)
        return {self.folder / file.file: known[file.sha256] for file in files if file.sha256 in known}

    def _sound(self, file: TileFile) -> Path:
        path = self.folder / file.file
        fetch_into_copy(self.folder, file.file)
        if not path.is_file():
            raise InputError(f"{path}: no such file, though the scene lists it; put it back, or index the scene again")
        if checksum(path) != file.sha256:
            raise InputError(
                f"{path} changed since the scene was indexed: if that is intended, run 'roofbench scenes index "
                f"{self.folder}'"
            )
        return path


def tiled_layers(folder: Path, entries: Sequence[Mapping[str, Any]], crs: str) -> dict[str, TiledLayer]:
    """Return the layers of the tile files that a manifest lists."""
    files = [
        TileFile(**{**entry, "bounds": tuple(entry["bounds"]), "bands": tuple(entry.get("bands", ()))})
        for entry in entries
    ]
    found = {}
    for layer in TILED_LAYERS:
        own = tuple(file for file in files if file.layer == layer)
        if own:
            found[layer] = TiledLayer(layer, folder, own, crs)
    infrared = found.pop("infrared", None)
    if infrared is not None and "image" in found:
        found["image"] = replace(found["image"], infrared=infrared)
    return found


def tile_problem(entries: Any) -> str | None:
    """Return what is wrong with the tile files in a manifest, in words, or None."""
    if not isinstance(entries, list):
        return "[[tiles]] must be a list of tables"
    for entry in entries:
        known = isinstance(entry, dict) and set(entry) <= set(TileFile.__dataclass_fields__)
        if not known or not all(isinstance(entry.get(name), str) for name in ("layer", "file", "sha256")):
            return "each of [[tiles]] needs layer, file and sha256"
        if entry["layer"] not in TILED_LAYERS:
            return f"[[tiles]] has the layer {entry['layer']!r}, which is none of {', '.join(TILED_LAYERS)}"
        path = PurePosixPath(entry["file"])
        if path.is_absolute() or ".." in path.parts:
            return f"[[tiles]] names {entry['file']!r}, which is not below the folder of the scene"
        bounds = entry.get("bounds")
        if not isinstance(bounds, list) or len(bounds) != 4 or not np.isfinite(np.array(bounds, dtype=float)).all():
            return f"bounds of {entry['file']} must be [xmin, ymin, xmax, ymax] in metres"
        if entry.get("depth", 16) not in range(8, 17):
            return f"depth of {entry['file']} must be a number of bits from 8 to 16"
        if not isinstance(entry.get("gain", 1.0), int | float) or not 0 < entry.get("gain", 1.0) < 1e9:
            return f"gain of {entry['file']} must be a positive number"
    return None


def checksum(path: Path) -> str:
    """Return the SHA-256 of a file, of a VRT with the files that it shows; files that did not change are read once."""
    state = path.stat()
    own = _checksum(path, state.st_size, state.st_mtime_ns)
    if path.suffix.lower() != ".vrt":
        return own
    from .geodata.raster_mosaic import raster_sources

    shown = [checksum(source) for source in sorted(raster_sources(path)) if source.is_file()]
    return hashlib.sha256(" ".join([own, *shown]).encode()).hexdigest()


@lru_cache(maxsize=4096)
def _checksum(path: Path, size: int, changed: int) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _points(paths: Sequence[Path], extent: _Extent, chunks: Mapping[Path, NDArray[np.float64]]) -> PointCloud:
    if not paths:
        none = np.empty(0)
        return PointCloud(x=none, y=none, z=none)
    from .geodata.las_files import read_points
    from .usable_points import is_land, is_noise

    cloud = read_points(paths, window=extent, chunks=chunks)
    usable = is_land(cloud.z) & ~is_noise(cloud)
    if not usable.all():
        cloud = cloud.take(usable)
    return cloud.distinct() if len(paths) > 1 else cloud
