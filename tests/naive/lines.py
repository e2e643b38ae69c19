"""Slow, obvious oracles for the kernels of the line detectors."""

from __future__ import annotations

import math

import numpy as np
import shapely

from roofbench.detectors.lines.boxes import OX, OY, U0, U1, UX, UY, V0, V1, box_corners


def cells_in_box(box: np.ndarray, rows: int, columns: int) -> np.ndarray:
    """Mask of the cells whose centre is in a box."""
    row, column = np.mgrid[0:rows, 0:columns]
    dx, dy = column + 0.5 - box[OX], row + 0.5 - box[OY]
    u, v = dx * box[UX] + dy * box[UY], -dx * box[UY] + dy * box[UX]
    return (u >= box[U0]) & (u < box[U1]) & (v >= box[V0]) & (v < box[V1])


def distances(points, chosen: np.ndarray, grid) -> np.ndarray:
    """Distance of each cell to the nearest cell that holds a chosen point, metres."""
    row, column = np.divmod(np.unique(grid.cells(points.x[chosen], points.y[chosen])[0]), grid.columns)
    rows, columns = np.mgrid[0 : grid.rows, 0 : grid.columns]
    out = np.full(grid.shape, np.inf)
    for r, c in zip(row, column, strict=True):
        out = np.minimum(out, np.hypot(rows - r, columns - c) * grid.gsd)
    return out


def ground_correction(x: np.ndarray, y: np.ndarray, above: np.ndarray, share: float, cell: float) -> np.ndarray:
    """Step of the ground of each cell [i, j] = [floor(y / cell), floor(x / cell)], by sorting the points of each."""
    rows, columns = int(y.max() // cell) + 1, int(x.max() // cell) + 1
    own = np.zeros((rows, columns))
    for i in range(rows):
        for j in range(columns):
            inside = sorted(above[(y // cell == i) & (x // cell == j)])
            if inside:
                own[i, j] = min(0.0, inside[min(int(share * len(inside)), len(inside) - 1)])
    return np.array(
        [[own[max(i - 1, 0) : i + 2, max(j - 1, 0) : j + 2].min() for j in range(columns)] for i in range(rows)]
    )


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


def local_entropy(grey: np.ndarray, window: int) -> np.ndarray:
    """Share of the largest possible entropy of a window, by its definition."""
    reach = window // 2
    out = np.zeros(grey.shape)
    for row in range(grey.shape[0]):
        for column in range(grey.shape[1]):
            part = grey[max(row - reach, 0) : row + reach + 1, max(column - reach, 0) : column + reach + 1]
            p = np.unique(part, return_counts=True)[1] / part.size
            out[row, column] = -(p * np.log2(p)).sum() / math.log2(window**2)
    return out


def length_in_box(line: np.ndarray, box: np.ndarray, steps: int = 20000) -> float:
    """Length of a line in a box by walking along it."""
    t = line[U0] + (np.arange(steps) + 0.5) * (line[U1] - line[U0]) / steps
    x, y = line[OX] + t * line[UX], line[OY] + t * line[UY]
    dx, dy = x - box[OX], y - box[OY]
    u, v = dx * box[UX] + dy * box[UY], -dx * box[UY] + dy * box[UX]
    inside = (u >= box[U0]) & (u <= box[U1]) & (v >= box[V0]) & (v <= box[V1])
    return float(inside.mean() * (line[U1] - line[U0]))


def new_share(box: np.ndarray, others: np.ndarray) -> float:
    """Share of a box outside the union of others, by exact areas."""
    polygon = shapely.polygons(box_corners(box[None]))[0]
    union = shapely.union_all(shapely.polygons(box_corners(others)))
    return polygon.difference(union).area / polygon.area


def duplicates(boxes: np.ndarray, least: float, tolerance: float) -> np.ndarray:
    """Rectangles whose new share beyond the larger turned ones that stay is below `least`, one after another."""
    degrees = np.degrees(np.arctan2(boxes[:, UY], boxes[:, UX]))
    area = (boxes[:, U1] - boxes[:, U0]) * (boxes[:, V1] - boxes[:, V0])
    stays: list[int] = []
    for i in sorted(range(len(boxes)), key=lambda k: -area[k]):
        turned = [j for j in stays if min((degrees[i] - degrees[j]) % 90, (degrees[j] - degrees[i]) % 90) > tolerance]
        if new_share(boxes[i], boxes[turned]) >= least:
            stays.append(i)
    return np.isin(range(len(boxes)), stays, invert=True)


def widest_new_square(box: np.ndarray, others: np.ndarray, widths: np.ndarray, steps: int = 40) -> float:
    """Widest of some squares parallel to a box that fits into the box outside others, by trying many places."""
    union = shapely.union_all(shapely.polygons(box_corners(others)))
    widest = 0.0
    for width in widths:
        half = width / 2
        along = np.linspace(box[U0] + half, box[U1] - half, steps) if width <= box[U1] - box[U0] else []
        across = np.linspace(box[V0] + half, box[V1] - half, steps) if width <= box[V1] - box[V0] else []
        squares = np.array([[*box[:4], u - half, u + half, v - half, v + half] for u in along for v in across])
        if (
            len(squares)
            and (shapely.area(shapely.intersection(shapely.polygons(box_corners(squares)), union)) < 1e-9).any()
        ):
            widest = width
    return widest


def chamfer_distance(points):
    """Return the distance of each pixel from the nearest point: steps are tried until none shortens any."""
    weights = {1: 10000, 2: 14000, 5: 21969}  # by squared length of the step
    rows, columns = points.shape
    distance = np.where(points, 0, 1 << 40)
    while True:
        padded = np.pad(distance, 2, constant_values=1 << 40)
        shorter = distance
        for down in range(-2, 3):
            for right in range(-2, 3):
                weight = weights.get(down * down + right * right)
                if weight is not None:
                    moved = padded[2 + down : 2 + down + rows, 2 + right : 2 + right + columns] + weight
                    shorter = np.minimum(shorter, moved)
        if np.array_equal(shorter, distance):
            return distance / 10000
        distance = shorter


def nearest_kind(low, high, reach, bare):
    """Return where the nearest point is low, or no high one is near, and where it is high."""
    to_low, to_high = chamfer_distance(low), chamfer_distance(high)
    return ((to_low <= to_high) & (to_low <= reach)) | (to_high > bare), (to_high < to_low) & (to_high <= reach)
