"""The options and arguments that several commands share, in alphabetical order, and how their values are read.

One option has one name, one metavar and one meaning in every command. A value that cannot be read is refused while the
command line is parsed, by the name of its option.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import typer

from ..core.errors import ParameterError
from . import completion

__all__ = [
    "DEFAULT_JOBS",
    "DEFAULT_STORE",
    "FORMAT_HELP",
    "INDEX_HELP",
    "Assignment",
    "BuildingIdOption",
    "CrsOption",
    "DetectorOption",
    "DetectorSeedsOption",
    "DetectorsOption",
    "DpiOption",
    "EvaluationAreaOption",
    "EvaluatorOption",
    "EvaluatorsOption",
    "FormatOption",
    "GsdOption",
    "IndexOption",
    "IndicesOption",
    "IntervalOption",
    "JobsOption",
    "JoinGapsOption",
    "MemoryLimitOption",
    "OverwriteOption",
    "ParameterOption",
    "PartsOption",
    "PictureOption",
    "PluginOption",
    "QuietOption",
    "RedrawsOption",
    "ReferenceErrorOption",
    "RunArgument",
    "ScenesOption",
    "SchedulerOption",
    "SeedsOption",
    "StoreOption",
    "SuiteOption",
    "TimeLimitOption",
    "VerboseOption",
    "WideOption",
    "WordsArgument",
    "read_assignment",
    "read_size",
]

#: Two workers where there are two cores: kernels are compiled at the same time.
DEFAULT_JOBS = min(2, os.cpu_count() or 1)
DEFAULT_STORE = Path("roofbench.sqlite")
FORMAT_HELP = "Output format."
INDEX_HELP = "Index by key or symbol, such as pixel.quality or Q_lp"

_SELECTION = "NAME, 'NAME[parameter=value,...]' or FILE.py:CLASS"
_SIZE = re.compile(r"^\s*(\d+(?:\.\d+)?)\s*([kKmMgG]?)(?:i?[bB])?\s*$")


class Assignment(NamedTuple):
    """A ``NAME=VALUE`` of the command line."""

    name: str
    value: str


def read_assignment(text: str) -> Assignment:
    """Read ``NAME=VALUE``."""
    from ..core.registry import parse_assignment  # here, since help has no use for registries

    try:
        return Assignment(*parse_assignment(text))
    except ParameterError as error:
        raise typer.BadParameter(str(error)) from error


def read_size(text: str) -> int:
    """Read a size in memory, such as ``500M`` or ``8G``, in bytes."""
    match = _SIZE.match(text)
    if match is None:
        raise typer.BadParameter(f"{text!r} is not a size: write 500M or 8G")
    return int(float(match[1]) * {"": 1, "k": 1e3, "m": 1e6, "g": 1e9}[match[2].lower()])


BuildingIdOption = Annotated[
    str | None,
    typer.Option(
        "--building-id", metavar="COLUMN", help="Reference column; footprints with the same value are one building."
    ),
]
CrsOption = Annotated[
    str | None,
    typer.Option(
        "--crs", metavar="CRS", help="CRS to assign to files whose CRS is missing or wrong, such as EPSG:25832."
    ),
]
DetectorOption = Annotated[
    list[str] | None,
    typer.Option(
        "--detector",
        "-d",
        metavar="DETECTOR",
        help=f"{_SELECTION}; repeat for more.",
        autocompletion=completion.detectors,
    ),
]
DetectorsOption = Annotated[
    str | None,
    typer.Option(
        "--detectors",
        metavar="PATTERN",
        help="Only detectors whose label matches, such as 'ndsm*'.",
        autocompletion=completion.detectors,
    ),
]
DetectorSeedsOption = Annotated[
    int,
    typer.Option(
        "--detector-seeds", min=1, metavar="N", help="Runs per scene of each stochastic detector given by -d."
    ),
]
DpiOption = Annotated[int, typer.Option("--dpi", min=30, max=1200, metavar="N", help="Resolution of a PNG, per inch.")]
EvaluationAreaOption = Annotated[
    str | None,
    typer.Option("--evaluation-area", metavar="FILE", help="Polygons inside which the reference is complete."),
]
EvaluatorOption = Annotated[
    str | None,
    typer.Option(
        "--evaluator",
        "-e",
        metavar="EVALUATOR",
        help=f"{_SELECTION}, or all; that of the 2010 paper by default.",
        autocompletion=completion.evaluators,
    ),
]
EvaluatorsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--evaluator",
        "-e",
        metavar="EVALUATOR",
        help=f"{_SELECTION}; repeat for more.",
        autocompletion=completion.evaluators,
    ),
]
FormatOption = Annotated[Literal["table", "csv", "md", "json"], typer.Option("--format", "-f", help=FORMAT_HELP)]
GsdOption = Annotated[float | None, typer.Option("--gsd", metavar="M", help="Ground sampling distance in metres.")]
IndexOption = Annotated[
    str | None,
    typer.Option(
        "--index",
        metavar="INDEX",
        help=f"{INDEX_HELP}; the evaluator's own choice by default.",
        autocompletion=completion.indices,
    ),
]
IndicesOption = Annotated[
    list[str] | None,
    typer.Option("--index", metavar="INDEX", help=f"{INDEX_HELP}; repeat for more.", autocompletion=completion.indices),
]
IntervalOption = Annotated[
    float | None,
    typer.Option("--interval", metavar="PERCENT", help="Level of the intervals of the indices, such as 95."),
]
JobsOption = Annotated[
    int,
    typer.Option("--jobs", "-j", min=0, metavar="N", help="Worker processes; 0: in this process, without limits."),
]
JoinGapsOption = Annotated[
    float | None,
    typer.Option(
        "--join-gaps", metavar="M", help="Join reference footprints across gaps narrower than this, in metres."
    ),
]
MemoryLimitOption = Annotated[
    int | None,
    typer.Option("--memory-limit", parser=read_size, metavar="SIZE", help="Memory limit of one run, such as 8G."),
]
OverwriteOption = Annotated[bool, typer.Option("--overwrite", help="Replace existing output.")]
ParameterOption = Annotated[
    list[Assignment] | None,
    typer.Option(
        "--parameter", "-p", parser=read_assignment, metavar="NAME=VALUE", help="Set a parameter; repeat for more."
    ),
]
PictureOption = Annotated[
    Path, typer.Option("--output", "-o", metavar="FILE", help="Picture to write: .png, .svg or .pdf.")
]
PartsOption = Annotated[
    int | None,
    typer.Option(
        "--parts",
        min=1,
        metavar="N",
        help="Compare files that are too large for the memory in about N parts; same result. From 2 million footprints "
        "on, the number of parts is chosen.",
    ),
]
PluginOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--plugin", metavar="FILE", help="Python file with your own detectors or evaluators; repeat for more."
    ),
]
QuietOption = Annotated[bool, typer.Option("--quiet", "-q", help="Suppress progress and messages.")]
RunArgument = Annotated[
    str, typer.Argument(metavar="RUN", help="Number of the run, or the first digits of its key (see 'roofbench ls').")
]
RedrawsOption = Annotated[
    int | None, typer.Option("--redraws", min=2, metavar="N", help="How often the reference is redrawn [50].")
]
ReferenceErrorOption = Annotated[
    float | None,
    typer.Option(
        "--reference-error",
        metavar="M",
        help="Redraw the reference with this digitising error, and print how far each value moves.",
    ),
]
ScenesOption = Annotated[
    str | None,
    typer.Option(
        "--scenes",
        metavar="PATTERN",
        help="Only scenes whose name matches, such as 'knox*'.",
        autocompletion=completion.scenes,
    ),
]
SchedulerOption = Annotated[
    str | None, typer.Option("--scheduler", metavar="URL", help="Dask scheduler, for instance tcp://host:8786.")
]
SeedsOption = Annotated[
    int | None, typer.Option("--seeds", min=1, metavar="N", help="Seeds 1 to N of every synthetic scene.")
]
StoreOption = Annotated[Path, typer.Option("--store", metavar="FILE", help="Results store, one SQLite file.")]
SuiteOption = Annotated[
    str | None,
    typer.Option("--suite", metavar="SUITE", help="Suite: TOML file or name.", autocompletion=completion.suites),
]
TimeLimitOption = Annotated[
    float | None,
    typer.Option("--time-limit", min=0.001, metavar="SECONDS", help="Time limit of one run, by the wall clock."),
]
VerboseOption = Annotated[bool, typer.Option("--verbose", "-v", help="Report every finished run.")]
WideOption = Annotated[
    bool, typer.Option("--wide", help="Show every index, and the mean over scenes beside the pooled value.")
]
WordsArgument = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="SUITE | SCENE...",
        help="A suite (TOML file or name), or scene folders and presets; 'quick' by default.",
        autocompletion=completion.suites_and_scenes,
    ),
]
