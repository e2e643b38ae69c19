"""``roofbench gate``: whether a change has made a detector better or worse."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..core.errors import InputError, ParameterError
from . import completion
from .command import RunOptions, with_run_options
from .console import messages, print_result, say
from .measuring import measure_suite
from .options import DetectorOption, FormatOption, IndicesOption, OverwriteOption, ScenesOption, SuiteOption

if TYPE_CHECKING:
    from ..benchmark.analysis.self_test import SelfTest
    from ..benchmark.suite import Suite

__all__ = ["gate"]


@with_run_options
def gate(
    baseline: Annotated[Path, typer.Argument(metavar="BASELINE", help="Baseline file.")],
    candidate: Annotated[
        Path | None,
        typer.Argument(
            metavar="CANDIDATE", help="Another baseline file; without it, the installed code is run and measured."
        ),
    ] = None,
    suite: SuiteOption = None,
    detector: DetectorOption = None,
    against: Annotated[
        str | None,
        typer.Option(
            "--against",
            metavar="DETECTOR",
            help="Detector of the baseline to compare the one of -d with.",
            autocompletion=completion.detectors,
        ),
    ] = None,
    scenes: ScenesOption = None,
    index: IndicesOption = None,
    margin: Annotated[
        list[str] | None,
        typer.Option(
            "--margin",
            metavar="INDEX=VALUE",
            help="Difference that counts as none, such as pixel.quality=0.005; repeat for more.",
        ),
    ] = None,
    level: Annotated[
        float,
        typer.Option(
            "--level",
            min=1e-6,
            max=0.5,
            metavar="P",
            help="Significance level; 0.01 means at most 0.5 % false alarms.",
        ),
    ] = 0.01,
    time: Annotated[
        bool, typer.Option("--time", help="Gate run time as well: the baseline's commit and this code take turns.")
    ] = False,
    time_margin: Annotated[
        float,
        typer.Option("--time-margin", min=0.001, metavar="SHARE", help="Share of run time that counts as equal."),
    ] = 0.1,
    self_test: Annotated[
        bool,
        typer.Option(
            "--self-test",
            help="Test the gate instead: run the installed code twice with different seeds, compare random deals of "
            "these runs, and print how often identical code is called worse.",
        ),
    ] = False,
    comparisons: Annotated[
        int, typer.Option("--comparisons", min=1, metavar="N", help="Number of null comparisons of --self-test.")
    ] = 1000,
    form: FormatOption = "table",
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="Markdown file for the result.")
    ] = None,
    overwrite: OverwriteOption = False,
    *,
    options: RunOptions,
) -> None:
    """Test by paired comparison over scenes whether a change has made a detector better or worse.

    -d compares only the detectors it names, each with the one of the same name in the baseline or with the one that
    --against names. --scenes compares only matching scenes, --suite measures other scenes than the baseline's.

    Exit code 1 when an index became worse or a run fails that succeeded before, 4 when nothing could be measured or
    the scenes differ, else 0. With --self-test 1 when identical code is called worse more often than the gate promises.
    """
    from ..benchmark.analysis.baseline import Baseline
    from ..benchmark.analysis.gate import compare, different_scenes, margins_of
    from ..benchmark.analysis.timing import time_side_by_side
    from ..benchmark.suite import suite_of_words
    from ..core.output import check_target
    from ..reports.gate_json import gate_json
    from ..reports.gate_text import format_gate
    from ..reports.self_test_text import format_self_test

    if output is not None:
        check_target(output, overwrite)
    before = Baseline.load(baseline)
    if scenes is not None:
        before = before.with_scenes(scenes)
    if against is not None:
        before = before.only([against])
    chosen_evaluator = before.evaluator.evaluator()
    indices = chosen_evaluator.gated_indices(index)
    margins = margins_of(margin or [], indices)
    if self_test and (candidate is not None or against is not None or time):
        raise ParameterError(
            "self_test=True compares the installed code with itself: leave out the candidate file, against= and time="
        )
    if candidate is not None:
        if suite is not None or detector or time:
            raise ParameterError("a candidate file is measured already: leave out suite=, detector= and time=")
        after = Baseline.load(candidate)
        if after == Baseline.load(baseline):
            raise InputError(f"{candidate} has the same content as {baseline}: there is nothing to compare")
        after = after if scenes is None else after.with_scenes(scenes)
    else:
        if detector:
            before, entries = before.named(detector)
        else:
            entries = before.to_suite().detectors
        chosen = replace(before.to_suite(), detectors=entries)
        if suite is not None:
            chosen = replace(chosen, scenes=suite_of_words([suite], None, None).scenes)
            chosen = chosen if scenes is None else chosen.with_scenes(scenes)
        if self_test:
            result_of_test = _self_test(
                chosen, options, indices=indices, margins=margins, level=level, comparisons=comparisons
            )
            _write(output, overwrite, format_self_test(result_of_test, "md"))
            print_result(format_self_test(result_of_test, form))
            raise typer.Exit(result_of_test.exit_code)
        after, _ = measure_suite(chosen, options, messages(options.quiet))
    after = after.with_labels_of(before)
    differences = different_scenes(before, after)
    if differences:
        for text in differences[:10]:
            say(f"Not comparable: {text}")
        raise typer.Exit(4)
    extra = time_side_by_side(before, after, margin=time_margin, level=level) if time else []
    result = compare(before, after, indices=indices, margins=margins, level=level, extra=extra)
    _write(output, overwrite, format_gate(result, "md"))
    print_result(gate_json(result) if form == "json" else format_gate(result, form))
    raise typer.Exit(result.exit_code)


def _write(path: Path | None, overwrite: bool, text: str) -> None:
    from ..core.output import whole_file

    if path is not None:
        with whole_file(path, overwrite=overwrite) as scratch:
            scratch.write_text(text + "\n", encoding="utf-8")


def _self_test(suite: Suite, options: RunOptions, **how: Any) -> SelfTest:
    """Measure a suite twice with different seeds, the second time without stored results, and test the gate on it."""
    from ..benchmark.analysis.self_test import self_test, with_other_seeds

    console = messages(options.quiet)
    first, _ = measure_suite(suite, options, console)
    with tempfile.TemporaryDirectory(prefix="roofbench-") as folder:
        apart = replace(options, store=Path(folder) / "self-test.sqlite")
        second, _ = measure_suite(with_other_seeds(suite), apart, console)
    return self_test(first, second, **how)
