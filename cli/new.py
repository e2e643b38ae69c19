"""``roofbench new``: a detector, evaluator, suite or package of plugins to start from."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Literal

import typer

from .console import print_result, say

__all__ = ["new"]


def new(
    template: Annotated[
        Literal["detector", "evaluator", "suite", "plugin-package"],
        typer.Argument(metavar="KIND", help="detector, evaluator, suite or plugin-package."),
    ],
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Lower-case letters and digits, parts separated by _ or -.")
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FOLDER", help="Folder to make [NAME].")
    ] = None,
) -> None:
    """Write a complete working example with a test, a README and a CI workflow.

    A plugin-package is a Python package with a detector and an evaluator, ready to be installed and published.

    Example: roofbench new detector my-detector && cd my-detector && pytest
    """
    from ..benchmark.scaffold import write_template

    folder = output or Path(name)
    for file in write_template(template, name, folder):
        print_result(file)
    test = "pytest" if find_spec("pytest") else "pip install pytest && pytest"
    say(f"Next: cd {folder} && {test}; README.md lists further commands")
