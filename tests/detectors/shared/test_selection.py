import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from roofbench.detectors.shared.selection import ordered_value


@given(st.lists(st.floats(-10, 10, width=32), min_size=1, max_size=40), st.data())
def test_heights_are_ordered_like_whole_numbers(heights, data):
    place = data.draw(st.integers(0, len(heights) - 1))
    values = np.array(heights, dtype=np.float32)
    assert ordered_value(values.copy(), len(heights), place) == sorted(heights)[place]


@given(st.lists(st.integers(-3, 3) | st.integers(-(2**31), 2**31 - 1), min_size=1, max_size=40), st.data())
def test_the_value_at_a_place_is_that_of_the_sorted_values(numbers, data):
    count = data.draw(st.integers(1, len(numbers)))
    place = data.draw(st.integers(0, count - 1))
    values = np.array(numbers, dtype=np.int32)
    assert ordered_value(values.copy(), count, place) == sorted(numbers[:count])[place]
