"""One building, one rectangle: what stands on a roof is lowered; houses in a row stay."""

import numpy as np
import pytest

from roofbench.detectors.mpp.cells import HIGH, LOW, VOID
from roofbench.detectors.mpp.superstructures import lower_superstructures


def land(rows=60, columns=70):
    """Return heights, states and texture of empty ground."""
    return (
        np.zeros((rows, columns), np.int32),
        np.full((rows, columns), LOW),
        np.zeros((rows, columns), bool),
    )


def build(world, top, left, tall, wide, metres):
    height, state, roof = world
    place = np.s_[top : top + tall, left : left + wide]
    height[place], state[place], roof[place] = round(100 * metres), HIGH, True


def lowered(world, **more):
    return lower_superstructures(*world, **({"step": 1.0, "share": 0.65, "most": 40} | more))


@pytest.mark.parametrize("left", [22, 16], ids=["in the middle", "beside one edge"])
def test_a_tower_on_its_podium_is_lowered_to_it(left):
    world = land()
    build(world, 10, 15, 30, 40, 12.0)
    build(world, 17, left, 16, 20, 60.0)
    height, _ = lowered(world)
    np.testing.assert_allclose(height[10:40, 15:55], 1200, atol=5)


def test_storeys_set_back_one_after_the_other_are_lowered_to_the_first():
    world = land()
    for k in range(3):
        build(world, 10 + 4 * k, 15 + 4 * k, 34 - 8 * k, 44 - 8 * k, 20.0 * (k + 1))
    height, _ = lowered(world)
    np.testing.assert_allclose(height[10:44, 15:59], 2000, atol=5)


def test_the_shadow_of_a_tower_on_its_podium_is_podium():
    world = land()
    build(world, 10, 15, 30, 40, 12.0)
    build(world, 17, 22, 16, 20, 60.0)
    world[1][33:37, 22:42], world[0][33:37, 22:42], world[2][33:37, 22:42] = VOID, 0, False
    height, state = lowered(world)
    assert (state[10:40, 15:55] == HIGH).all()
    np.testing.assert_allclose(height[10:40, 15:55], 1200, atol=5)


def test_a_penthouse_at_the_end_of_its_wing_is_lowered_to_the_wing_and_not_to_the_lower_one_beside():
    world = land()
    build(world, 4, 25, 30, 20, 12.0)
    build(world, 34, 5, 16, 40, 42.0)
    build(world, 37, 28, 10, 14, 46.0)
    height, _ = lowered(world)
    np.testing.assert_allclose(height[34:50, 5:45], 4200, atol=5)
    np.testing.assert_allclose(height[4:34, 25:45], 1200, atol=5)


def test_houses_of_a_row_keep_their_heights():
    world = land()
    for k, metres in enumerate((8.0, 11.0, 8.0, 12.0, 9.5)):
        build(world, 20, 10 + 10 * k, 16, 10, metres)
    np.testing.assert_array_equal(lowered(world)[0], world[0])


def test_a_house_with_a_low_annexe_keeps_its_height():
    world = land()
    build(world, 20, 20, 16, 14, 9.0)
    build(world, 36, 20, 10, 14, 3.5)
    np.testing.assert_array_equal(lowered(world)[0], world[0])


def test_roof_structures_take_the_height_of_the_roof_around_them_up_to_their_largest_size():
    world = land()
    build(world, 10, 10, 30, 30, 10.0)
    world[0][20:26, 20:26] = 1000 + np.random.default_rng(0).integers(50, 400, (6, 6))
    world[2][20:26, 20:26] = False
    np.testing.assert_array_equal(lowered(world)[0][20:26, 20:26], 1000)


def test_a_roof_structure_over_a_step_of_the_roof_is_lowered_to_its_levels():
    world = land()
    build(world, 10, 10, 30, 20, 10.0)
    build(world, 10, 30, 30, 20, 12.0)
    build(world, 20, 26, 8, 8, 16.0)
    height, _ = lowered(world)
    inside = np.s_[20:28, 26:34]
    assert set(np.unique(height[inside])) <= {1000, 1200}
    height[inside] = world[0][inside]
    np.testing.assert_array_equal(height, world[0])


def test_a_share_above_one_changes_nothing():
    world = land()
    build(world, 10, 15, 30, 40, 12.0)
    build(world, 17, 22, 16, 20, 60.0)
    np.testing.assert_array_equal(lowered(world, share=1.1)[0], world[0])
