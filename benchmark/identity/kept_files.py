"""Copies of small files in a baseline: the program of a detector, so that an old version can run again.

Nouns
-----
kept files
    The content of a detector's code files (`Detector.code_files`) by path relative to one folder, the *root*.
"""

from __future__ import annotations

import base64
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from ...core.errors import InputError
from ...detectors.base import Detector
from ...detectors.external.external_paths import files_of, moved_words

__all__ = ["MOST_BYTES", "KeptFiles"]

#: Larger programs and models are not kept, bytes in all.
MOST_BYTES = 1_000_000


@dataclass(frozen=True)
class KeptFiles:
    """Copies of files below a root.

    Attributes
    ----------
    root : str
        Folder that they were in; relative to the working folder if it is below.
    files : mapping of str to mapping
        By relative path: ``text`` or ``base64``, and ``executable``.
    """

    root: str
    files: Mapping[str, Mapping[str, Any]]

    @classmethod
    def of(cls, detector: Detector) -> Self | None:
        """Return copies of the files of a detector; None where there are none, or too much."""
        paths = detector.code_files()
        files = [path / name if path.is_dir() else path for path in paths for name, _ in files_of(path)]
        if not files or sum(file.stat().st_size for file in files) > MOST_BYTES:
            return None
        root = Path(os.path.commonpath([path.parent for path in paths]))
        kept = {file.relative_to(root).as_posix(): _kept(file) for file in files}
        here = Path.cwd()
        place = os.path.relpath(root, here) if root.is_relative_to(here) else str(root)
        return cls(place, dict(sorted(kept.items())))

    def unpack(self, folder: Path) -> None:
        """Write the files below a folder."""
        for name, facts in self.files.items():
            target = (folder / name).resolve()
            if not target.is_relative_to(folder.resolve()):
                raise InputError(f"the baseline keeps a file outside its folder: {name!r}")
            try:
                text = facts.get("text")
                content = base64.b64decode(facts["base64"], validate=True) if text is None else text.encode()
            except (AttributeError, KeyError, TypeError, ValueError) as error:
                raise InputError(f"the baseline's copy of {name!r} is damaged: save the baseline again") from error
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
            if facts.get("executable"):
                target.chmod(0o755)

    def moved(self, parameters: Mapping[str, Any], folder: Path) -> dict[str, Any]:
        """Return the parameters of `command` for copies that `unpack` wrote below a folder."""
        root = Path(os.path.abspath(self.root))
        changed = dict(parameters)
        for name in ("run", "files"):
            if isinstance(parameters.get(name), str):
                changed[name] = moved_words(parameters[name], name, root, folder)
        return changed

    def to_dict(self) -> dict[str, Any]:
        """Return JSON content."""
        return {"root": self.root, "files": {name: dict(facts) for name, facts in self.files.items()}}


def _kept(file: Path) -> dict[str, Any]:
    content = file.read_bytes()
    executable = {"executable": True} if os.access(file, os.X_OK) else {}
    try:
        return {"text": content.decode(), **executable}
    except UnicodeDecodeError:
        return {"base64": base64.b64encode(content).decode(), **executable}
