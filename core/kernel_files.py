"""Files of compiled kernels: one file an entry, named by its key, safe to share between processes.

A file holds the SHA-256 of its content and then the content. It appears whole or not at all; a damaged file is removed
and counts as absent. Reading an entry renews its date, so that cleaning removes what was not used for a month and, when
the folder is still too large, what was not used for longest.

Processes that need the same entry at the same time compile it once: the first one reserves it, the others wait for it.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import tempfile
import time
import zlib
from pathlib import Path
from typing import IO, Any

fcntl: Any
try:
    import fcntl
except ImportError:  # Windows: each process compiles for itself
    fcntl = None

__all__ = ["clean", "default_folder", "load", "names", "remove", "reserve", "save"]

_SUFFIX = ".kernel"
_CHECKSUM = 32  # bytes of a SHA-256
_DAY = 86_400.0
#: Entries that were not used for this time are removed, s.
_OLDEST = 30 * _DAY
#: Size that a cleaned folder does not exceed, bytes. The kernels of `mpp` and the line detectors take 16 MB.
_LARGEST = 512_000_000
#: Longest wait for the process that compiles an entry, s; one that was suspended may never finish.
_PATIENCE = 120.0
_PAUSE = 0.02  # s between two attempts
_RESERVED = "reserved.lock"


def default_folder() -> Path:
    """Return the folder in the user's cache.

    Beside the modules the files would outlive an uninstall, and what is left of the folder then hides the package when
    it is installed in editable mode.
    """
    cache = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA") or os.path.expanduser("~/.cache")
    return Path(cache) / "roofbench" / "kernels"


def names(folder: Path) -> list[str]:
    """Return the names of the entries, the oldest first."""
    found = []
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for item in entries:
            if item.name.endswith(_SUFFIX):
                with contextlib.suppress(OSError):  # another process may clean at the same time
                    found.append((item.stat().st_mtime_ns, item.name.removesuffix(_SUFFIX)))
    return [name for _, name in sorted(found)]


def load(folder: Path, name: str) -> bytes | None:
    """Return the content of an entry, None when it is absent, unreadable or damaged."""
    path = folder / (name + _SUFFIX)
    try:
        data = path.read_bytes()
    except OSError:
        return None
    if hashlib.sha256(data[_CHECKSUM:]).digest() != data[:_CHECKSUM]:
        remove(folder, name)
        return None
    with contextlib.suppress(OSError):  # a read-only cache still works
        if time.time() - path.stat().st_mtime > _DAY:
            os.utime(path)
    return data[_CHECKSUM:]


def reserve(folder: Path, name: str, *, patience: float = _PATIENCE) -> IO[bytes] | None:
    """Wait until no other process compiles an entry, and reserve it for this process.

    Parameters
    ----------
    folder : Path
    name : str
    patience : float
        Longest wait, s.

    Returns
    -------
    file or None
        Closing it, or the end of the process, ends the reservation. A process holds one at a time. None where the
        folder, the file system or the platform has no locks, and after the longest wait.
    """
    if fcntl is None:
        return None
    deadline = time.monotonic() + patience
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / _RESERVED).open("ab")
    except OSError:
        return None
    while True:
        try:
            # One byte of one file stands for each entry, so that no file is left behind.
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, zlib.crc32(name.encode()) >> 1)
        except (BlockingIOError, PermissionError):
            if time.monotonic() < deadline:
                time.sleep(_PAUSE)
                continue
        except OSError:
            pass
        else:
            return file
        file.close()
        return None


def save(folder: Path, name: str, content: bytes) -> None:
    """Write an entry.

    Raises
    ------
    OSError
        The folder cannot be made or written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(prefix="unfinished-", dir=folder)
    try:
        with open(handle, "wb") as file:
            file.write(hashlib.sha256(content).digest() + content)
        os.replace(temporary, folder / (name + _SUFFIX))
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise


def remove(folder: Path, name: str) -> None:
    """Remove an entry if it is there and can be removed."""
    with contextlib.suppress(OSError):
        (folder / (name + _SUFFIX)).unlink()


def clean(folder: Path, *, oldest: float = _OLDEST, largest: int = _LARGEST) -> None:
    """Remove what is no longer needed: old entries, the least used of too many, and the layout of version 0.1.

    Parameters
    ----------
    folder : Path
    oldest : float
        Time after the last use at which an entry is removed, s.
    largest : int
        Size of all entries together, bytes.
    """
    now = time.time()
    entries = []
    with contextlib.suppress(OSError), os.scandir(folder) as found:
        for item in found:
            with contextlib.suppress(OSError):  # another process may clean at the same time
                status = item.stat()
                if item.name.endswith(_SUFFIX):
                    entries.append((status.st_mtime, status.st_size, item.path))
                elif item.name.startswith("unfinished-") and now - status.st_mtime > _DAY:
                    os.unlink(item.path)
    size = 0
    for used, length, path in sorted(entries, reverse=True):
        size += length
        if now - used > oldest or size > largest:
            with contextlib.suppress(OSError):
                os.unlink(path)
    if folder == default_folder():
        shutil.rmtree(folder.parent / "numba", ignore_errors=True)
