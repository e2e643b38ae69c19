"""Spooled scenes: scenes of this process written to a temporary file, so that other processes can open them.

A scene folder rounds coordinates to the resolution of LAZ. A spooled scene is a numpy archive of the unchanged arrays;
it is private to one run and deleted after it.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.points import PointCloud
from ...scenes.geodata.raster import Elevation, Grid, Image
from ...scenes.scene import Layers, Scene

__all__ = ["measured_arrays", "measured_layers", "read_spooled", "spool"]


def measured_arrays(scene: Scene) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return points, image and DEM as arrays by name, and what JSON holds of them: extent, CRS, bands, grids."""
    arrays: dict[str, Any] = {}
    about: dict[str, Any] = {"extent": scene.extent, "crs": scene.crs}
    if (cloud := scene.points) is not None:
        for field in dataclasses.fields(cloud):
            if (column := getattr(cloud, field.name)) is not None:
                arrays[f"points.{field.name}"] = column
    if (image := scene.image) is not None:
        arrays["image.values"] = image.values
        if image.valid is not None:
            arrays["image.valid"] = image.valid
        about["image"] = {"bands": image.bands, "grid": dataclasses.astuple(image.grid)}
    if (dem := scene.dem) is not None:
        arrays["dem.values"] = dem.values
        about["dem"] = dataclasses.astuple(dem.grid)
    return about, arrays


def measured_layers(about: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Layers:
    """Return the layers of a scene from what `measured_arrays` returned."""
    columns = {key.partition(".")[2]: value for key, value in arrays.items() if key.startswith("points.")}
    layers: Layers = {"points": PointCloud(**columns) if columns else None}
    if "image" in about:
        grid = Grid(*about["image"]["grid"])
        layers["image"] = Image(arrays["image.values"], tuple(about["image"]["bands"]), grid, arrays.get("image.valid"))
    if "dem" in about:
        layers["dem"] = Elevation(arrays["dem.values"], Grid(*about["dem"]))
    return layers


def spool(scene: Scene, folder: Path) -> Path:
    """Write a scene into `folder` and return the file."""
    file = folder / f"{scene.content_hash[:24]}.npz"
    about, arrays = measured_arrays(scene)
    about["content_hash"] = scene.content_hash
    if (reference := scene.reference) is not None:
        blobs = shapely.to_wkb(reference.polygons)
        arrays["reference.wkb"] = np.frombuffer(b"".join(blobs), dtype=np.uint8)
        arrays["reference.lengths"] = np.array([len(blob) for blob in blobs], dtype=np.int64)
        arrays["reference.ids"] = reference.ids
        if reference.building_ids is not None:
            labels = reference.building_ids
            arrays["reference.building_ids"] = labels.astype(str) if labels.dtype.kind == "O" else labels
    if scene.area is not None:
        about["area"] = shapely.to_wkt(scene.area, rounding_precision=-1)
    with file.open("wb") as target:
        np.savez(target, about=np.array(json.dumps(about)), **arrays)
    return file


def read_spooled(file: Path, *, name: str) -> Scene:
    """Open a spooled scene."""
    with np.load(file, allow_pickle=False) as archive:
        about = json.loads(str(archive["about"]))
        arrays = {key: archive[key] for key in archive.files if key != "about"}
    layers = measured_layers(about, arrays)
    if "reference.wkb" in arrays:
        ends = np.cumsum(arrays["reference.lengths"])
        whole = arrays["reference.wkb"].tobytes()
        blobs = [whole[end - length : end] for end, length in zip(ends, arrays["reference.lengths"], strict=True)]
        polygons = np.empty(len(blobs), dtype=object)
        polygons[:] = shapely.from_wkb(blobs)
        layers["reference"] = Footprints(
            polygons=polygons,
            building_ids=arrays.get("reference.building_ids"),
            crs=about["crs"],
            ids=arrays["reference.ids"],
            source=name,
        )
    if "area" in about:
        layers["area"] = shapely.from_wkt(about["area"])
    return Scene(name, about["extent"], crs=about["crs"], content_hash=about["content_hash"], **layers)
