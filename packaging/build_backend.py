"""The build backend: setuptools, which leaves nothing in the source folder.

The root of the repository is the package itself, so the ``build/`` and ``*.egg-info`` folders that setuptools writes
would lie inside the package. They are removed after each build, and before it, because files of an earlier build in
``build/`` would enter the wheel.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from setuptools import build_meta

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
]

get_requires_for_build_editable = build_meta.get_requires_for_build_editable
get_requires_for_build_sdist = build_meta.get_requires_for_build_sdist
get_requires_for_build_wheel = build_meta.get_requires_for_build_wheel

_LEFT = ("build", "roofbench.egg-info")


def _remove() -> None:
    for name in _LEFT:
        shutil.rmtree(Path(name), ignore_errors=True)


@contextmanager
def _clean() -> Iterator[None]:
    _remove()
    try:
        yield
    finally:
        _remove()


def build_wheel(
    wheel_directory: str, config_settings: dict[str, Any] | None = None, metadata_directory: str | None = None
) -> str:
    """Build a wheel; return its file name."""
    with _clean():
        return build_meta.build_wheel(wheel_directory, config_settings, metadata_directory)


def build_editable(
    wheel_directory: str, config_settings: dict[str, Any] | None = None, metadata_directory: str | None = None
) -> str:
    """Build the wheel of an editable installation; return its file name."""
    with _clean():
        return build_meta.build_editable(wheel_directory, config_settings, metadata_directory)


def build_sdist(sdist_directory: str, config_settings: dict[str, Any] | None = None) -> str:
    """Build a source archive; return its file name."""
    with _clean():
        return build_meta.build_sdist(sdist_directory, config_settings)
