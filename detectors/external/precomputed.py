"""Footprints made elsewhere: one file for each scene, found by the name of the scene.

A detector sees a scene under a neutral name, so the runner, which knows the real one, asks this class for the file.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...core.errors import InputError, ParameterError, UnsupportedError
from ...core.parameters import parameter
from ...core.registry import nearest_hint
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.vector_files import DRIVERS
from ...scenes.scene import Scene
from ..base import Detector
from .external_paths import content_digest
from .program_output import read_output

__all__ = ["Precomputed", "file_stem", "unknown_files", "vector_files"]


@dataclass(frozen=True, kw_only=True)
class Precomputed(Detector):
    """Footprints made elsewhere: a folder with one vector file for each scene, named as the scene."""

    name = "precomputed"
    requires = ()

    folder: str = parameter("", doc="folder with one vector file for each scene: knox-small-1.gpkg")
    label: str = parameter("", doc="name in tables; the name of the folder where it is not given")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.folder:
            raise ParameterError("precomputed: folder must name the folder with one vector file for each scene")
        object.__setattr__(self, "folder", os.path.abspath(self.folder))
        if not Path(self.folder).is_dir():
            raise ParameterError(
                f"precomputed: {self.folder} is not a folder: name one with a vector file for each scene"
            )

    def own_label(self) -> str:
        """Return the name in tables."""
        return self.label or Path(self.folder).name

    def fingerprint(self) -> str:
        """Return a digest of all files of the folder."""
        return content_digest([Path(self.folder)])

    def fingerprint_on(self, scene: str) -> str:
        """Return a digest of the file of a scene; empty where there is none."""
        try:
            return content_digest([self.file_of(scene)])
        except InputError:
            return ""

    def file_of(self, scene: str) -> Path:
        """Return the file of a scene, by its real name.

        Raises
        ------
        InputError
            There is none, or there are several.
        """
        stem = file_stem(scene)
        found = [file for file in vector_files(Path(self.folder)) if file.stem == stem]
        if len(found) == 1:
            return found[0]
        if found:
            names = " and ".join(file.name for file in found)
            raise InputError(f"{self.folder} holds {names} for the scene {scene!r}: keep one of them")
        others = [file.name for file in sorted(Path(self.folder).iterdir()) if file.stem == stem]
        known = f"; {others[0]} is not a vector file that roofbench reads" if others else ""
        raise InputError(f"{self.folder} has no footprints of the scene {scene!r}: add {stem}.gpkg or .geojson{known}")

    def footprints_of(self, scene: str, crs: str | None) -> Footprints:
        """Return the footprints of a scene, by its real name and its CRS."""
        return read_output(self.file_of(scene), crs=crs)

    def detect(self, scene: Scene, rng: np.random.Generator) -> Footprints:
        """Raise `UnsupportedError`: only the runner knows the real name of a scene."""
        raise UnsupportedError("precomputed footprints are found by the name of a scene: use roofbench.detect or run")


def file_stem(scene: str) -> str:
    """Return the name of a scene as a file or folder is called; a generated scene writes 40 as 40.0.

    >>> file_stem("knox-small-3[tree_density=40.0,scene.slope=5]")
    'knox-small-3_tree_density=40,scene.slope=5'
    """
    short = re.sub(r"(=-?\d+)\.0(?=[],])", r"\1", scene)
    return re.sub(r"[^\w.,=+-]+", "_", short).strip("_")


def vector_files(folder: Path) -> list[Path]:
    """Return the vector files of a folder, by name."""
    return sorted(file for file in folder.iterdir() if file.suffix.lower() in DRIVERS and file.is_file())


def unknown_files(folder: Path, scenes: Iterable[str]) -> list[tuple[Path, str]]:
    """Return the vector files of a folder that belong to none of the scenes, each with a hint at the nearest name."""
    stems = {file_stem(scene) for scene in scenes}
    unknown = [file for file in vector_files(folder) if file.stem not in stems]
    return [(file, nearest_hint(file.stem, stems)) for file in unknown]
