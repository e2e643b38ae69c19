"""``roofbench scenes``: make, import, check and show scenes, the folders that everything else runs on."""

from __future__ import annotations

import glob
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from ..core.errors import InputError
from . import scenes_make

__all__ = ["app"]

app = typer.Typer(
    name="scenes",
    help="Make, import, check and show scenes.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)

app.command("make")(scenes_make.make)
app.command("list")(scenes_make.list_)

_POINT_ENDINGS = (".las", ".laz")
_IMAGE_ENDINGS = (".tif", ".tiff", ".vrt", ".jp2", ".png", ".jpg", ".jpeg", ".img")


@app.command("import")
def import_(
    output: Annotated[Path, typer.Option("--output", "-o", help="Scene folder to make.")],
    files: Annotated[
        list[str] | None,
        typer.Argument(help="Point files (.las, .laz) and orthoimages (.tif, .jp2, ...), sorted by their ending."),
    ] = None,
    points: Annotated[
        list[str] | None, typer.Option(help="LAS, LAZ or COPC file or pattern; may be given several times.")
    ] = None,
    ortho: Annotated[list[str] | None, typer.Option(help="Orthoimage or pattern; several are mosaicked.")] = None,
    dem: Annotated[
        list[str] | None, typer.Option(help="Bare-earth elevation; derived from the points when not given.")
    ] = None,
    reference: Annotated[
        str | None, typer.Option(help="Reference footprints, any vector format; FILE|layername=NAME for a layer.")
    ] = None,
    area: Annotated[str | None, typer.Option(help="Polygons inside which the reference is complete.")] = None,
    crs: Annotated[str | None, typer.Option(help="CRS of files that name none, for instance EPSG:25832.")] = None,
    bands: Annotated[
        str | None, typer.Option(help="Bands of the image in order, e.g. red,green,blue,nir; - skips one.")
    ] = None,
    gsd: Annotated[float | None, typer.Option(help="Cell size of the orthoimage, m; default: its own.")] = None,
    dem_cell: Annotated[float | None, typer.Option(help="Cell size of the DEM, m; default: its own, or 1 m.")] = None,
    ground_filter: Annotated[
        str | None,
        typer.Option(help="Derive the DEM by this filter, opening or cloth; default: ground points, else opening."),
    ] = None,
    building_id: Annotated[
        str | None, typer.Option(help="Column of the reference: footprints of one value are one building.")
    ] = None,
    reference_from_class: Annotated[
        bool, typer.Option("--reference-from-class", help="Derive the reference from points of class 6 (building).")
    ] = False,
    ortho_from_points: Annotated[
        bool, typer.Option("--ortho-from-points", help="Derive the orthoimage from coloured points.")
    ] = False,
    as_rectangles: Annotated[
        bool, typer.Option("--as-rectangles", help="Decompose the reference into rectangles with a common building id.")
    ] = False,
    join_gaps: Annotated[
        float | None, typer.Option(help="Join reference footprints over gaps below this, m: houses of a row to blocks.")
    ] = None,
    extent: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option("--extent", "--clip", help="Keep only xmin ymin xmax ymax, metres."),
    ] = None,
    name: Annotated[str | None, typer.Option(help="Name of the scene; default: that of the folder.")] = None,
    source: Annotated[str | None, typer.Option(help="Where the data come from, for the manifest.")] = None,
    licence: Annotated[str | None, typer.Option(help="Licence of the data, for the manifest.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the folder if it exists.")] = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", "-q", help="Do not tell what was assigned, mended or derived.")
    ] = False,
) -> None:
    """Make a scene folder from point files, orthoimages, footprints.

    Example: roofbench scenes import tiles/*.laz --crs EPSG:28992 --reference register.gpkg -o delft
    """
    from ..scenes.importing.scene_import import import_scene

    loose_points, loose_images = _sorted_by_ending(_expanded(files))
    with _progress() as (note, progress):
        scene = import_scene(
            output,
            points=[*_expanded(points), *loose_points],
            ortho=[*_expanded(ortho), *loose_images],
            dem=_expanded(dem),
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
            overwrite=overwrite,
            note=None if quiet else note,
            progress=progress,
        )
    typer.echo(f"{output}: scene {scene.name!r} with {', '.join(scene.holdings)}")


class _Format(StrEnum):
    table = "table"
    json = "json"


@app.command()
def check(
    scene: Annotated[Path, typer.Argument(help="Scene folder.")],
    output_format: Annotated[_Format, typer.Option("--format", help="How to print the facts.")] = _Format.table,
    seal: Annotated[bool, typer.Option("--seal", help="Take edited files into the manifest.")] = False,
) -> None:
    """Check a scene folder and print what it holds; exit code 2 when something is wrong with it."""
    import json

    from ..scenes.checking import check_scene
    from ..scenes.folder import seal_scene

    for name in seal_scene(scene) if seal else ():
        typer.echo(f"- {name} differed and was taken into the manifest", err=True)
    report = check_scene(scene)
    if output_format is _Format.json:
        typer.echo(json.dumps({"facts": report.facts, "problems": report.problems}, indent=2))
    else:
        for part, facts in report.facts.items():
            typer.echo(part)
            width = max(map(len, facts), default=0)
            for key, value in facts.items():
                typer.echo(f"  {key.replace('_', ' '):<{width}}  {_told(key, value)}")
    for problem in report.problems:
        typer.echo(f"Error: {problem}", err=True)
    if report.problems:
        raise typer.Exit(2)


#: Unit of a fact, by the last word of its name.
_UNITS = {"density": "/m²", "gsd": "m", "height": "m", "width": "m", "area": "m²"}


def _told(key: str, value: Any) -> str:
    """Return a fact as people read it."""
    unit = _UNITS.get(key.rpartition("_")[2], "")
    if isinstance(value, bool):
        return "yes" if value else "no"
    if key.endswith(("share", "coverage")):
        return f"{value:.1%}"
    if isinstance(value, dict):
        return ", ".join(f"{name}: {count}" for name, count in value.items())
    if isinstance(value, list):
        return (" to " if unit else ", ").join(_told("", item) for item in value) + (f" {unit}" if unit else "")
    if isinstance(value, float):
        value = f"{value:.10g}" if value.is_integer() else f"{value:.2f}"
    return f"{value} {unit}".rstrip()


@app.command()
def show(
    scene: Annotated[Path, typer.Argument(help="Scene folder.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Picture to write: .png, .pdf or .svg.")],
    dpi: Annotated[int, typer.Option(min=30, max=600, help="Resolution; each panel is 4.6 inches wide.")] = 130,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the picture if it exists.")] = False,
) -> None:
    """Draw a scene: orthoimage, height above ground and reference side by side."""
    from ..reports.figures import save_figure
    from ..reports.scene_map import scene_figure
    from ..scenes.folder import open_scene

    save_figure(scene_figure(open_scene(scene), dpi=dpi), output, overwrite=overwrite)
    typer.echo(output)


def _expanded(patterns: list[str] | None) -> list[str]:
    """Return the files of names and patterns, those of a pattern in alphabetical order."""
    found = []
    for pattern in patterns or []:
        if glob.has_magic(pattern) and not Path(pattern).exists():
            matches = sorted(glob.glob(pattern, recursive=True))
            if not matches:
                raise InputError(f"{pattern}: no file matches this pattern")
            found.extend(matches)
        else:
            found.append(pattern)
    return found


def _sorted_by_ending(files: list[str]) -> tuple[list[str], list[str]]:
    points = [file for file in files if file.lower().endswith(_POINT_ENDINGS)]
    images = [file for file in files if file.lower().endswith(_IMAGE_ENDINGS)]
    for file in files:
        if file not in points and file not in images:
            raise InputError(
                f"{file} ends neither as a point file (.las, .laz) nor as an image: name it with --points, --ortho, "
                "--dem, --reference or --area"
            )
    return points, images


@contextmanager
def _progress() -> Iterator[tuple[Callable[[str], None], Callable[[int, int], None] | None]]:
    """Yield what tells a note and what moves a bar; there is a bar only when standard error is a terminal."""
    if not sys.stderr.isatty():
        yield (lambda sentence: typer.echo(f"- {sentence}", err=True)), None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task: Any = None

        def move(done: int, total: int) -> None:
            nonlocal task
            if task is None:
                task = bar.add_task("reading points", total=total)
            bar.update(task, completed=done, visible=done < total)

        yield (lambda sentence: bar.console.print(f"- {sentence}", markup=False, highlight=False, soft_wrap=True)), move
