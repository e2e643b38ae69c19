"""Extension: move a side of a box outwards step by step while the added area looks like a building.

A *strip* is the area that a step adds. The paper extends a line by a rectangle 3 m along and 3 m deep, and the side of
a rectangle by the same technique: a strip is divided along its side into equal *parts* of at least that length, and
passes when each part is more than 70 % black in the primary mask and not vegetation. Tested as a whole, a strip would
pass over a court of less than 30 % of the side, and the rectangle of one wing would cover the next. The first step is 3
m; a step that fails is halved; the extension ends below the point spacing. *Vegetation* has a mean index above the
threshold and, where texture is used, a mean entropy above its threshold, too. Sources: Awrangjeb, Ravanbakhsh & Fraser
(2010), sections 3.3.2 and 3.3.3; entropy beside the index: Awrangjeb, Zhang & Fraser (2011), section 3.2.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .boxes import U0, U1, V0, V1, Boxes, sum_in_box, sums_in_box

__all__ = ["Cover", "Growth", "band", "extend_lines", "extend_rectangle", "last_step", "mean_in_boxes"]


class Cover(NamedTuple):
    """Row prefix sums of the rasters that decide whether an area can be part of a building.

    Attributes
    ----------
    black : ndarray of int32, shape (rows, columns + 1)
        Of the primary mask.
    vegetation : ndarray of int32, shape (rows, columns + 1)
        Of the vegetation index, 0..255.
    entropy : ndarray of int32, shape (rows, columns + 1)
        Of the local entropy, 0..255; shape (0, 1) where texture is not used.
    """

    black: NDArray[np.int32]
    vegetation: NDArray[np.int32]
    entropy: NDArray[np.int32]


class Growth(NamedTuple):
    """Rules of growth; lengths in pixels.

    Attributes
    ----------
    step, least_step : float
        First step, and the step below which the extension ends.
    black_share : float
        Least share of black cells in a part of a strip; cells beyond the raster count as white.
    part : float
        Least length of the parts of a strip; a strip up to twice as long is one.
    vegetation, entropy : float
        Thresholds, 0..255.
    same_kind : bool
        Whether strips beside a line that is green need to be green and smooth, and the others not green.
    """

    step: float
    least_step: float
    black_share: float
    part: float
    vegetation: float
    entropy: float
    same_kind: bool = False


def last_step(rules: Growth) -> float:
    """Return the smallest step that is tried, pixels; a side ends at most that far before the end of the black area."""
    step = rules.step
    while step / 2 >= rules.least_step:
        step /= 2
    return step


@kernel
def mean_in_box(prefix: NDArray[np.int32], box: NDArray[np.float64]) -> float:
    """Return the mean over the cells in a box, 0 where there is none."""
    total, cells, _ = sum_in_box(prefix, box)
    return total / cells if cells > 0 else 0.0


@kernel
def mean_in_boxes(prefix: NDArray[np.int32], boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean over the cells in each box, shape (n,)."""
    out = np.empty(len(boxes))
    for i in range(len(boxes)):
        out[i] = mean_in_box(prefix, boxes[i])
    return out


@kernel
def passes(cover: Cover, rules: Growth, strip: NDArray[np.float64], green: bool) -> bool:
    """Return whether a part of a strip may be added: black, and no vegetation.

    With `same_kind`, a part that is unlike the line, green or not, may not either.
    """
    black, index, on_raster, cells = sums_in_box(cover.black, cover.vegetation, strip)
    if cells == 0 or black <= rules.black_share * cells:
        return False
    is_green = (index / on_raster if on_raster > 0 else 0.0) > rules.vegetation
    if rules.same_kind and is_green != green:
        return False
    return not is_green or (len(cover.entropy) > 0 and mean_in_box(cover.entropy, strip) <= rules.entropy)


@kernel
def parts_pass(cover: Cover, rules: Growth, strip: NDArray[np.float64], start: int, green: bool) -> bool:
    """Return whether each part of a strip passes; `start` is where its interval along the side begins, `U0` or `V0`."""
    first, last = strip[start], strip[start + 1]
    parts = max(1, int((last - first) / rules.part))
    width = (last - first) / parts
    piece = strip.copy()
    for k in range(parts):
        piece[start], piece[start + 1] = first + k * width, first + (k + 1) * width
        if not passes(cover, rules, piece, green):
            return False
    return True


@kernel
def extended_side(cover: Cover, rules: Growth, box: NDArray[np.float64], side: int, green: bool) -> float:
    """Return how far one end (`U0`, `U1`, `V0` or `V1`) of a box can move outwards while the strips pass."""
    outwards = 1.0 if side in (U1, V1) else -1.0
    step, reached = rules.step, box[side]
    strip = box.copy()
    opposite = U0 + U1 - side if side in (U0, U1) else V0 + V1 - side
    while step >= rules.least_step:
        end = reached + outwards * step
        strip[side], strip[opposite] = end, reached
        if parts_pass(cover, rules, strip, V0 if side in (U0, U1) else U0, green):
            reached = end
        else:
            step /= 2
    return float(reached)


@kernel
def extend_lines(
    cover: Cover, rules: Growth, lines: NDArray[np.float64], depth: float, green: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return the lines, green or not, with both ends extended; strips are `depth` pixels deep on the black side."""
    out = lines.copy()
    for i in range(len(lines)):
        box = lines[i].copy()
        box[V1] = depth
        out[i, U0] = extended_side(cover, rules, box, U0, green[i])
        out[i, U1] = extended_side(cover, rules, box, U1, green[i])
    return out


@kernel
def extend_rectangle(cover: Cover, rules: Growth, box: NDArray[np.float64], green: bool) -> NDArray[np.float64]:
    """Return the rectangle of a line, green or not, with the opposite side extended, then both lateral ones."""
    out = box.copy()
    for side in (V1, U0, U1):
        out[side] = extended_side(cover, rules, out, side, green)
    return out


def band(lines: Boxes, inner: float, outer: float) -> Boxes:
    """Return the boxes that reach from `outer` pixels outside to `inner` pixels inside of each line."""
    boxes = lines.copy()
    boxes[:, V0], boxes[:, V1] = -outer, inner
    return boxes
