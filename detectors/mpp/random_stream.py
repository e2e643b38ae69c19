"""Random numbers inside compiled kernels: one stream per task, the same on every machine.

The state is that of xoshiro256++ (Blackman & Vigna 2021, "Scrambled linear pseudorandom number generators", ACM TOMS
47(4)): four 64 bit words, filled from a `numpy.random.SeedSequence`, so that streams of tiles are independent and a
stream depends on its tile alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...core.kernels import kernel
from .arrays import RandomState

__all__ = ["gaussian", "integer", "stream", "uniform"]


def stream(entropy: Sequence[int]) -> RandomState:
    """Return the state, shape (4,), of the stream that belongs to whole numbers such as (seed, column, row)."""
    words = np.random.SeedSequence([int(number) for number in entropy]).generate_state(4, np.uint64)
    return words.astype(np.uint64)


@kernel(inline="always")
def _left(word: np.uint64, bits: int) -> np.uint64:
    """Rotate a word to the left."""
    return (word << np.uint64(bits)) | (word >> np.uint64(64 - bits))


@kernel
def uniform(state: RandomState) -> float:
    """Draw from [0, 1) with 53 random bits and advance the state."""
    result = _left(state[0] + state[3], 23) + state[0]
    shifted = state[1] << np.uint64(17)
    state[2] ^= state[0]
    state[3] ^= state[1]
    state[1] ^= state[2]
    state[0] ^= state[3]
    state[2] ^= shifted
    state[3] = _left(state[3], 45)
    return np.float64(result >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@kernel
def integer(state: RandomState, size: int) -> int:
    """Draw from 0 .. size - 1."""
    return min(int(uniform(state) * size), size - 1)


@kernel
def gaussian(state: RandomState) -> float:
    """Draw from the standard normal distribution (Box and Muller; the second value is not kept)."""
    radius = math.sqrt(-2.0 * math.log(1.0 - uniform(state)))
    return radius * math.cos(2.0 * math.pi * uniform(state))
