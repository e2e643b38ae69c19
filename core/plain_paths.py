"""Plain paths: names of files that GDAL's Python wrappers pass on as they are.

They read ``!`` as a member of an archive, split at ``;``, drop line ends and blanks at the beginning, take ``a:b`` for
a scheme, and cannot encode names that are not UTF-8. Such a file is opened and written through a temporary link.
"""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import InputError

__all__ = ["plain_path", "plain_target"]

#: What a wrapper would change or could not encode.
_SPECIAL = re.compile("[!;?#\x00-\x1f\x7f\ud800-\udfff]|^[ ]|^//|^[A-Za-z][A-Za-z0-9+.-]*:")


@contextmanager
def plain_path(file: Path) -> Iterator[Path]:
    """Yield a path of an existing file that GDAL opens as it is; side files (.shx, .dbf, .tfw) come along."""
    if not _SPECIAL.search(str(file)):
        yield file
        return
    with tempfile.TemporaryDirectory(prefix="roofbench-") as folder:
        place = Path(folder, "in")
        if _SPECIAL.search(file.name):
            place.mkdir()
            name = "input" + _plain(file.suffix)
            for item in file.parent.iterdir():
                if item.name.startswith(f"{file.stem}."):
                    _link(place / ("input" + _plain(item.name[len(file.stem) :])), item)
        else:
            name = file.name
            _link(place, file.parent)
        yield place / name


@contextmanager
def plain_target(file: Path) -> Iterator[Path]:
    """Yield a path that GDAL writes as it is; what was written is moved beside `file`, under its name."""
    if not _SPECIAL.search(str(file)):
        yield file
        return
    with tempfile.TemporaryDirectory(prefix="roofbench-") as folder:
        place = Path(folder, "out")
        _link(place, file.parent)
        stem = "output" if _SPECIAL.search(file.name) else file.stem
        yield place / (stem + _plain(file.suffix))
        for item in file.parent.iterdir():
            if stem != file.stem and item.name.startswith(f"{stem}."):
                item.replace(file.parent / (file.stem + item.name[len(stem) :]))


def _plain(suffix: str) -> str:
    return _SPECIAL.sub("_", suffix)


def _link(link: Path, target: Path) -> None:
    try:
        link.symlink_to(os.path.abspath(target))
    except OSError as error:
        raise InputError(f"{target} cannot be opened under this name: rename it without ! ; ? # and :") from error
