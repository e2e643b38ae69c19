"""The two real scenes, imported from the files as their publishers give them; skipped where they are not at hand."""

import os
from pathlib import Path

import numpy as np
import pytest
import shapely

import roofbench as rb
from roofbench.scenes.importing.request import ImportRequest
from roofbench.scenes.importing.scene_import import import_scene

SHARED = Path(os.environ.get("ROOFBENCH_SHARED") or Path(rb.__file__).parent.parent / "shared" / "scenes")
DELFT, IGN = SHARED / "delft-ahn3", SHARED / "ign-870200-colour"
pytestmark = pytest.mark.skipif(not DELFT.is_dir(), reason="the real scenes are not at hand")


@pytest.fixture(scope="module")
def delft(tmp_path_factory):
    return import_scene(
        tmp_path_factory.mktemp("real") / "delft",
        ImportRequest(
            points=sorted(DELFT.glob("*.laz")),
            crs="EPSG:28992",
            reference=DELFT / "bgt_pand_footprints.gpkg",
            building_id="identificatiebagpnd",
            area=DELFT / "evaluation_area.gpkg",
        ),
    )


@pytest.fixture(scope="module")
def ign(tmp_path_factory):
    return import_scene(
        tmp_path_factory.mktemp("real") / "ign",
        ImportRequest(
            points=sorted(IGN.glob("*.laz")),
            reference=IGN / "reference_from_class.gpkg",
            ortho_from_points=True,
        ),
    )


def test_both_tiles_of_delft_are_there(delft):
    assert len(delft.points) == 848_942
    assert delft.extent == (84808.0, 447412.0, 85073.0, 447642.0)
    assert delft.crs == "EPSG:28992"
    assert len(delft.reference) == 160
    assert len(np.unique(delft.reference.building_ids)) == 160


def test_the_dem_of_delft_lies_on_its_ground_points(delft):
    cloud = delft.points
    ground = cloud.classification == 2
    off = cloud.z[ground] - delft.dem.sample(cloud.x[ground], cloud.y[ground])
    assert abs(np.median(off)) < 0.01
    assert np.percentile(np.abs(off), 90) < 0.25
    roof = cloud.classification == 6
    assert np.percentile(cloud.z[roof] - delft.dem.sample(cloud.x[roof], cloud.y[roof]), 5) > 2.0


def test_the_register_of_delft_covers_the_building_points_in_its_area(delft):
    cloud = delft.points
    roof = (cloud.classification == 6) & shapely.contains_xy(delft.area, cloud.x, cloud.y)
    blocks = shapely.union_all(shapely.buffer(delft.reference.polygons, 0.5))
    shapely.prepare(blocks)
    assert shapely.contains_xy(blocks, cloud.x[roof], cloud.y[roof]).mean() > 0.9


def test_the_image_of_the_french_village_shows_the_colours_of_its_points(ign):
    image, cloud = ign.image, ign.points
    assert image.bands == ("red", "green", "blue")
    assert image.grid.extent[0] <= ign.extent[0]
    assert image.grid.extent[3] >= ign.extent[3]
    index, inside = image.grid.cells(cloud.x, cloud.y)
    assert inside.all()
    for band in range(3):
        seen = image.values[band].ravel()[index] * 257.0
        assert np.corrcoef(seen, cloud.colour[:, band])[0, 1] > 0.9


def test_a_published_raster_of_the_same_points_has_the_same_place(ign):
    """No shift: the correlation with the publisher's 0.5 m raster falls when it is moved by a cell."""
    import rasterio

    with rasterio.open(IGN / "ortho_from_points.tif") as source:
        theirs, transform = source.read(2).astype(float), source.transform
    rows, columns = np.mgrid[6 : theirs.shape[0] - 6, 6 : theirs.shape[1] - 6]
    x, y = transform.c + (columns + 0.5) * transform.a, transform.f + (rows + 0.5) * transform.e
    green = rb.Elevation(ign.image.values[1].astype(np.float32), ign.image.grid)

    def agreement(east, north):
        return np.corrcoef(green.sample(x + east, y + north).ravel(), theirs[rows, columns].ravel())[0, 1]

    centred = agreement(0, 0)
    assert centred > 0.9
    for shift in (0.25, -0.25):
        assert agreement(shift, 0) < centred
        assert agreement(0, shift) < centred


def test_the_outlines_of_class_6_are_where_the_register_has_buildings(delft, tmp_path):
    derived = import_scene(
        tmp_path / "derived",
        ImportRequest(points=sorted(DELFT.glob("*.laz")), crs="EPSG:28992", reference_from_class=True),
    )
    assert "traced around the points of class 6" in derived.facts["derived"]["reference"]
    ours = shapely.intersection(shapely.union_all(derived.reference.polygons), delft.area)
    theirs = shapely.intersection(shapely.union_all(delft.reference.polygons), delft.area)
    assert shapely.intersection(ours, theirs).area / shapely.union(ours, theirs).area > 0.75
