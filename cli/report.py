"""``roofbench report``: the one-file report of a results store, and two stores compared."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from ..core.errors import ParameterError
from ..core.wording import counted
from .command import load_plugins
from .console import messages, print_result
from .options import DetectorsOption, IndexOption, OverwriteOption, PluginOption, QuietOption, ScenesOption

__all__ = ["report"]


def report(
    store: Annotated[Path, typer.Argument(metavar="STORE", help="Results store.")],
    against: Annotated[
        Path | None,
        typer.Option("--against", metavar="STORE", help="Compare with this store: a table of paired differences."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="HTML file [report.html]; with --against Markdown (.md) or .csv."
        ),
    ] = None,
    detectors: DetectorsOption = None,
    scenes: ScenesOption = None,
    index: IndexOption = None,
    title: Annotated[str | None, typer.Option("--title", metavar="TEXT", help="Title of the report.")] = None,
    sweep: Annotated[
        list[Path] | None,
        typer.Option("--sweep", metavar="FILE", help="Table of 'roofbench sweep -o' to draw as well; repeat for more."),
    ] = None,
    gate: Annotated[
        Path | None,
        typer.Option("--gate", metavar="FILE", help="Output of 'roofbench gate --format json' to show as well."),
    ] = None,
    level: Annotated[
        float, typer.Option("--level", min=0, max=1, metavar="Q", help="Quality below which a detector breaks down.")
    ] = 0.8,
    overwrite: OverwriteOption = False,
    plugin: PluginOption = None,
    quiet: QuietOption = False,
) -> None:
    """Write the contents of a results store as one HTML file, to view offline or to send by mail.

    With --against, print the paired differences between two stores over the detectors and scenes they share.
    """
    from ..core.output import check_target

    load_plugins(plugin)
    if against is not None:
        _compare(store, against, output, detectors, scenes, overwrite)
        return
    output = output or Path("report.html")
    check_target(output, overwrite)

    from ..benchmark.analysis.report_contents import fill_report, newest_runs
    from ..benchmark.analysis.sensitivity import read_sweep_table
    from ..benchmark.store.writer import Store
    from ..reports.gate_json import read_gate
    from ..reports.html_report import write_report

    tables = [line for path in sweep or () for line in read_sweep_table(path, level=level)]
    with Store(store, must_exist=True) as opened:
        filled = fill_report(
            opened,
            newest_runs(opened, detector=detectors, scene=scenes),
            title=title or f"Results of {store.name}",
            rank_by=index,
            gate=None if gate is None else read_gate(gate),
            sensitivities=tables,
            level=level,
        )
    size = write_report(filled, output, level=level, overwrite=overwrite)
    messages(quiet).print(f"{output}: {size / 1e6:.1f} MB, {counted(len(filled.scenes), 'scene')} drawn", markup=False)


def _compare(
    one: Path, two: Path, output: Path | None, detectors: str | None, scenes: str | None, overwrite: bool
) -> None:
    from ..benchmark.analysis.comparison import compare_stores
    from ..benchmark.store.writer import Store
    from ..core.output import check_target, whole_file
    from ..reports.comparison_text import format_comparison

    form: Literal["table", "md", "csv"] = "table"
    if output is not None:
        endings: dict[str, Literal["md", "csv"]] = {".md": "md", ".csv": "csv"}
        if output.suffix.lower() not in endings:
            raise ParameterError(f"{output}: a comparison is written as .md or .csv")
        form = endings[output.suffix.lower()]
        check_target(output, overwrite)
    with Store(one, must_exist=True) as first, Store(two, must_exist=True) as second:
        result = compare_stores(first, second, detector=detectors, scene=scenes)
    print_result(format_comparison(result, "table"))
    if output is not None:
        with whole_file(output, overwrite=overwrite) as scratch:
            scratch.write_text(format_comparison(result, form) + "\n", encoding="utf-8")
    if not result.rows:
        raise typer.Exit(4)
