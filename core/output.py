"""Output files appear whole or not at all.

`whole_file` and `whole_folder` yield a temporary path beside the target and move it into place only when the block
ends without an error, so an interrupted command leaves what was there before.
"""

from __future__ import annotations

import errno
import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from fnmatch import fnmatch
from pathlib import Path

from .errors import OutputError

__all__ = ["check_folder", "check_target", "is_scratch", "make_folder_for", "whole_file", "whole_folder"]

#: Errors of a file system that has no room: they name no file.
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
#: Names of temporary folders, which `tempfile.mkdtemp` ends with eight random characters.
_SCRATCH = re.compile(r"\..+\.[a-z0-9_]{8}")


def check_target(path: Path, overwrite: bool) -> None:
    """Raise `OutputError` when a file or folder cannot be written; call it before long work."""
    if path.exists() and not overwrite:
        raise OutputError(f"{path} exists already: set overwrite=True or name another file")
    if not path.parent.is_dir():
        raise OutputError(f"{path} cannot be written: there is no folder {path.parent}")
    if not os.access(path.parent, os.W_OK):
        raise OutputError(f"{path} cannot be written: no permission to write in {path.parent}")


def check_folder(path: Path, overwrite: bool, *, holds: Sequence[str]) -> None:
    """Raise `OutputError` when a folder cannot be written, or when replacing it would delete files of others.

    Parameters
    ----------
    path : Path
    overwrite : bool
        Whether an existing folder may be replaced.
    holds : sequence of str
        Patterns of the names that such a folder holds; only a folder without any other name is replaced.
    """
    check_target(path, overwrite)
    if not path.exists():
        return
    if not path.is_dir():
        raise OutputError(f"{path} is a file: name a folder")
    other = sorted(
        item.name for item in path.iterdir() if item.is_dir() or not any(fnmatch(item.name, name) for name in holds)
    )
    if other:
        more = f" and {len(other) - 1} more" if len(other) > 1 else ""
        raise OutputError(
            f"{path} holds {other[0]}{more}, which replacing it would delete: name another folder, or move that away"
        )


def make_folder_for(names: Sequence[str], folder: Path, *, overwrite: bool) -> None:
    """Make a folder for files of these names before the long work, or raise `OutputError`."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = "it is a file" if folder.is_file() else error.strerror
        raise OutputError(f"{folder} cannot be made: {reason}; set another folder by output=") from error
    for name in names:
        check_target(folder / name, overwrite)


@contextmanager
def whole_file(path: str | os.PathLike[str], *, overwrite: bool = False, scratch: Path | None = None) -> Iterator[Path]:
    """Yield a temporary path with the same name; on success it (and its side files) replace `path`.

    Side files are files that a driver writes beside the requested one: ``.dbf``, ``.shx``, ``.aux.xml``.

    Parameters
    ----------
    path : str or path
    overwrite : bool
    scratch : Path, optional
        Folder of the same file system in which the temporary path is made; by default that of `path`. A process that
        is killed leaves the temporary path behind, so work that is resumed keeps it in its work folder.
    """
    target = Path(path)
    check_target(target, overwrite)
    if target.exists() and not target.is_file():
        raise OutputError(f"{target} is {'a folder' if target.is_dir() else 'a device'}: name a file")
    with _scratch(target, scratch) as folder:
        yield folder / target.name
        written = sorted(folder.iterdir(), key=lambda item: item.name == target.name)
        if not written:
            raise OutputError(f"{target} was not written")
        for item in written:
            item.replace(target.parent / item.name)


@contextmanager
def whole_folder(path: str | os.PathLike[str], *, holds: Sequence[str], overwrite: bool = False) -> Iterator[Path]:
    """Yield a temporary folder; on success it replaces `path`, which may contain only names that match `holds`."""
    target = Path(path)
    check_folder(target, overwrite, holds=holds)
    with _scratch(target) as scratch:
        new = scratch / "new"
        new.mkdir()
        yield new
        if target.exists():
            target.replace(scratch / "old")
        new.replace(target)


@contextmanager
def _scratch(target: Path, place: Path | None = None) -> Iterator[Path]:
    try:
        folder = Path(tempfile.mkdtemp(prefix=f".{target.name[:40]}.", dir=place or target.parent))
    except OSError as error:
        raise OutputError(f"{target} cannot be written: {error.strerror}") from error
    folder.chmod(0o755)  # mkdtemp makes it private; results are for the group too
    try:
        yield folder
    except OSError as error:
        if isinstance(error, OutputError) or (error.filename is None and error.errno not in _NO_ROOM):
            raise
        raise OutputError(f"{target} cannot be written: {error.strerror}") from error
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def is_scratch(path: Path) -> bool:
    """Return whether a path is the temporary folder of an output: one being written, or left by a killed process.

    >>> is_scratch(Path("houses.gpkg"))
    False
    """
    return path.is_dir() and not path.is_symlink() and _SCRATCH.fullmatch(path.name) is not None
