"""Commands on stored runs: ``roofbench ls``, ``why``, ``score`` and ``export``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

import typer

from .options import DEFAULT_STORE, PluginOption, StoreOption, load_plugins, table_console


def ls(
    status: Annotated[Literal["ok", "failed", "skipped"] | None, typer.Option(help="Only runs of this status.")] = None,
    detector: Annotated[
        str | None, typer.Option("--detector", "-d", help="Only matching labels.", metavar="PATTERN")
    ] = None,
    scene: Annotated[str | None, typer.Option("--scene", help="Only matching scenes.", metavar="PATTERN")] = None,
    limit: Annotated[int, typer.Option("--limit", "-n", min=0, help="At most so many, the newest first; 0: all.")] = 50,
    form: Annotated[
        Literal["table", "csv", "json"], typer.Option("--format", "-f", help="How they are printed.")
    ] = "table",
    store: StoreOption = DEFAULT_STORE,
) -> None:
    """List stored runs."""
    from ..benchmark.store.listing import list_runs

    pieces = list_runs(store, status=status, detector=detector, scene=scene, limit=limit or None, form=form)
    for piece in pieces:
        typer.echo(piece, nl=False)


def why(
    run: Annotated[str, typer.Argument(help="Number of the run, or the first digits of its key.")],
    store: StoreOption = DEFAULT_STORE,
    plugin: PluginOption = None,
) -> None:
    """Say what a stored run depends on, and what of it has changed since."""
    from ..benchmark.analysis.leaderboard import repeat_command
    from ..benchmark.plan import differences, identity_now
    from ..benchmark.store.writer import Store
    from ..core.errors import RoofbenchError

    load_plugins(plugin)
    with Store(store, must_exist=True) as opened:
        row = opened.run(run)
        code, machine = opened.code(row.id), opened.machine(row.id)
        lines = [
            f"run {row.id}, key {row.key}",
            f"  status     {row.status}{': ' + row.reason if row.reason else ''}",
            f"  detector   {row.detector}  {json.dumps(row.parameters)}",
            f"  scene      {row.scene}, key {row.scene_key[:16]}",
            f"  seed       {row.seed}",
            f"  code       roofbench {row.version}, {len(code.modules)} modules, digest {code.digest[:16]}",
            f"  packages   {', '.join(f'{name} {version}' for name, version in code.packages.items())}",
            f"  cost       {row.seconds:.3f} s, CPU {row.cpu_seconds:.3f} s, {row.peak_memory / 1e6:.0f} MB",
            f"  machine    {', '.join(f'{name} {value}' for name, value in machine.items()) or 'not known'}",
            f"  finished   {row.finished}",
            f"  repeat     {repeat_command(row)}",
        ]
        try:
            changes = differences(opened, row.id, identity_now(row))
        except RoofbenchError as error:
            lines.append(f"It cannot be made again here: {error}")
        else:
            lines.append(
                "Nothing that it depends on has changed: it would not be run again."
                if not changes
                else "It would be run again: " + "; ".join(changes) + "."
            )
            if row.status == "failed" and not changes:
                lines[-1] = "Nothing that it depends on has changed; failures are tried again."
        if row.traceback:
            lines += ["", row.traceback.rstrip()]
    typer.echo("\n".join(lines))


def score(
    evaluator: Annotated[list[str], typer.Option("--evaluator", "-e", help="NAME or 'NAME[parameter=value,...]'.")],
    detector: Annotated[
        str | None, typer.Option("--detector", "-d", help="Only matching labels.", metavar="PATTERN")
    ] = None,
    scene: Annotated[str | None, typer.Option("--scene", help="Only matching scenes.", metavar="PATTERN")] = None,
    rank_by: Annotated[str | None, typer.Option(help="Index that ranks, for instance pixel.quality.")] = None,
    store: StoreOption = DEFAULT_STORE,
    plugin: PluginOption = None,
) -> None:
    """Judge stored detections by further evaluators and print their leaderboards; nothing is detected again."""
    from ..benchmark.analysis.leaderboard import make_leaderboard
    from ..benchmark.execution.runner import score_stored
    from ..benchmark.plan import Judge
    from ..benchmark.store.writer import Store
    from ..evaluators.registry import make_evaluator

    load_plugins(plugin)
    judges = tuple(Judge.of(make_evaluator(name)) for name in evaluator)
    with Store(store, must_exist=True) as opened:
        rows = opened.runs(detector=detector, scene=scene)[::-1]
        good = [row.id for row in rows if row.status == "ok"]
        for judge in judges:
            known = opened.evaluated(good, judge.key)
            for run_id in good:
                if run_id not in known:
                    score_stored(opened, run_id, (judge,))
        for judge in judges:
            board = make_leaderboard(rows, opened, judge, title=f"Stored runs of {store}", rank_by=rank_by)
            board.print(table_console())
    if not good:
        raise typer.Exit(4)


def export(
    run: Annotated[str, typer.Argument(help="Number of the run, or the first digits of its key.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Vector file; a GeoPackage holds both layers.")],
    evaluator: Annotated[str | None, typer.Option("--evaluator", "-e", help="Whose verdicts.")] = None,
    store: StoreOption = DEFAULT_STORE,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a file that exists.")] = False,
) -> None:
    """Write a stored run as vector layers: detections and references with their verdicts."""
    from ..benchmark.store.stored_verdicts import export_run
    from ..benchmark.store.writer import Store

    with Store(store, must_exist=True) as opened:
        what = export_run(opened, opened.run(run).id, output, evaluator=evaluator, overwrite=overwrite)
    typer.echo(f"{output}: {what}", err=True)
