"""Label images and masks are footprints."""

import json

import numpy as np
import pytest
import rasterio
import shapely
from harness.command_line import roofbench

import roofbench as rb
from roofbench.core.errors import InputError

LABELS = np.array(
    [
        [7, 7, 0, 0, 9, 9],
        [7, 7, 0, 3, 9, 9],
        [0, 0, 7, 3, 0, 0],
        [0, 0, 0, 3, 3, 3],
    ],
    dtype=np.uint16,
)


def write(path, values, *, georeferenced=True, **more):
    bands = np.atleast_3d(values.T).T
    options = {"width": bands.shape[2], "height": bands.shape[1], "count": len(bands), "dtype": bands.dtype, **more}
    if georeferenced:
        options |= {"crs": "EPSG:25832", "transform": rasterio.Affine(0.5, 0, 500_000, 0, -0.5, 5_500_000)}
    with rasterio.open(path, "w", driver="GTiff", **options) as file:
        file.write(bands)
    return path


def test_each_id_is_a_building_also_in_parts(tmp_path):
    found = rb.read_footprints(write(tmp_path / "labels.tif", LABELS))
    assert found.crs == "EPSG:25832"
    assert found.attributes["label"].tolist() == [3, 7, 9]
    assert found.areas.tolist() == [5 * 0.25, 5 * 0.25, 4 * 0.25]
    assert found.polygons[1].geom_type == "MultiPolygon"
    assert found.polygons[2].equals(shapely.box(500_002, 5_499_999, 500_003, 5_500_000))


def test_the_components_of_a_mask_are_buildings(tmp_path):
    found = rb.read_footprints(write(tmp_path / "mask.tif", (LABELS > 0).astype(np.uint8) * 255))
    # The upper 7 meets the lower one at a corner only, and is apart; the lower 7, the 3 and the 9 share edges.
    assert sorted(found.areas.tolist()) == [4 * 0.25, 10 * 0.25]


def test_cells_without_data_are_background(tmp_path):
    found = rb.read_footprints(write(tmp_path / "labels.tif", LABELS, nodata=9))
    assert found.attributes["label"].tolist() == [3, 7]
    values = np.where(LABELS == 9, np.nan, LABELS).astype(np.float32)
    assert len(rb.read_footprints(write(tmp_path / "floats.tif", values))) == 2


def test_label_images_stand_on_either_side(tmp_path):
    labels = write(tmp_path / "labels.tif", LABELS)
    write(tmp_path / "mask.tif", (LABELS > 0).astype(np.uint8))
    rb.write_footprints(rb.read_footprints(labels), tmp_path / "same.gpkg")
    for names in (("labels.tif", "same.gpkg"), ("same.gpkg", "labels.tif")):
        result = json.loads(roofbench("evaluate", *names, "-f", "json", folder=tmp_path).stdout)
        assert result["object"]["quality"] == 1
        assert result["pixel"]["quality"] == pytest.approx(1)
    result = json.loads(roofbench("evaluate", "mask.tif", "labels.tif", "-f", "json", folder=tmp_path).stdout)
    assert result["counts"]["detected"] == 2
    assert result["counts"]["false_positives"] == 0


@pytest.mark.parametrize(
    ("values", "more", "message"),
    [
        (LABELS, {"georeferenced": False}, "no affine transform"),
        (np.stack([LABELS] * 3), {}, "has 3 bands"),
        (LABELS.astype(np.float32) / 10, {}, "not whole numbers"),
    ],
)
@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_what_is_no_label_image_is_refused(tmp_path, values, more, message):
    with pytest.raises(InputError, match=message):
        rb.read_footprints(write(tmp_path / "no.tif", values, **more))


def test_an_image_without_buildings_has_no_footprints(tmp_path):
    assert len(rb.read_footprints(write(tmp_path / "none.tif", np.zeros((4, 4), np.uint8)))) == 0


def test_a_file_that_is_no_image_is_refused(tmp_path):
    (tmp_path / "no.tif").write_text("no image")
    with pytest.raises(InputError, match=r"no\.tif"):
        rb.read_footprints(tmp_path / "no.tif")
