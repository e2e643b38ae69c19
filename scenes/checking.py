"""Check of a scene folder: against its manifest, of its parts against each other, with facts about each.

A *fact* is a number or text about one part (``points``, ``image``, ``dem``, ``reference``, ``area``, ``scene``); a
*problem* is one sentence about something that makes results on this scene wrong.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ..core.errors import RoofbenchError
from .folder import FILES, changed_files, open_scene, read_manifest
from .geodata.crs import crs_label, same_crs
from .geodata.density import point_counts
from .geodata.footprints import Footprints
from .geodata.points import PointCloud
from .geodata.raster import Elevation, Grid, Image
from .scene import Scene

__all__ = ["SceneReport", "check_scene"]


@dataclass(frozen=True)
class SceneReport:
    """What a check found.

    Attributes
    ----------
    facts : mapping of str to mapping
        Part to name to value, values that JSON can hold.
    problems : tuple of str
        One sentence each; empty when the scene is sound.
    """

    facts: Mapping[str, Mapping[str, Any]]
    problems: tuple[str, ...]


def check_scene(path: str | os.PathLike[str]) -> SceneReport:
    """Read every file of a scene folder and report facts and problems.

    Raises
    ------
    InputError
        No scene folder, or a manifest that cannot be read: there is nothing to check then.
    """
    folder, manifest = read_manifest(path)
    scene = open_scene(path)
    problems = [
        f"{name} changed since the manifest was written: if that is intended, run "
        "'roofbench scenes check --update-checksums'"
        for name in changed_files(path)
    ]
    facts: dict[str, dict[str, Any]] = {"scene": _scene_facts(scene)}
    indexed = {tile["layer"] for tile in manifest.get("tiles", ())}
    for kind in scene.contents:
        try:
            facts[kind], found = _part(kind, scene)
            problems.extend(found)
            # The CRS of tiles was checked, or given, when they were indexed.
            if kind not in indexed:
                problems.extend(_crs_problems(folder / FILES[kind], kind, scene.crs))
        except RoofbenchError as error:
            problems.append(str(error))
    if not {"points", "image"} & set(scene.contents):
        problems.append(f"{folder} holds neither points nor an orthoimage: no detector can run on it")
    for kind, text in manifest.get("derived", {}).items():
        facts.setdefault(kind, {})["derived"] = text
    return SceneReport(facts, tuple(problems))


def _part(kind: str, scene: Scene) -> tuple[dict[str, Any], list[str]]:
    """Return facts and problems of one part of a scene."""
    if kind == "points" and scene.points is not None:
        return _points(scene.points, scene)
    if kind == "image" and scene.image is not None:
        return _image(scene.image, scene)
    if kind == "dem" and scene.dem is not None:
        return _dem(scene.dem, scene)
    if kind == "reference" and scene.reference is not None:
        return _reference(scene.reference, scene)
    area = float(shapely.area(scene.area)) if scene.area is not None else 0.0
    fits = scene.area is not None and bool(shapely.intersects(scene.area, shapely.box(*scene.extent)))
    return {"area": area, "share": area / _size(scene)}, [] if fits else [_outside("area", scene)]


def _scene_facts(scene: Scene) -> dict[str, Any]:
    xmin, ymin, xmax, ymax = scene.extent
    facts: dict[str, Any] = {"name": scene.name, "crs": crs_label(scene.crs), "extent": list(scene.extent)}
    facts |= {"width": xmax - xmin, "height": ymax - ymin}
    return facts | {key: scene.facts[key] for key in ("source", "licence") if key in scene.facts}


def _points(cloud: PointCloud, scene: Scene) -> tuple[dict[str, Any], list[str]]:
    xmin, ymin, xmax, ymax = scene.extent
    inside = (cloud.x >= xmin) & (cloud.x <= xmax) & (cloud.y >= ymin) & (cloud.y <= ymax)
    grid = Grid.covering(scene.extent, 2.0)
    covered = np.count_nonzero(point_counts(cloud.x, cloud.y, grid)) / (grid.rows * grid.columns)
    facts: dict[str, Any] = {"count": len(cloud), "density": len(cloud) / _size(scene), "coverage": covered}
    if cloud.return_number is not None:
        facts["first_return_density"] = np.count_nonzero(cloud.return_number == 1) / _size(scene)
    if cloud.number_of_returns is not None and len(cloud):
        facts["multiple_return_share"] = np.count_nonzero(cloud.number_of_returns > 1) / len(cloud)
    if len(cloud):
        facts["height"] = [float(cloud.z.min()), float(cloud.z.max())]
    if cloud.classification is not None:
        codes, counts = np.unique(cloud.classification, return_counts=True)
        facts["classes"] = {str(code): int(count) for code, count in zip(codes, counts, strict=True)}
    facts["intensity"] = cloud.intensity is not None
    facts["colour"] = cloud.colour is not None
    problems = []
    if not len(cloud):
        problems.append(f"{FILES['points']} holds no points")
    elif inside.mean() < 0.99:
        problems.append(f"{FILES['points']}: {1 - inside.mean():.0%} of the points lie outside the extent of the scene")
    return facts, problems


def _image(image: Image, scene: Scene) -> tuple[dict[str, Any], list[str]]:
    facts: dict[str, Any] = {
        "gsd": image.grid.gsd,
        "bands": list(image.bands),
        "rows": image.grid.rows,
        "columns": image.grid.columns,
        "depth": image.values.dtype.name,
        "no_data_share": 0.0 if image.valid is None else float(1 - image.valid.mean()),
    }
    return facts, _coverage_problems("image", image.grid, scene)


def _dem(dem: Elevation, scene: Scene) -> tuple[dict[str, Any], list[str]]:
    known = dem.values[np.isfinite(dem.values)]
    facts: dict[str, Any] = {"gsd": dem.grid.gsd, "unknown_share": 1 - known.size / dem.values.size}
    problems = _coverage_problems("dem", dem.grid, scene)
    if known.size:
        facts["height"] = [float(known.min()), float(known.max())]
    else:
        problems.append(f"{FILES['dem']} holds no height (all NaN)")
    return facts, problems


def _reference(reference: Footprints, scene: Scene) -> tuple[dict[str, Any], list[str]]:
    facts: dict[str, Any] = {"footprints": len(reference), "buildings": len(np.unique(reference.building_codes))}
    problems = []
    if len(reference):
        facts["area"] = float(reference.areas.sum())
        facts["median_area"] = float(np.median(reference.areas))
        outside = ~shapely.intersects(reference.polygons, shapely.box(*scene.extent))
        if outside.all():
            problems.append(_outside("reference", scene))
        elif outside.any():
            problems.append(f"{FILES['reference']}: {np.count_nonzero(outside)} footprints lie outside the scene")
    problems.extend(f"{FILES['reference']}: {repair}" for repair in reference.repairs)
    return facts, problems


def _coverage_problems(kind: str, grid: Grid, scene: Scene) -> list[str]:
    box, own = shapely.box(*scene.extent), shapely.box(*grid.extent)
    share = shapely.area(shapely.intersection(box, own)) / shapely.area(box)
    if share == 0:
        return [_outside(kind, scene)]
    return [] if share > 0.99 else [f"{FILES[kind]} covers only {share:.0%} of the extent of the scene"]


def _crs_problems(file: Path, kind: str, expected: str | None) -> list[str]:
    found = _file_crs(file, kind)
    if found is None and expected is None:
        return []
    if found is None or expected is None or not same_crs(found, expected):
        return [f"{file.name} is in {crs_label(found)}, but the scene in {crs_label(expected)}"]
    return []


def _file_crs(file: Path, kind: str) -> str | None:
    if kind == "points":
        from .geodata.las_files import read_las_header

        return read_las_header(file).crs
    if kind in ("image", "dem"):
        from .geodata.raster_headers import read_raster_header

        return read_raster_header(file).crs
    from .geodata.vector_files import read_footprints

    return read_footprints(file).crs


def _outside(kind: str, scene: Scene) -> str:
    return f"{FILES[kind]} lies outside the extent of the scene, {list(scene.extent)}"


def _size(scene: Scene) -> float:
    xmin, ymin, xmax, ymax = scene.extent
    return (xmax - xmin) * (ymax - ymin)
