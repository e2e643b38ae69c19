"""Options that several commands share, and how they are read."""

from __future__ import annotations

import functools
import inspect
import os
import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..core.errors import ParameterError

if TYPE_CHECKING:
    from rich.console import Console

    from ..benchmark.execution.isolation import Limits
    from ..benchmark.execution.runner import Execution
    from ..benchmark.suite import Suite

__all__ = [
    "DEFAULT_STORE",
    "DetectorOption",
    "DetectorSeedsOption",
    "EvaluatorOption",
    "PluginOption",
    "QuietOption",
    "RunOptions",
    "ScenesOption",
    "SeedsOption",
    "StoreOption",
    "WordsArgument",
    "load_plugins",
    "messages",
    "read_limits",
    "suite_from_words",
    "table_console",
    "with_run_options",
]

DEFAULT_STORE = Path("roofbench.sqlite")

StoreOption = Annotated[Path, typer.Option("--store", help="Results store, one SQLite file.", metavar="FILE")]
DetectorOption = Annotated[
    list[str] | None,
    typer.Option("--detector", "-d", help="NAME, 'NAME[parameter=value,...]' or FILE.py:CLASS; repeat for more."),
]
EvaluatorOption = Annotated[
    list[str] | None,
    typer.Option("--evaluator", "-e", help="NAME or 'NAME[parameter=value,...]'; repeat for more."),
]
PluginOption = Annotated[
    list[Path] | None,
    typer.Option("--plugin", help="Python file with detectors or evaluators of your own; repeat for more."),
]
WordsArgument = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="[SUITE | SCENE...]",
        help="A suite (TOML file or name), or scene folders and presets; 'quick' by default.",
    ),
]
ScenesOption = Annotated[
    str | None, typer.Option("--scenes", help="Only scenes whose name matches.", metavar="PATTERN")
]
SeedsOption = Annotated[int | None, typer.Option("--seeds", min=1, help="Seeds 1 to N of every preset.", metavar="N")]
DetectorSeedsOption = Annotated[
    int, typer.Option("--detector-seeds", min=1, help="Seeds of stochastic detectors given by -d.", metavar="N")
]
QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no messages.")]


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """What every command that runs detectors is told: where, within which limits, and where the results are kept.

    The fields are the options, see `with_run_options`.
    """

    jobs: Annotated[
        int, typer.Option("--jobs", "-j", min=0, help="Worker processes; 0: in this process, without limits.")
    ] = 1
    scheduler: Annotated[
        str | None, typer.Option("--scheduler", help="Dask scheduler, for instance tcp://host:8786.", metavar="URL")
    ] = None
    time_limit: Annotated[
        float | None, typer.Option("--time-limit", min=0.001, help="Wall clock seconds that one run may take.")
    ] = None
    memory_limit: Annotated[
        str | None, typer.Option("--memory-limit", help="Memory that one run may take: 500M, 8G.", metavar="SIZE")
    ] = None
    store: StoreOption = DEFAULT_STORE
    plugin: PluginOption = None
    quiet: QuietOption = False

    def execution(self) -> Execution:
        """Return how runs are executed."""
        from ..benchmark.execution.runner import Execution

        if self.jobs == 0 and (self.time_limit is not None or self.memory_limit is not None):
            raise ParameterError("limits need a worker process: use --jobs 1 or more")
        limits = read_limits(self.time_limit, self.memory_limit)
        return Execution(jobs=self.jobs, scheduler=self.scheduler, limits=limits)


def with_run_options(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of `RunOptions`, handed over in one piece as its parameter ``options``.

    Plugins are registered before the command starts.
    """
    names = [option.name for option in fields(RunOptions)]
    # Typer reads signatures: annotations are evaluated here, where the names in them are known.
    own = inspect.signature(command, eval_str=True).parameters.values()
    shared = inspect.signature(RunOptions, eval_str=True).parameters.values()
    parameters = [
        parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY)
        for parameter in (*own, *shared)
        if parameter.name != "options"
    ]

    @functools.wraps(command)
    def called(**values: Any) -> None:
        options = RunOptions(**{name: values.pop(name) for name in names})
        load_plugins(options.plugin)
        command(**values, options=options)

    called.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    called.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return called


_SIZE = re.compile(r"^\s*(\d+(?:\.\d+)?)\s*([kKmMgG]?)(?:i?[bB])?\s*$")


def read_limits(seconds: float | None, memory: str | None) -> Limits:
    """Return the limits of a run."""
    from ..benchmark.execution.isolation import Limits

    if memory is None:
        return Limits(seconds, None)
    match = _SIZE.match(memory)
    if match is None:
        raise ParameterError(f"--memory-limit must be a size such as 500M or 8G, not {memory!r}")
    return Limits(seconds, int(float(match[1]) * {"": 1, "k": 1e3, "m": 1e6, "g": 1e9}[match[2].lower()]))


def messages(quiet: bool = False) -> Console:
    """Return the console for messages and progress: standard error, plain when it is no terminal."""
    from rich.console import Console

    return Console(stderr=True, quiet=quiet, highlight=False)


def table_console() -> Console:
    """Return the console for tables: standard output, wide when it is neither a terminal nor told otherwise."""
    from rich.console import Console

    told = sys.stdout.isatty() or "COLUMNS" in os.environ
    return Console(highlight=False, width=None if told else 160)


def load_plugins(files: list[Path] | None) -> None:
    """Register every detector and evaluator in the files."""
    from ..detectors.registry import DETECTORS
    from ..evaluators.registry import EVALUATORS

    for file in files or ():
        found = [*DETECTORS.add_all(file), *EVALUATORS.add_all(file)]
        if not found:
            raise ParameterError(f"{file} holds neither a detector nor an evaluator: derive from roofbench.Detector")


def suite_from_words(
    words: list[str] | None, detectors: list[str] | None, evaluators: list[str] | None, *, seeds: int = 1
) -> Suite:
    """Return the suite that positional words and options mean.

    Parameters
    ----------
    words : list of str
        One suite (a TOML file or the name of one that comes with roofbench), or scene folders and presets; the suite
        ``quick`` when empty.
    detectors, evaluators : list of str
        Selections that replace those of the suite.
    seeds : int
        Seeds of stochastic detectors that are selected here.
    """
    from dataclasses import replace

    from ..benchmark.suite import Entrant, Suite, all_entrants, named_suite, read_suite, scenes_of, suite_names
    from ..detectors.registry import make_detector
    from ..evaluators.registry import make_evaluator

    words = words or ["quick"]
    if len(words) == 1 and words[0].endswith(".toml"):
        suite = read_suite(words[0])
    elif len(words) == 1 and words[0] in suite_names():
        suite = named_suite(words[0])
    else:
        suite = Suite("scenes", scenes_of(words), (), (make_evaluator("threshold-free"),))
        if not detectors:
            suite = replace(suite, entrants=all_entrants())
    if detectors:
        numbers = tuple(range(seeds))
        suite = replace(suite, entrants=tuple(Entrant(make_detector(name), numbers) for name in detectors))
    if evaluators:
        suite = replace(suite, evaluators=tuple(make_evaluator(name) for name in evaluators))
    return suite
