"""How every command is called: errors name the options of the command, and shared options arrive in one piece.

The library speaks of parameters (``overwrite=True``, ``crs=``). Where the command has an option for such a parameter,
the message names the option instead.
"""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
import typer.core

from ..core.errors import ParameterError, RoofbenchError
from .options import (
    DEFAULT_JOBS,
    DEFAULT_STORE,
    JobsOption,
    MemoryLimitOption,
    PluginOption,
    QuietOption,
    SchedulerOption,
    StoreOption,
    TimeLimitOption,
    VerboseOption,
)
from .usage_errors import UsageError

if TYPE_CHECKING:
    from ..benchmark.execution.executors import Execution

__all__ = ["Command", "RunOptions", "load_plugins", "option_names", "with_run_options"]

#: ``crs=``, ``overwrite=True``, ``ground_filter='opening'``; not inside ``name[parameter=value]``.
_PARAMETER = re.compile(
    r"(?<![\[\w,.-])([a-z][a-z_]*)=(?:(?P<flag>True|False)\b|'(?P<text>[^']*)'|\((?P<tuple>[^)]*)\)|(?P<word>[\w.:/,=-]*\w))?"
)

#: Choices as some versions of typer print them.
_CHOICES = re.compile(r"<([\w|-]+)>")


def option_names(message: str, options: dict[str, str]) -> str:
    """Return a message of the library with parameters replaced by options of a command.

    Parameters
    ----------
    message : str
    options : dict of str to str
        Name of each parameter of the command to its option.

    Examples
    --------
    >>> option_names("a.gpkg has no CRS: set it by crs=", {"crs": "--crs"})
    'a.gpkg has no CRS: set it by --crs'
    >>> option_names("out exists: set overwrite=True or use another name", {"overwrite": "--overwrite"})
    'out exists: set --overwrite or use another name'
    >>> option_names("use ground_filter='opening'", {"ground_filter": "--ground-filter"})
    'use --ground-filter opening'
    >>> option_names("ground_filter= must be opening or cloth", {"ground_filter": "--ground-filter"})
    '--ground-filter must be opening or cloth'
    >>> option_names("set extent=(0, 0, 9, 9)", {"extent": "--extent"})
    'set --extent 0 0 9 9'
    """

    def replaced(match: re.Match[str]) -> str:
        option = options.get(match[1])
        if option is None or match["flag"] == "False":
            return match[0]
        value = match["text"] or match["word"] or (match["tuple"] or "").replace(",", "")
        return f"{option} {value}" if value else option

    return _PARAMETER.sub(replaced, message)


class Command(typer.core.TyperCommand):
    """A command whose errors name its options, and whose help names arguments by metavar and not by type."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words of the command; errors of the parser carry its context."""
        try:
            return list(super().parse_args(ctx, args))
        except UsageError as error:
            if error.ctx is None:
                error.ctx = ctx
            raise

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Return the words of the usage line."""
        return ["[OPTIONS]", *(_usage(parameter) for parameter in self.get_params(ctx) if _is_argument(parameter))]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the arguments and options with their meanings."""
        sections: dict[str, list[tuple[str, str]]] = {"Arguments": [], "Options": []}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record is None:
                continue
            if _is_argument(parameter):
                sections["Arguments"].append((str(parameter.metavar), record[1]))
            else:
                sections["Options"].append((_CHOICES.sub(r"[\1]", record[0]), _ranges_in_words(record[1])))
        for title, records in sections.items():
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)

    def invoke(self, ctx: Any) -> Any:
        """Call the command."""
        try:
            return super().invoke(ctx)
        except RoofbenchError as error:
            options = {
                parameter.name: str(parameter.metavar) if _is_argument(parameter) else max(parameter.opts, key=len)
                for parameter in self.params
                if parameter.name
            }
            message = str(error)
            if "overwrite" not in options:
                message = message.replace("set overwrite=True or ", "")
            error.args = (option_names(message, options),)
            raise


def _is_argument(parameter: Any) -> bool:
    return str(parameter.param_type_name) == "argument"


def _ranges_in_words(text: str) -> str:
    """Replace ``x>=1`` by ``at least 1``."""
    text = re.sub(r"([\w.+-]+)<=x<=([\w.+-]+)", r"from \1 to \2", text)
    return re.sub(r"\bx>=([\w.+-]+)", r"at least \1", text)


def _usage(argument: Any) -> str:
    """Return an argument in the usage line: optional ones in brackets, repeated ones with dots."""
    name = str(argument.metavar)
    dots = "..." if argument.nargs != 1 and not name.endswith("...") else ""
    return name + dots if argument.required else f"[{name}]{dots}"


def load_plugins(files: list[Path] | None) -> None:
    """Register every detector and evaluator in the files."""
    from ..detectors.registry import DETECTORS
    from ..evaluators.registry import EVALUATORS

    for file in files or ():
        found = [*DETECTORS.add_all(file), *EVALUATORS.add_all(file)]
        if not found:
            raise ParameterError(
                f"{file} contains no detector and no evaluator: derive a class from roofbench.Detector or "
                "roofbench.Evaluator"
            )


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """The options of every command that runs detectors: where, within which limits, and where results are stored.

    The fields are the options, see `with_run_options`.
    """

    jobs: JobsOption = DEFAULT_JOBS
    memory_limit: MemoryLimitOption = None
    plugin: PluginOption = None
    quiet: QuietOption = False
    scheduler: SchedulerOption = None
    store: StoreOption = DEFAULT_STORE
    time_limit: TimeLimitOption = None
    verbose: VerboseOption = False

    def execution(self) -> Execution:
        """Return how runs are executed."""
        from ..benchmark.execution.executors import Execution
        from ..core.processes import Limits

        if self.jobs == 0 and (self.time_limit is not None or self.memory_limit is not None):
            raise ParameterError("limits need a worker process: set jobs=1 or more")
        return Execution(jobs=self.jobs, scheduler=self.scheduler, limits=Limits(self.time_limit, self.memory_limit))


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
