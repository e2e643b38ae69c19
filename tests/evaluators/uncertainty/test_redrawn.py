"""Redrawn references: corners move by the error, shared corners once, curves stay curves, indices move accordingly."""

import numpy as np
import pytest
import shapely

import roofbench as rb
from roofbench.core.errors import ParameterError
from roofbench.evaluators.uncertainty.redrawn import redraw, redraw_changes

HOUSES = rb.Footprints.of(
    [shapely.box(30 * k, 0, 30 * k + 12, 10) for k in range(400)], building_ids=np.arange(400) // 2
)


def corners(footprints):
    return shapely.get_coordinates(footprints.polygons)


def test_corners_move_by_the_error_and_everything_else_stays():
    moved = redraw(HOUSES, 0.3, number=0)
    steps = corners(moved) - corners(HOUSES)
    assert steps.std() == pytest.approx(0.3, rel=0.05)
    assert abs(steps.mean()) < 0.02
    assert moved.building_ids.tolist() == HOUSES.building_ids.tolist()
    assert moved.ids.tolist() == HOUSES.ids.tolist()


def test_a_corner_that_two_outlines_share_moves_once():
    row = rb.Footprints.of([shapely.box(0, 0, 8, 10), shapely.box(8, 0, 16, 10)])
    moved = redraw(row, 0.3, number=1)
    assert moved.polygons[0].intersection(moved.polygons[1]).area == pytest.approx(0, abs=1e-9)
    assert shapely.touches(*moved.polygons)


def test_the_vertices_of_a_curve_move_together():
    tower = rb.Footprints.of([shapely.Point(0, 0).buffer(15, quad_segs=90)])
    moved = redraw(tower, 0.3, number=2)
    assert moved.repairs == ()
    turns = np.diff(corners(moved) - corners(tower), axis=0)
    assert np.abs(turns).max() < 0.3, "neighbouring vertices, 0.26 m apart, do not jump"
    assert np.abs(corners(moved) - corners(tower)).max() > 0.1


def test_courtyards_and_parts_stay():
    court = shapely.box(0, 0, 20, 20) - shapely.box(6, 6, 14, 14)
    parts = shapely.MultiPolygon([shapely.box(40, 0, 50, 10), shapely.box(55, 0, 60, 10)])
    moved = redraw(rb.Footprints.of([court, parts]), 0.2, number=3)
    assert len(moved.polygons[0].interiors) == 1
    assert len(moved.polygons[1].geoms) == 2
    assert moved.areas == pytest.approx([court.area, parts.area], rel=0.1)


def test_indices_move_with_the_error_and_not_without():
    detected = HOUSES.take(np.arange(300))
    none, small, large = (redraw_changes(detected, HOUSES, error=error, redraws=5).changes for error in (0, 0.1, 0.5))
    assert set(none.values()) <= {0.0, None}
    assert small["object.completeness"] == large["object.completeness"] == 0
    assert 0 < small["pixel.quality"] < large["pixel.quality"]
    # RMSE of corners that moved by normal errors in x and y: error times the square root of 2.
    assert large["geometric.rmse"] == pytest.approx(0.5 * 2**0.5, rel=0.1)


def test_a_seed_repeats_the_redraws():
    one, two, other = (redraw_changes(HOUSES, HOUSES, error=0.3, redraws=3, seed=seed).changes for seed in (1, 1, 2))
    assert one == two != other


@pytest.mark.parametrize("error", [-0.1, 1000, float("nan")])
def test_an_error_that_is_no_length_is_refused(error):
    with pytest.raises(ParameterError, match="not a digitising error"):
        redraw_changes(HOUSES, HOUSES, error=error)


def test_nothing_is_redrawn_as_nothing():
    assert len(redraw(rb.Footprints.empty(), 0.3, number=0)) == 0
