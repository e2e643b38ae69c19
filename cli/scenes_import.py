"""``roofbench scenes import``: a scene folder from files."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .console import messages, print_next, print_result
from .options import GsdOption, JoinGapsOption, OverwriteOption, QuietOption
from .progress import import_progress
from .scenes_index import report_index

if TYPE_CHECKING:
    from ..scenes.importing.request import ImportRequest

__all__ = ["import_"]


def import_(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FOLDER", help="Scene folder to make.")],
    files: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="FILE",
            help="Point files (.las, .laz) and orthoimages (.tif, .jp2, ...).",
        ),
    ] = None,
    points: Annotated[
        list[str] | None,
        typer.Option("--points", metavar="FILE", help="LAS, LAZ or COPC file or pattern; repeat for more."),
    ] = None,
    dsm: Annotated[
        list[str] | None,
        typer.Option(
            "--dsm", metavar="FILE", help="Digital surface model instead of points, one point a cell; repeat for more."
        ),
    ] = None,
    ortho: Annotated[
        list[str] | None,
        typer.Option("--ortho", metavar="FILE", help="Orthoimage or pattern; repeat for more, which are mosaicked."),
    ] = None,
    nir: Annotated[
        list[str] | None,
        typer.Option(
            "--nir", metavar="FILE", help="Near infrared (or colour infrared) of the orthoimage as a file of its own."
        ),
    ] = None,
    dem: Annotated[
        list[str] | None,
        typer.Option(
            "--dem", "--dtm", metavar="FILE", help="Bare-earth elevation; derived from the points by default."
        ),
    ] = None,
    reference: Annotated[
        str | None,
        typer.Option(
            "--reference",
            metavar="FILE",
            help="Reference footprints in any vector format; 'FILE|layername=NAME' names a layer.",
        ),
    ] = None,
    area: Annotated[
        str | None,
        typer.Option("--area", metavar="FILE", help="Polygons inside which the reference is complete."),
    ] = None,
    crs: Annotated[
        str | None,
        typer.Option(
            "--crs", metavar="CRS", help="CRS to assign to files whose CRS is missing or wrong, such as EPSG:25832."
        ),
    ] = None,
    bands: Annotated[
        str | None,
        typer.Option(
            "--bands",
            metavar="LIST",
            help="Bands of the image in order, such as red,green,blue,nir; - skips one.",
        ),
    ] = None,
    gsd: GsdOption = None,
    dem_cell: Annotated[
        float | None, typer.Option("--dem-cell", metavar="M", help="Cell size of the DEM in metres [its own, or 1].")
    ] = None,
    ground_filter: Annotated[
        str | None,
        typer.Option(
            "--ground-filter",
            metavar="NAME",
            help="Derive the DEM by this filter, opening or cloth [ground points where classified, else opening].",
        ),
    ] = None,
    building_id: Annotated[
        str | None,
        typer.Option(
            "--building-id", metavar="COLUMN", help="Reference column; footprints with the same value are one building."
        ),
    ] = None,
    reference_from_class: Annotated[
        bool, typer.Option("--reference-from-class", help="Derive the reference from points of class 6 (building).")
    ] = False,
    ortho_from_points: Annotated[
        bool, typer.Option("--ortho-from-points", help="Derive the orthoimage from coloured points.")
    ] = False,
    as_rectangles: Annotated[
        bool,
        typer.Option("--as-rectangles", help="Decompose the reference into rectangles with a common building id."),
    ] = False,
    join_gaps: JoinGapsOption = None,
    extent: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option("--extent", "--clip", metavar="XMIN YMIN XMAX YMAX", help="Keep only this extent, in metres."),
    ] = None,
    name: Annotated[
        str | None, typer.Option("--name", metavar="NAME", help="Name of the scene [name of the folder].")
    ] = None,
    source: Annotated[
        str | None, typer.Option("--source", metavar="TEXT", help="Source of the data, for the manifest.")
    ] = None,
    licence: Annotated[
        str | None, typer.Option("--licence", metavar="TEXT", help="Licence of the data, for the manifest.")
    ] = None,
    tiled: Annotated[
        bool,
        typer.Option("--tiled", help="Keep the files as they are and read them by window: for scenes of any size."),
    ] = False,
    overwrite: OverwriteOption = False,
    quiet: QuietOption = False,
) -> None:
    """Make a scene folder from point files, orthoimages and footprints.

    Example: roofbench scenes import tiles/*.laz --crs EPSG:28992 --reference register.gpkg -o delft
    """
    from ..scenes.importing.input_files import expanded, sorted_by_ending
    from ..scenes.importing.request import ImportRequest
    from ..scenes.importing.scene_import import import_scene

    loose_points, loose_images = sorted_by_ending(expanded(files or ()))
    request = ImportRequest(
        points=[*expanded(points or ()), *loose_points],
        ortho=[*expanded(ortho or ()), *loose_images],
        dsm=expanded(dsm or ()),
        nir=expanded(nir or ()),
        dem=expanded(dem or ()),
        reference=reference,
        area=area,
        crs=crs,
        bands=None if bands is None else [band.strip() for band in bands.split(",")],
        gsd=gsd,
        dem_cell=dem_cell,
        ground_filter=ground_filter,
        building_id=building_id,
        reference_from_class=reference_from_class,
        ortho_from_points=ortho_from_points,
        as_rectangles=as_rectangles,
        join_gaps=join_gaps,
        extent=extent,
        name=name,
        source=source,
        licence=licence,
    )
    if tiled:
        _import_tiles(output, request, overwrite, quiet)
        return
    with import_progress() as (note, progress):
        scene = import_scene(output, request, overwrite=overwrite, note=None if quiet else note, progress=progress)
    print_result(f"{output}: scene {scene.name!r} with {', '.join(scene.contents)}")
    print_next(messages(quiet), f"roofbench run {shlex.quote(str(output))}")


def _import_tiles(output: Path, request: ImportRequest, overwrite: bool, quiet: bool) -> None:
    from ..scenes.importing.tiled_import import import_tiles

    with import_progress() as (note, progress):
        found = import_tiles(
            output, request, overwrite=overwrite, note=None if quiet else note, progress=None if quiet else progress
        )
    report_index(output, found)
