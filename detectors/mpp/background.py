"""What is no building: how likely a cell's height and texture are on the ground, in a crown and on a roof.

Nouns
-----
window
    3 x 3 cells, all of them high.
roughness
    Root mean square distance of a window's heights from their best plane, metres.
openness
    Mean share of points that a closed surface would not give (see `cells`), of a window.
texture
    Roughness and openness of the smoothest window that holds a cell, so that cells at the edge of a roof are judged by
    the roof and not by the edge.
evidence
    log p(texture | roof) - log p(texture | crown), nats.
score
    What a cell adds to a rectangle besides the fit of its roof: for a high cell with evidence for a roof, evidence -
    log p(height | crown); with evidence against it, the evidence; for a low and for a void cell a fixed price. A high
    cell has no more than the mean of the high cells within `_AROUND` metres: in a crown of few points smooth places lie
    among rough ones by chance, and a rectangle could be drawn around each handful of them.

Texture of the two classes is estimated from the scene by EM (expectation maximisation) on a histogram of cells, and
held near what roofs and crowns are by pseudo-counts, so that a scene of roofs alone or of crowns alone keeps two
classes. The crowns' heights are Gaussian as in Yu, Li, Guan & Wang (2013), equation 1, with a floor for outliers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .cells import HIGH, LOW, Cells
from .rectangles import row_span
from .tables import MILLI
from .threads import ONE_THREAD, Threads

__all__ = ["Background", "estimate_background", "fitted_cells", "restrain", "score_cells", "textures"]

#: Bins of the histogram: log roughness from 1 cm to 4 m, openness from 0 to 1.
_ROUGH_BINS, _OPEN_BINS = 24, 8
_LOG_LOW, _LOG_HIGH = math.log(0.01), math.log(4.0)
#: What roofs and crowns are like before a scene is seen: median roughness (m) in windows of cells of `_COMMON`, spread
#: of its logarithm, openness. A wider window holds more ridges and steps: roofs grow as the cell, crowns as its root.
_ROOF_ROUGH, _CROWN_ROUGH = (0.05, 0.75), (0.40, 0.55)
_COMMON = 0.5
_ROOF_OPEN = (0.70, 0.12, 0.07, 0.04, 0.03, 0.02, 0.01, 0.01)
_CROWN_OPEN = (0.22, 0.10, 0.10, 0.10, 0.10, 0.12, 0.12, 0.14)
#: log p(height | crown) is not less than this, so that a bird or a tower is no proof of anything.
_HEIGHT_FLOOR = -5.0
#: Metres along x and y within which the scores of high cells are averaged.
_AROUND = 1.0
#: A high cell that no window holds (a pole, a wall, the rim of a crown) has this evidence.
_THIN = -1.0


@dataclass(frozen=True)
class Background:
    """The estimated classes.

    Attributes
    ----------
    crown_height, crown_spread : float
        Mean and standard deviation of heights in crowns, metres.
    crown_share : float
        Share of cells in crowns.
    roof_roughness, crown_roughness : float
        Median roughness, metres.
    evidence : tuple of tuple of float
        Nats per bin of log roughness and of openness, (24, 8).
    cells : int
        How many cells it was estimated from.
    """

    crown_height: float
    crown_spread: float
    crown_share: float
    roof_roughness: float
    crown_roughness: float
    evidence: tuple[tuple[float, ...], ...]
    cells: int


def textures(
    height: NDArray[np.int32], state: NDArray[np.uint8], openness: NDArray[np.uint8], *, threads: Threads = ONE_THREAD
) -> NDArray[np.int16]:
    """Return the bin of the texture of each cell, -1 where no window holds it: shape (rows, columns)."""
    rows = state.shape[0]
    windows, bins = np.empty(state.shape, dtype=np.int16), np.empty(state.shape, dtype=np.int16)
    threads.bands(lambda first, last: _describe_windows(height, state, openness, first, last, windows), rows)
    threads.bands(lambda first, last: _choose_windows(windows, state, first, last, bins), rows)
    return bins


#: Bin of what is no window.
_NONE = np.int16(_ROUGH_BINS * _OPEN_BINS)


@kernel
def _describe_windows(height, state, openness, first, last, windows):  # type: ignore[no-untyped-def]
    """Fill the bin of the window around each cell of some rows."""
    rows, columns = state.shape
    for r in range(first, last):
        for c in range(columns):
            windows[r, c] = _NONE
            if state[r, c] != HIGH or r == 0 or r == rows - 1 or c == 0 or c == columns - 1:
                continue
            total, squares, east, south, openly = 0, 0, 0, 0, 0
            whole = True
            for i in range(-1, 2):
                for j in range(-1, 2):
                    if state[r + i, c + j] != HIGH:
                        whole = False
                    h = height[r + i, c + j] - height[r, c]
                    total += h
                    squares += h * h
                    east += j * h
                    south += i * h
                    openly += openness[r + i, c + j]
            if not whole:
                continue
            residual = squares - total * total / 9.0 - (east * east + south * south) / 6.0
            rough = 0.01 * math.sqrt(max(residual, 0.0) / 6.0)
            share = (math.log(max(rough, 0.01)) - _LOG_LOW) / (_LOG_HIGH - _LOG_LOW)
            a = min(int(share * _ROUGH_BINS), _ROUGH_BINS - 1)
            b = min(int(openly / 9.0 / 255.0 * _OPEN_BINS), _OPEN_BINS - 1)
            windows[r, c] = a * _OPEN_BINS + b


@kernel
def _choose_windows(windows, state, first, last, bins):  # type: ignore[no-untyped-def]
    """Give each cell of some rows the bin of the smoothest window that holds it."""
    rows, columns = windows.shape
    for r in range(first, last):
        for c in range(columns):
            bins[r, c] = -1
            if state[r, c] != HIGH:
                continue
            least = _NONE
            for i in range(max(r - 1, 0), min(r + 2, rows)):
                for j in range(max(c - 1, 0), min(c + 2, columns)):
                    least = min(least, windows[i, j])
            if least < _NONE:
                bins[r, c] = least


@kernel
def _tally(bins, height, first, last):  # type: ignore[no-untyped-def]
    """Return n, sum of heights, of their squares (centimetres) of each bin in some rows, shape (192, 3), int64."""
    tally = np.zeros((_ROUGH_BINS * _OPEN_BINS, 3), dtype=np.int64)
    for r in range(first, last):
        for c in range(bins.shape[1]):
            k = bins[r, c]
            if k >= 0:
                h = np.int64(height[r, c])
                tally[k, 0] += 1
                tally[k, 1] += h
                tally[k, 2] += h * h
    return tally


def _log_likelihoods(
    rough: NDArray[np.float64], means: list[float], spreads: list[float], opens: list[NDArray[np.float64]]
) -> list[NDArray[np.float64]]:
    """Return the log-likelihood of each bin of roughness and openness, shape (24, 8), in each class."""
    return [
        -0.5 * ((rough - mean) / spread)[:, None] ** 2 - math.log(spread) + np.log(opening)[None, :]
        for mean, spread, opening in zip(means, spreads, opens, strict=True)
    ]


def estimate_background(cells: Cells, *, threads: Threads = ONE_THREAD) -> tuple[Background, NDArray[np.int16]]:
    """Estimate the classes of a scene; also return the bin of each cell's texture (-1: no window holds it)."""
    bins = textures(cells.height, cells.state, cells.openness, threads=threads)
    tally = np.sum(threads.bands(lambda first, last: _tally(bins, cells.height, first, last), len(bins)), axis=0)
    counts = tally[:, 0].astype(np.float64).reshape(_ROUGH_BINS, _OPEN_BINS)
    rough = _LOG_LOW + (np.arange(_ROUGH_BINS) + 0.5) * (_LOG_HIGH - _LOG_LOW) / _ROUGH_BINS
    size_of_sample = int(counts.sum())
    pseudo = max(200.0, 0.1 * size_of_sample)
    wider = cells.grid.gsd / _COMMON
    before = ((wider * _ROOF_ROUGH[0], _ROOF_ROUGH[1]), (math.sqrt(wider) * _CROWN_ROUGH[0], _CROWN_ROUGH[1]))
    means, spreads = [math.log(centre) for centre, _ in before], [width for _, width in before]
    opens = [np.array(_ROOF_OPEN), np.array(_CROWN_OPEN)]
    share = 0.5
    belongs = np.full(counts.shape, 0.5)
    for _ in range(20):
        logs = _log_likelihoods(rough, means, spreads, opens)
        odds = logs[1] - logs[0] + math.log(share / (1 - share))
        belongs = 1 / (1 + np.exp(-np.clip(odds, -50, 50)))
        for k, weight in enumerate((counts * (1 - belongs), counts * belongs)):
            centre, width = before[k]
            by_rough = weight.sum(axis=1)
            size = by_rough.sum() + pseudo
            means[k] = float((by_rough @ rough + pseudo * math.log(centre)) / size)
            scatter = by_rough @ (rough - means[k]) ** 2 + pseudo * (width**2 + (math.log(centre) - means[k]) ** 2)
            spreads[k] = float(np.clip(math.sqrt(scatter / size), 0.4, 1.0))
            opens[k] = (weight.sum(axis=0) + pseudo * np.array((_ROOF_OPEN, _CROWN_OPEN)[k])) / size
        share = float(np.clip(((counts * belongs).sum() + 100) / (size_of_sample + 200), 0.02, 0.98))
    logs = _log_likelihoods(rough, means, spreads, opens)
    evidence = logs[0] - logs[1]
    # A smoother window is never less of a roof: the tail of the narrower class must not turn the ratio round.
    evidence = np.minimum.accumulate(evidence, axis=0)
    evidence = np.minimum.accumulate(evidence, axis=1)
    size, rise, squares = belongs.ravel() @ (tally * np.array([1.0, 1e-2, 1e-4]))
    crown_height = (rise + 100.0 * 6.0) / (size + 100.0)
    scatter = squares - 2.0 * crown_height * rise + crown_height**2 * size
    crown_spread = math.sqrt((max(scatter, 0.0) + 100.0 * 9.0) / (size + 100.0))
    background = Background(
        crown_height=float(crown_height),
        crown_spread=max(crown_spread, 2.0),
        crown_share=share,
        roof_roughness=math.exp(means[0]),
        crown_roughness=math.exp(means[1]),
        evidence=tuple(tuple(float(value) for value in row) for row in evidence),
        cells=size_of_sample,
    )
    return background, bins


def fitted_cells(
    cells: Cells,
    bins: NDArray[np.int16],
    background: Background,
    *,
    texture_weight: float,
    texture_limit: float,
    threads: Threads = ONE_THREAD,
) -> NDArray[np.bool_]:
    """Return which cells take part in the fit of a roof: high ones whose texture does not speak against one.

    A wall, a chimney or a branch over the eaves pays its evidence (see `score_cells`), but does not spoil the fit: a
    Gaussian would let a few such cells outweigh a thousand good ones.

    Parameters
    ----------
    cells : Cells
    bins : ndarray of int16, shape (rows, columns)
        As `textures` returns them.
    background : Background
    texture_weight, texture_limit : float
        As for `score_cells`.
    threads : Threads
    """
    evidence, thin = _evidence(background, texture_weight, texture_limit), texture_weight * _THIN
    fitted = np.empty(bins.shape, dtype=np.bool_)
    threads.bands(lambda first, last: _choose_fitted(cells.state, bins, evidence, thin, first, last, fitted), len(bins))
    return fitted


def _evidence(background: Background, weight: float, limit: float) -> NDArray[np.float64]:
    """Return the evidence of each bin."""
    return np.clip(weight * np.array(background.evidence), -limit, limit).ravel()


@kernel
def _choose_fitted(state, bins, evidence, thin, first, last, fitted):  # type: ignore[no-untyped-def]
    for r in range(first, last):
        for c in range(state.shape[1]):
            fitted[r, c] = state[r, c] == HIGH and (evidence[bins[r, c]] if bins[r, c] >= 0 else thin) >= 0.0


def score_cells(
    cells: Cells,
    bins: NDArray[np.int16],
    background: Background,
    *,
    fit_weight: float,
    texture_weight: float,
    texture_limit: float,
    low_price: float,
    void_price: float,
    threads: Threads = ONE_THREAD,
) -> NDArray[np.int16]:
    """Return the score of each cell in thousandths of a nat.

    Parameters
    ----------
    cells : Cells
    bins : ndarray of int16, shape (rows, columns)
        As `textures` returns them.
    background : Background
    fit_weight : float
        Factor of the likelihood of heights.
    texture_weight, texture_limit : float
        Factor of the evidence (windows of neighbours share cells, so they are no independent witnesses), and the
        bound of its absolute value, nats.
    low_price, void_price : float
        Nats that a low and a void cell cost.
    threads : Threads
    """
    evidence = _evidence(background, texture_weight, texture_limit)
    score, modest = np.empty(bins.shape, dtype=np.int16), np.empty(bins.shape, dtype=np.int16)
    crowns = (background.crown_height, background.crown_spread)
    prices = (texture_weight * _THIN, low_price, void_price)

    def work(first: int, last: int) -> None:
        _score(cells.height, cells.state, bins, evidence, crowns, fit_weight, prices, first, last, score)

    threads.bands(work, len(bins))
    reach = max(1, round(_AROUND / cells.grid.gsd))
    threads.bands(lambda first, last: restrain(score, cells.state, reach, first, last, modest), len(bins))
    return modest


@kernel
def restrain(score, state, reach, first, last, modest):  # type: ignore[no-untyped-def]
    """Fill the scores of some rows, of high cells at most the mean of the high cells within some rows and columns."""
    rows, columns = score.shape
    for r in range(first, last):
        for c in range(columns):
            modest[r, c] = score[r, c]
            if state[r, c] != HIGH:
                continue
            total, many = 0, 0
            for i in range(max(r - reach, 0), min(r + reach + 1, rows)):
                for j in range(max(c - reach, 0), min(c + reach + 1, columns)):
                    if state[i, j] == HIGH:
                        total += score[i, j]
                        many += 1
            modest[r, c] = min(np.int64(score[r, c]), total // many)


@kernel(inline="always")
def _milli(nats):  # type: ignore[no-untyped-def]
    """Return thousandths of a nat, within what 16 bits hold."""
    return np.int16(min(max(round(nats * MILLI), -32767), 32767))


@kernel
def _score(height, state, bins, evidence, crowns, fit_weight, prices, first, last, score):  # type: ignore[no-untyped-def]
    mean, spread = crowns
    thin, low_price, void_price = prices
    level = -math.log(spread * math.sqrt(2.0 * math.pi))
    for r in range(first, last):
        for c in range(state.shape[1]):
            score[r, c] = _milli(-void_price)
            if state[r, c] == LOW:
                score[r, c] = _milli(-low_price)
            elif state[r, c] == HIGH:
                best = evidence[bins[r, c]] if bins[r, c] >= 0 else thin
                if best < 0.0:
                    score[r, c] = _milli(best)
                    continue
                log_crown = level - 0.5 * ((0.01 * height[r, c] - mean) / spread) ** 2
                score[r, c] = _milli(best - fit_weight * max(log_crown, _HEIGHT_FLOOR))


def mean_evidence(
    rectangles: NDArray[np.float64],
    height: NDArray[np.uint16],
    state: NDArray[np.uint8],
    score: NDArray[np.int16],
    background: Background,
    *,
    fit_weight: float,
) -> NDArray[np.float64]:
    """Return the mean evidence, as restrained by what lies around, of the high cells in each rectangle.

    Nats, shape (n,); 0 without such a cell. Heights in crowns, which a score holds besides, are taken out again.
    """
    crowns = (background.crown_height, background.crown_spread)
    means: NDArray[np.float64] = _mean_evidence(rectangles, height, state, score, crowns, fit_weight)
    return means


@kernel
def _mean_evidence(rectangles, height, state, score, crowns, fit_weight):  # type: ignore[no-untyped-def]
    mean, spread = crowns
    level = -math.log(spread * math.sqrt(2.0 * math.pi))
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
                # Only evidence for a roof was given the height in a crown (`_score`).
                if score[r, c] > 0:
                    log_crown = level - 0.5 * ((0.01 * height[r, c] - mean) / spread) ** 2
                    total += fit_weight * max(log_crown, _HEIGHT_FLOOR)
        if cells > 0:
            means[k] = total / cells
    return means
