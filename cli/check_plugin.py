"""``roofbench check-plugin``: whether a detector or evaluator follows the rules."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..core.errors import ParameterError, UnknownNameError
from . import completion
from .command import load_plugins
from .options import PluginOption

if TYPE_CHECKING:
    from ..detectors.base import Detector
    from ..evaluators.base import Evaluator

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
    from ..core.registry import nearest_hint, parse_selection
    from ..detectors.registry import DETECTORS, make_detector
    from ..evaluators.registry import EVALUATORS, make_evaluator

    load_plugins(plugin)
    known = [*DETECTORS.names(), *EVALUATORS.names()]
    word = parse_selection(name)[0]
    chosen: Detector | Evaluator
    if ".py" in word:
        chosen = _from_file(name)
    elif word in DETECTORS.names():
        chosen = make_detector(name)
    elif word in EVALUATORS.names():
        chosen = make_evaluator(name)
    else:
        raise UnknownNameError(f"no plugin called {word!r}{nearest_hint(word, known)}; there are {', '.join(known)}")
    with redirect_stdout(sys.stderr):
        checks = conformance.check_plugin(chosen)
    for check in checks:
        typer.echo(
            f"{'ok    ' if check.passed else 'BROKEN'}  {check.rule}{': ' + check.problem if check.problem else ''}"
        )
    broken = sum(not check.passed for check in checks)
    typer.echo(f"{name}: {len(checks) - broken} of {len(checks)} rules kept")
    if broken:
        raise typer.Exit(3)


def _from_file(selection: str) -> Detector | Evaluator:
    """Return the detector or the evaluator that ``file.py:Class`` names, whichever it is."""
    from ..core.registry import parse_selection
    from ..detectors.registry import DETECTORS, make_detector
    from ..evaluators.registry import EVALUATORS, make_evaluator

    word = parse_selection(selection)[0]
    file = Path(word.partition(".py")[0] + ".py")
    if ":" not in word.rpartition(".py")[2] and not DETECTORS.add_all(file) and not EVALUATORS.add_all(file):
        raise UnknownNameError(f"{file} holds neither a detector nor an evaluator: derive from roofbench.Detector")
    try:
        return make_detector(selection)
    except ParameterError as error:
        try:
            return make_evaluator(selection)
        except ParameterError:
            raise error from None
