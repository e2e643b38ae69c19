"""Contributions: footprints that somebody made elsewhere on the scenes of a suite.

A *blind scene* is a scene folder without reference, area, classification and facts. A *contribution* is a folder with
one vector file for each scene, named as the folder of the blind scene.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from ..core.errors import OutputError, RoofbenchError
from ..core.output import check_folder
from ..detectors.checks import checked_output
from ..detectors.external.precomputed import Precomputed, file_stem, unknown_files
from ..scenes.folder import SCENE_FILES, save_scene
from ..scenes.scene import Scene
from .analysis.report_contents import newest_runs
from .store.records import RunRow
from .store.writer import Store
from .suite import DetectorEntry, Suite

__all__ = ["blind_scenes", "contribution_problems", "contribution_suite", "runs_beside"]


def blind_scenes(suite: Suite, folder: Path, *, overwrite: bool = False) -> Iterator[tuple[Path, Scene]]:
    """Write the scenes of a suite without their ground truth, and yield each folder with its scene.

    Raises
    ------
    OutputError
        A folder exists (without `overwrite`) or cannot be written; nothing is written then.
    """
    targets = {folder / file_stem(scene.name): scene for scene in suite.scenes}
    if len(targets) < len(suite.scenes):
        raise OutputError(f"the scenes of {suite.name!r} need different folders, but their names are too similar")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder} cannot be made: {error.strerror}; name another folder") from error
    for target in targets:
        check_folder(target, overwrite, holds=SCENE_FILES)
    for target, scene in targets.items():
        opened = scene if isinstance(scene, Scene) else scene.open()
        seen = opened.for_detection()
        seen.name = target.name
        save_scene(seen, target, overwrite=overwrite)
        yield target, seen


def contribution_suite(suite: Suite, folder: Path, *, label: str = "") -> Suite:
    """Return the suite with the footprints of a folder as its only detector."""
    return replace(suite, detectors=(DetectorEntry(Precomputed(folder=str(folder), label=label)),))


def runs_beside(store: Store, contributed: Sequence[RunRow]) -> list[RunRow]:
    """Return the newest stored runs of other detectors on the scenes of a contribution."""
    scenes, labels = {row.scene_key for row in contributed}, {row.label for row in contributed}
    return [row for row in newest_runs(store) if row.scene_key in scenes and row.label not in labels]


def contribution_problems(suite: Suite, folder: Path, whole: Suite | None = None) -> Iterator[tuple[str, str]]:
    """Yield the name of each scene with what is wrong with its file (empty: nothing), then of each unknown file.

    Files of further scenes of the `whole` suite are known, too.
    """
    detector = Precomputed(folder=str(folder))
    for scene in suite.scenes:
        try:
            # Opened for its CRS and extent; its measurements are neither read nor generated.
            place = scene if isinstance(scene, Scene) else scene.open()
            found = detector.footprints_of(scene.name, place.crs)
            checked_output(found, place, detector.file_of(scene.name).name)
        except RoofbenchError as error:
            yield scene.name, str(error)
        else:
            yield scene.name, ""
    for file, hint in unknown_files(folder, [scene.name for scene in (whole or suite).scenes]):
        yield file.name, f"belongs to no scene of {suite.name!r}{hint}"
