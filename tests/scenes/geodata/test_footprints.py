import re

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely import GeometryCollection, LineString, MultiPolygon, Point, Polygon, box

import roofbench as rb
from roofbench.core.errors import InputError

BOW_TIE = Polygon([(0, 0), (2, 2), (2, 0), (0, 2)])


def repairs(*polygons):
    return [str(repair) for repair in rb.Footprints.of(polygons).repairs]


def test_sound_polygons_pass_unchanged():
    polygons = [box(0, 0, 1, 2), Polygon([(0, 0), (4, 0), (4, 4), (0, 4)], [[(1, 1), (2, 1), (2, 2)]])]
    footprints = rb.Footprints.of(polygons)
    assert shapely.equals_exact(footprints.polygons, polygons, 0).all()
    assert footprints.repairs == ()
    assert footprints.areas.tolist() == [2.0, 15.5]


@pytest.mark.parametrize(
    ("geometry", "printed"),
    [
        (None, "no geometry: left out"),
        (Polygon(), "empty: left out"),
        (MultiPolygon(), "empty: left out"),
        (Point(1, 2), "not a polygon: Point: left out"),
        (LineString([(0, 0), (1, 1)]), "not a polygon: LineString: left out"),
        (GeometryCollection([Point(0, 0), LineString([(0, 0), (1, 1)])]), "a collection of geometries: left out"),
        (GeometryCollection([box(0, 0, 1, 1), Point(5, 5)]), "a collection of geometries: repaired"),
        (Polygon([(0, 0), (1, np.inf), (1, 1)]), "coordinates that are not finite: left out"),
        (Polygon([(0, 0), (1e300, 0), (1e300, 1e300)]), "coordinates that are not finite: left out"),
        (Polygon([(0, 0), (1, 1), (2, 2)]), "Self-intersection[1 1]: left out"),
        (BOW_TIE, "Self-intersection[1 1]: repaired"),
        (Polygon([(0, 0), (4, 0), (4, 4)], [[(9, 9), (10, 9), (10, 10)]]), "Hole lies outside shell[9 9]: repaired"),
        (MultiPolygon([box(0, 0, 2, 2), box(1, 1, 3, 3)]), "Self-intersection[1 2]: repaired"),
    ],
)
def test_what_is_not_usable_is_reported(geometry, printed):
    # Where along the ring the fault is found differs between versions of GEOS.
    (found,) = repairs(box(0, 0, 1, 1), geometry)
    assert re.sub(r"\[.*\]", "", found) == "feature 1: " + re.sub(r"\[.*\]", "", printed)


def test_repairs_keep_the_area_that_is_meant():
    footprints = rb.Footprints.of([BOW_TIE, MultiPolygon([box(0, 0, 2, 2), box(1, 1, 3, 3)])])
    assert footprints.areas.tolist() == [2.0, 7.0]
    assert shapely.is_valid(footprints.polygons).all()


def test_the_polygons_given_are_not_changed():
    given_polygons = np.array([BOW_TIE, MultiPolygon([box(0, 0, 1, 1)])], dtype=object)
    rb.Footprints.of(given_polygons)
    assert given_polygons[0] is BOW_TIE
    assert given_polygons[1].geom_type == "MultiPolygon"


def test_rows_left_out_take_their_columns_with_them():
    footprints = rb.Footprints.of(
        [box(0, 0, 1, 1), None, box(2, 0, 3, 1)], building_ids=["a", "b", "c"], attributes={"height": [1.0, 2.0, 3.0]}
    )
    assert footprints.ids.tolist() == [0, 2]
    assert footprints.building_ids.tolist() == ["a", "c"]
    assert footprints.attributes["height"].tolist() == [1.0, 3.0]


@pytest.mark.parametrize(
    ("labels", "codes"),
    [
        (["a", "b", "a"], [0, 1, 0]),
        ([7, 9, 7], [0, 1, 0]),
        (["a", None, "a"], [1, 0, 1]),
        ([1.0, np.nan, np.nan], [2, 0, 1]),
        ([1, "1", None], [1, 1, 0]),
        (np.array(["2020-01-01", "NaT", "2020-01-01"], "datetime64[D]"), [1, 0, 1]),
        (np.array([True, False, True]), [1, 0, 1]),
    ],
)
def test_building_ids_of_any_kind_group_the_parts(labels, codes):
    footprints = rb.Footprints.of([box(i, 0, i + 1, 1) for i in range(3)], building_ids=labels)
    assert footprints.building_codes.tolist() == codes


def test_without_building_ids_each_is_its_own_building():
    assert rb.Footprints.of([box(0, 0, 1, 1), box(0, 0, 1, 1)]).building_codes.tolist() == [0, 1]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: rb.Footprints.of(["POLYGON ((0 0, 1 0, 1 1, 0 0))"]), "shapely polygons, not str"),
        (lambda: rb.Footprints.of(box(0, 0, 1, 1)), "put a single one in a list"),
        (lambda: rb.Footprints.of(np.array([[box(0, 0, 1, 1)]])), "one dimension"),
        (lambda: rb.Footprints.of([box(0, 0, 1, 1)], building_ids=[1, 2]), "2 building ids for 1 polygon"),
        (lambda: rb.Footprints.of([box(0, 0, 1, 1)], attributes={"a": []}), "attribute 'a' has 0 values for 1"),
    ],
)
def test_a_wrong_call_is_answered_in_words(call, message):
    with pytest.raises(InputError, match=message):
        call()


def test_no_footprints_is_a_set_like_any_other():
    for empty in (
        rb.Footprints.of([]),
        rb.Footprints.empty(),
        rb.Footprints.of([box(0, 0, 1, 1)]).take(np.array([], int)),
    ):
        assert len(empty) == 0
        assert empty.centres.shape == (0, 2)
        assert empty.areas.shape == empty.building_codes.shape == (0,)
        assert empty.quadrilaterals[1].shape == (0, 4, 2)


def test_the_centre_of_a_quadrilateral_is_where_its_diagonals_cross():
    trapezoid = Polygon([(0, 0), (4, 0), (3, 2), (1, 2)])
    footprints = rb.Footprints.of([trapezoid, shapely.reverse(trapezoid)])
    np.testing.assert_allclose(footprints.centres, [[2, 4 / 3]] * 2)
    assert trapezoid.centroid.y != pytest.approx(4 / 3)


@pytest.mark.parametrize(
    "polygon",
    [
        Polygon([(0, 0), (4, 0), (1, 1), (0, 4)]),  # not convex
        Polygon([(0, 0), (2, 0), (4, 0), (4, 4)]),  # a triangle with a vertex on a side
        Polygon([(0, 0), (4, 0), (4, 4), (2, 6), (0, 4)]),
        Polygon([(0, 0), (4, 0), (4, 4), (0, 4)], [[(1, 1), (2, 1), (2, 2)]]),
        MultiPolygon([box(0, 0, 1, 1), box(3, 0, 5, 1)]),
    ],
)
def test_the_centre_of_anything_else_is_the_area_centroid(polygon):
    footprints = rb.Footprints.of([polygon])
    assert len(footprints.quadrilaterals[0]) == 0
    np.testing.assert_allclose(footprints.centres[0], [polygon.centroid.x, polygon.centroid.y])


def test_corners_run_counter_clockwise():
    clockwise = shapely.reverse(box(0, 0, 2, 1)) if box(0, 0, 2, 1).exterior.is_ccw else box(0, 0, 2, 1)
    _, corners = rb.Footprints.of([clockwise]).quadrilaterals
    assert Polygon(corners[0]).exterior.is_ccw


@given(st.tuples(st.floats(-1e7, 1e7), st.floats(-1e7, 1e7)), st.floats(0, np.pi), st.floats(1, 200), st.floats(1, 200))
def test_the_centre_of_a_rectangle_is_found_anywhere(middle, angle, length, width):
    half = np.array([[-length, -width], [length, -width], [length, width], [-length, width]]) / 2
    cosine, sine = np.cos(angle), np.sin(angle)
    corners = half @ np.array([[cosine, sine], [-sine, cosine]]) + middle
    footprints = rb.Footprints.from_rectangles(corners)
    np.testing.assert_allclose(footprints.centres[0], middle, atol=1e-6)
    assert footprints.areas[0] == pytest.approx(length * width, rel=1e-6)


def test_rings_of_what_clipping_leaves_empty_have_no_points():
    clipped = np.array([shapely.box(0, 0, 1, 1), shapely.MultiPolygon(), shapely.Polygon(), shapely.box(5, 5, 6, 6)])
    start, points = rb.Footprints(clipped).rings
    assert start.tolist() == [0, 5, 5, 5, 10]
    assert np.isfinite(points).all()


@pytest.mark.parametrize(("offset", "blocks"), [(0.0, 1), (0.3, 1), (0.35, 1), (0.4, 2), (1.0, 2)])
def test_neighbours_at_a_corner_are_joined_as_neighbours_at_a_side_are(offset, blocks):
    far = 10 + offset
    pair = rb.Footprints.of([shapely.box(0, 0, 10, 10), shapely.box(far, far, far + 10, far + 10)])
    found = pair.joined(0.5)
    assert len(found) == blocks
    assert found.areas.sum() == pytest.approx(200, abs=0.02)
    row = rb.Footprints.of([*pair.polygons, shapely.box(-10.2, 0, -0.2, 10), shapely.box(40, 0, 50, 10)]).joined(0.5)
    assert len(row) == blocks + 1
    assert all(one.geom_type == "Polygon" and one.is_valid for one in row.polygons)
