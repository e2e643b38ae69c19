"""Every detector stands on the same ground, however much of the DEM is there."""

import dataclasses
import functools

import numpy as np
import pytest

import roofbench as rb
from roofbench.scenes.builtin import hamlet

DETECTORS = ("ndsm", "mpp", "original", "improved")


@functools.cache
def whole():
    return hamlet(1)


def dem_of(kind):
    """The DEM of the hamlet, of which a part is known."""
    dem = whole().dem
    rows, columns = dem.values.shape
    known = {
        "complete": np.s_[:, :],
        "half": np.s_[:, : columns // 2],
        "1 %": np.s_[20 : 20 + rows // 10, 30 : 30 + columns // 10],
        "NaN": np.s_[:0],
    }
    if kind == "none":
        return None
    if kind == "half the raster":
        return rb.Elevation(dem.values[:, : columns // 2], dataclasses.replace(dem.grid, columns=columns // 2))
    values = np.full_like(dem.values, np.nan)
    values[known[kind]] = dem.values[known[kind]]
    return rb.Elevation(values, dem.grid)


@functools.cache
def found(detector, kind):
    scene = whole()
    place = rb.Scene(scene.name, scene.extent, crs=scene.crs, points=scene.points, image=scene.image, dem=dem_of(kind))
    return rb.detect(place, detector)


@pytest.mark.parametrize("detector", DETECTORS)
@pytest.mark.parametrize("kind", ["half", "half the raster", "1 %", "NaN", "none"])
def test_a_detector_finds_as_many_buildings_however_much_of_the_dem_is_there(detector, kind):
    footprints, complete = found(detector, kind), found(detector, "complete")
    assert abs(len(footprints) - len(complete)) <= 1
    before, now = (rb.evaluate(each, whole().reference).object.quality for each in (complete, footprints))
    assert now > before - 0.05
    (note,) = footprints.metadata["notes"]
    assert "filtered from the points" in note
    assert not complete.metadata.get("notes")
