"""Fetching of open data: recipes that name the files of a place, and the record of what was downloaded.

A *recipe* is a TOML file with title, licence, attribution, CRS and ``[[files]]``, each with its ``kind`` (``points``,
``reference``, ``ortho``, ``dem``), ``url`` and ``name``. ``{xmin}``, ``{ymin}``, ``{xmax}``, ``{ymax}`` in them are the
extent, other names in braces the ``[values]`` that the recipe asks for. ``listed`` names the property of a GeoJSON list
whose values are the addresses of the files themselves; ``most`` is the number of features at which a server stops.
Archives (``.zip``) are unpacked.

The *record* (``fetched.toml`` in the folder of the files) has address, SHA-256 and size of each download. A file that
is there is not downloaded again: it must have the recorded checksum, as must one that is downloaded anew.
"""

from __future__ import annotations

import json
import re
import tomllib
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import IO, Any, Literal, TypeAlias, cast, get_args

from ..core.errors import InputError, ParameterError, UnknownNameError
from ..core.output import whole_file
from ..core.registry import nearest_hint
from .download import download, file_checksum

__all__ = ["RECORD", "OpenData", "fetch", "open_data", "open_data_names"]

RECORD = "fetched.toml"
_FOLDER = Path(__file__).resolve().parent / "open_data"
_SAFE = re.compile(r"[\w.+-]+")
_FIELD = re.compile(r"\{(\w+)\}")
_EXTENT = ("xmin", "ymin", "xmax", "ymax")
_Kind: TypeAlias = Literal["points", "reference", "ortho", "dem"]


@dataclass(frozen=True, kw_only=True)
class _File:
    kind: _Kind
    url: str
    name: str
    listed: str = ""
    most: int = 0

    @property
    def fields(self) -> set[str]:
        return set(_FIELD.findall(self.url + self.name))


@dataclass(frozen=True, kw_only=True)
class OpenData:
    """A recipe: which files of which publisher make a scene.

    Attributes
    ----------
    name, title, licence, attribution, crs : str
    pages : tuple of str
        Where the publisher describes the data.
    building_id : str
        Column of the reference.
    tried : str
        Against which server the recipe was tried.
    values : mapping of str to str
        What has to be given, with its meaning; ``extent`` is asked for separately.
    files : tuple
    """

    name: str
    title: str
    licence: str
    attribution: str
    crs: str
    pages: tuple[str, ...]
    building_id: str
    tried: str
    values: Mapping[str, str]
    files: tuple[_File, ...]

    @property
    def needs_extent(self) -> bool:
        """Whether an extent has to be given."""
        return any(file.fields & set(_EXTENT) for file in self.files)


def open_data_names() -> list[str]:
    """Return the names of the recipes that come with roofbench."""
    return sorted(file.stem for file in _FOLDER.glob("*.toml"))


def open_data(name: str) -> OpenData:
    """Return a recipe by its name, or from a TOML file.

    Raises
    ------
    UnknownNameError, InputError
        No such recipe; a file that is none.
    """
    path = Path(name) if name.endswith(".toml") else _FOLDER / f"{name}.toml"
    if not path.is_file():
        raise UnknownNameError(
            f"no recipe called {name!r}{nearest_hint(name, open_data_names())}; there are "
            f"{', '.join(open_data_names())}"
        )
    try:
        content = tomllib.loads(path.read_text("utf-8"))
        content["files"] = tuple(_File(**file) for file in content["files"])
        content["pages"] = tuple(content.get("pages", ()))
        found = OpenData(**{"name": path.stem, "building_id": "", "values": {}, "tried": "not known", **content})
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, KeyError, TypeError) as error:
        raise InputError(f"{path} is not a recipe: {error}") from error
    for file in found.files:
        unknown = file.fields - {*_EXTENT, *found.values}
        if unknown or file.kind not in get_args(_Kind):
            raise InputError(f"{path}: {', '.join(unknown) or file.kind} is neither explained in [values] nor a kind")
    return found


def fetch(
    recipe: OpenData,
    folder: Path,
    *,
    values: Mapping[str, str] | None = None,
    extent: tuple[float, float, float, float] | None = None,
    note: Callable[[str], None] = lambda _: None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, list[Path]]:
    """Download the files of a recipe into a folder, and return them by kind.

    Parameters
    ----------
    recipe : OpenData
    folder : Path
        Made where it is absent; files in it that were downloaded before are checked and kept.
    values : mapping of str to str, optional
        What the recipe asks for.
    extent : tuple of float, optional
        ``(xmin, ymin, xmax, ymax)`` in the CRS of the recipe, metres.
    note : callable, optional
        Called with a sentence for each file.
    progress : callable, optional
        Called with (bytes received, bytes in all).

    Raises
    ------
    ParameterError, InputError, OutputError
        A value is missing; a download failed; a checksum is not the recorded one.
    """
    filled = _filled_values(recipe, dict(values or {}), extent)
    folder.mkdir(parents=True, exist_ok=True)
    found: dict[str, list[Path]] = {}
    for file in recipe.files:
        url, name = (_FIELD.sub(lambda match: filled[match[1]], text) for text in (file.url, file.name))
        path = _fetched(url, folder / _safe(name), note, progress)
        paths = [path]
        if file.listed:
            paths = [
                _fetched(address, folder / _safe(PurePosixPath(address).name), note, progress)
                for address in _listed(path, file.listed)
            ]
        elif file.most and len(_features(path)) >= file.most:
            raise InputError(f"{path}: the server stops at {file.most} features: choose a smaller extent=")
        found.setdefault(file.kind, []).extend(member for each in paths for member in _unpacked(each, note))
    return found


def _filled_values(
    recipe: OpenData, values: dict[str, str], extent: tuple[float, float, float, float] | None
) -> dict[str, str]:
    for name in values:
        if name not in recipe.values:
            raise ParameterError(f"{recipe.name} has no value {name!r}{nearest_hint(name, list(recipe.values))}")
    for name, meaning in recipe.values.items():
        if not _SAFE.fullmatch(values.get(name, "")):
            raise ParameterError(f"{recipe.name} needs the parameter {name}: {meaning}")
    if not recipe.needs_extent:
        return values
    if extent is None or not (extent[2] > extent[0] and extent[3] > extent[1]):
        raise ParameterError(f"{recipe.name} needs extent= as xmin ymin xmax ymax in {recipe.crs}, metres")
    return {**values, **{name: f"{value:.10g}" for name, value in zip(_EXTENT, extent, strict=True)}}


def _safe(name: str) -> str:
    if not _SAFE.fullmatch(name) or name.startswith("."):
        raise InputError(f"{name!r} is not the name of a file")
    return name


def _fetched(url: str, path: Path, note: Callable[[str], None], progress: Callable[[int, int], None] | None) -> Path:
    """Return the file, downloaded where it is absent, with the checksum that was recorded at the first download."""
    record = _read_record(path.parent)
    known = record.get(path.name)
    present = path.is_file() and known is not None
    checksum = file_checksum(path) if present else download(url, path, progress=progress)
    if known is not None and known["sha256"] != checksum:
        what = "changed since it was downloaded" if present else f"is not the file that {url} had before"
        raise InputError(
            f"{path} {what}: its SHA-256 is not the one in {RECORD}; remove it there to accept the new one"
        )
    if known is None:
        record[path.name] = {"url": url, "sha256": checksum, "bytes": path.stat().st_size}
        _write_record(path.parent, record)
    note(f"{path}: {'there already, checksum as recorded' if present else f'downloaded from {url}'}")
    return path


def _read_record(folder: Path) -> dict[str, dict[str, Any]]:
    path = folder / RECORD
    if not path.exists():
        return {}
    try:
        return cast("dict[str, dict[str, Any]]", tomllib.loads(path.read_text("utf-8"))["files"])
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, KeyError) as error:
        raise InputError(f"{path} cannot be read as the record of downloads: {error}") from error


def _write_record(folder: Path, record: Mapping[str, Mapping[str, Any]]) -> None:
    import tomli_w

    with whole_file(folder / RECORD, overwrite=True) as scratch:
        scratch.write_text(tomli_w.dumps({"files": record}), encoding="utf-8")


def _features(path: Path) -> list[dict[str, Any]]:
    try:
        return list(json.loads(path.read_text("utf-8"))["features"])
    except (UnicodeDecodeError, json.JSONDecodeError, KeyError, TypeError) as error:
        raise InputError(f"{path} is not the GeoJSON that was asked for: {error}") from error


def _listed(path: Path, name: str) -> list[str]:
    addresses = [str(feature.get("properties", {}).get(name, "")) for feature in _features(path)]
    if not addresses:
        raise InputError(f"{path} lists no files: the extent lies outside the published tiles")
    return addresses


def _copy(packed: IO[bytes], target: Path) -> None:
    with target.open("wb") as file:
        while chunk := packed.read(1 << 20):
            file.write(chunk)


def _unpacked(path: Path, note: Callable[[str], None]) -> list[Path]:
    """Return the file, or the members of an archive, written beside it."""
    if path.suffix.lower() != ".zip":
        return [path]
    members = []
    try:
        with zipfile.ZipFile(path) as archive:
            for info in archive.infolist():
                name = PurePosixPath(info.filename).name
                if info.is_dir() or PurePosixPath(name).suffix.lower() not in (".las", ".laz", ".gpkg", ".tif"):
                    continue
                target = path.parent / _safe(name)
                if not target.exists() or target.stat().st_size != info.file_size:
                    with archive.open(info) as packed, whole_file(target, overwrite=True) as scratch:
                        _copy(packed, scratch)
                    note(f"{target}: unpacked")
                members.append(target)
    except zipfile.BadZipFile as error:
        raise InputError(f"{path} is not an archive: {error}") from error
    if not members:
        raise InputError(f"{path} holds no points, vectors or rasters")
    return members
