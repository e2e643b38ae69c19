"""Inference over scenes: intervals, paired tests, Holm's correction, and groups without significant differences.

The unit is the scene: one number per scene and detector (the mean over seeds of a stochastic one). Everything is
deterministic: resampling draws from a fixed stream, so the same numbers give the same interval.

Sources
-------
Hesterberg 2015, What Teachers Should Know About the Bootstrap, The American Statistician 69(4): the expanded
percentile interval. Holm 1979, A Simple Sequentially Rejective Multiple Test Procedure, Scandinavian Journal of
Statistics 6. Piepho 2004, An Algorithm for a Letter-Based Representation of All-Pairwise Comparisons, Journal of
Computational and Graphical Statistics 13. Wilson 1927, Probable Inference, Journal of the American Statistical
Association 22.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.resampling import expanded_level, resampling_weights

__all__ = [
    "HALF_SPLITS",
    "LEVEL",
    "bootstrap_interval",
    "first_places",
    "holm",
    "letter_groups",
    "lowest_p",
    "paired_p",
    "scenes_needed",
    "sign_flip_p",
    "wilson_interval",
]

LEVEL = 0.05

#: How often the scenes are split into halves.
HALF_SPLITS = 50

_MOST_ENUMERATED = 16  # 2^16 sign patterns
#: Steps between zero and the largest difference, for so many differences at most; beyond, their number falls with the
#: square root of the count, so that the time grows as the count.
_LATTICE, _FINE = 4096, 64
_Z = 1.959963984540054  # two-sided 95 %


def bootstrap_interval(values: ArrayLike, *, level: float = LEVEL) -> tuple[float, float] | None:
    """Return the expanded percentile bootstrap interval of the mean; None for fewer than two values.

    Examples
    --------
    >>> bootstrap_interval([0.5, 0.5, 0.5])
    (0.5, 0.5)
    >>> bootstrap_interval([0.5]) is None
    True
    """
    numbers = np.sort(np.asarray(values, dtype=np.float64))  # the order in which scenes come is no information
    if len(numbers) < 2:
        return None
    if (numbers == numbers[0]).all():
        return float(numbers[0]), float(numbers[0])
    means = resampling_weights(len(numbers)) @ numbers / len(numbers)
    tail = expanded_level(len(numbers), level)
    low, high = np.quantile(means, [tail, 1 - tail])
    return float(low), float(high)


def sign_flip_p(differences: ArrayLike) -> float:
    """Return the one-sided p of paired differences against the alternative that their centre lies below zero.

    The exact sign-flip permutation test of the mean: the share of all sign patterns whose sum is as low as the one
    found. It only assumes that differences are symmetric under the null hypothesis. If all differences are 0, it is 1.
    Adding a constant to all differences never lowers it.

    Up to 16 differences every pattern is enumerated. With more, differences are rounded to 1/4096 of the largest (more
    coarsely beyond 64 differences), and the distribution of their sum is computed on that lattice. This is exact again,
    because rounding keeps symmetry.

    Examples
    --------
    >>> sign_flip_p([-1.0, -2.0, -3.0, -4.0, -5.0])
    0.03125
    >>> sign_flip_p([1.0, -1.0, 0.0])
    0.75
    """
    return _tails(differences)[0]


def _tails(differences: ArrayLike) -> tuple[float, float]:
    """Return the shares of all sign patterns whose sum is at most, and at least, the one found."""
    numbers = np.asarray(differences, dtype=np.float64)
    scale = np.abs(numbers).max(initial=0.0)
    if scale == 0:
        return 1.0, 1.0
    if len(numbers) > _MOST_ENUMERATED:
        steps = round(_LATTICE * min(1.0, math.sqrt(_FINE / len(numbers))))
        return _lattice_tails(np.rint(numbers / scale * steps).astype(np.int64))
    numbers = np.round(numbers / scale, 12)  # ties among sums must not depend on the last bit
    sums = np.zeros(1)
    for number in numbers:
        sums = np.concatenate([sums + number, sums - number])
    found = numbers.sum()
    return float((sums <= found + 1e-9).mean()), float((sums >= found - 1e-9).mean())


def _lattice_tails(numbers: NDArray[np.int64]) -> tuple[float, float]:
    """Return the tails of whole numbers, see `_tails`.

    A sum is as low as the one found exactly when the numbers whose sign turned add up to at least zero. Counted in
    steps of two, the sums reach from minus to plus the sum of magnitudes.
    """
    sizes = np.abs(numbers)
    total = int(sizes.sum())
    chances = np.zeros(total + 1)  # chances[k]: that magnitudes with a plus add up to k; the sum is then 2 k - total
    chances[0] = 1.0
    reached = 0
    for size in sizes:
        after = 0.5 * chances[: reached + size + 1]
        after[size:] += 0.5 * chances[: reached + 1]
        reached += int(size)
        chances[: reached + 1] = after
    found = int(numbers[numbers > 0].sum())
    # The sums are symmetric: a tail from above is added up from its thin end, too.
    return float(min(1.0, chances[: found + 1].sum())), float(min(1.0, chances[: total - found + 1].sum()))


def paired_p(differences: ArrayLike) -> float:
    """Return the two-sided p of the exact sign-flip permutation test, see `sign_flip_p`.

    Examples
    --------
    >>> paired_p([1.0, 2.0, 3.0, 4.0, 5.0])  # all of one sign: 2 ** (1 - 5)
    0.0625
    """
    low, high = _tails(differences)
    return min(1.0, 2 * low, 2 * high)


def lowest_p(count: int) -> float:
    """Return the lowest two-sided p that `count` paired differences can reach: ``2 ** (1 - count)``, at most 1."""
    return min(1.0, 2.0 ** (1 - count))


def scenes_needed(tests: int, level: float = LEVEL) -> int:
    """Return how many scenes are needed so that the first of `tests` Holm-corrected tests can reach `level`."""
    return math.ceil(1 + math.log2(tests / level) - 1e-12)


def holm(p_values: Sequence[float]) -> list[float]:
    """Return Holm-adjusted p values in the order given.

    >>> holm([0.01, 0.04, 0.03])
    [0.03, 0.06, 0.06]
    """
    adjusted = [1.0] * len(p_values)
    reached = 0.0
    for place, i in enumerate(sorted(range(len(p_values)), key=lambda i: p_values[i])):
        reached = min(1.0, max(reached, (len(p_values) - place) * p_values[i]))
        adjusted[i] = reached
    return adjusted


def wilson_interval(found: int, count: int) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a share: `found` of `count`.

    Examples
    --------
    >>> tuple(round(bound, 3) for bound in wilson_interval(9, 10))
    (0.596, 0.982)
    >>> tuple(round(bound, 4) for bound in wilson_interval(0, 1000))
    (0.0, 0.0038)
    """
    share, spread = found / count, _Z**2 / count
    middle = (share + spread / 2) / (1 + spread)
    half = _Z / (1 + spread) * math.sqrt(share * (1 - share) / count + spread / (4 * count))
    return max(0.0, middle - half), min(1.0, middle + half)


def first_places(values: ArrayLike, splits: int = HALF_SPLITS) -> NDArray[np.int64]:
    """Return how often each detector has the highest mean over a random half of the scenes.

    Parameters
    ----------
    values : array_like, shape (detectors, scenes)
        Higher is better; each split draws half of the scenes (rounded up) from a fixed stream.
    splits : int

    Returns
    -------
    ndarray of int64, shape (detectors,)
        Equal first places count for the earlier row.

    Examples
    --------
    >>> first_places([[0.9, 0.8, 0.9, 0.7], [0.5, 0.4, 0.6, 0.3]]).tolist()
    [50, 0]
    """
    table = np.asarray(values, dtype=np.float64)
    count = table.shape[1]
    rng = np.random.default_rng(np.random.SeedSequence([count, splits]))
    halves = np.argsort(rng.random((splits, count)), axis=1)[:, : -(-count // 2)]
    first = np.argmax(table[:, halves].mean(axis=2), axis=0)
    return np.bincount(first, minlength=len(table)).astype(np.int64)


def letter_groups(count: int, differs: Callable[[int, int], bool]) -> list[str]:
    """Return letters for `count` items in order of rank, so that two items share one exactly if they do not differ.

    Piepho's insert-and-absorb procedure.

    >>> letter_groups(3, lambda i, j: {i, j} == {0, 2})
    ['a', 'ab', 'b']
    """
    columns = [set(range(count))]
    for i, j in itertools.combinations(range(count), 2):
        if not differs(i, j):
            continue
        split = []
        for column in columns:
            split += [column - {i}, column - {j}] if {i, j} <= column else [column]
        columns = []
        for column in split:
            if not any(column < other or column == other for other in columns):
                columns = [other for other in columns if not other < column] + [column]
    columns.sort(key=sorted)
    return ["".join(_letter(place) for place, column in enumerate(columns) if i in column) for i in range(count)]


def _letter(place: int) -> str:
    return chr(ord("a") + place) if place < 26 else f"({place})"
