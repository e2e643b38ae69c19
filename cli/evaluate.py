"""``roofbench evaluate``: compare two footprint files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from .console import print_result
from .evaluation_in_parts import InParts, evaluate_in_parts, is_large
from .footprint_inputs import print_problems, read_truth, short_name
from .options import (
    FORMAT_HELP,
    BuildingIdOption,
    CrsOption,
    EvaluationAreaOption,
    EvaluatorOption,
    GsdOption,
    IntervalOption,
    JoinGapsOption,
    OverwriteOption,
    PartsOption,
    QuietOption,
    RedrawsOption,
    ReferenceErrorOption,
    SchedulerOption,
)

if TYPE_CHECKING:
    from ..evaluators.uncertainty.summary import Uncertainty

__all__ = ["evaluate"]


def evaluate(
    detected: Annotated[
        str,
        typer.Argument(metavar="DETECTED", help="Detected footprints; 'FILE.gpkg|layername=NAME' names a layer."),
    ],
    reference: Annotated[
        str,
        typer.Argument(
            metavar="REFERENCE",
            help="Reference footprints, or a scene (folder or name): its reference, area and pixel grid.",
        ),
    ],
    evaluator: EvaluatorOption = None,
    matching: Annotated[
        Literal["nearest", "one-pass", "overlap"] | None,
        typer.Option("--matching", help="How detections and references are matched [nearest]."),
    ] = None,
    area: Annotated[
        Literal["exact", "pixels"] | None,
        typer.Option("--area", help="Measure areas by polygon overlay or by pixel centres [exact]."),
    ] = None,
    gsd: GsdOption = None,
    minimum_area: Annotated[
        float | None,
        typer.Option("--minimum-area", metavar="M2", help="Leave out references smaller than this, in m2."),
    ] = None,
    evaluation_area: EvaluationAreaOption = None,
    building_id: BuildingIdOption = None,
    join_gaps: JoinGapsOption = None,
    crs: CrsOption = None,
    interval: IntervalOption = None,
    reference_error: ReferenceErrorOption = None,
    redraws: RedrawsOption = None,
    form: Annotated[Literal["table", "json", "csv", "md"], typer.Option("--format", "-f", help=FORMAT_HELP)] = "table",
    verdicts: Annotated[
        Path | None,
        typer.Option(
            "--verdicts", metavar="FILE", help="Vector file for the verdicts and their reasons (.gpkg: two layers)."
        ),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", metavar="FILE", help="Map of the verdicts (.png, .svg, .pdf).")
    ] = None,
    parts: PartsOption = None,
    scheduler: SchedulerOption = None,
    overwrite: OverwriteOption = False,
    quiet: QuietOption = False,
) -> None:
    """Compare detected with reference footprints: 15 indices, and why each object counts as correct or wrong.

    Files may be GeoJSON, GeoPackage, Shapefile, FlatGeobuf or GeoParquet, in a projected CRS in metres, or label images
    (GeoTIFF with one id per building, or a mask whose components are the buildings).
    """
    from ..core.errors import InputError, ParameterError, UnsupportedError
    from ..evaluators.registry import ALL, DEFAULT, all_evaluators, make_evaluator
    from ..reports.evaluation_text import format_evaluation, format_evaluations
    from ..reports.verdict_outputs import check_targets
    from ..scenes.geodata.vector_files import read_footprints

    chosen: dict[str, Any] = {"matching": matching, "area": area, "gsd": gsd, "minimum_area": minimum_area}
    given = {name: str(value) for name, value in chosen.items() if value is not None}
    every = evaluator == ALL
    if every and (verdicts is not None or plot is not None):
        raise InputError(f"verdicts= and plot= show one evaluator: leave them out, or evaluator={ALL}")
    scorers = all_evaluators(given) if every else [make_evaluator(evaluator, given)]
    check_targets(verdicts, plot, inputs=(detected, reference, evaluation_area), overwrite=overwrite)
    if building_id is not None and join_gaps is not None:
        raise InputError("blocks of joined footprints have no building ids: set building_id= or join_gaps=, not both")
    if redraws is not None and reference_error is None:
        raise ParameterError("redraws= needs reference_error=, the digitising error in metres")
    whole = {
        "evaluation_area=": evaluation_area,
        "join_gaps=": join_gaps,
        f"evaluator={ALL}": every or None,
    }
    needs = [name for name, value in whole.items() if value is not None]
    title = f"{short_name(detected)} against {short_name(reference)}"
    asked = "parts=" if parts is not None else "scheduler=" if scheduler is not None else None
    if asked and needs:
        raise InputError(f"{needs[0]} needs whole files in memory: leave it out, or leave out {asked}")
    if asked or (not needs and evaluator in (None, DEFAULT) and is_large((detected, reference))):
        options = InParts(
            *(parts, scheduler, building_id, crs, verdicts, plot, overwrite, quiet),
            interval=interval,
            reference_error=reference_error,
            redraws=redraws,
        )
        result, doubt = evaluate_in_parts(scorers[0], (detected, reference), options, title=title)
        print_result(format_evaluation(result, form, title=title, uncertainty=doubt))
        return
    found = read_footprints(detected, crs=crs)
    given_truth = read_truth(reference, building_id=building_id, crs=crs, evaluation_area=evaluation_area)
    print_problems([found], given_truth, evaluation_area=evaluation_area, quiet=quiet)
    truth, boundary, grid = given_truth
    if join_gaps is not None:
        truth = truth.joined(join_gaps)
    results = [scorer.evaluate(found, truth, area=boundary, grid=grid) for scorer in scorers]
    result = results[0]
    doubts: list[Uncertainty | None] = [None] * len(results)
    if interval is not None or reference_error is not None:
        from ..evaluators.uncertainty.summary import uncertainty_of

        doubts = [
            uncertainty_of(
                result,
                (found, truth),
                interval=interval,
                reference_error=reference_error,
                redraws=redraws,
                area=boundary,
                grid=grid,
            )
            for result in results
        ]
    if verdicts is not None or plot is not None:
        objects = result.verdicts
        if objects is None:
            raise UnsupportedError(
                f"the evaluator {scorers[0].name!r} gives no verdicts: leave out verdicts= and plot="
            )
        if verdicts is not None:
            from ..reports.verdict_layers import write_verdicts

            write_verdicts(objects, verdicts, overwrite=overwrite)
        if plot is not None:
            from ..reports.figures import save_figure
            from ..reports.verdict_map import verdict_figure

            save_figure(verdict_figure(result, title=title, area=boundary), plot, overwrite=overwrite)
    print_result(
        format_evaluations(results, form, title=title, uncertainties=doubts)
        if every
        else format_evaluation(result, form, title=title, uncertainty=doubts[0])
    )
