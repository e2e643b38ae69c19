"""Templates of plugins and suites: complete, working examples to start from.

``roofbench new detector NAME`` writes a folder with the example, a test, a README and a workflow that runs the test in
the user's own repository. Templates are text in which ``@name@``, ``@module@`` and ``@Class@`` are replaced.
"""

from __future__ import annotations

import re
from importlib import resources
from pathlib import Path
from typing import Literal, TypeAlias, get_args

from ..core.errors import ParameterError
from ..core.output import whole_folder
from ..detectors.registry import DETECTORS
from ..evaluators.registry import EVALUATORS
from .suite import suite_names

__all__ = ["TEMPLATES", "Template", "write_template"]

Template: TypeAlias = Literal["detector", "evaluator", "suite"]
TEMPLATES: tuple[Template, ...] = get_args(Template)

_NAME = re.compile(r"[a-z][a-z0-9]*([_-][a-z0-9]+)*")
#: Folders of a template's files, by the first part of the file's name.
_FOLDERS = {"workflow": Path(".github") / "workflows"}


def write_template(template: Template, name: str, folder: Path) -> list[Path]:
    """Write a new plugin or suite into a folder that does not exist yet; return its files.

    Parameters
    ----------
    template : {"detector", "evaluator", "suite"}
    name : str
        Lower-case letters and digits, parts separated by ``_`` or ``-``; no name that exists already.
    folder : Path

    Raises
    ------
    ParameterError
        The name cannot be used or is taken.
    OutputError
        The folder exists or cannot be written.
    """
    if not _NAME.fullmatch(name):
        raise ParameterError(
            f"{name!r} cannot be used as a name: write lower-case letters and digits, parts separated by _ or -"
        )
    taken = {"detector": DETECTORS.names, "evaluator": EVALUATORS.names, "suite": suite_names}[template]()
    if name in taken:
        raise ParameterError(f"a {template} called {name!r} exists already: choose another name")
    module = name.replace("-", "_")
    words = {"@name@": name, "@module@": module, "@Class@": "".join(part.capitalize() for part in module.split("_"))}
    written = []
    with whole_folder(folder, holds=()) as scratch:
        for source in sorted(resources.files(__package__).joinpath("templates", template).iterdir(), key=str):
            target = Path(_filled(source.name.removesuffix(".template"), words))
            place = _FOLDERS.get(target.name.partition("-")[0])
            if place is not None:
                target = place / target.name.partition("-")[2]
            (scratch / target).parent.mkdir(parents=True, exist_ok=True)
            (scratch / target).write_text(_filled(source.read_text("utf-8"), words), encoding="utf-8")
            written.append(folder / target)
    return written


def _filled(text: str, words: dict[str, str]) -> str:
    for token, word in words.items():
        text = text.replace(token, word)
    return text
