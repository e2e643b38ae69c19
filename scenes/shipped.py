"""Shipped scenes: the small real scenes inside the package, which are opened by their name.

``delft`` is a block of the old town of Delft (AHN3 points, footprints of the register, no image), ``ign`` a few houses
of a French village (LiDAR HD points, their colours as image). Source and licence are in the ``scene.toml`` and the
``LICENCE.txt`` of each; ``tests/performance/make_real_scenes.py`` makes them from the published files.

A name means the shipped scene, unless the working directory has a scene folder of this name.
"""

from __future__ import annotations

import os
from pathlib import Path

__all__ = ["shipped_folder", "shipped_names", "shipped_or_given"]

_DATA = Path(__file__).resolve().parent / "data"
_MANIFEST = "scene.toml"


def shipped_names() -> list[str]:
    """Return the names of the shipped scenes."""
    return sorted(file.parent.name for file in _DATA.glob(f"*/{_MANIFEST}"))


def shipped_folder(name: str) -> Path | None:
    """Return the folder of a shipped scene; None where `name` is none."""
    return _DATA / name if name in shipped_names() else None


def shipped_or_given(path: str | os.PathLike[str]) -> Path:
    """Return the folder of the shipped scene that `path` names, or `path` itself.

    A scene folder of that name in the working directory comes first.
    """
    name = os.fspath(path)
    if (Path(name) / _MANIFEST).is_file():
        return Path(name)
    return shipped_folder(name) or Path(name)
