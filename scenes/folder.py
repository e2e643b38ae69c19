"""Scene folders: a scene on disk that any GIS opens.

::

    scene.toml       manifest: name, CRS, units, extent, source, licence, and of each file its SHA-256 and origin
    points.laz       laser points
    ortho.tif        orthoimage, bands named
    dem.tif          bare-earth elevation, NaN where not known
    reference.gpkg   reference footprints with building_id
    area.gpkg        where the reference is complete, when it is not everywhere

All files but the manifest are optional and in the CRS of the scene. A folder is opened without reading any of them.
Points, images and DEM of a city lie in many files instead, which ``[[tiles]]`` of the manifest lists (`tile_layers`).
"""

from __future__ import annotations

import hashlib
import math
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ..core.errors import CRSError, InputError
from ..core.output import whole_folder
from ..core.plain_values import plain_value
from ..core.registry import nearest_hint
from .geodata.crs import require_metric
from .geodata.footprints import Footprints
from .remote import copy_of, fetch_into_copy, is_address
from .scene import Scene
from .shipped import shipped_names, shipped_or_given
from .tile_layers import checksum, tile_problem, tiled_layers

__all__ = [
    "FILES",
    "MANIFEST",
    "SCENE_FILES",
    "changed_files",
    "listed_hash",
    "open_scene",
    "read_manifest",
    "save_scene",
    "update_checksums",
    "write_area",
    "write_manifest",
    "write_reference",
]

MANIFEST = "scene.toml"
#: What a scene holds, and the file that holds it.
FILES: Mapping[str, str] = {
    "points": "points.laz",
    "image": "ortho.tif",
    "dem": "dem.tif",
    "reference": "reference.gpkg",
    "area": "area.gpkg",
}
#: Names in a scene folder, with the side files that a GIS leaves: a folder with any other is not replaced.
SCENE_FILES = (
    MANIFEST,
    *FILES.values(),
    "*.aux.xml",
    "*.ovr",
    "*.qmd",
    "*.qml",
    "*.gpkg-wal",
    "*.gpkg-shm",
    "*.lax",
    "LICENCE.txt",
)
#: Facts at the head of the manifest; of tiles, `left_out` says which files are no part of the scene and why.
_HEAD = ("source", "licence", "notes", "derived", "left_out")
#: Version of the layout; raised when older folders can no longer be read.
_FORMAT = 1


def open_scene(path: str | os.PathLike[str]) -> Scene:
    """Open a scene folder; points and rasters are read when they are first asked for.

    Parameters
    ----------
    path : path
        The folder, its ``scene.toml``, the name of a scene that comes with roofbench (see `scenes.shipped`), or an
        address such as ``https://host/town`` (see `scenes.remote`).

    Raises
    ------
    InputError
        No folder, no or a broken manifest, a file of the manifest that is not there.
    """
    folder, manifest = read_manifest(path)
    files: dict[str, Mapping[str, Any]] = manifest.get("files", {})
    sources: dict[str, Any] = {}
    for kind in files:
        sources[kind] = _LayerFile(kind, folder / FILES[kind], files[kind])
    sources.update(tiled_layers(folder, manifest.get("tiles", ()), manifest.get("crs", "")))
    facts: dict[str, Any] = {key: manifest[key] for key in _HEAD if key in manifest}
    facts.update(manifest.get("facts", {}))
    return Scene(
        manifest["name"],
        tuple(manifest["extent"]),
        crs=manifest.get("crs"),
        facts=facts,
        content_hash=lambda: _content_hash(folder, manifest),
        **sources,
    )


def save_scene(scene: Scene, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write a scene as a folder, whole or not at all.

    Coordinates of points are rounded to 1 mm. What the scene's `facts` say of ``source`` (text), ``licence`` (text),
    ``notes`` (list of texts) and ``derived`` (kind to text) goes to the head of the manifest, the rest under
    ``[facts]``.

    Raises
    ------
    OutputError
        The folder exists (without `overwrite`) or cannot be written.
    """
    with whole_folder(path, holds=SCENE_FILES, overwrite=overwrite) as folder:
        if scene.points is not None:
            from .geodata.las_files import write_points

            write_points(scene.points, folder / FILES["points"], crs=scene.crs)
        if scene.image is not None:
            from .geodata.raster_files import write_image

            write_image(scene.image, folder / FILES["image"], crs=scene.crs)
        if scene.dem is not None:
            from .geodata.raster_files import write_elevation

            write_elevation(scene.dem, folder / FILES["dem"], crs=scene.crs)
        if scene.reference is not None:
            write_reference(scene.reference, folder / FILES["reference"], scene.crs)
        if scene.area is not None:
            write_area(scene.area, folder / FILES["area"], scene.crs)
        write_manifest(folder, _manifest(scene, folder))


def read_manifest(path: str | os.PathLike[str]) -> tuple[Path, dict[str, Any]]:
    """Return the folder and the checked content of its ``scene.toml``."""
    given = copy_of(os.fspath(path)) if is_address(os.fspath(path)) else shipped_or_given(path)
    folder = given.parent if given.name == MANIFEST else given
    file = folder / MANIFEST
    if not folder.exists():
        raise InputError(
            f"{folder}: no such folder{nearest_hint(str(folder), shipped_names())}; make a scene with roofbench scenes "
            f"import or scenes make, or name one that comes with roofbench: {', '.join(shipped_names())}"
        )
    if not file.is_file():
        raise InputError(
            f"{folder} is not a scene: there is no {MANIFEST} in it; make one with roofbench scenes import"
        )
    try:
        manifest = tomllib.loads(file.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{file} is not valid TOML: {error}") from error
    problem = _manifest_problem(manifest)
    if problem:
        raise InputError(f"{file}: {problem}")
    try:
        require_metric(manifest.get("crs"), str(file), remedy="write the CRS that its files are in")
    except CRSError as error:
        sentence = str(error)
        raise CRSError(sentence if sentence.startswith(str(file)) else f"{file}: {sentence}") from error
    for kind in manifest.get("files", {}):
        fetch_into_copy(folder, FILES[kind])
        if not (folder / FILES[kind]).is_file():
            raise InputError(
                f"{folder / FILES[kind]}: no such file, though {MANIFEST} lists it; put it back or make the scene again"
            )
    return folder, manifest


def changed_files(path: str | os.PathLike[str], *, tiles: bool = True) -> list[str]:
    """Return the names of the files whose SHA-256 is not the one in the manifest; `tiles`: of tile files, too."""
    folder, manifest = read_manifest(path)
    files: dict[str, Mapping[str, Any]] = manifest.get("files", {})
    listed = {FILES[kind]: entry["sha256"] for kind, entry in files.items()}
    listed |= {entry["file"]: entry["sha256"] for entry in manifest.get("tiles", ()) if tiles}
    return [
        name for name, digest in listed.items() if not (folder / name).is_file() or checksum(folder / name) != digest
    ]


def update_checksums(path: str | os.PathLike[str]) -> list[str]:
    """Write the checksums of edited files into the manifest, and return the files that differed."""
    changed = changed_files(path)
    folder, manifest = read_manifest(path)
    for entry_kind, entry in manifest.get("files", {}).items():
        entry["sha256"] = checksum(folder / FILES[entry_kind])
    write_manifest(folder, manifest)
    return changed


def _manifest(scene: Scene, folder: Path) -> dict[str, Any]:
    facts = dict(scene.facts)
    manifest: dict[str, Any] = {"format": _FORMAT, "name": scene.name}
    if scene.crs is not None:
        manifest["crs"] = scene.crs
    manifest["units"] = "metre"
    manifest["extent"] = list(scene.extent)
    for key in _HEAD:
        if facts.get(key):
            manifest[key] = facts.pop(key)
        else:
            facts.pop(key, None)
    files = {}
    for kind, name in FILES.items():
        if (folder / name).exists():
            files[kind] = {"file": name, "sha256": checksum(folder / name), **_file_facts(kind, scene)}
    if files:
        manifest["files"] = files
    if facts:
        manifest["facts"] = facts
    plain: dict[str, Any] = _toml_content(manifest)
    return plain


def _file_facts(kind: str, scene: Scene) -> dict[str, Any]:
    if kind == "points" and scene.points is not None:
        return {"count": len(scene.points)}
    if kind == "image" and scene.image is not None:
        return {"bands": list(scene.image.bands), "gsd": scene.image.grid.gsd}
    if kind == "dem" and scene.dem is not None:
        return {"gsd": scene.dem.grid.gsd}
    if kind == "reference" and scene.reference is not None:
        return {"count": len(scene.reference)}
    return {}


def _manifest_problem(manifest: Mapping[str, Any]) -> str | None:
    """Return what is wrong with a manifest, in words, or None."""
    if manifest.get("format") != _FORMAT:
        return f"format {manifest.get('format')!r} is not {_FORMAT}, the one this version of roofbench reads"
    if not isinstance(manifest.get("name"), str) or not manifest["name"]:
        return "it needs a name"
    extent = manifest.get("extent")
    numbers = isinstance(extent, list) and len(extent) == 4 and all(type(value) in (int, float) for value in extent)
    if not numbers or not all(map(math.isfinite, extent)) or not (extent[2] > extent[0] and extent[3] > extent[1]):  # type: ignore[arg-type,index]
        return f"extent {extent} must be [xmin, ymin, xmax, ymax] in metres"
    if not isinstance(manifest.get("crs", ""), str):
        return f"crs {manifest['crs']!r} must be a text such as EPSG:25832"
    if manifest.get("units", "metre") != "metre":
        return f"units {manifest['units']!r} must be metre"
    files = manifest.get("files", {})
    if not isinstance(files, dict):
        return "[files] must be a table"
    problem = tile_problem(manifest.get("tiles", []))
    if problem is None and manifest.get("tiles") and not manifest.get("crs"):
        problem = "a scene of tiles needs its crs"
    if problem:
        return problem
    for kind, entry in files.items():
        if kind not in FILES:
            return f"[files.{kind}] is none of {', '.join(FILES)}"
        if not isinstance(entry, dict) or not isinstance(entry.get("sha256"), str):
            return f"[files.{kind}] needs its sha256"
        if entry.get("file", FILES[kind]) != FILES[kind]:
            return f"[files.{kind}] names {entry['file']!r}, but this file is always {FILES[kind]}"
    return None


@dataclass(frozen=True)
class _LayerFile:
    """One file of a scene folder, read when it is called or by window."""

    kind: str
    file: Path
    entry: Mapping[str, Any]

    def __call__(self) -> Any:
        return self._read(None)

    def window(self, extent: tuple[float, float, float, float]) -> Any:
        if self.kind == "area":
            return shapely.intersection(self._read(None), shapely.box(*extent))
        if self.kind == "reference":
            reference = self._read(None)
            return reference.take(shapely.intersects(reference.polygons, shapely.box(*extent)))
        return self._read(extent)

    def digest(self, extent: tuple[float, float, float, float]) -> str:
        return f"{self.kind} {self.entry['sha256']}"

    def meets(self, extent: tuple[float, float, float, float]) -> bool:
        return True

    def _read(self, extent: tuple[float, float, float, float] | None) -> Any:
        if self.kind == "points":
            from .geodata.las_files import read_points

            return read_points(self.file, window=extent)
        if self.kind in ("image", "dem") and extent is not None:
            from .geodata.raster_headers import read_raster_header

            if read_raster_header(self.file).grid.part(extent) is None:
                return None
        if self.kind == "image":
            from .geodata.raster_files import read_image

            return read_image(self.file, bands=self.entry.get("bands"), window=extent)
        if self.kind == "dem":
            from .geodata.raster_files import read_elevation

            return read_elevation(self.file, window=extent)
        from .geodata.vector_files import read_footprints

        found = read_footprints(self.file)
        return found if self.kind == "reference" else shapely.union_all(found.polygons)


def write_reference(reference: Footprints, file: Path, crs: str | None) -> None:
    """Write reference footprints as they lie in a scene folder."""
    from .geodata.vector_files import write_layers

    columns: dict[str, Any] = dict(reference.attributes)
    # Always there, so that a person who opens the file sees that parts can share one.
    columns["building_id"] = (
        np.arange(len(reference), dtype=np.int64) if reference.building_ids is None else reference.building_ids
    )
    write_layers({"reference": (reference.polygons, columns)}, file, crs=crs)


def write_area(area: shapely.Geometry, file: Path, crs: str | None) -> None:
    """Write an evaluation area as it lies in a scene folder."""
    from .geodata.vector_files import write_layers

    write_layers({"area": (np.array([area], dtype=object), {"id": np.array([0])})}, file, crs=crs)


def write_manifest(folder: Path, manifest: Mapping[str, Any]) -> None:
    """Write the manifest of a scene folder."""
    import tomli_w

    from ..core.output import whole_file

    with whole_file(folder / MANIFEST, overwrite=True) as scratch:
        scratch.write_text(tomli_w.dumps(manifest), encoding="utf-8")


def _toml_content(value: Any) -> Any:
    """Return what TOML can hold: numpy scalars as numbers, tuples as lists; None and NaN are left out."""
    if isinstance(value, Mapping):
        return {str(key): item for key, given in value.items() if (item := _toml_content(given)) is not None}
    if isinstance(value, list | tuple | np.ndarray):
        return [item for given in value if (item := _toml_content(given)) is not None]
    return plain_value(value)


def listed_hash(path: str | os.PathLike[str]) -> str:
    """Return the content hash of a scene without reading its tile files, which are checked when a window meets them."""
    folder, manifest = read_manifest(path)
    return _content_hash(folder, manifest, tiles=False)


def _content_hash(folder: Path, manifest: Mapping[str, Any], *, tiles: bool = True) -> str:
    """Return the digest of the manifest's digests, after checking that the files are still those."""
    changed = changed_files(folder, tiles=tiles)
    if changed:
        raise InputError(
            f"{folder}: {', '.join(changed)} changed since {MANIFEST} was written: if that is intended, run "
            "'roofbench scenes check --update-checksums'"
        )
    digest = hashlib.sha256(repr((manifest["extent"], manifest.get("crs"))).encode())
    for kind in FILES:
        if kind in manifest.get("files", {}):
            digest.update(f"{kind} {manifest['files'][kind]['sha256']}\n".encode())
    for entry in manifest.get("tiles", ()):
        digest.update(f"{entry['layer']} {entry['file']} {entry['sha256']}\n".encode())
    return digest.hexdigest()
