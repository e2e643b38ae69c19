"""Whatever holds polygons can be compared: frames of geopandas, series, arrays, lists, files, scenes."""

import numpy as np
import pytest
import shapely

import roofbench as rb
from roofbench.core.errors import CRSError, InputError
from roofbench.scenes.builtin import hamlet

gpd = pytest.importorskip("geopandas")

SQUARES = shapely.box([0, 20, 40], [0, 0, 0], [10, 30, 50], [10, 10, 10])


@pytest.fixture
def frame():
    return gpd.GeoDataFrame({"bag_id": ["a", "a", None], "floors": [1, 2, 3]}, geometry=SQUARES, crs="EPSG:28992")


def test_every_form_gives_the_same_evaluation(frame, tmp_path):
    path = tmp_path / "a.gpkg"
    frame.to_file(path)
    expected = rb.evaluate(rb.Footprints.of(SQUARES[:2]), rb.Footprints.of(SQUARES)).to_dict()
    footprints = rb.Footprints.of(SQUARES, crs="EPSG:28992")
    forms = (frame, frame.geometry, np.array(SQUARES), list(SQUARES), path, str(path), footprints)
    for reference in forms:
        assert rb.evaluate(list(SQUARES[:2]), reference).to_dict() == expected
        assert rb.evaluate(frame[:2], reference).counts.true_positives == 2


def test_footprints_without_a_crs_are_not_guessed_to_be_in_that_of_the_others(frame):
    with pytest.raises(CRSError, match="no coordinate reference system"):
        rb.evaluate(rb.Footprints.of(SQUARES), frame)


def test_crs_columns_and_buildings_are_kept(frame):
    evaluation = rb.evaluate(frame[:2], frame, building_id="bag_id")
    references = evaluation.verdicts.references
    assert references.crs.to_epsg() == 28992
    assert references["floors"].tolist() == [1, 2, 3]
    assert len(np.unique(evaluation.verdicts.reference.building_codes)) == 2


def test_a_frame_becomes_footprints_and_a_frame_again(frame):
    footprints = rb.Footprints.from_geopandas(frame, building_id="bag_id")
    again = footprints.to_geopandas()
    assert again.crs == frame.crs
    assert again.geometry.tolist() == frame.geometry.tolist()
    assert again["building_id"].tolist() == ["a", "a", "(row 2)"]
    assert again["floors"].tolist() == [1, 2, 3]
    assert rb.Footprints.from_geopandas(frame.geometry).crs == "EPSG:28992"


def test_footprints_are_a_sequence_of_polygons():
    footprints = rb.Footprints.of(SQUARES, building_ids=[7, 7, 8], attributes={"floors": [1, 2, 3]})
    assert footprints[0].equals(SQUARES[0])
    assert footprints[-1].equals(SQUARES[2])
    assert [polygon.area for polygon in footprints] == [100.0, 100.0, 100.0]
    part = footprints[np.array([True, False, True])]
    assert part.building_ids.tolist() == [7, 8]
    assert part.attributes["floors"].tolist() == footprints[[0, 2]].attributes["floors"].tolist() == [1, 3]
    assert len(footprints[1:]) == 2
    with pytest.raises(IndexError):
        footprints[3]


def test_footprints_are_drawn_on_given_axes():
    from matplotlib.figure import Figure

    axes = Figure().subplots()
    assert rb.Footprints.of(SQUARES).plot(axes) is axes
    assert len(axes.collections) == 1


def test_a_scene_is_a_reference_with_its_grid(tmp_path):
    scene = hamlet(1)
    given = rb.evaluate(scene.reference, scene)
    assert given.to_dict() == rb.evaluate(scene.reference, scene.reference, grid=scene.image.grid).to_dict()
    assert rb.compare(scene.reference, scene.reference, scene).objects["both"] == len(scene.reference)
    rb.save_scene(scene, tmp_path / "village")
    assert rb.evaluate(scene.reference, tmp_path / "village").counts.reference == len(scene.reference)
    delft = rb.open_scene("delft").reference
    assert rb.evaluate(delft, "delft").counts.reference < len(delft), "by name, with its evaluation area"
    with pytest.raises(InputError, match="has no reference footprints"):
        rb.evaluate(scene.reference, rb.Scene("bare", scene.extent))


@pytest.mark.parametrize(
    ("value", "problem"),
    [
        (3, "detected is int, not footprints: give Footprints, a GeoDataFrame"),
        (shapely.box(0, 0, 1, 1), "detected is Polygon"),
        (["a"], "shapely polygons, not str"),
        ({"type": "FeatureCollection"}, "detected is dict"),
        ("absent.gpkg", "no such file"),
    ],
)
def test_what_holds_no_polygons_is_refused_in_one_sentence(value, problem):
    with pytest.raises(InputError, match=problem):
        rb.evaluate(value, list(SQUARES))


def test_a_frame_in_degrees_or_without_the_column_is_refused_with_a_remedy(frame):
    with pytest.raises(CRSError, match=r"detected: EPSG:4326 .* reproject the frame"):
        rb.evaluate(frame.to_crs(4326), frame)
    with pytest.raises(InputError, match=r"no column 'bagid' \(did you mean 'bag_id'\?\)"):
        rb.evaluate(frame, frame, building_id="bagid")
    with pytest.raises(InputError, match=r"no column 'bagid'"):
        rb.evaluate(frame, rb.Footprints.from_geopandas(frame), building_id="bagid")
