"""``roofbench score``: evaluate stored detections again."""

from __future__ import annotations

from typing import Annotated

import typer

from . import completion
from .command import load_plugins
from .console import messages, table_console
from .options import (
    DEFAULT_STORE,
    DetectorsOption,
    FormatOption,
    IndexOption,
    PluginOption,
    ScenesOption,
    StoreOption,
    WideOption,
)

__all__ = ["score"]


def score(
    evaluator: Annotated[
        list[str],
        typer.Option(
            "--evaluator",
            "-e",
            metavar="EVALUATOR",
            help="NAME or 'NAME[parameter=value,...]'; repeat for more.",
            autocompletion=completion.evaluators,
        ),
    ],
    detectors: DetectorsOption = None,
    scenes: ScenesOption = None,
    index: IndexOption = None,
    form: FormatOption = "table",
    wide: WideOption = False,
    store: StoreOption = DEFAULT_STORE,
    plugin: PluginOption = None,
) -> None:
    """Evaluate stored detections with other evaluators and print their leaderboards; no detector runs again.

    Exit code 3 when an evaluator failed on a run, 4 when there is nothing to evaluate.
    """
    from ..benchmark.analysis.leaderboard import make_leaderboard
    from ..benchmark.execution.runner import score_stored
    from ..benchmark.plan import KeyedEvaluator
    from ..benchmark.store.writer import Store
    from ..evaluators.registry import make_evaluator
    from ..reports.leaderboard_text import print_unsuccessful, show_leaderboards

    load_plugins(plugin)
    evaluators = tuple(KeyedEvaluator.of(make_evaluator(name)) for name in evaluator)
    with Store(store, must_exist=True) as opened:
        rows = opened.runs(detector=detectors, scene=scenes)[::-1]
        good = [row.id for row in rows if row.status == "ok"]
        for keyed in evaluators:
            known = opened.evaluated(good, keyed.key)
            for run_id in good:
                if run_id not in known:
                    score_stored(opened, run_id, (keyed,))
        boards = [
            make_leaderboard(rows, opened, keyed, title=f"Stored runs of {store}", rank_by=index)
            for keyed in evaluators
        ]
        show_leaderboards(boards, form, table_console(), wide=wide)
    unevaluated = [run for board in boards for run in board.unsuccessful if run.status == "not evaluated"]
    print_unsuccessful(unevaluated, messages())
    if unevaluated:
        raise typer.Exit(3)
    if not good:
        raise typer.Exit(4)
