"""Party walls: where the roof of a row of houses is cut across, seen in the heights and colours of its cells.

Nouns
-----
profile
    Heights inside a rectangle on a lattice of `_LATTICE`, one row for each station along its longer side, one column
    for each line across; NaN where the cell is not high. The outermost lines are left out: eaves and gutters.
step
    Median over the lines of the height just behind a station less that just before it, and the share of the lines that
    agree in sign and exceed the noise.
valley
    Median over the lines of how far a station lies below the roof on both sides, and the share of the lines with one:
    the gutter between two gables that face the street.
colour edge
    Length of the median over the lines of the difference of colour (shares of red and of blue) between the two sides
    of a station, and the share of the lines whose difference points that way and exceeds the noise.
raised wall
    A parapet or a chimney above the roofs on both sides (`raised_walls`).
party wall
    A station with a step, a valley, a parapet or a colour edge through most of the lines, or with a chimney, at least
    `_NARROWEST` from other ones and from the ends. Walls are found twice: *certain* ones show that a building is a
    row, *probable* ones cut a row into houses. A chimney is certain in a series, else probable.

The thresholds were chosen on the development scenes (docs/results/mpp.md), not on scenes kept for tests.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...scenes.geodata.raster import Grid
from .arrays import Floats, Rectangles
from .cells import HIGH
from .profiles import line_medians, station_means
from .raised_walls import chimneys, parapet_strength, repeated, rises, series
from .rectangles import corners
from .wall_colours import Colours, colours_at

__all__ = [
    "CERTAIN",
    "PROBABLE",
    "Wall",
    "WallRule",
    "colour_strength",
    "most_walls",
    "party_walls",
    "raised_strength",
    "wall_strength",
]

#: Metres: spacing of the lattice, narrowest house, smallest depth of a rectangle with walls (the front or the rear half
#: of a row often has one of its own), widest house of a row (median).
_LATTICE, _NARROWEST, _SHALLOWEST, _WIDEST = 0.5, 4.0, 3.5, 12.0
#: Stations that a mean reaches on either side, and that lie between a valley and its shoulders.
_REACH, _SHOULDER = 2, 2
#: Stations that the mean of colours reaches on either side: they are blurred by a pixel, and pixels are displaced.
_COLOUR_REACH = 3
#: Metres: deepest houses; on deeper roofs patches of membrane and gravel differ in colour, and plant rises.
_DEEPEST = 16.0
#: Share of the least colour edge that is noise, share of the lines that must have colours, and metres of a step that a
#: difference of 1 counts like.
_COLOUR_NOISE, _KNOWN_COLOUR, _COLOUR_METRES = 0.5, 0.5, 20.0
#: Metres of a step that a chimney counts like; least rise of a pitched roof from eaves to ridge, m, and tangent of 15
#: degrees over half its depth: vents of flatter roofs stand anywhere, and their ducts and sections rise in lines.
_CHIMNEY_METRES, _PITCHED, _PITCH = 0.3, 1.0, 0.27
#: Metres: height differences that are noise, for steps and for valleys.
_STEP_NOISE, _VALLEY_NOISE = 0.12, 0.25
#: Share of the lines that must have heights for a step, and for a valley.
_KNOWN_STEP, _KNOWN_VALLEY = 0.6, 0.5

#: Fractions of a cell that places of the lattice are rounded to.
_FRACTIONS = 1024
#: Decimals of the sides of rectangles, metres.
_DECIMALS = 6


class WallRule(NamedTuple):
    """What makes a party wall of a step or of a valley.

    Attributes
    ----------
    step_share, valley_share : float
        Least share of the lines that show it.
    step, valley : float
        Least median over the lines, m.
    colour_share, colour : float
        The same of a colour edge, which has no unit.
    parapet_share, parapet : float
        The same of a parapet, m.
    single : bool
        Whether chimneys count that belong to no series.
    """

    step_share: float
    step: float
    valley_share: float
    valley: float
    colour_share: float
    colour: float
    parapet_share: float
    parapet: float
    single: bool


CERTAIN = WallRule(0.75, 0.25, 0.75, 0.4, 0.75, 0.02, 0.65, 0.15, False)
PROBABLE = WallRule(0.5, 0.1, 0.5, 0.15, 0.6, 0.01, 0.65, 0.1, True)


class Wall(NamedTuple):
    """A party wall in the grid frame: a point on it and the direction along it, each of shape (2,), unit length."""

    point: Floats
    along: Floats


def most_walls(rectangles: Rectangles, grid: Grid) -> NDArray[np.int64]:
    """Return how many party walls there is room for in each rectangle, shape (n,): houses have a least width."""
    sides = np.sort(np.round(np.asarray(rectangles).reshape(-1, 5)[:, 2:4] * grid.gsd, _DECIMALS), axis=1)
    room = np.floor(sides[:, 1] / _NARROWEST).astype(np.int64) - 1
    return np.where(sides[:, 0] < _SHALLOWEST, 0, np.maximum(room, 0))


def party_walls(
    rectangle: Rectangles,
    height: NDArray[np.uint16],
    state: NDArray[np.uint8],
    grid: Grid,
    rule: WallRule,
    colours: Colours | None = None,
    structures: NDArray[np.uint8] | None = None,
) -> list[Wall]:
    """Return the party walls across the longer side of a rectangle, in order; none where houses would be wide.

    Parameters
    ----------
    rectangle : ndarray, shape (5,)
        Grid frame.
    height : ndarray of uint16, shape (rows, columns)
        Height above ground, cm.
    state : ndarray of uint8, shape (rows, columns)
        See `cells`.
    grid : Grid
    rule : WallRule
    colours : Colours, optional
        Around the rectangle, where there is an image.
    structures : ndarray of uint8, shape (rows, columns), optional
        Height of what stands on the roofs, cm.
    """
    place = corners(rectangle)[0] * grid.gsd
    first, second = place[1] - place[0], place[3] - place[0]
    # Rounded, so that a side of exactly so many stations has as many in every window of a scene.
    length, depth = (round(float(np.hypot(*side)), _DECIMALS) for side in (first, second))
    if length < depth:
        first, second, length, depth = second, first, depth, length
    if length < 2 * _NARROWEST or depth < _SHALLOWEST:
        return []
    u, v = first / length, second / depth
    stations = np.arange(_LATTICE / 2, length, _LATTICE)
    lines = np.arange(_LATTICE / 2, depth, _LATTICE)
    x, y = (place[0] + stations[:, None, None] * u + lines[None, :, None] * v).transpose(2, 0, 1) / grid.gsd
    column = np.clip(_cell_of(x), 0, grid.columns - 1)
    row = np.clip(_cell_of(y), 0, grid.rows - 1)
    high = state[row, column] == HIGH
    profile = np.where(high, height[row, column] / 100.0, np.nan)
    inner = np.s_[:, 1:-1]
    strength = wall_strength(profile[inner], rule)
    if colours is not None and depth <= _DEEPEST:
        strength += colour_strength(np.where(high, colours_at(colours, row, column), np.nan)[:, :, 1:-1], rule)
    if structures is not None:
        strength += raised_strength(profile, profile + structures[row, column] / 100.0, rule)
    found: list[float] = []
    for station in np.argsort(-strength, kind="stable"):
        if strength[station] <= 0:
            break
        at = station * _LATTICE
        if _NARROWEST <= at <= length - _NARROWEST and all(abs(at - other) >= _NARROWEST for other in found):
            found.append(at)
    found.sort()
    if not found or np.median(np.diff([0.0, *found, length])) > _WIDEST:
        return []
    return [Wall((place[0] + at * u) / grid.gsd, v) for at in found]


def _cell_of(place: Floats) -> NDArray[np.int64]:
    """Return the cells of places in cells; on a border the same one whatever cell a window of the scene begins with."""
    return np.floor(np.round(place * _FRACTIONS) / _FRACTIONS).astype(np.int64)


def wall_strength(profile: Floats, rule: WallRule) -> Floats:
    """Return the evidence for a wall before each station of a profile, m, shape (stations,); 0 where there is none."""
    count = len(profile)
    strength = np.zeros(count)
    if count < 2 * (_REACH + _SHOULDER):
        return strength
    means = station_means(profile, _REACH)  # of stations i to i + _REACH - 1
    before, behind = np.full_like(profile, np.nan), np.full_like(profile, np.nan)
    before[_REACH:], behind[: len(means)] = means[: count - _REACH], means
    step = behind - before
    known = np.isfinite(step)
    middle = line_medians(step)
    agree = known & (np.sign(step) == np.sign(middle)[:, None]) & (np.abs(step) > _STEP_NOISE)
    enough = known.mean(axis=1) >= _KNOWN_STEP
    share = agree.sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    stepped = enough & (share >= rule.step_share) & (np.abs(middle) >= rule.step)
    strength[stepped] += np.abs(middle[stepped])

    low = np.full_like(profile, np.nan)
    low[1:] = np.fmin(profile[1:], profile[:-1])
    left, right = np.full_like(profile, np.nan), np.full_like(profile, np.nan)
    far = _REACH + _SHOULDER
    left[far:] = means[: count - far]
    right[: len(means) - _SHOULDER] = means[_SHOULDER:]
    valley = (left + right) / 2 - low
    known = np.isfinite(valley)
    middle = line_medians(valley)
    share = (known & (valley > _VALLEY_NOISE)).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    sunk = (known.mean(axis=1) >= _KNOWN_VALLEY) & (share >= rule.valley_share) & (middle >= rule.valley)
    strength[sunk] += middle[sunk]
    return strength


def raised_strength(roof: Floats, profile: Floats, rule: WallRule) -> Floats:
    """Return the evidence of parapets and chimneys for a wall before each station, m, shape (stations,).

    Parameters
    ----------
    roof, profile : ndarray, shape (stations, lines)
        Heights of all lines without and with what stands on the roofs.
    rule : WallRule
    """
    count, lines = profile.shape
    if _LATTICE * lines > _DEEPEST:
        return np.zeros(count)
    rise = rises(profile)
    strength = parapet_strength(rise[:, 1:-1], rule.parapet_share, rule.parapet)
    section = line_medians(roof[:, 1:-1].T, np.nan)
    section = section[np.isfinite(section)]
    if len(section) == 0 or np.ptp(section) < max(_PITCHED, _PITCH * _LATTICE * lines / 2):
        return repeated(strength)
    found = chimneys(rise)
    for station in found if rule.single else series(found):
        strength[round(float(station))] += _CHIMNEY_METRES
    return strength


def colour_strength(shares: Floats, rule: WallRule) -> Floats:
    """Return the evidence of colours for a wall before each station, shape (stations,); 0 where there is none.

    Parameters
    ----------
    shares : ndarray, shape (2, stations, lines)
        Shares of red and of blue; NaN where they are not known.
    rule : WallRule
    """
    _, count, lines = shares.shape
    strength = np.zeros(count)
    if count < 2 * _COLOUR_REACH or not np.isfinite(shares).any():
        return strength
    edges = np.full((2, count, lines), np.nan)
    for edge, share in zip(edges, shares, strict=True):
        means = station_means(share, _COLOUR_REACH)
        edge[_COLOUR_REACH : 1 - _COLOUR_REACH] = means[_COLOUR_REACH:] - means[:-_COLOUR_REACH]
    middle = np.stack([line_medians(edge) for edge in edges])
    size = np.hypot(*middle)
    known = np.isfinite(edges).all(axis=0)
    along = (edges * middle[:, :, None]).sum(axis=0) / np.maximum(size, 1e-12)[:, None]
    agree = known & (along > _COLOUR_NOISE * rule.colour)
    share = agree.sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    seen = (known.mean(axis=1) >= _KNOWN_COLOUR) & (share >= rule.colour_share) & (size >= rule.colour)
    strength[seen] = _COLOUR_METRES * size[seen]
    return strength
