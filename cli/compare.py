"""``roofbench compare``: two detections of one place, paired."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import typer

from .console import print_result
from .evaluation_in_parts import InParts, compare_in_parts, is_large
from .footprint_inputs import print_problems, read_truth, short_name
from .options import (
    FORMAT_HELP,
    BuildingIdOption,
    CrsOption,
    EvaluationAreaOption,
    EvaluatorOption,
    JoinGapsOption,
    OverwriteOption,
    PartsOption,
    QuietOption,
    RedrawsOption,
    ReferenceErrorOption,
    SchedulerOption,
)

__all__ = ["compare"]


def compare(
    first: Annotated[str, typer.Argument(metavar="A", help="Detected footprints; 'FILE.gpkg|layername=NAME'.")],
    second: Annotated[str, typer.Argument(metavar="B", help="Other detected footprints of the same place.")],
    reference: Annotated[
        str,
        typer.Argument(
            metavar="REFERENCE",
            help="Reference footprints, or a scene (folder or name): its reference, area and pixel grid.",
        ),
    ],
    evaluator: EvaluatorOption = None,
    evaluation_area: EvaluationAreaOption = None,
    building_id: BuildingIdOption = None,
    join_gaps: JoinGapsOption = None,
    crs: CrsOption = None,
    interval: Annotated[
        float, typer.Option("--interval", metavar="PERCENT", help="Level of the intervals of the differences.")
    ] = 95.0,
    reference_error: ReferenceErrorOption = None,
    redraws: RedrawsOption = None,
    form: Annotated[Literal["table", "json", "csv", "md"], typer.Option("--format", "-f", help=FORMAT_HELP)] = "table",
    verdicts: Annotated[
        Path | None,
        typer.Option(
            "--verdicts", metavar="FILE", help="Vector file for what each finds and why (.gpkg: three layers)."
        ),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", metavar="FILE", help="Map of what only one finds (.png, .svg, .pdf).")
    ] = None,
    parts: PartsOption = None,
    scheduler: SchedulerOption = None,
    overwrite: OverwriteOption = False,
    quiet: QuietOption = False,
) -> None:
    """Compare two detections of one place: what only one of them finds, and by how much each index differs.

    Differences are B - A, with the interval of a paired bootstrap over connected groups of objects; the objects that
    only one finds are tested by McNemar's exact test. Two results stores are compared by 'roofbench report --against'.
    """
    from ..core.errors import InputError, ParameterError, UnsupportedError
    from ..evaluators.registry import ALL, DEFAULT, make_evaluator
    from ..evaluators.uncertainty.paired import compare as compared
    from ..evaluators.uncertainty.redrawn import REDRAWS, redraw_differences, require_error
    from ..reports.format import shortened
    from ..reports.pair_text import format_pair
    from ..reports.verdict_outputs import check_targets
    from ..scenes.geodata.vector_files import read_footprints

    if evaluator == ALL:
        raise ParameterError("two detections are compared by one evaluator at a time: name it by evaluator=")
    if building_id is not None and join_gaps is not None:
        raise InputError("blocks of joined footprints have no building ids: set building_id= or join_gaps=, not both")
    if redraws is not None and reference_error is None:
        raise ParameterError("redraws= needs reference_error=, the digitising error in metres")
    if reference_error is not None:
        require_error(reference_error)
    check_targets(verdicts, plot, inputs=(first, second, reference, evaluation_area), overwrite=overwrite)
    names = (short_name(first), short_name(second), short_name(reference))
    whole = {
        "evaluation_area=": evaluation_area,
        "join_gaps=": join_gaps,
    }
    needs = [name for name, value in whole.items() if value is not None]
    asked = "parts=" if parts is not None else "scheduler=" if scheduler is not None else None
    if asked and needs:
        raise InputError(f"{needs[0]} needs whole files in memory: leave it out, or leave out {asked}")
    paths = first, second, reference
    title = ", ".join(
        f"{role}: {shortened(name, 48)}" for role, name in zip(("A", "B", "reference"), names, strict=True)
    )
    if asked or (not needs and evaluator in (None, DEFAULT) and is_large(paths)):
        options = InParts(
            *(parts, scheduler, building_id, crs, verdicts, plot, overwrite, quiet),
            interval=interval,
            reference_error=reference_error,
            redraws=redraws,
        )
        result = compare_in_parts(make_evaluator(evaluator, {}), paths, options, title=title)
        print_result(format_pair(result, form, names=names))
        return
    one, two = (read_footprints(path, crs=crs) for path in (first, second))
    truth = read_truth(reference, building_id=building_id, crs=crs, evaluation_area=evaluation_area)
    print_problems([one, two], truth, evaluation_area=evaluation_area, quiet=quiet)
    if join_gaps is not None:
        truth = truth._replace(footprints=truth.footprints.joined(join_gaps))
    found = compared(
        one,
        two,
        truth.footprints,
        evaluator=evaluator or DEFAULT,
        area=truth.area,
        grid=truth.grid,
        interval=interval,
    )
    if reference_error is not None:
        sets = one, two, truth.footprints
        redrawn = redraw_differences(
            *sets,
            error=reference_error,
            evaluator=found.evaluator,
            area=truth.area,
            grid=truth.grid,
            redraws=redraws or REDRAWS,
        )
        found = replace(found, redrawn=redrawn)
    if found.fates is None and (verdicts is not None or plot is not None):
        raise UnsupportedError(
            f"the evaluator {found.evaluator.name!r} gives no verdicts: leave out verdicts= and plot="
        )
    if verdicts is not None:
        from ..reports.verdict_layers import write_pair

        write_pair(found, verdicts, overwrite=overwrite)
    if plot is not None:
        from ..reports.figures import save_figure
        from ..reports.pair_map import pair_figure

        save_figure(pair_figure(found, title=title, area=truth.area), plot, overwrite=overwrite)
    print_result(format_pair(found, form, names=names))
