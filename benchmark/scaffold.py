"""Templates of plugins, packages of plugins and suites: complete, working examples to start from.

``roofbench new detector NAME`` writes a folder with the example, a test, a README and a workflow that runs the test in
the user's own repository. Templates are text in which ``@name@``, ``@module@`` and ``@Class@`` are replaced.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from importlib import resources
from pathlib import Path
from typing import Literal, TypeAlias, get_args

from ..core.errors import ParameterError
from ..core.output import whole_folder
from ..detectors.registry import DETECTORS
from ..evaluators.registry import EVALUATORS
from .suite import suite_names

__all__ = ["TEMPLATES", "Template", "write_template"]

Template: TypeAlias = Literal["detector", "evaluator", "suite", "plugin-package"]
TEMPLATES: tuple[Template, ...] = get_args(Template)

_NAME = re.compile(r"[a-z][a-z0-9]*([_-][a-z0-9]+)*")
#: Folders of a template's files, by the first part of the file's name.
_FOLDERS = {"workflow": Path(".github") / "workflows"}
#: What a package takes from other templates: template and file to the place in the package.
_IN_A_PACKAGE = {
    ("detector", "@module@.py"): "src/@module@/detector.py",
    ("evaluator", "@module@.py"): "src/@module@/evaluator.py",
    ("detector", "test_@module@.py"): "tests/test_detector.py",
    ("evaluator", "test_@module@.py"): "tests/test_evaluator.py",
}
_PACKAGE_INIT = '"""A building detector and an evaluator for roofbench."""\n'


def write_template(template: Template, name: str, folder: Path) -> list[Path]:
    """Write a new plugin or suite into a folder that does not exist yet; return its files.

    Parameters
    ----------
    template : {"detector", "evaluator", "suite", "plugin-package"}
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
    _require_free(template, name)
    written = []
    with whole_folder(folder, holds=()) as scratch:
        for target, text in _files(template, name):
            (scratch / target).parent.mkdir(parents=True, exist_ok=True)
            (scratch / target).write_text(text, encoding="utf-8")
            written.append(folder / target)
    return written


def _require_free(template: Template, name: str) -> None:
    kinds = {"detector": DETECTORS.names, "evaluator": EVALUATORS.names, "suite": suite_names}
    kind = "detector" if template == "plugin-package" else template
    if name in kinds[kind]():
        raise ParameterError(f"{name!r} is already the name of another {kind}: choose a different one")


def _files(template: Template, name: str) -> Iterator[tuple[Path, str]]:
    """Yield the place and the text of every file."""
    words = _words(name)
    for file, text in _sources(template):
        target = Path(_filled(file, words))
        if target.name == "gitignore":
            # Patterns of package data leave out names that begin with a dot.
            target = Path(".gitignore")
        place = _FOLDERS.get(target.name.partition("-")[0])
        yield (target if place is None else place / target.name.partition("-")[2]), _filled(text, words)
    if template == "plugin-package":
        module = words["@module@"]
        yield Path("src") / module / "__init__.py", _PACKAGE_INIT
        for (part, file), inside in _IN_A_PACKAGE.items():
            own = words if part == "detector" else {**_words(f"{name}-score"), "@module@": module}
            text = dict(_sources(part))[file]
            # A package is imported; a single file is named by its path.
            text = text.replace("from @module@ import", "from @module@.evaluator import")
            text = text.replace("with_name('@module@.py')", "parents[1] / 'src' / '@module@' / 'detector.py'")
            text = text.replace("Path(__file__).parents", "Path(__file__).resolve().parents")
            yield Path(_filled(inside, words)), _filled(text, own)


def _words(name: str) -> dict[str, str]:
    module = name.replace("-", "_")
    return {"@name@": name, "@module@": module, "@Class@": "".join(part.capitalize() for part in module.split("_"))}


def _sources(template: str) -> Iterator[tuple[str, str]]:
    """Yield the name of each file of a template and its text, not filled in yet."""
    for source in sorted(resources.files(__package__).joinpath("templates", template).iterdir(), key=str):
        yield source.name.removesuffix(".template"), source.read_text("utf-8")


def _filled(text: str, words: dict[str, str]) -> str:
    for token, word in words.items():
        text = text.replace(token, word)
    return text
