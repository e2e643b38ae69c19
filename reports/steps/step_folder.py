"""The steps of a detection as a folder: one picture each, and a README with the captions."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from ...core.output import check_folder, whole_folder
from ...detectors.steps import Step
from ..figures import save_figure
from .step_figure import step_figure

__all__ = ["check_step_folder", "write_steps"]

#: Names of the files in a folder of steps; a folder with others is not replaced.
_CONTENTS = ("README.md", "[0-9][0-9]-*.png")


def check_step_folder(folder: Path, *, overwrite: bool) -> None:
    """Raise `OutputError` when the folder cannot be written, or exists and may not be replaced."""
    check_folder(folder, overwrite, holds=_CONTENTS)


def write_steps(steps: Iterable[Step], folder: Path, *, title: str, overwrite: bool = False) -> int:
    """Write the pictures of all steps, numbered, and return how many there are.

    Raises
    ------
    OutputError
        Existing folder, or one that cannot be written.
    """
    captions = []
    with whole_folder(folder, holds=_CONTENTS, overwrite=overwrite) as scratch:
        for number, step in enumerate(steps, start=1):
            name = f"{number:02d}-{step.name}.png"
            save_figure(step_figure(step), scratch / name, tight=True)
            captions.append(f"- `{name}`: {step.caption}\n")
        (scratch / "README.md").write_text(f"# {title}\n\n" + "".join(captions), "utf-8")
    return len(captions)
