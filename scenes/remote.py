"""Scenes on a server or in object storage: each machine keeps copies of the files that its windows meet.

Nouns
-----
address
    Of a scene folder: ``https://host/town``, ``s3://bucket/town``, or any other that fsspec opens.
copy
    Folder on this machine with the manifest, and with the files that were asked for so far; ``ROOFBENCH_SCENES`` names
    where copies lie, by default the user's cache. It can be removed at any time.

A task carries the address, so that every worker reads for itself. Files are checked by the checksum in the manifest.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from urllib.parse import quote

from ..core.errors import InputError, UnsupportedError
from ..core.output import whole_file
from .download import download

__all__ = ["copy_of", "fetch_into_copy", "is_address"]

#: File of a copy that names where it is from.
_ADDRESS = ".address"


def is_address(text: str) -> bool:
    """Return whether a text is the address of a scene and not a path."""
    return "://" in text


@lru_cache(maxsize=64)
def copy_of(address: str) -> Path:
    """Return the copy of a scene; its manifest is fetched once in each process."""
    address = address.rstrip("/")
    folder = _copies() / hashlib.sha256(address.encode()).hexdigest()[:16]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / _ADDRESS).write_text(address, "utf-8")
    _fetch(address, "scene.toml", folder)
    # Not every scene has one, and without it all points of a file are read.
    with suppress(InputError):
        _fetch(address, "chunks.npz", folder)
    return folder


def fetch_into_copy(folder: Path, name: str) -> None:
    """Fetch a file that a copy does not hold yet; nothing is done for folders that are no copies."""
    address = folder / _ADDRESS
    if not (folder / name).exists() and address.is_file():
        _fetch(address.read_text("utf-8"), name, folder)


def _copies() -> Path:
    chosen = os.environ.get("ROOFBENCH_SCENES")
    cache = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or os.path.expanduser("~/.cache")
    return Path(chosen) if chosen else Path(cache) / "roofbench" / "scenes"


def _fetch(address: str, name: str, folder: Path) -> None:
    target = folder / name
    target.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(target, overwrite=True) as scratch:
        if address.startswith(("http://", "https://")):
            download(f"{address}/{quote(name)}", scratch)
        else:
            _copy(f"{address}/{name}", scratch)


def _copy(url: str, target: Path) -> None:
    try:
        import fsspec  # type: ignore[import-untyped]
    except ImportError as error:
        raise UnsupportedError(f"{url} needs fsspec and what it asks for: pip install fsspec") from error
    try:
        with fsspec.open(url, "rb") as source, target.open("wb") as copy:
            shutil.copyfileobj(source, copy, 1 << 20)
    except ImportError as error:
        raise UnsupportedError(f"{url} cannot be opened: {error}") from error
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{url} cannot be read: {' '.join(str(error).split())}") from error
