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
        most = 0
        for m in range(low, high):
            most += one.start[members.one[m] + 1] - one.start[members.one[m]]
            if members.two[m] >= 0:
                most += two.start[members.two[m] + 1] - two.start[members.two[m]]
        # An edge: lower end x, y, upper end x, y, and twice the member's number, plus 1 for the second polygon.
        edges = np.empty((most, 5))
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
        count = 0
        for m in range(low, high):
            row = members.one[m]
            count = _gather(one.points, one.start[row], one.start[row + 1], frame, 2.0 * (m - low), edges, count)
            row = members.two[m]
            if row >= 0:
                label = 2.0 * (m - low) + 1.0
                count = _gather(two.points, two.start[row], two.start[row + 1], frame, label, edges, count)
        areas[place] = _covered(edges[:count], members.two[low:high])


@kernel
def _gather(
    points: NDArray[np.float64],
    begin: int,
    end: int,
    frame: tuple[float, float, int],
    label: float,
    edges: NDArray[np.float64],
    count: int,
) -> int:
    """Append the edges of an outline, seen from the origin of a frame and its first axis; return how many there are."""
    x, y, axis = frame
    for k in range(begin, end - 1):
        ax, ay = points[k, axis] - x, points[k, 1 - axis] - y
        bx, by = points[k + 1, axis] - x, points[k + 1, 1 - axis] - y
        if ay == by or ay != ay or by != by:
            continue  # level, or beside the NaN between two rings
        if ay > by:
            ax, ay, bx, by = bx, by, ax, ay
        edges[count, 0], edges[count, 1], edges[count, 2], edges[count, 3] = ax, ay, bx, by
        edges[count, 4] = label
        count += 1
    return count


@kernel
def _covered(edges: NDArray[np.float64], second: NDArray[np.int64]) -> float:
    """Return the area that the members cover; `second` is -1 where a member is one polygon alone."""
    n = len(edges)
    edges = edges[np.argsort(edges[:, 1], kind="mergesort")]
    heights = np.empty(2 * n + 16)
    count = 0
    for i in range(n):
        heights[count], heights[count + 1] = edges[i, 1], edges[i, 3]
        count += 2
    limit = count + _MOST_CROSSINGS * n
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
