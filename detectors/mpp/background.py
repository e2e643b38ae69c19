"""Background: texture and height of crowns, and texture of roofs, estimated from the scene.

Nouns
-----
class
    Roof or crown (of a tree).
evidence
    log p(texture | roof) - log p(texture | crown), nats.

Textures of the two classes are estimated by EM (expectation maximisation) on a histogram of cells, and kept near
typical values by pseudo-counts, so that a scene of roofs alone or of crowns alone keeps two classes. The heights of
crowns are Gaussian as in Yu, Li, Guan & Wang (2013), equation 1.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core.kernels import kernel
from .arrays import Floats, Heights, Integers
from .cells import Cells
from .textures import LOG_HIGH, LOG_LOW, OPENNESS_BINS, ROUGHNESS_BINS, Bins, textures
from .threads import ONE_THREAD, Threads

__all__ = ["Background", "estimate_background", "tally_textures"]

#: Priors of roofs and crowns: median roughness (m) in windows of cells of `_COMMON` metres,
#: spread of its logarithm, openness. A wider window holds more ridges and steps: roofs grow as the cell, crowns as its
#: square root.
_ROOF_ROUGHNESS, _CROWN_ROUGHNESS = (0.05, 0.75), (0.40, 0.55)
_COMMON = 0.5
_ROOF_OPENNESS = (0.70, 0.12, 0.07, 0.04, 0.03, 0.02, 0.01, 0.01)
_CROWN_OPENNESS = (0.22, 0.10, 0.10, 0.10, 0.10, 0.12, 0.12, 0.14)
#: Middle of each bin of openness.
_OPENNESS = (np.arange(OPENNESS_BINS) + 0.5) / OPENNESS_BINS
#: Pseudo-counts of each class: cells at least, and share of the cells.
_PSEUDO_CELLS, _PSEUDO_SHARE = 200.0, 0.1
#: Nats in favour of a roof where openness is not known: roughness alone takes half of an old town for crowns.
_WITHOUT_OPENNESS = 0.25
#: Steps of the EM, and range of the spread of the logarithm of roughness.
_STEPS = 20
_NARROW, _WIDE = 0.4, 1.0
#: Range of the share of crowns, and pseudo-counts of each class in it.
_FEWEST_CROWNS, _MOST_CROWNS, _SHARE_CELLS = 0.02, 0.98, 100.0
#: Metres: prior mean and standard deviation of heights in crowns, weighted as so many pseudo-counts, and the
#: least standard deviation.
_CROWN_HEIGHT, _CROWN_SPREAD, _HEIGHT_CELLS, _LEAST_SPREAD = 6.0, 3.0, 100.0, 2.0


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
    crown_openness : float
        Mean openness of crowns, 0 to 1; nan where openness is not known.
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
    crown_openness: float
    evidence: tuple[tuple[float, ...], ...]
    cells: int


@kernel
def _tally(bins: Bins, height: Heights, first: int, last: int) -> Integers:
    """Return n, sum of heights, of their squares (centimetres) of each bin in some rows, shape (192, 3), int64."""
    tally = np.zeros((ROUGHNESS_BINS * OPENNESS_BINS, 3), dtype=np.int64)
    for r in range(first, last):
        for c in range(bins.shape[1]):
            k = bins[r, c]
            if k >= 0:
                h = np.int64(height[r, c])
                tally[k, 0] += 1
                tally[k, 1] += h
                tally[k, 2] += h * h
    return tally


def _log_likelihoods(logs: Floats, means: list[float], spreads: list[float], opens: list[Floats]) -> list[Floats]:
    """Return the log-likelihood of each bin in each class, shape (24, 8); `logs` are logarithms of roughness."""
    return [
        -0.5 * ((logs - mean) / spread)[:, None] ** 2 - math.log(spread) + np.log(opening)[None, :]
        for mean, spread, opening in zip(means, spreads, opens, strict=True)
    ]


def tally_textures(
    cells: Cells, extent: Sequence[float] | None = None, *, threads: Threads = ONE_THREAD
) -> tuple[Integers, Bins]:
    """Return n, sum of heights and of their squares (cm) of each bin, shape (192, 3), and the bin of each cell.

    With an extent only the cells in it count.
    """
    bins = textures(cells.height, cells.state, cells.openness, threads=threads)
    part = None if extent is None else cells.grid.part(extent)
    counted = (
        (bins, cells.height) if part is None else tuple(map(np.ascontiguousarray, (bins[part], cells.height[part])))
    )
    tally = np.sum(threads.bands(lambda first, last: _tally(*counted, first, last), len(counted[0])), axis=0)
    return tally, bins


def estimate_background(tally: Integers, cell: float, *, openness: bool = True) -> Background:
    """Estimate the classes of a scene from what `tally_textures` counted in it, in cells of so many metres.

    Without openness, textures are rated by their roughness alone, from a prior in favour of roofs.
    """
    counts = tally[:, 0].astype(np.float64).reshape(ROUGHNESS_BINS, OPENNESS_BINS)
    logs = LOG_LOW + (np.arange(ROUGHNESS_BINS) + 0.5) * (LOG_HIGH - LOG_LOW) / ROUGHNESS_BINS
    size_of_sample = int(counts.sum())
    pseudo = max(_PSEUDO_CELLS, _PSEUDO_SHARE * size_of_sample)
    wider = cell / _COMMON
    before = (
        (wider * _ROOF_ROUGHNESS[0], _ROOF_ROUGHNESS[1]),
        (math.sqrt(wider) * _CROWN_ROUGHNESS[0], _CROWN_ROUGHNESS[1]),
    )
    # The same in both classes, openness cancels out.
    openness_before = np.array(_ROOF_OPENNESS), np.array(_CROWN_OPENNESS if openness else _ROOF_OPENNESS)
    means, spreads = [math.log(centre) for centre, _ in before], [width for _, width in before]
    opens = list(openness_before)
    share = 0.5
    belongs = np.full(counts.shape, 0.5)
    for _ in range(_STEPS):
        likelihoods = _log_likelihoods(logs, means, spreads, opens)
        odds = likelihoods[1] - likelihoods[0] + math.log(share / (1 - share))
        belongs = 1 / (1 + np.exp(-np.minimum(np.maximum(odds, -50), 50)))
        for k, weight in enumerate((counts * (1 - belongs), counts * belongs)):
            centre, width = before[k]
            by_roughness = weight.sum(axis=1)
            size = by_roughness.sum() + pseudo
            means[k] = float((by_roughness @ logs + pseudo * math.log(centre)) / size)
            scatter = by_roughness @ (logs - means[k]) ** 2 + pseudo * (width**2 + (math.log(centre) - means[k]) ** 2)
            spreads[k] = min(max(math.sqrt(scatter / size), _NARROW), _WIDE)
            if openness:
                opens[k] = (weight.sum(axis=0) + pseudo * openness_before[k]) / size
        in_crowns = (counts * belongs).sum() + _SHARE_CELLS
        share = float(min(max(in_crowns / (size_of_sample + 2 * _SHARE_CELLS), _FEWEST_CROWNS), _MOST_CROWNS))
    likelihoods = _log_likelihoods(logs, means, spreads, opens)
    evidence = likelihoods[0] - likelihoods[1] + (0.0 if openness else _WITHOUT_OPENNESS)
    # A smoother window is never less likely to be a roof: the tail of the narrower class must not reverse the ratio.
    evidence = np.minimum.accumulate(evidence, axis=0)
    evidence = np.minimum.accumulate(evidence, axis=1)
    size, rise, squares = belongs.ravel() @ (tally * np.array([1.0, 1e-2, 1e-4]))
    crown_height = (rise + _HEIGHT_CELLS * _CROWN_HEIGHT) / (size + _HEIGHT_CELLS)
    scatter = squares - 2.0 * crown_height * rise + crown_height**2 * size
    crown_spread = math.sqrt((max(scatter, 0.0) + _HEIGHT_CELLS * _CROWN_SPREAD**2) / (size + _HEIGHT_CELLS))
    return Background(
        crown_height=float(crown_height),
        crown_spread=max(crown_spread, _LEAST_SPREAD),
        crown_share=share,
        roof_roughness=math.exp(means[0]),
        crown_roughness=math.exp(means[1]),
        crown_openness=float(opens[1] @ _OPENNESS) if openness else math.nan,
        evidence=tuple(tuple(float(value) for value in row) for row in evidence),
        cells=size_of_sample,
    )
