"""``roofbench score``: evaluate stored detections again, or footprints that were made elsewhere."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from ..core.errors import ParameterError
from ..core.wording import counted
from .command import load_plugins
from .console import messages, print_result, table_console
from .options import (
    DEFAULT_STORE,
    DetectorsOption,
    EvaluatorsOption,
    FormatOption,
    IndexOption,
    PluginOption,
    ScenesOption,
    StoreOption,
    SuiteOption,
    WideOption,
)

if TYPE_CHECKING:
    from ..benchmark.plan import KeyedEvaluator
    from ..benchmark.store.records import RunRow
    from ..benchmark.store.writer import Store
    from ..benchmark.suite import Suite

__all__ = ["score"]


def score(
    evaluator: EvaluatorsOption = None,
    footprints: Annotated[
        Path | None,
        typer.Option("--footprints", metavar="FOLDER", help="Folder with one vector file for each scene of --suite."),
    ] = None,
    suite: SuiteOption = None,
    label: Annotated[
        str, typer.Option("--label", metavar="NAME", help="Name of these footprints in tables [name of the folder].")
    ] = "",
    check: Annotated[
        bool, typer.Option("--check", help="Only say which files are missing or cannot be used; nothing is stored.")
    ] = False,
    detectors: DetectorsOption = None,
    scenes: ScenesOption = None,
    index: IndexOption = None,
    form: FormatOption = "table",
    wide: WideOption = False,
    all_versions: Annotated[
        bool,
        typer.Option(
            "--all-versions",
            help="Rank the runs of all versions of the benchmark together, not only those of the newest.",
        ),
    ] = False,
    store: StoreOption = DEFAULT_STORE,
    plugin: PluginOption = None,
) -> None:
    """Evaluate stored detections with other evaluators, or footprints made elsewhere, and print leaderboards.

    Exit code 2 when --check finds a problem, 3 when runs or evaluators failed, 4 when there is nothing to evaluate.
    """
    from ..benchmark.analysis.report_contents import newest_runs
    from ..benchmark.plan import KeyedEvaluator
    from ..benchmark.store.writer import Store
    from ..benchmark.suite import suite_of_words
    from ..evaluators.registry import make_evaluator

    load_plugins(plugin)
    if footprints is None:
        if suite is not None or check or label:
            raise ParameterError("suite=, label= and check=True belong to footprints=: name the folder with the files")
        if not evaluator:
            raise ParameterError("name an evaluator by evaluator=, or footprints made elsewhere by footprints=")
        evaluators = tuple(KeyedEvaluator.of(make_evaluator(name)) for name in evaluator)
        with Store(store, must_exist=True) as opened:
            rows = newest_runs(opened, detector=detectors, scene=scenes)
            show = _Shown(form, index, wide, all_versions)
            _show(opened, rows, evaluators, show, title=f"Stored runs of {store}")
        return
    if suite is None:
        raise ParameterError("footprints= needs a suite=: the scenes that the files belong to")
    whole = suite_of_words([suite], evaluators=evaluator)
    chosen = whole if scenes is None else whole.with_scenes(scenes)
    if check:
        _check(chosen, footprints, whole)
        return
    with Store(store) as opened:
        others, own = _contributed(opened, chosen, footprints, label)
        others = [row for row in others if detectors is None or fnmatchcase(row.label, detectors)]
        rows, failed = [*others, *own], [row for row in own if row.status == "failed"]
        evaluators = tuple(KeyedEvaluator.of(one) for one in chosen.evaluators)
        show = _Shown(form, index, wide, all_versions)
        _show(opened, rows, evaluators, show, title=f"Suite {chosen.name}", failed=failed)


def _contributed(store: Store, suite: Suite, folder: Path, label: str) -> tuple[list[RunRow], list[RunRow]]:
    """Run the footprints of a folder; return the other stored rows of the same scenes, and theirs."""
    from ..benchmark.contribution import contribution_suite, runs_beside
    from ..benchmark.execution.executors import Execution
    from ..benchmark.execution.runner import run_plan
    from ..benchmark.plan import make_plan, plan_content
    from .progress import run_progress

    suite = contribution_suite(suite, folder, label=label)
    plan = make_plan(suite, store)
    store.save_plan(suite.name, shlex.join(["roofbench", *sys.argv[1:]]), plan_content(suite))
    with run_progress(plan, messages()) as report:
        result = run_plan(plan, store, execution=Execution(jobs=1), progress=report)
    return runs_beside(store, result.rows), list(result.rows)


def _check(suite: Suite, folder: Path, whole: Suite) -> None:
    """Print what is missing, and leave with exit code 2 where something is.

    `suite` has the chosen scenes of the `whole` one, to which all files may belong.
    """
    from ..benchmark.contribution import contribution_problems

    problems = dict(contribution_problems(suite, folder, whole))
    for name, problem in problems.items():
        print_result(f"{name}: {problem or 'ok'}")
    wrong = sum(map(bool, problems.values()))
    print_result(f"{counted(len(suite.scenes), 'scene')}, {counted(wrong, 'problem')}")
    if wrong:
        raise typer.Exit(2)


@dataclass(frozen=True)
class _Shown:
    """How leaderboards are made and printed."""

    form: Literal["table", "csv", "md", "json"]
    index: str | None
    wide: bool
    all_versions: bool


def _show(
    store: Store,
    rows: list[RunRow],
    evaluators: tuple[KeyedEvaluator, ...],
    show: _Shown,
    *,
    title: str,
    failed: Sequence[RunRow] = (),
) -> None:
    """Evaluate what lacks an evaluation, and print a leaderboard for each evaluator."""
    from ..benchmark.analysis.leaderboard import make_leaderboard, unsuccessful_runs
    from ..benchmark.execution.runner import score_missing
    from ..reports.leaderboard_text import print_unsuccessful, show_leaderboards

    good = score_missing(store, rows, evaluators)
    boards = [
        make_leaderboard(rows, store, keyed, title=title, rank_by=show.index, all_versions=show.all_versions)
        for keyed in evaluators
    ]
    show_leaderboards(boards, show.form, table_console(), wide=show.wide)
    unevaluated = [run for board in boards for run in board.unsuccessful if run.status == "not evaluated"]
    print_unsuccessful([*unsuccessful_runs(failed), *unevaluated], messages())
    if unevaluated or failed:
        raise typer.Exit(3)
    if not good:
        raise typer.Exit(4)
