"""``roofbench check-plugin``: whether a detector or evaluator follows the rules."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from typing import Annotated

import typer

from . import completion
from .command import load_plugins
from .console import print_result
from .options import PluginOption

__all__ = ["check_plugin"]


def check_plugin(
    name: Annotated[
        str,
        typer.Argument(
            metavar="PLUGIN", help="Detector or evaluator: NAME or FILE.py:CLASS.", autocompletion=completion.plugins
        ),
    ],
    plugin: PluginOption = None,
) -> None:
    """Check that a detector or evaluator follows the rules, on a small built-in scene; exit code 3 if not."""
    from ..benchmark import conformance
    from ..benchmark.catalogue import find_plugin

    load_plugins(plugin)
    chosen = find_plugin(name)
    with redirect_stdout(sys.stderr):
        checks = conformance.check_plugin(chosen)
    for check in checks:
        print_result(
            f"{'ok    ' if check.passed else 'FAILED'}  {check.rule}{': ' + check.problem if check.problem else ''}"
        )
    failed = sum(not check.passed for check in checks)
    print_result(f"{name}: {len(checks) - failed} of {len(checks)} rules followed")
    if failed:
        raise typer.Exit(3)
