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


def cells(x, y, height, returns, shape, cell, low):
    """Height in centimetres, state (0 void, 1 low, 2 high) and openness of cells, point by point and cell by cell.

    North-west corner at (0, 0), `height` above ground in metres, `low` in centimetres.
    """
    held = {}
    for east, north, h, many in zip(x, y, height, returns, strict=True):
        r, c = math.floor(-north / cell), math.floor(east / cell)
        if 0 <= r < shape[0] and 0 <= c < shape[1]:
            held.setdefault((r, c), []).append((math.floor(100 * h + 0.5), many))
    tops, state, openness = (np.zeros(shape, int) for _ in range(3))
    for place, points in held.items():
        high = [level for level, _ in points if level > low]
        state[place] = 2 if 2 * len(high) > len(points) else 1
        if state[place] == 2:
            near = [level for level in high if level >= max(high) - 75]
            tops[place] = sum(near) // len(near)
            open_points = max(len(points) - len(high), sum(many > 1 for _, many in points))
            openness[place] = 255 * open_points // len(points)

    def around(r, c):
        places = [(i, j) for i in range(r - 1, r + 2) for j in range(c - 1, c + 2) if (i, j) != (r, c)]
        return [(i, j) for i, j in places if 0 <= i < shape[0] and 0 <= j < shape[1]]

    before = state.copy()
    for r, c in np.argwhere(before == 2):
        if not any(before[p] == 2 and abs(tops[p] - tops[r, c]) <= 200 for p in around(r, c)):
            state[r, c] = 0
    tops[state == 0], openness[state == 0] = 0, 0
    for _ in range(2):
        before, old_tops, old_openness = state.copy(), tops.copy(), openness.copy()
        for r, c in np.argwhere(before == 0):
            known = [p for p in around(r, c) if before[p]]
            high = [p for p in known if before[p] == 2]
            if len(known) >= 3:
                state[r, c] = 2 if 2 * len(high) > len(known) else 1
            if state[r, c] == 2:
                tops[r, c] = sum(old_tops[p] for p in high) // len(high)
                openness[r, c] = sum(old_openness[p] for p in high) // len(high)
    return tops, state, openness


def restrained(score, high, reach):
    """Scores, those of high cells at most the mean (rounded down) of the high cells at most `reach` away."""
    result = score.copy()
    for r, c in np.argwhere(high):
        near = np.s_[max(r - reach, 0) : r + reach + 1, max(c - reach, 0) : c + reach + 1]
        result[r, c] = min(score[r, c], np.floor(score[near][high[near]].mean()))
    return result


def nearness(rectangle, x, y):
    """Return the distance of a place from a rectangle, inside the negative distance from the nearest side."""
    dx, dy = x - rectangle[0], y - rectangle[1]
    u = abs(dx * np.cos(rectangle[4]) + dy * np.sin(rectangle[4])) - rectangle[2] / 2
    v = abs(dy * np.cos(rectangle[4]) - dx * np.sin(rectangle[4])) - rectangle[3] / 2
    return np.hypot(u, v) if u > 0 and v > 0 else max(u, v)
