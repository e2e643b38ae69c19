"""Patches, their rims and what is assigned and lowered are those of the slow oracles, for any number of threads."""

import numpy as np
import pytest
import shapely
from naive import mpp as naive_mpp
from naive import patches as naive

from roofbench.detectors.mpp.candidates import propose_boxes
from roofbench.detectors.mpp.cells import HIGH, LOW, VOID
from roofbench.detectors.mpp.frames import _REACH, _cells_of, _waves
from roofbench.detectors.mpp.patches import (
    Division,
    cells_of_patches,
    count_rims,
    divide_patches,
    label_patches,
    longer_patches,
    patch_sizes,
)
from roofbench.detectors.mpp.rectangles import corners
from roofbench.detectors.mpp.roughness import assign_rough_cells
from roofbench.detectors.mpp.superstructures import _lower_to_roof, lower_superstructures
from roofbench.detectors.mpp.threads import started_threads

SHAPES = [(1, 1), (1, 9), (2, 30), (40, 1), (33, 47)]


@pytest.fixture(params=[1, 2, 3, 7])
def threads(request):
    with started_threads(request.param) as threads:
        yield threads


def terraces(shape, seed=0):
    """Random heights on few levels, states, and a mask of roof that winds through them."""
    rng = np.random.default_rng(seed)
    height = (rng.integers(0, 4, shape) * 120 + rng.integers(0, 20, shape)).astype(np.int32)
    state = rng.choice(np.array([VOID, LOW, HIGH]), shape, p=[0.1, 0.15, 0.75])
    return height, state, (state == HIGH) & (rng.random(shape) < 0.8)


def town(seed=0, size=220):
    """Houses, towers on podiums and rough crowns: heights, states and roof texture."""
    rng = np.random.default_rng(seed)
    height, state = np.zeros((size, size), np.int32), np.full((size, size), LOW)
    roof = np.zeros((size, size), bool)
    for _ in range(60):
        top, left, tall, wide = rng.integers(2, size - 50, 2).tolist() + rng.integers(8, 45, 2).tolist()
        low = int(rng.integers(300, 1500))
        state[top : top + tall, left : left + wide] = HIGH
        height[top : top + tall, left : left + wide] = low
        roof[top : top + tall, left : left + wide] = True
        if min(tall, wide) > 14:
            inner = np.s_[top + 4 : top + tall - 4, left + 4 : left + wide - 5]
            height[inner] = low + int(rng.integers(150, 3000))
            rim = np.s_[top + 4, left + 4 : left + wide - 5]
            height[rim], roof[rim] = low + rng.integers(0, 2000, height[rim].shape), False
            state[top + tall - 6 : top + tall - 4, left + 6 : left + wide - 8] = VOID
    rough = rng.random((size, size)) < 0.03
    height[rough & (state == HIGH)] += rng.integers(50, 400, np.count_nonzero(rough & (state == HIGH))).astype(np.int32)
    roof &= ~rough & (state == HIGH)
    height[state != HIGH] = 0
    return height, state, roof


@pytest.mark.parametrize("shape", SHAPES, ids=str)
@pytest.mark.parametrize("step", [0, 25, 130, 1 << 30])
def test_patches_are_numbered_by_their_first_cells(shape, step, threads):
    height, _, mask = terraces(shape)
    expected, count = naive.label_patches(height, mask, step)
    for chosen in (mask, 5 * mask.astype(np.int32)):
        labels, found = label_patches(height, chosen, step, threads=threads)
        np.testing.assert_array_equal(labels, expected)
        assert found == count


def test_a_spiral_that_meets_every_band_again_and_again_is_one_patch(threads):
    mask = np.zeros((41, 41), bool)
    for ring in range(0, 20, 2):
        mask[ring, ring : 41 - ring] = mask[40 - ring, ring : 41 - ring] = True
        mask[ring : 41 - ring, 40 - ring] = mask[ring + 2 : 41 - ring, ring] = True
        mask[ring + 2, ring : ring + 2] = True
    labels, count = label_patches(np.zeros(mask.shape, np.int32), mask, 0, threads=threads)
    assert count == 1
    np.testing.assert_array_equal(labels, mask)


@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_cells_and_rims_of_patches_are_those_of_the_oracle(shape, threads):
    height, state, mask = terraces(shape, 1)
    labels, count = naive.label_patches(height, mask, 25)
    cells, starts = cells_of_patches(labels, count, threads=threads)
    for k in range(count):
        np.testing.assert_array_equal(cells[starts[k] : starts[k + 1]], np.argwhere(labels == k + 1))
    np.testing.assert_array_equal(patch_sizes(labels, count, threads=threads)[1:], np.diff(starts))
    roof = np.where(height < 300, labels, 0).astype(np.int32)
    for fall in (1, -(1 << 30)):
        found = count_rims(labels, count, height, state, roof, fall=fall, threads=threads)
        names = np.arange(count + 1)
        for values, expected in zip(
            (found.cells, found.length, found.roof), naive.rims(labels, height, state, roof, fall), strict=True
        ):
            np.testing.assert_array_equal(values, [expected[name] for name in names])


def test_rough_cells_are_assigned_round_by_round(threads):
    height, state, roof = town(2, 60)
    roof &= np.random.default_rng(3).random(roof.shape) < 0.75
    labels, _ = naive.label_patches(height, roof, 100)
    expected = naive.assign_rough_cells(height, state, labels, HIGH)
    assign_rough_cells(height, state, labels, threads=threads)
    np.testing.assert_array_equal(height, expected[0])
    np.testing.assert_array_equal(labels, expected[1])


@pytest.mark.parametrize("above", [-50, 1 << 30])
def test_cells_are_lowered_ring_by_ring(above, threads):
    height, _, roof = town(4, 60)
    labels, count = naive.label_patches(height, roof, 100)
    chosen = np.random.default_rng(5).random(count + 1) < 0.3
    chosen[0] = False
    expected = naive.lowered(height, labels, chosen[labels], above)
    assert (expected != height).any()
    assert _lower_to_roof(height, labels, labels.copy(), chosen, above, threads)
    np.testing.assert_array_equal(height, expected)
    assert not _lower_to_roof(height, labels, labels.copy(), np.zeros_like(chosen), above, threads)


def test_boxes_and_superstructures_do_not_depend_on_the_number_of_threads(threads):
    height, state, roof = town()
    boxes = propose_boxes(height, roof, steps=(0.4, 1.0, 1000.0), least_cells=20)
    assert len(boxes) > 60
    np.testing.assert_array_equal(
        propose_boxes(height, roof, steps=(0.4, 1.0, 1000.0), least_cells=20, threads=threads), boxes
    )
    alone = lower_superstructures(height, state, roof, step=1.0, share=0.65, most=40)
    assert (alone[0] < height).sum() > 1000
    assert (alone[1] != state).any()
    found = lower_superstructures(height, state, roof, step=1.0, share=0.65, most=40, threads=threads)
    np.testing.assert_array_equal(found[0], alone[0])
    np.testing.assert_array_equal(found[1], alone[1])


def test_boxes_that_share_cells_are_processed_in_their_order():
    rng = np.random.default_rng(6)
    boxes = np.column_stack([rng.uniform(0, 150, (80, 2)), rng.uniform(3, 25, (80, 2)), rng.uniform(0, np.pi, 80)])
    grown = shapely.polygons(corners(boxes + 2 * _REACH * np.array([0, 0, 1, 1, 0])))
    expected = []
    for k in range(80):
        met = [expected[j] for j in range(k) if grown[j].intersection(grown[k]).area > 0]
        expected.append(max(met, default=-1) + 1)
    assert max(expected) > 3
    np.testing.assert_array_equal(_waves(boxes, 140, 160), expected)


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2, np.pi / 2])
def test_the_border_of_a_box_is_found_without_its_inside(angle):
    for rectangle in ([30.2, 25.7, 21.0, 13.0, angle], [3.0, 50.0, 40.0, 9.0, angle], [20.1, 20.3, 3.0, 6.0, angle]):
        box, shape = np.array(rectangle), (60, 55)
        whole, border = _cells_of(box, shape, True), _cells_of(box, shape, False)
        mask = np.zeros(shape, bool)
        mask[whole[:, 0], whole[:, 1]] = True
        np.testing.assert_array_equal(mask, naive_mpp.cells_inside(box, *shape))
        u, v = naive_mpp.frame(box, *shape)
        away = np.minimum(box[2] / 2 - abs(u), box[3] / 2 - abs(v))[whole[:, 0], whole[:, 1]]
        np.testing.assert_array_equal(whole[:, 2] == 5, away < 0.5)
        np.testing.assert_array_equal(whole[:, 2] == 4, away >= 2.0)
        np.testing.assert_array_equal(border, whole[whole[:, 2] != 4])


@pytest.mark.parametrize("angle", [0.0, 0.35, 1.2])
def test_a_house_cut_by_the_border_of_the_scene_keeps_the_direction_of_its_walls(angle):
    rows, columns = np.indices((80, 90)) + 0.5
    u = (columns - 4) * np.cos(angle) + (rows - 40) * np.sin(angle)
    v = (rows - 40) * np.cos(angle) - (columns - 4) * np.sin(angle)
    roof = (np.abs(u) < 26) & (np.abs(v) < 14)
    assert roof[:, 0].sum() > 10
    boxes = propose_boxes(np.full(roof.shape, 800, np.int32), roof, steps=(1.0,), least_cells=24)
    largest = boxes[np.argmax(boxes[:, 2] * boxes[:, 3])]
    turn = (largest[4] - angle + np.pi / 4) % (np.pi / 2) - np.pi / 4
    assert abs(turn) < np.radians(1.5)
    assert largest[2] * largest[3] > 0.5 * roof.sum()


def test_patches_longer_than_a_square_are_divided_at_borders_that_do_not_depend_on_the_window():
    rng = np.random.default_rng(4)
    roof = rng.random((60, 70)) < 0.5
    roof[20:24] = True
    height = np.full(roof.shape, 500, np.int32)
    whole, count = divide_patches(*label_patches(height, roof, 10), Division(100, 200, 16, 16))
    sizes = [(np.ptp(row), np.ptp(column)) for row, column in (np.nonzero(whole == k) for k in range(1, count + 1))]
    assert max(max(size) for size in sizes) < 16
    assert np.array_equal(whole > 0, roof)
    # Pieces of a window, 24 cells inside it, are those of the whole.
    part = np.s_[7:60, 5:70]
    seen, _ = divide_patches(*label_patches(height[part], roof[part], 10), Division(107, 205, 16, 16))
    inner, same = seen[24:-24, 24:-24], whole[part][24:-24, 24:-24]
    pairs = np.unique(np.stack([inner.ravel(), same.ravel()]), axis=1)
    assert len(np.unique(pairs[0])) == len(np.unique(pairs[1])) == pairs.shape[1] > 5


def test_a_patch_is_longer_than_so_many_cells_along_rows_or_columns():
    rng = np.random.default_rng(5)
    labels, count = label_patches(np.zeros((40, 50), np.int32), rng.random((40, 50)) < 0.6, 10)
    long = longer_patches(labels, count, 8)
    extents = [max(np.ptp(axis) for axis in np.nonzero(labels == k)) + 1 for k in range(1, count + 1)]
    assert long[1:].tolist() == [extent > 8 for extent in extents]
    assert 0 < long.sum() < count
    assert not long[0]


def test_boxes_do_not_depend_on_where_a_window_begins_to_the_last_bit():
    rng = np.random.default_rng(6)
    row, column = np.mgrid[:90, :90]
    roof = np.zeros((90, 90), dtype=bool)
    for x, y, angle in rng.uniform([12, 12, 0], [78, 78, 1.5], (12, 3)):
        u = (column - x) * np.cos(angle) + (row - y) * np.sin(angle)
        v = (row - y) * np.cos(angle) - (column - x) * np.sin(angle)
        roof |= (abs(u) < 9) & (abs(v) < 5)
    height = np.full(roof.shape, 600, np.int32)
    boxes = propose_boxes(height, roof, steps=(1.0,), least_cells=12)
    moved = np.pad(roof, ((1031, 5), (2057, 3)))
    others = propose_boxes(np.full(moved.shape, 600, np.int32), moved, steps=(1.0,), least_cells=12)
    assert np.array_equal(others - [2057, 1031, 0, 0, 0], boxes)
    assert len(boxes) > 5
