"""Final rectangles: initial ones, shrunk and then extended over areas with the colours of their roof.

Nouns
-----
strip
    Area that a step adds to a side: as long as the side, 0.35 m wide. It is sampled on a lattice in its own
    coordinates, at least one row and one sample per pixel, because it may be narrower than a pixel.
rise
    More black in the primary mask than in the strip before: the side may extend over a neighbour.

A strip passes when more than 40 % of it is in range in each of Y, I and Q, more than 90 % is black in the secondary
mask, and the primary black does not rise. A rise after the primary black fell below 10 % ends the side; any other
failure halves the strip, down to the ground sampling distance. The authors' own program differs (`filled_share`,
`independent` and `rises_after_gap` of `FinalRules`). By default, colours are not tested well inside the initial
rectangle, where points prove a roof whatever its colours: another face of the roof, or a displaced image.
Source: Awrangjeb, Ravanbakhsh & Fraser (2010), section 3.4.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel
from .boxes import U0, U1, V0, V1, column_range, from_box, row_range, to_box
from .colours import Colours, dominant_ranges, yiq_bins

__all__ = ["DROPPED", "FinalRules", "final_rectangles", "shrink"]

#: Index for an initial rectangle that lies wholly inside a final one.
DROPPED = -1


class FinalRules(NamedTuple):
    """Rules of the final extension; lengths in pixels, shares 0..1.

    Attributes
    ----------
    reduction : float
        Share by which length and width are reduced at first.
    part_share, total_share : float
        Of the dominant colours (see `colours`).
    strip, least_strip : float
        First width of a strip, and the width below which the extension ends.
    colour_share, black_share : float
        Least shares in range (each of Y, I, Q) and black in the secondary mask.
    gap_share : float
        Primary black below which the next rise ends the extension of the side.
    rise : float
        Largest increase of primary black that does not count as a rise.
    whole_initial : bool
        Whether an initial rectangle is compared with final ones before it is shrunk.
    filled_share : float
        Least share of the shrunk rectangle that is black in the secondary mask; else it is dropped.
    independent : bool
        Whether all sides are extended from the shrunk rectangle, each by itself, and not one after another.
    rises_after_gap : bool
        Whether a rise counts only after the primary black fell below `gap_share`.
    colour_margin : float
        Colours are tested from this distance inside the sides of the initial rectangle on; infinite: in every strip.
    """

    reduction: float
    part_share: float
    total_share: float
    strip: float
    least_strip: float
    colour_share: float
    black_share: float
    gap_share: float
    rise: float
    whole_initial: bool
    filled_share: float = 0.0
    independent: bool = False
    rises_after_gap: bool = False
    colour_margin: float = math.inf


@kernel
def shrink(box: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Return a box with the same centre whose length and width are reduced by a share."""
    out = box.copy()
    along, across = share * (box[U1] - box[U0]) / 2, share * (box[V1] - box[V0]) / 2
    out[U0] += along
    out[U1] -= along
    out[V0] += across
    out[V1] -= across
    return out


@kernel
def lies_inside(inner: NDArray[np.float64], outer: NDArray[np.float64]) -> bool:
    """Return whether all corners of one box are in the other."""
    slack = 1e-9
    for along in (inner[U0], inner[U1]):
        for across in (inner[V0], inner[V1]):
            x, y = from_box(along, across, inner)
            u, v = to_box(x, y, outer)
            if u < outer[U0] - slack or u > outer[U1] + slack or v < outer[V0] - slack or v > outer[V1] + slack:
                return False
    return True


@kernel
def black_shares(
    primary: NDArray[np.uint8], secondary: NDArray[np.uint8], strip: NDArray[np.float64]
) -> tuple[float, float]:
    """Return the shares of a strip that are black in the primary and in the secondary mask."""
    rows, columns = primary.shape
    across, down = max(1, round(strip[U1] - strip[U0])), max(1, round(strip[V1] - strip[V0]))
    black, filled = 0, 0
    for i in range(across):
        u = strip[U0] + np.divide((i + 0.5) * (strip[U1] - strip[U0]), across)  # without a test for zero
        for j in range(down):
            v = strip[V0] + np.divide((j + 0.5) * (strip[V1] - strip[V0]), down)
            x, y = from_box(u, v, strip)
            column, row = math.floor(x), math.floor(y)
            if 0 <= row < rows and 0 <= column < columns:
                black += primary[np.uintp(row), np.uintp(column)]
                filled += secondary[np.uintp(row), np.uintp(column)]
    return black / (across * down), filled / (across * down)


@kernel
def has_colours(colours: Colours, within: NDArray[np.bool_], strip: NDArray[np.float64], colour_share: float) -> bool:
    """Return whether more than a share of a strip is in range in each of Y, I and Q."""
    rows, columns = colours.values.shape[1:]
    across, down = max(1, round(strip[U1] - strip[U0])), max(1, round(strip[V1] - strip[V0]))
    cells = across * down
    # The least number that is a larger share than asked, whatever the rounding: it is often known after a few rows.
    least = math.floor(colour_share * cells)
    while np.divide(least, cells) <= colour_share:
        least += 1
    of_y, of_i, of_q = 0, 0, 0
    for i in range(across):
        u = strip[U0] + np.divide((i + 0.5) * (strip[U1] - strip[U0]), across)  # without a test for zero
        for j in range(down):
            v = strip[V0] + np.divide((j + 0.5) * (strip[V1] - strip[V0]), down)
            x, y = from_box(u, v, strip)
            column, row = math.floor(x), math.floor(y)
            if not (0 <= row < rows and 0 <= column < columns):
                continue
            y_bin, i_bin, q_bin = yiq_bins(colours, row, column)
            of_y += within[0, np.uintp(y_bin)]
            of_i += within[1, np.uintp(i_bin)]
            of_q += within[2, np.uintp(q_bin)]
        fewest = min(of_y, of_i, of_q)
        if fewest >= least or fewest + (across - i - 1) * down < least:
            return bool(fewest >= least)
    return False


@kernel
def extended_final_side(
    colours: Colours,
    primary: NDArray[np.uint8],
    secondary: NDArray[np.uint8],
    within: NDArray[np.bool_],
    rules: FinalRules,
    box: NDArray[np.float64],
    side: int,
    initial: float,
) -> float:
    """Return how far one side of a box can move outwards while the strips pass.

    `initial` is where the side of the initial rectangle is.
    """
    outwards = 1.0 if side in (U1, V1) else -1.0
    opposite = U0 + U1 - side if side in (U0, U1) else V0 + V1 - side
    width, before, reached, gap = rules.strip, 1.0, box[side], False
    strip = box.copy()
    while width >= rules.least_strip:
        end = reached + outwards * width
        strip[side], strip[opposite] = end, reached
        black, filled = black_shares(primary, secondary, strip)
        rises = black > before + rules.rise
        gap = gap or before < rules.gap_share if rules.rises_after_gap else before < rules.gap_share
        if rises and gap:
            break
        solid = filled > rules.black_share and (rules.rises_after_gap or not rises)
        proven = outwards * (initial - end) >= rules.colour_margin
        if solid and (proven or has_colours(colours, within, strip, rules.colour_share)):
            reached, before = end, black
        else:
            width /= 2
    return float(reached)


@kernel
def black_share(mask: NDArray[np.uint8], box: NDArray[np.float64]) -> float:
    """Return the share of the cells in a box that are black; cells beyond the raster are white."""
    rows, columns = mask.shape
    black, cells = 0, 0
    first_row, last_row = row_range(box)
    for row in range(first_row, last_row):
        first, last = column_range(box, row)
        cells += last - first
        if 0 <= row < rows:
            for column in range(max(first, 0), min(last, columns)):
                black += mask[row, column]
    return black / cells if cells > 0 else 0.0


@kernel
def final_rectangles(
    colours: Colours,
    primary: NDArray[np.uint8],
    secondary: NDArray[np.uint8],
    rules: FinalRules,
    initial: NDArray[np.float64],
    order: NDArray[np.int64],
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Extend the initial rectangles one after another.

    Parameters
    ----------
    order : ndarray of int64, shape (n,)
        Initial rectangles, the largest first.

    Returns
    -------
    rectangles : ndarray, shape (m, 8)
    final_of : ndarray of int64, shape (n,)
        Index of the final rectangle of each initial one, or `DROPPED`.
    """
    out, final_of = np.empty((len(initial), 8)), np.full(len(initial), DROPPED)
    found = 0
    for i in order:
        box = shrink(initial[i], rules.reduction)
        compared = initial[i] if rules.whole_initial else box
        inside = False
        for j in range(found):
            if lies_inside(compared, out[j]):
                inside = True
                break
        if inside or (rules.filled_share > 0 and black_share(secondary, box) < rules.filled_share):
            continue
        within = dominant_ranges(colours, box, rules.part_share, rules.total_share)
        start = box.copy()
        for side in (V0, V1, U0, U1):
            grown = start if rules.independent else box
            box[side] = extended_final_side(colours, primary, secondary, within, rules, grown, side, initial[i, side])
        for k in range(8):
            out[found, k] = box[k]
        final_of[i] = found
        found += 1
    return out[:found].copy(), final_of
