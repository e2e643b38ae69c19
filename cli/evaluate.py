"""``roofbench evaluate``: compare two footprint files."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from .options import FORMAT_HELP, EvaluatorOption, GsdOption, JoinGapsOption, OverwriteOption, QuietOption

__all__ = ["evaluate"]


def evaluate(
    detected: Annotated[
        str,
        typer.Argument(metavar="DETECTED", help="Detected footprints; 'FILE.gpkg|layername=NAME' names a layer."),
    ],
    reference: Annotated[
        str,
        typer.Argument(
            metavar="REFERENCE", help="Reference footprints, or a scene folder (its reference, area and pixel grid)."
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
    evaluation_area: Annotated[
        str | None,
        typer.Option(
            "--evaluation-area",
            metavar="FILE",
            help="Polygons inside which the reference is complete.",
        ),
    ] = None,
    building_id: Annotated[
        str | None,
        typer.Option(
            "--building-id", metavar="COLUMN", help="Reference column; footprints with the same value are one building."
        ),
    ] = None,
    join_gaps: JoinGapsOption = None,
    crs: Annotated[
        str | None,
        typer.Option(
            "--crs", metavar="CRS", help="CRS to assign to files whose CRS is missing or wrong, such as EPSG:25832."
        ),
    ] = None,
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
    overwrite: OverwriteOption = False,
    quiet: QuietOption = False,
) -> None:
    """Compare detected with reference footprints: 15 indices, and why each object counts as correct or wrong.

    Files may be GeoJSON, GeoPackage, Shapefile, FlatGeobuf or GeoParquet, in a projected CRS in metres.
    """
    from ..core.errors import InputError, UnsupportedError
    from ..evaluators.registry import ALL, all_evaluators, make_evaluator
    from ..reports.evaluation_text import format_evaluation, format_evaluations
    from ..scenes.geodata.common_place import place_warnings, reaches
    from ..scenes.geodata.vector_files import read_footprints, read_polygon

    chosen: dict[str, Any] = {"matching": matching, "area": area, "gsd": gsd, "minimum_area": minimum_area}
    given = {name: str(value) for name, value in chosen.items() if value is not None}
    every = evaluator == ALL
    if every and (verdicts is not None or plot is not None):
        raise InputError(f"verdicts= and plot= show one evaluator: leave them out, or evaluator={ALL}")
    scorers = all_evaluators(given) if every else [make_evaluator(evaluator, given)]
    _check_targets(verdicts, plot, inputs=(detected, reference, evaluation_area), overwrite=overwrite)
    if building_id is not None and join_gaps is not None:
        raise InputError("blocks of joined footprints have no building ids: set building_id= or join_gaps=, not both")
    found = read_footprints(detected, crs=crs)
    scene = None
    if Path(reference).is_dir():
        from ..scenes.folder import open_scene

        scene = open_scene(reference)
    if scene is not None:
        if scene.reference is None:
            raise InputError(f"{reference}: the scene has no reference footprints: name a vector file")
        if building_id is not None:
            raise InputError(
                f"{reference} is a scene with its own building ids: leave out building_id=, or name a vector file"
            )
        truth, boundary, grid = scene.reference, scene.area, scene.evaluation_grid
    else:
        truth, boundary, grid = read_footprints(reference, crs=crs, building_id=building_id), None, None
    if evaluation_area:
        boundary = read_polygon(evaluation_area, crs=crs, common_with=truth)
    if not quiet:
        for footprints in (found, truth):
            for repair in footprints.repairs[:10]:
                typer.echo(f"{footprints.source}: {repair}", err=True)
            if len(footprints.repairs) > 10:
                typer.echo(f"{footprints.source}: {len(footprints.repairs) - 10} more repaired or left out", err=True)
            if not len(footprints):
                typer.echo(f"{footprints.source}: no footprints", err=True)
        for warning in place_warnings(found, truth):
            typer.echo(warning, err=True)
    if evaluation_area and not any(reaches(boundary, footprints) for footprints in (found, truth)):
        raise InputError(
            f"{evaluation_area} holds none of the footprints, neither detected nor reference: "
            "check that it shows the same place in the CRS that it names"
        )
    if join_gaps is not None:
        truth = truth.joined(join_gaps)
    results = [scorer.evaluate(found, truth, area=boundary, grid=grid) for scorer in scorers]
    result, title = results[0], f"{_short(detected)} against {_short(reference)}"
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
    typer.echo(
        format_evaluations(results, form, title=title) if every else format_evaluation(result, form, title=title)
    )


def _check_targets(
    verdicts: Path | None, plot: Path | None, *, inputs: tuple[str | None, ...], overwrite: bool
) -> None:
    """Raise `OutputError` for any output that could not be written, before there is a first one."""
    from ..core.errors import OutputError
    from ..core.output import check_target
    from ..scenes.geodata.vector_files import output_driver, split_layer

    read = {os.path.realpath(split_layer(name)[0]) for name in inputs if name}
    for target in (verdicts, plot):
        if target is not None:
            check_target(target, overwrite)
            if os.path.realpath(target) in read:
                raise OutputError(f"{target} is an input of this comparison: name another file")
    if verdicts is not None:
        output_driver(verdicts)
    if plot is not None:
        from ..reports.figures import check_picture

        check_picture(plot)


def _short(path: str) -> str:
    """Return the last part of a path, with its layer."""
    return path.replace("\\", "/").rstrip("/").rpartition("/")[2]
