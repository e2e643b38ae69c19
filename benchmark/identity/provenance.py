"""Provenance: version and commit of the running code, and whether the working tree has changes."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from ...core.package import FOLDER, VERSION

__all__ = ["CodeVersion", "code_version"]


@dataclass(frozen=True)
class CodeVersion:
    """Version number, commit (None outside a git checkout), and whether tracked files differ from that commit."""

    version: str
    commit: str | None
    dirty: bool

    def __str__(self) -> str:
        if self.commit is None:
            return self.version
        return f"{self.version} ({self.commit[:10]}{', dirty' if self.dirty else ''})"


@lru_cache(maxsize=1)
def code_version() -> CodeVersion:
    """Return the version of the running roofbench."""
    version = VERSION
    top = _git("rev-parse", "--show-toplevel")
    if top is None or Path(top).resolve() != FOLDER:
        return CodeVersion(version, None, False)
    return CodeVersion(version, _git("rev-parse", "HEAD"), bool(_git("status", "--porcelain", "--untracked-files=no")))


def _git(*arguments: str) -> str | None:
    command = ["git", "-C", str(FOLDER), *arguments]
    try:
        answer = subprocess.run(command, capture_output=True, text=True, timeout=20, check=True)  # noqa: S603
    except (OSError, subprocess.SubprocessError):
        return None
    return answer.stdout.strip()
