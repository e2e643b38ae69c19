"""``roofbench report``: the one-file report of a results store, and two stores compared."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from ..core.errors import ParameterError
from .options import PluginOption, QuietOption, load_plugins, messages

if TYPE_CHECKING:
    from ..reports.report_data import Report

__all__ = ["report", "write_report"]


def report(
    words: Annotated[
        list[str],
        typer.Argument(metavar="STORE | compare A B", help="A results store; or 'compare' and two of them."),
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="HTML file (of compare: Markdown or CSV).")
    ] = None,
    detector: Annotated[
        str | None, typer.Option("--detector", "-d", help="Only matching labels.", metavar="PATTERN")
    ] = None,
    scene: Annotated[str | None, typer.Option("--scene", help="Only matching scenes.", metavar="PATTERN")] = None,
    rank_by: Annotated[str | None, typer.Option(help="Index that ranks, for instance pixel.quality.")] = None,
    title: Annotated[str | None, typer.Option(help="Title of the report.")] = None,
    sweep: Annotated[
        list[Path] | None, typer.Option(help="Table of 'roofbench sweep -o' to draw as well; repeat for more.")
    ] = None,
    gate: Annotated[Path | None, typer.Option(help="Result of 'roofbench gate --format json' to show.")] = None,
    level: Annotated[float, typer.Option(min=0, max=1, help="Quality at which a detector breaks down.")] = 0.8,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a file that exists.")] = False,
    plugin: PluginOption = None,
    quiet: QuietOption = False,
) -> None:
    """Write everything that a results store holds into one HTML file, to look at offline or to mail.

    With 'compare A B': the detectors and scenes that two stores have in common, as a table of paired differences.
    """
    from ..core.output import check_target

    load_plugins(plugin)
    if words[0] == "compare" and len(words) == 3:
        _compare(Path(words[1]), Path(words[2]), output, detector, scene, overwrite)
        return
    if len(words) != 1 or words[0] == "compare":
        raise ParameterError("name one results store, or 'compare' and two of them: roofbench report compare A B")
    if output is None:
        output = Path("report.html")
    check_target(output, overwrite)

    from ..benchmark.analysis.report_contents import fill_report, newest_runs
    from ..benchmark.analysis.sensitivity import read_sweep_table
    from ..benchmark.store.writer import Store
    from ..reports.gate_json import read_gate

    tables = [line for path in sweep or () for line in read_sweep_table(path, level=level)]
    with Store(words[0], must_exist=True) as opened:
        filled = fill_report(
            opened,
            newest_runs(opened, detector=detector, scene=scene),
            title=title or f"Results of {Path(words[0]).name}",
            rank_by=rank_by,
            gate=None if gate is None else read_gate(gate),
            sensitivities=tables,
            level=level,
        )
    size = write_report(filled, output, level=level, overwrite=overwrite)
    messages(quiet).print(f"{output}: {size / 1e6:.1f} MB, {len(filled.scenes)} scenes drawn", markup=False)


def write_report(filled: Report, path: Path, *, level: float = 0.8, overwrite: bool) -> int:
    """Write a report, whole or not at all; return its size in bytes."""
    from ..core.output import whole_file
    from ..reports.html_report import html_report

    content = html_report(filled, level=level).encode("utf-8", "xmlcharrefreplace")
    with whole_file(path, overwrite=overwrite) as scratch:
        scratch.write_bytes(content)
    return len(content)


def _compare(
    one: Path, two: Path, output: Path | None, detector: str | None, scene: str | None, overwrite: bool
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
        result = compare_stores(first, second, detector=detector, scene=scene)
    typer.echo(format_comparison(result, "table"))
    if output is not None:
        with whole_file(output, overwrite=overwrite) as scratch:
            scratch.write_text(format_comparison(result, form) + "\n", encoding="utf-8")
    if not result.rows:
        raise typer.Exit(4)
