"""Files that the reader of a page brings: each function writes some into a folder."""

from __future__ import annotations

import shutil
from pathlib import Path

import geopandas
import numpy as np
import rasterio
import shapely
from affine import Affine

import roofbench as rb
from roofbench.benchmark.suite import named_suite
from roofbench.core.package import FOLDER

__all__ = ["FILES"]

_DELFT = FOLDER / "scenes" / "data" / "delft"


def two_sets(folder: Path) -> None:
    """Write a register with the column ``bag_id``, and what was detected: once, in an old and in a new version."""
    scene = rb.open_scene(_DELFT)
    houses = scene.reference.polygons
    houses = houses[shapely.area(houses) > 25][:60]
    register = {"bag_id": [f"05031000{number:08d}" for number in range(len(houses))]}
    geopandas.GeoDataFrame(register, geometry=houses, crs=scene.crs).to_file(folder / "register.gpkg")
    shifted = shapely.transform(houses, lambda xy: xy + np.array([0.4, -0.2]))
    for name, share in (("detected", 0.9), ("old", 0.7), ("new", 0.9)):
        rb.write_footprints(
            rb.Footprints.of(shifted[: round(share * len(shifted))], crs=scene.crs), folder / f"{name}.gpkg"
        )


def tiles(folder: Path) -> None:
    """Write a folder of laser tiles, with an image, a register and the area where it is complete beside it."""
    (folder / "tiles").mkdir()
    shutil.copy(_DELFT / "points.laz", folder / "tiles" / "C_37EN1.laz")
    shutil.copy(_DELFT / "area.gpkg", folder / "complete.gpkg")
    scene = rb.open_scene(_DELFT)
    register = {"bag_id": [str(number) for number in range(len(scene.reference))]}
    geopandas.GeoDataFrame(register, geometry=scene.reference.polygons, crs=scene.crs).to_file(folder / "register.gpkg")
    west, south, east, north = scene.extent
    bands = np.random.default_rng(1).integers(30, 220, (3, round(north - south) * 2, round(east - west) * 2), np.uint8)
    # Made of its six numbers: rasterio's helper multiplies as newer versions of affine warn of.
    place = Affine(0.5, 0, west, 0, -0.5, north)
    with rasterio.open(
        folder / "dop.tif",
        "w",
        driver="GTiff",
        dtype="uint8",
        count=3,
        width=bands.shape[2],
        height=bands.shape[1],
        crs=scene.crs,
        transform=place,
    ) as image:
        image.write(bands)


def programs(folder: Path) -> None:
    """Write the footprints that somebody made for the scenes of the suite ``quick``, one file each, moved by 0.5 m."""
    (folder / "mine").mkdir()
    for recipe in named_suite("quick").scenes:
        reference = recipe.open().reference
        moved = shapely.transform(reference.polygons, lambda xy: xy + 0.5)
        rb.write_footprints(rb.Footprints.of(moved, crs=reference.crs), folder / "mine" / f"{recipe.name}.gpkg")


def plugin(folder: Path) -> None:
    """Write ``threshold.py``, the detector that the page on writing one shows."""
    page = (FOLDER / "docs" / "guide" / "detector.md").read_text(encoding="utf-8")
    code = page.partition("```python\n")[2].partition("\n\nscene = ")[0]
    (folder / "threshold.py").write_text(f'"""Everything high is a building."""\n\n{code}\n')


def suite(folder: Path) -> None:
    """Write ``my-city.toml`` as the page on running detectors shows it, with the scene folder that it names."""
    page = (FOLDER / "docs" / "guide" / "running.md").read_text(encoding="utf-8")
    (folder / "my-city.toml").write_text(page.partition("```toml\n")[2].partition("```")[0])
    rb.save_scene(rb.open_scene(_DELFT.parent / "ign"), folder / "centre")
    plugin(folder)


FILES = {"two-sets": two_sets, "tiles": tiles, "programs": programs, "plugin": plugin, "suite": suite}
