"""Scores: what each cell adds to a rectangle that covers it, besides the fit of its roof.

Nouns
-----
score
    Of a high cell with evidence for a roof: evidence - weight * log p(height | crown); with evidence against one, the
    evidence; of a low and of a void cell a fixed price. A high cell has at most the mean of the high cells within
    `_AROUND` metres: in a crown of few points smooth cells lie among rough ones by chance, and a rectangle could be
    drawn around each handful of them.
fitted cell
    A cell that takes part in the fit of roofs: a high one whose texture does not speak against a roof. A wall, a
    chimney or a branch over the eaves has its score, but does not spoil the fit: a Gaussian would let a few such cells
    outweigh a thousand good ones.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .arrays import Floats, Heights, Mask, Rectangles, Scores, States
from .background import Background
from .cells import HIGH, LOW, Cells
from .rectangles import row_span
from .tables import MILLI
from .textures import Bins
from .threads import ONE_THREAD, Threads

__all__ = ["Weights", "fitted_cells", "mean_evidence", "restrain", "score_cells"]

#: log p(height | crown) is not less than this, so that a bird or a tower is limited evidence.
_HEIGHT_FLOOR = -5.0
#: Metres along x and y within which the scores of high cells are averaged.
_AROUND = 1.0
#: A high cell that no window holds (a pole, a wall, the rim of a crown) has this evidence.
_THIN = -1.0


class Weights(NamedTuple):
    """How observations count.

    Attributes
    ----------
    fit : float
        Factor of the likelihood of heights.
    texture : float
        Factor of the evidence: windows of neighbours share cells, so they are no independent observations.
    limit : float
        Bound of the absolute value of the evidence, nats.
    low, void : float
        Nats that a low and a void cell cost.
    """

    fit: float
    texture: float
    limit: float
    low: float
    void: float


class _Rules(NamedTuple):
    """Evidence of each bin and of thin cells, Gaussian of heights in crowns, and the weights that kernels read.

    `crown_level` is the logarithm of the density of that Gaussian at its mean.
    """

    evidence: Floats
    thin: float
    crown_height: float
    crown_spread: float
    crown_level: float
    fit: float
    low: float
    void: float


def _rules(background: Background, weights: Weights) -> _Rules:
    evidence = np.clip(weights.texture * np.array(background.evidence), -weights.limit, weights.limit).ravel()
    spread = background.crown_spread
    heights = (background.crown_height, spread, -math.log(spread * math.sqrt(2.0 * math.pi)))
    return _Rules(evidence, weights.texture * _THIN, *heights, weights.fit, weights.low, weights.void)


def fitted_cells(
    cells: Cells, bins: Bins, background: Background, weights: Weights, *, threads: Threads = ONE_THREAD
) -> Mask:
    """Return which cells take part in the fit of roofs.

    Parameters
    ----------
    cells : Cells
    bins : ndarray of int16, shape (rows, columns)
        As `textures` returns them.
    background : Background
    weights : Weights
    threads : Threads
    """
    rules = _rules(background, weights)
    fitted = np.empty(bins.shape, dtype=np.bool_)
    threads.bands(lambda first, last: _choose_fitted(cells.state, bins, rules, first, last, fitted), len(bins))
    return fitted


@kernel(inline="always")
def _evidence_of(number: int, rules: _Rules) -> float:
    """Return the evidence of a bin."""
    return rules.evidence[number] if number >= 0 else rules.thin


@kernel
def _choose_fitted(state: States, bins: Bins, rules: _Rules, first: int, last: int, fitted: Mask) -> None:
    """Fill for some rows which cells are fitted."""
    for r in range(first, last):
        for c in range(state.shape[1]):
            fitted[r, c] = state[r, c] == HIGH and _evidence_of(bins[r, c], rules) >= 0.0


def score_cells(
    cells: Cells, bins: Bins, background: Background, weights: Weights, *, threads: Threads = ONE_THREAD
) -> Scores:
    """Return the score of each cell in thousandths of a nat; the arguments are those of `fitted_cells`."""
    rules = _rules(background, weights)
    score, limited = np.empty(bins.shape, dtype=np.int16), np.empty(bins.shape, dtype=np.int16)
    threads.bands(lambda first, last: _score(cells.height, cells.state, bins, rules, first, last, score), len(bins))
    reach = max(1, round(_AROUND / cells.grid.gsd))
    threads.bands(lambda first, last: restrain(score, cells.state, reach, first, last, limited), len(bins))
    return limited


@kernel
def restrain(score: Scores, state: States, reach: int, first: int, last: int, limited: Scores) -> None:
    """Fill the scores of some rows, of high cells at most the mean of the high cells within some rows and columns."""
    rows, columns = score.shape
    for r in range(first, last):
        for c in range(columns):
            limited[r, c] = score[r, c]
            if state[r, c] != HIGH:
                continue
            total, many = 0, 0
            for i in range(max(r - reach, 0), min(r + reach + 1, rows)):
                for j in range(max(c - reach, 0), min(c + reach + 1, columns)):
                    if state[i, j] == HIGH:
                        total += score[i, j]
                        many += 1
            limited[r, c] = min(int(score[r, c]), total // many)


@kernel(inline="always")
def _milli(nats: float) -> np.int16:
    """Return thousandths of a nat, within what 16 bits hold."""
    return np.int16(min(max(round(nats * MILLI), -32767), 32767))


@kernel(inline="always")
def _log_crown(height: float, rules: _Rules) -> float:
    """Return log p(height | crown) of a height in centimetres, not less than its floor."""
    return max(
        rules.crown_level - 0.5 * ((0.01 * height - rules.crown_height) / rules.crown_spread) ** 2, _HEIGHT_FLOOR
    )


@kernel
def _score(height: Heights, state: States, bins: Bins, rules: _Rules, first: int, last: int, score: Scores) -> None:
    """Fill the scores of some rows."""
    for r in range(first, last):
        for c in range(state.shape[1]):
            score[r, c] = _milli(-rules.void)
            if state[r, c] == LOW:
                score[r, c] = _milli(-rules.low)
            elif state[r, c] == HIGH:
                best = _evidence_of(bins[r, c], rules)
                if best < 0.0:
                    score[r, c] = _milli(best)
                    continue
                score[r, c] = _milli(best - rules.fit * _log_crown(height[r, c], rules))


def mean_evidence(
    rectangles: Rectangles,
    height: NDArray[np.uint16],
    state: States,
    score: Scores,
    background: Background,
    weights: Weights,
) -> Floats:
    """Return the mean evidence, as restrained by what lies around, of the high cells in each rectangle.

    Nats, shape (n,); 0 without such a cell. The share of a score that is the height in crowns is removed again.
    """
    means: Floats = _mean_evidence(rectangles, height, state, score, _rules(background, weights))
    return means


@kernel
def _mean_evidence(
    rectangles: Rectangles, height: NDArray[np.uint16], state: States, score: Scores, rules: _Rules
) -> Floats:
    """Return the mean evidence of each rectangle."""
    rows, columns = state.shape
    means = np.zeros(len(rectangles))
    for k in range(len(rectangles)):
        cx, cy, half_a, half_b = rectangles[k, 0], rectangles[k, 1], 0.5 * rectangles[k, 2], 0.5 * rectangles[k, 3]
        cos, sin = math.cos(rectangles[k, 4]), math.sin(rectangles[k, 4])
        tall = half_a * abs(sin) + half_b * abs(cos)
        total, cells = 0.0, 0
        for r in range(max(math.floor(cy - tall), 0), min(math.ceil(cy + tall), rows)):
            lo, hi = row_span(r + 0.5 - cy, half_a, half_b, cos, sin)
            if lo >= hi:
                continue
            for c in range(max(math.ceil(cx + lo - 0.5), 0), min(math.floor(cx + hi + 0.5), columns)):
                if state[r, c] != HIGH:
                    continue
                cells += 1
                total += score[r, c] / MILLI
                # Only scores with evidence for a roof hold the height in crowns (`_score`).
                if score[r, c] > 0:
                    total += rules.fit * _log_crown(height[r, c], rules)
        if cells > 0:
            means[k] = total / cells
    return means
