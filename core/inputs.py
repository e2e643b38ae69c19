"""Input files: one sentence for a path that names no regular file."""

from __future__ import annotations

import stat
from pathlib import Path

from .errors import InputError

__all__ = ["require_file"]


def require_file(path: Path, wanted: str) -> None:
    """Raise `InputError` unless a path names a file that can be read from its beginning; links are followed.

    Parameters
    ----------
    path : Path
    wanted : str
        What to name instead of a folder, a pipe or a device, for the message.
    """
    try:
        kind = path.stat().st_mode
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from error
    if stat.S_ISDIR(kind):
        raise InputError(f"{path} is a folder: name {wanted}")
    if not stat.S_ISREG(kind):
        raise InputError(f"{path} is a pipe or a device: name {wanted}")
