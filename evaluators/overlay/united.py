"""Area that many groups of polygons cover together, compiled, without an overlay.

Nouns
-----
member
    A polygon of one set, or what it has in common with a polygon of another set.
group
    Members whose union is measured.
slab
    The plane between two successive heights at which an edge of the group begins, ends or crosses another one. Heights
    are along the longer side of the group's bounds: y, or x with both axes exchanged.
    Edges do not cross inside a slab, so what a group covers of it are trapezoids: the length that is covered in the
    middle of the slab, times its height, is their area.
strip
    A part of the plane along the slabs' heights. A group in which many members lie side by side is measured strip by
    strip, so that few edges pass through a slab.

A point is inside a polygon where an odd number of its edges lie to the left; holes and parts need no rule of their
own. Coordinates are taken from the lower left corner of the group, so the bits of the area depend neither on the order
of the members nor on that of their vertices. The cost grows with the number of slabs times that of the edges that pass
through one.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .groups import Members
from .outline_arrays import Outlines

__all__ = ["united_areas"]

#: Groups that a thread works on at a time.
_CHUNK = 512
#: Most crossings for each edge of a group; with more of them the slabs cost more than an overlay.
_MOST_CROSSINGS = 24
#: Members that lie side by side in a strip, and most crossings for each edge there: an overlay of so many is slower.
_ACROSS, _MOST_IN_STRIP = 12, 384
#: Edges that begin in a slab, beyond which its edges are sorted anew.
_MANY_NEW = 16


def united_areas(one: Outlines, two: Outlines, members: Members, *, threads: int | None = None) -> NDArray[np.float64]:
    """Return the area of the union of the members of each group, m2; NaN where an overlay is faster.

    Parameters
    ----------
    one, two : Outlines
        The two sets.
    members : Members
    threads : int, optional
        By default as many as there are processors; the bits of the result do not depend on their number.

    Examples
    --------
    >>> import shapely
    >>> from roofbench import Footprints
    >>> from roofbench.evaluators.overlay.groups import Members
    >>> from roofbench.evaluators.overlay.outline_arrays import outlines_of
    >>> boxes = outlines_of(Footprints.of([shapely.box(0, 0, 2, 2), shapely.box(1, 1, 3, 3)]))
    >>> united_areas(boxes, boxes, Members(np.array([0, 2]), np.array([0, 1]), np.array([-1, -1])))
    array([7.])
    """
    areas = np.empty(len(members.start) - 1)
    chunks = [slice(begin, begin + _CHUNK) for begin in range(0, len(areas), _CHUNK)]

    def fill(part: slice) -> None:
        _fill(one, two, members, part.start, areas[part])

    with ThreadPoolExecutor(min(threads or os.cpu_count() or 1, max(len(chunks), 1))) as pool:
        list(pool.map(fill, chunks))
    return areas


@kernel
def _fill(one: Outlines, two: Outlines, members: Members, begin: int, areas: NDArray[np.float64]) -> None:
    """Fill the areas of some groups."""
    for place in range(len(areas)):
        low, high = members.start[begin + place], members.start[begin + place + 1]
        x, y, right, top = np.inf, np.inf, -np.inf, -np.inf
        for m in range(low, high):
            row = members.one[m]
            x, y = min(x, one.bounds[row, 0]), min(y, one.bounds[row, 1])
            right, top = max(right, one.bounds[row, 2]), max(top, one.bounds[row, 3])
            row = members.two[m]
            if row >= 0:
                x, y = min(x, two.bounds[row, 0]), min(y, two.bounds[row, 1])
                right, top = max(right, two.bounds[row, 2]), max(top, two.bounds[row, 3])
        # Slabs across the longer side of the group have few edges each.
        axis = 1 if right - x > top - y else 0
        frame = (x, y, 0) if axis == 0 else (y, x, 1)
        side = top - y if axis else right - x
        across = np.empty((high - low, 2))
        total = 0.0
        for m in range(low, high):
            row, other = members.one[m], members.two[m]
            across[m - low, 0], across[m - low, 1] = one.bounds[row, axis], one.bounds[row, axis + 2]
            if other >= 0:
                across[m - low, 0] = max(across[m - low, 0], two.bounds[other, axis])
                across[m - low, 1] = min(across[m - low, 1], two.bounds[other, axis + 2])
            across[m - low] -= frame[0]
            total += max(across[m - low, 1] - across[m - low, 0], 0.0)
        strips = int(min(side * (high - low) / (total * _ACROSS), high - low)) if total > 0.0 else 1
        every = np.arange(low, high)
        if strips < 2:
            edges = _edges(one, two, members, every, frame, (-np.inf, np.inf))
            areas[place] = _covered(edges, members.two[low:high], _MOST_CROSSINGS)
            continue
        start, inside = _by_strip(across, side / strips, strips)
        areas[place] = 0.0
        for strip in range(strips):
            rows = inside[start[strip] : start[strip + 1]] + low
            edges = _edges(one, two, members, rows, frame, (side * strip / strips, side * (strip + 1) / strips))
            areas[place] += _covered(edges, members.two[rows], _MOST_IN_STRIP)


@kernel
def _by_strip(across: NDArray[np.float64], width: float, strips: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return which intervals reach into each strip: those of strip s from ``start[s]`` to ``start[s + 1]``."""
    start = np.zeros(strips + 2, dtype=np.int64)
    inside = np.empty(0, dtype=np.int64)
    for counted in range(2):
        if counted:
            start[1:] = np.cumsum(start[1:])
            inside = np.empty(start[-1], dtype=np.int64)
        for i in range(len(across)):
            if across[i, 1] <= across[i, 0]:
                continue
            # A little wider, against rounding.
            first = max(int(across[i, 0] / width - 1e-6), 0)
            last = min(int(across[i, 1] / width + 1e-6), strips - 1)
            for strip in range(first, last + 1):
                if counted:
                    inside[start[strip + 1]] = i
                    start[strip + 1] += 1
                else:
                    start[strip + 2] += 1
    return start, inside


@kernel
def _edges(
    one: Outlines,
    two: Outlines,
    members: Members,
    rows: NDArray[np.int64],
    frame: tuple[float, float, int],
    strip: tuple[float, float],
) -> NDArray[np.float64]:
    """Return the edges of some members inside a strip.

    An edge: lower end x, y, upper end x, y, and twice the place of the member in `rows`, plus 1 for the second polygon.
    """
    most = 0
    for m in rows:
        most += one.start[members.one[m] + 1] - one.start[members.one[m]]
        if members.two[m] >= 0:
            most += two.start[members.two[m] + 1] - two.start[members.two[m]]
    edges = np.empty((most if strip[1] == np.inf else 3 * most, 5))
    count = 0
    for k in range(len(rows)):
        row = members.one[rows[k]]
        count = _gather(one.points[one.start[row] : one.start[row + 1]], frame, strip, 2.0 * k, edges, count)
        row = members.two[rows[k]]
        if row >= 0:
            label = 2.0 * k + 1.0
            count = _gather(two.points[two.start[row] : two.start[row + 1]], frame, strip, label, edges, count)
    return edges[:count]


@kernel
def _gather(
    points: NDArray[np.float64],
    frame: tuple[float, float, int],
    strip: tuple[float, float],
    label: float,
    edges: NDArray[np.float64],
    count: int,
) -> int:
    """Append the edges of an outline, seen from the origin of a frame and its first axis; return how many there are.

    What lies beside the strip is moved to its border, so that inside it the outline covers what it did.
    """
    x, y, axis = frame
    left, right = strip
    for k in range(len(points) - 1):
        ax, ay = points[k, axis] - x, points[k, 1 - axis] - y
        bx, by = points[k + 1, axis] - x, points[k + 1, 1 - axis] - y
        if ay == by or ay != ay or by != by:
            continue  # level, or beside the NaN between two rings
        if ay > by:
            ax, ay, bx, by = bx, by, ax, ay
        # The edge is cut where it crosses a border: first the one that it meets first.
        near, far = (left, right) if ax <= bx else (right, left)
        slope = (by - ay) / (bx - ax) if ax != bx else 0.0
        px, py = min(max(ax, left), right), ay
        for border in (near, far):
            if (ax < border < bx) or (bx < border < ax):
                height = min(max(ay + (border - ax) * slope, py), by)
                if height > py:
                    edges[count, 0], edges[count, 1], edges[count, 2], edges[count, 3] = px, py, border, height
                    edges[count, 4] = label
                    count += 1
                px, py = border, height
        if by > py:
            edges[count, 0], edges[count, 1], edges[count, 2], edges[count, 3] = px, py, min(max(bx, left), right), by
            edges[count, 4] = label
            count += 1
    return count


@kernel
def _covered(edges: NDArray[np.float64], second: NDArray[np.int64], most: int) -> float:
    """Return the area that the members cover, NaN beyond `most` crossings for each edge.

    `second` is -1 where a member is one polygon alone.
    """
    n = len(edges)
    edges = edges[np.argsort(edges[:, 1], kind="mergesort")]
    heights = np.empty(2 * n + 16)
    count = 0
    for i in range(n):
        heights[count], heights[count + 1] = edges[i, 1], edges[i, 3]
        count += 2
    limit = count + most * n
    for i in range(n):
        ax, ay, by, label = edges[i, 0], edges[i, 1], edges[i, 3], edges[i, 4]
        slope = (edges[i, 2] - ax) / (by - ay)
        for j in range(i + 1, n):
            cy = edges[j, 1]
            if cy >= by:
                break
            if edges[j, 4] == label:
                continue
            cx = edges[j, 0]
            other = (edges[j, 2] - cx) / (edges[j, 3] - cy)
            top = min(by, edges[j, 3])
            # Signed distance along x at both ends of the common range of heights.
            low = ax + (cy - ay) * slope - cx
            high = ax + (top - ay) * slope - (cx + (top - cy) * other)
            if (low > 0.0 and high < 0.0) or (low < 0.0 and high > 0.0):
                if count + 1 > limit:
                    return np.nan
                if count == len(heights):
                    larger = np.empty(2 * count)
                    larger[:count] = heights
                    heights = larger
                heights[count] = cy + (top - cy) * (low / (low - high))
                count += 1
    # The quicksort of the compiler is quadratic for rows of sorted heights.
    heights = heights[:count][np.argsort(heights[:count], kind="mergesort")]
    active = np.empty(n, dtype=np.int64)
    along = np.empty(n)
    inside = np.zeros(2 * len(second), dtype=np.bool_)
    total, passing, following = 0.0, 0, 0
    for k in range(count - 1):
        low, high = heights[k], heights[k + 1]
        if high <= low:
            continue
        kept = 0
        for i in range(passing):
            if edges[active[i], 3] > low:
                active[kept] = active[i]
                kept += 1
        passing = kept
        while following < n and edges[following, 1] <= low:
            if edges[following, 3] > low:
                active[passing] = following
                passing += 1
            following += 1
        middle = 0.5 * (low + high)
        for i in range(passing):
            e = active[i]
            share = (middle - edges[e, 1]) / (edges[e, 3] - edges[e, 1])
            along[i] = edges[e, 0] + share * (edges[e, 2] - edges[e, 0])
        # Edges that go on are in order already; many new ones are sorted, few are inserted.
        if passing - kept > _MANY_NEW:
            order = np.argsort(along[:passing], kind="mergesort")
            along[:passing], active[:passing] = along[order], active[order]
        for i in range(passing):
            e, x = active[i], along[i]
            place = i
            while place > 0 and along[place - 1] > x:
                along[place], active[place] = along[place - 1], active[place - 1]
                place -= 1
            along[place], active[place] = x, e
        # A stretch that ends where the next one begins goes on, whichever of two equal edges is taken first.
        length, covering, since, until = 0.0, 0, 0.0, -np.inf
        for i in range(passing):
            label = int(edges[active[i], 4])
            partner = label ^ 1
            inside[label] = not inside[label]
            if (label % 2 == 1 or second[label // 2] >= 0) and not inside[partner]:
                continue
            if inside[label]:
                if covering == 0 and along[i] > until:
                    if until > -np.inf:
                        length += until - since
                    since = along[i]
                covering += 1
            else:
                covering -= 1
                until = along[i]
        if until > -np.inf:
            length += until - since
        total += length * (high - low)
    return total
