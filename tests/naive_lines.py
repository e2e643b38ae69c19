"""Slow, obvious oracles for the kernels of the line detectors."""

from __future__ import annotations

import math

import numpy as np

from roofbench.detectors.lines.boxes import OX, OY, U0, U1, UX, UY, V0, V1


def cells_in_box(box: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """Mask of the cells whose centre is in a box."""
    row, column = np.mgrid[0:rows, 0:columns]
    dx, dy = column + 0.5 - box[OX], row + 0.5 - box[OY]
    u, v = dx * box[UX] + dy * box[UY], -dx * box[UY] + dy * box[UX]
    return (u >= box[U0]) & (u < box[U1]) & (v >= box[V0]) & (v < box[V1])


def accumulated_distance(curve: np.ndarray, chord: int, closed: bool) -> np.ndarray:
    """CPDA by its definition, point by point and chord by chord."""
    n = len(curve)
    out = np.zeros(n)
    for k in range(n):
        total = 0.0
        for before in range(1, chord):
            start, end = k - before, k - before + chord
            if not closed and (start < 0 or end >= n):
                continue
            a, b = curve[start % n], curve[end % n]
            along = (b - a) / np.linalg.norm(b - a)
            off = curve[k] - a
            total += off[0] * along[1] - off[1] * along[0]
        out[k] = abs(total)
    return out


def gaussian_smooth_closed(curve: np.ndarray, sigma: float) -> np.ndarray:
    n, reach = len(curve), math.ceil(3 * sigma)
    out = np.zeros_like(curve)
    weights = {j: math.exp(-0.5 * (j / sigma) ** 2) for j in range(-reach, reach + 1)}
    for k in range(n):
        for j, weight in weights.items():
            out[k] += weight * curve[(k + j) % n]
    return out / sum(weights.values())


def rotation_candidates(directions: np.ndarray, centres: np.ndarray, radius: float, tolerance: float) -> np.ndarray:
    """Smallest rotation of each line towards any neighbour, by trying multiples of 90 degrees."""
    out = np.full(len(directions), np.nan)
    for j in range(len(directions)):
        best = math.inf
        for i in range(len(directions)):
            if i == j or np.linalg.norm(centres[i] - centres[j]) > radius:
                continue
            turns = [directions[i] + k * math.pi / 2 - directions[j] for k in range(-8, 9)]
            turn = min(turns, key=abs)
            if abs(turn) <= tolerance and abs(turn) < abs(best):
                best = turn
        if math.isfinite(best):
            out[j] = best
    return out
