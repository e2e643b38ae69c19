"""The code of a baseline, made available again beside the running code.

Roofbench of the baseline comes from its commit, plugins and programs from the copies that the baseline keeps. Whether a
restored program is the old one is checked by its fingerprint.
"""

from __future__ import annotations

import subprocess
import tarfile
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from ...core.errors import RoofbenchError, UnsupportedError
from ...core.package import FOLDER, NAME
from ..identity.kept_files import MOST_BYTES
from ..identity.recipes import PluginRecipe
from .baseline import Baseline, Measured

__all__ = ["OldCode", "changed_detectors", "restored", "same_framework"]


@dataclass(frozen=True)
class OldCode:
    """Restored code.

    Attributes
    ----------
    places : list of Path
        Folders from which it is imported.
    recipes : dict of str to PluginRecipe
        Detectors by label.
    """

    places: list[Path]
    recipes: dict[str, PluginRecipe]


def changed_detectors(baseline: Baseline, candidate: Baseline) -> list[str]:
    """Return the detectors whose code or parameters differ between the sides.

    Raises
    ------
    UnsupportedError
        None differs, or the baseline does not name its code.
    """
    changed = []
    for label, before in baseline.detectors.items():
        after = candidate.detectors[label]
        if before.code is None or after.code is None:
            raise UnsupportedError(
                f"the baseline does not say which code of {label} it measured, as those of version 0.1 do not: save it "
                "again, or leave out time=True"
            )
        if (before.code.digest, before.recipe.parameters) != (after.code.digest, after.recipe.parameters):
            changed.append(label)
    if not changed:
        codes = ", ".join(
            f"{label} {found.code.digest[:10]}" for label, found in baseline.detectors.items() if found.code
        )
        raise UnsupportedError(
            f"both sides would run the same code ({codes}), so there is no run time to compare: leave out time=True"
        )
    return changed


def same_framework(baseline: Baseline, candidate: Baseline) -> bool:
    """Return whether all detectors depend on the same modules of roofbench on both sides."""
    codes = ((found.code, candidate.detectors[label].code) for label, found in baseline.detectors.items())
    return all(old is not None and new is not None and old.framework == new.framework for old, new in codes)


@contextmanager
def restored(baseline: Baseline, labels: Sequence[str], *, framework: bool) -> Iterator[OldCode]:
    """Yield the code of detectors of a baseline; with `framework` that of roofbench, too.

    Raises
    ------
    UnsupportedError
        The old code is not available.
    """
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="roofbench-")))
        recipes = {label: _old_recipe(label, baseline.detectors[label], folder) for label in labels}
        places = [folder / "packages"]
        if framework:
            places.append(stack.enter_context(_unpacked(baseline.version.commit)))
        yield OldCode(places, recipes)


def _old_recipe(label: str, measured: Measured, folder: Path) -> PluginRecipe:
    """Return the recipe of a detector as it was; what the baseline keeps of it is written below `folder`."""
    code, recipe = measured.code, measured.recipe
    if code is None or not code.plugin:
        return _with_old_files(label, measured, folder)
    if not code.sources:
        raise UnsupportedError(f"the baseline keeps no source of {label}: save it again, or leave out time=True")
    if code.fingerprint:
        raise UnsupportedError(
            f"{label} is a plugin that reads further files, of which the baseline keeps no copy: leave out time=True"
        )
    path, colon, name = recipe.use.rpartition(":")
    if not path.endswith(".py"):
        code.unpack(folder / "packages")
        return recipe
    place = folder / f"plugin-{len(list(folder.iterdir()))}"
    code.unpack(place)
    return replace(recipe, use=f"{place / Path(path).name}{colon}{name}")


def _with_old_files(label: str, measured: Measured, folder: Path) -> PluginRecipe:
    """Return the recipe of a detector of roofbench; its program is the kept copy, or that of its path if unchanged."""
    code = measured.code
    if code is None or not code.fingerprint:
        return measured.recipe
    place = folder / f"program-{len(list(folder.iterdir()))}"
    try:
        if code.kept is not None:
            code.kept.unpack(place)
            parameters = code.kept.moved(measured.recipe.parameters, place)
            detector = replace(measured.recipe, parameters=parameters).detector()
        else:
            detector = measured.recipe.detector()
    except RoofbenchError as error:
        raise UnsupportedError(
            f"the old program of {label} cannot be restored ({error}): leave out time=True"
        ) from error
    if detector.fingerprint() != code.fingerprint:
        raise UnsupportedError(
            f"the old program of {label} is not available: something that it runs or reads has changed, of which the "
            f"baseline keeps no copy (files of up to {MOST_BYTES // 1000} kB in all are kept): leave out time=True"
        )
    return PluginRecipe.of(detector)


@contextmanager
def _unpacked(commit: str | None) -> Iterator[Path]:
    """Yield a folder that holds the package as it was at a commit."""
    if commit is None:
        raise UnsupportedError(
            "the baseline names no commit, and roofbench itself has changed since: its old code is not available; save "
            "the baseline again, or leave out time=True"
        )
    with tempfile.TemporaryDirectory(prefix="roofbench-") as name:
        archive, target = Path(name) / "code.tar", Path(name) / NAME
        command = ["git", "-C", str(FOLDER), "archive", "--format=tar", "-o", str(archive), commit]
        try:
            subprocess.run(command, check=True, capture_output=True, timeout=60)  # noqa: S603 - a list, no shell
        except (OSError, subprocess.SubprocessError) as error:
            raise UnsupportedError(
                f"the commit {commit[:10]} of the baseline is not in this repository: fetch it (in CI, a checkout "
                "with its whole history), or leave out time=True"
            ) from error
        with tarfile.open(archive) as packed:
            packed.extractall(target, filter="data")
        if not (target / Path(*__package__.split(".")[1:-1]) / "execution" / "isolation.py").is_file():
            raise UnsupportedError(
                f"the commit {commit[:10]} of the baseline is older than the present layout and cannot run beside it: "
                "save the baseline again, or leave out time=True"
            )
        yield Path(name)
