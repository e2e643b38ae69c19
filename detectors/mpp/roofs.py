"""Roofs: the surface that fits the cells inside a rectangle best.

Nouns
-----
roof
    A surface over the rectangle: `FLAT` h = m; `PLANE` h = m + p u + q v; `GABLE_U`, `GABLE_V` h = m - s t with
    t = |v| (ridge along u) or |u|; `HIP` with t = max(|v|, |u| - (a - b)/2) for a >= b (a pyramid when a = b).
tau
    Standard deviation of heights around the roof, metres, not less than the least one that a real roof has.

A roof is chosen by its Gaussian log-likelihood with tau profiled, less a price for each number it has more than a flat
one. Source of the flat one: Yu, Li, Guan & Wang (2013), equation 1; the others are roofbench's (docs/results/mpp.md).
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from ...core.kernels import kernel
from .arrays import Rectangles
from .rectangle_sums import Sums, scan, scan_halves, scan_hip
from .tables import Tables

__all__ = ["KINDS", "Roof", "RoofFit", "RoofRules", "choose_roof", "fit_roof", "log_likelihood"]


class Roof(IntEnum):
    """Kinds of roofs."""

    FLAT = 0
    PLANE = 1
    GABLE_U = 2
    GABLE_V = 3
    HIP = 4


#: Names of the roofs, by their number.
KINDS = ("flat", "plane", "gable", "gable", "hip")


class RoofRules(NamedTuple):
    """How a roof is chosen.

    Attributes
    ----------
    price : float
        Nats per number that a roof has more than a flat one; infinite allows flat roofs alone.
    least_tau : float
        Metres.
    least_height : float
        Metres. A roof whose mean height is below it is a flat one at the least height.
    cell : float
        Metres.
    """

    price: float
    least_tau: float
    least_height: float
    cell: float


class RoofFit(NamedTuple):
    """The roof of a rectangle.

    Attributes
    ----------
    likelihood : float
        Of the heights of its high cells under its roof, less the price; 0 without a high cell. Nats.
    cells : float
        High cells.
    height, tau : float
        Mean and standard deviation around the roof, metres.
    kind : Roof
    slope : float
        Metres per metre, 0 of a flat one.
    """

    likelihood: float
    cells: float
    height: float
    tau: float
    kind: int
    slope: float


#: A hip is tried where a gable won and that along the longer side falls by at least this, metres per metre.
_STEEP = 0.12
#: Fewer high cells than this have a flat roof.
_FEWEST_CELLS = 8.0


@kernel
def log_likelihood(n: float, residual: float, least_tau: float) -> float:
    """Gaussian log-likelihood of n heights whose squared residuals sum up to `residual`, tau profiled; 0 of none."""
    variance = max(residual / max(n, 1.0), least_tau * least_tau)
    return -0.5 * n * math.log(2.0 * math.pi * variance) - 0.5 * residual / variance


@kernel
def _ridge_residual(n: float, t: float, tt: float, h: float, th: float, level: float) -> tuple[float, float]:
    """Residual of h = m - s t with s > 0, and s; the flat residual `level` when the roof does not fall outwards."""
    spread = tt - t * t / n
    if spread <= 1e-9:
        return level, 0.0
    slope = (th - t * h / n) / spread
    if slope >= 0.0:
        return level, 0.0
    return max(level - slope * slope * spread, 0.0), -slope


@kernel
def _plane_residual(sums: Sums, level: float) -> float:
    """Residual of the best plane."""
    n, u, v, h = sums.n, sums.u, sums.v, sums.h
    uu, uv, vv = sums.uu - u * u / n, sums.uv - u * v / n, sums.vv - v * v / n
    uh, vh = sums.uh - u * h / n, sums.vh - v * h / n
    determinant = uu * vv - uv * uv
    if determinant <= 1e-9 * (uu * vv + 1.0):
        return level
    explained = (uh * uh * vv - 2.0 * uh * vh * uv + vh * vh * uu) / determinant
    return max(level - explained, 0.0)


@kernel
def choose_roof(
    tables: Tables, rectangle: Rectangles, sums: Sums, rules: RoofRules, explained: float, needed: float
) -> tuple[float, float, int, float]:
    """Choose the roof of a rectangle.

    Parameters
    ----------
    tables : Tables
    rectangle : ndarray, shape (5,)
    sums : Sums
        Of the rectangle.
    rules : RoofRules
    explained : float
        Variance of heights, m2, that the roof need not explain: only what exceeds it counts.
    needed : float
        Roofs that cannot be likelier than this are not tried: the likelihood is exact if it is more than this, else any
        number that is not more.

    Returns
    -------
    likelihood, residual, kind, slope
    """
    n, u, v, h = sums.n, sums.u, sums.v, sums.h
    if n < 1.0:
        return 0.0, 0.0, Roof.FLAT, 0.0
    mean = h / n
    level = max(sums.hh - h * mean, 0.0)
    if mean < rules.least_height:
        level += n * (rules.least_height - mean) ** 2
    residual, kind, slope = level, Roof.FLAT, 0.0
    slack, least_tau = n * explained, rules.least_tau
    best = log_likelihood(n, max(level - slack, 0.0), least_tau)
    if mean < rules.least_height or n < _FEWEST_CELLS or rules.price == np.inf:
        return best, residual, kind, slope
    at_best = log_likelihood(n, 0.0, least_tau) - rules.price
    if at_best <= max(best, needed):
        return best, residual, kind, slope
    trial = _plane_residual(sums, level)
    value = log_likelihood(n, max(trial - slack, 0.0), least_tau) - 2.0 * rules.price
    if value > best:
        best, residual, kind = value, trial, Roof.PLANE
    if at_best <= best:
        return best, residual, kind, slope
    u_half, uh_half, v_half, vh_half = scan_halves(tables, rectangle)
    along_u, slope_u = _ridge_residual(n, 2.0 * v_half - v, sums.vv, h, 2.0 * vh_half - sums.vh, level)
    value = log_likelihood(n, max(along_u - slack, 0.0), least_tau) - rules.price
    if value > best:
        best, residual, kind, slope = value, along_u, Roof.GABLE_U, slope_u / rules.cell
    along_v, slope_v = _ridge_residual(n, 2.0 * u_half - u, sums.uu, h, 2.0 * uh_half - sums.uh, level)
    value = log_likelihood(n, max(along_v - slack, 0.0), least_tau) - rules.price
    if value > best:
        best, residual, kind, slope = value, along_v, Roof.GABLE_V, slope_v / rules.cell
    steep = (slope_u if rectangle[2] >= rectangle[3] else slope_v) / rules.cell
    gable = kind == Roof.GABLE_U or kind == Roof.GABLE_V
    if gable and steep > _STEEP and residual - slack > n * least_tau * least_tau:
        trial, slope_h = _hip_residual(tables, rectangle, n, h, level)
        value = log_likelihood(n, max(trial - slack, 0.0), least_tau) - rules.price
        if value > best:
            best, residual, kind, slope = value, trial, Roof.HIP, slope_h / rules.cell
    return best, residual, kind, slope


@kernel
def fit_roof(tables: Tables, rectangle: Rectangles, rules: RoofRules, explained: float) -> RoofFit:
    """Return the roof of a rectangle; the arguments are those of `choose_roof`."""
    sums = scan(tables, rectangle)
    best, residual, kind, slope = choose_roof(tables, rectangle, sums, rules, explained, -np.inf)
    n = max(sums.n, 1.0)
    return RoofFit(best, sums.n, sums.h / n, max(math.sqrt(residual / n), rules.least_tau), kind, slope)


@kernel
def _hip_residual(tables: Tables, rectangle: Rectangles, n: float, h: float, level: float) -> tuple[float, float]:
    """Residual of a hip roof whose ridge runs along the longer side, and its slope."""
    longer = rectangle.copy()
    if longer[2] < longer[3]:
        longer[2], longer[3], longer[4] = rectangle[3], rectangle[2], rectangle[4] + 0.5 * math.pi
    t, tt, th = scan_hip(tables, longer)
    residual, slope = _ridge_residual(n, t, tt, h, th, level)
    return residual, slope
