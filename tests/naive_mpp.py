"""Slow, obvious oracles of the marked point process."""

import math

import numpy as np


def cells_inside(rectangle, rows, columns):
    """Mask of the cells whose centre is inside."""
    y, x = np.mgrid[:rows, :columns] + 0.5
    dx, dy = x - rectangle[0], y - rectangle[1]
    cos, sin = math.cos(rectangle[4]), math.sin(rectangle[4])
    return (np.abs(dx * cos + dy * sin) <= rectangle[2] / 2) & (np.abs(dy * cos - dx * sin) <= rectangle[3] / 2)


def frame(rectangle, rows, columns):
    """Coordinates u, v of all cell centres."""
    y, x = np.mgrid[:rows, :columns] + 0.5
    dx, dy = x - rectangle[0], y - rectangle[1]
    cos, sin = math.cos(rectangle[4]), math.sin(rectangle[4])
    return dx * cos + dy * sin, dy * cos - dx * sin


def roof_residuals(heights, u, v, a, b):
    """Squared residuals of the five roofs by least squares on the cells: flat, plane, two gables, hip.

    A ridge roof that would fall inwards counts as flat.
    """
    flat = float(((heights - heights.mean()) ** 2).sum())

    def fitted(*columns):
        design = np.column_stack([np.ones(len(heights)), *columns])
        coefficients = np.linalg.lstsq(design, heights, rcond=None)[0]
        return float(((heights - design @ coefficients) ** 2).sum()), coefficients

    def ridge(t):
        residual, coefficients = fitted(t)
        return residual if coefficients[1] < 0 else flat

    longer, shorter, ridge_half = (u, v, (a - b) / 2) if a >= b else (v, u, (b - a) / 2)
    hip = np.maximum(np.abs(shorter), np.abs(longer) - ridge_half)
    return flat, fitted(u, v)[0], ridge(np.abs(v)), ridge(np.abs(u)), ridge(hip)


def log_normal_sum(residual, n, least_tau):
    """Gaussian log-likelihood with profiled spread, term by term."""
    tau = max(math.sqrt(residual / n), least_tau)
    return n * (-math.log(tau) - 0.5 * math.log(2 * math.pi)) - residual / (2 * tau**2)
