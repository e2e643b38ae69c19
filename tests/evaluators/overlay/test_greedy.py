"""Greedy acceptance: many pairs at once give what one after the other gives."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from roofbench.evaluators.overlay import greedy
from roofbench.evaluators.overlay.greedy import accept_in_order


def one_by_one(pairs, counts):
    of_detection, of_reference = [-1] * counts[0], [-1] * counts[1]
    for detection, reference in pairs:
        if of_detection[detection] < 0 and of_reference[reference] < 0:
            of_detection[detection], of_reference[reference] = reference, detection
    return of_detection, of_reference


@pytest.mark.parametrize("rounds", [1, 3, 50])
@given(pairs=st.sets(st.tuples(st.integers(0, 9), st.integers(0, 7)), max_size=60).map(sorted), seed=st.integers(0, 99))
def test_rounds_accept_what_the_order_accepts(rounds, pairs, seed):
    pairs = [pairs[row] for row in np.random.default_rng(seed).permutation(len(pairs))]
    columns = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    with pytest.MonkeyPatch.context() as changed:
        changed.setattr(greedy, "_FEW", 1)
        changed.setattr(greedy, "_ROUNDS", rounds)
        found = accept_in_order(*columns, (10, 8))
    assert [side.tolist() for side in found] == list(one_by_one(pairs, (10, 8)))
