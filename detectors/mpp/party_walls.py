"""Party walls: where the roof of a row of houses is cut across, seen in the heights and colours of its cells.

Nouns
-----
profile
    Heights inside a rectangle on a lattice of `_LATTICE`, one row for each station along its longer side, one column
    for each line across; NaN where the cell is not high. The outermost lines are left out: eaves and gutters.
step
    Median over the lines of the height just behind a station less that just before it and less what the roof rises
    there anyway, which is the mean of its rise on both sides: a slope is no step. And the share of the lines that agree
    in sign and exceed the noise.
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

from collections.abc import Callable
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
    "Marks",
    "Profile",
    "Wall",
    "WallRule",
    "colour_marks",
    "colour_strength",
    "most_walls",
    "party_walls",
    "profile_of",
    "raised_strength",
    "roof_marks",
    "wall_strength",
]

#: Metres: spacing of the lattice, narrowest house, smallest depth of a rectangle with walls (the front or the rear half
#: of a row often has one of its own), widest house of a row (median).
_LATTICE, _NARROWEST, _SHALLOWEST, _WIDEST = 0.5, 4.0, 2.5, 12.0
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

#: Bits of the fractions of a cell that places of the lattice are rounded to.
_FRACTION_BITS = 10
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
PROBABLE = WallRule(0.5, 0.1, 0.5, 0.15, 0.6, 0.005, 0.65, 0.1, True)


class Wall(NamedTuple):
    """A party wall in the grid frame: a point on it and the direction along it, each of shape (2,), unit length."""

    point: Floats
    along: Floats


def most_walls(rectangles: Rectangles, grid: Grid) -> NDArray[np.int64]:
    """Return how many party walls there is room for in each rectangle, shape (n,): houses have a least width."""
    sides = np.sort(np.round(np.asarray(rectangles).reshape(-1, 5)[:, 2:4] * grid.gsd, _DECIMALS), axis=1)
    room = np.floor(sides[:, 1] / _NARROWEST).astype(np.int64) - 1
    return np.where(sides[:, 0] < _SHALLOWEST, 0, np.maximum(room, 0))


class Profile(NamedTuple):
    """What is known of the roofs of a rectangle for any rule.

    Attributes
    ----------
    place, along, across : ndarray, shape (2,)
        The first corner, metres in the grid frame, and the directions along the row and across it, unit length.
    length : float
        Along the row, m.
    stations : int
        Along the row.
    roof : tuple of Marks or None
        Steps and valleys, without what stands on the roofs.
    colours : Marks or None
    rise : ndarray, shape (stations, lines), or None
        See `raised_walls`.
    chimneys : ndarray or None
        Stations of the chimneys; None on a flat roof.
    """

    place: Floats
    along: Floats
    across: Floats
    length: float
    stations: int
    roof: tuple[Marks, Marks] | None
    colours: Marks | None
    rise: Floats | None
    chimneys: Floats | None


def profile_of(
    rectangle: Rectangles,
    height: NDArray[np.uint16],
    state: NDArray[np.uint8],
    grid: Grid,
    colours: Callable[[], Colours | None] = lambda: None,
    structures: NDArray[np.uint8] | None = None,
) -> Profile | None:
    """Return the profile of a rectangle; None where it is too small for houses.

    Parameters
    ----------
    rectangle : ndarray, shape (5,)
        Grid frame.
    height : ndarray of uint16, shape (rows, columns)
        Height above ground, cm.
    state : ndarray of uint8, shape (rows, columns)
        See `cells`.
    grid : Grid
    colours : callable, optional
        Returns the colours around the rectangle, where there is an image; called only where they are used.
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
        return None
    u, v = first / length, second / depth
    stations = np.arange(_LATTICE / 2, length, _LATTICE)
    lines = np.arange(_LATTICE / 2, depth, _LATTICE)
    x, y = ((place[0, k] + stations[:, None] * u[k] + lines * v[k]) / grid.gsd for k in (0, 1))
    column = np.minimum(np.maximum(_cell_of(x), 0), grid.columns - 1)
    row = np.minimum(np.maximum(_cell_of(y), 0), grid.rows - 1)
    flat = row * state.shape[1] + column
    high = state.take(flat) == HIGH
    roof = np.where(high, height.take(flat) / 100.0, np.nan)
    inner = np.s_[..., 1:-1]
    edges = rise = stacks = None
    around = colours() if depth <= _DEEPEST else None
    if around is not None:
        edges = colour_marks(np.where(high, colours_at(around, row, column), np.nan)[inner])
    if depth <= _DEEPEST and structures is not None:
        rise = rises(roof + structures.take(flat) / 100.0)
        stacks = chimneys(rise) if _is_pitched(roof) else None
    return Profile(place[0], u, v, length, len(stations), roof_marks(roof[inner]), edges, rise, stacks)


def _is_pitched(roof: Floats) -> bool:
    section = line_medians(roof[:, 1:-1].T, np.nan)
    section = section[np.isfinite(section)]
    least = max(_PITCHED, _PITCH * _LATTICE * roof.shape[1] / 2)
    return len(section) > 0 and bool(np.ptp(section) >= least)


def party_walls(profile: Profile | None, rule: WallRule, grid: Grid) -> list[Wall]:
    """Return the party walls across the longer side of a rectangle, in order; none where houses would be wide."""
    if profile is None:
        return []
    strength = np.zeros(profile.stations) if profile.roof is None else wall_strength(profile.roof, rule)
    if profile.colours is not None:
        strength += colour_strength(profile.colours, rule)
    if profile.rise is not None:
        strength += raised_strength(profile.rise, profile.chimneys, rule)
    found: list[float] = []
    for station in np.argsort(-strength, kind="stable")[: np.count_nonzero(strength > 0)].tolist():
        at = station * _LATTICE
        inside = _NARROWEST <= at <= profile.length - _NARROWEST
        if inside and all(abs(at - other) >= _NARROWEST for other in found):
            found.append(at)
    found.sort()
    if not found or np.median(np.diff([0.0, *found, profile.length])) > _WIDEST:
        return []
    return [Wall((profile.place + at * profile.along) / grid.gsd, profile.across) for at in found]


def _cell_of(place: Floats) -> NDArray[np.int64]:
    """Return the cells of places in cells; on a border the same one whatever cell a window of the scene begins with."""
    parts: NDArray[np.int64] = np.rint(place * 2**_FRACTION_BITS).astype(np.int64)
    return parts >> _FRACTION_BITS


class Marks(NamedTuple):
    """A step, a valley or an edge of colour before each station, as far as it does not depend on a rule.

    Attributes
    ----------
    values : ndarray, shape (stations, lines)
        Its size in each line, in the direction of the median; NaN is unknown.
    size : ndarray, shape (stations,)
        Of the median.
    known : ndarray of int64, shape (stations,)
        Number of lines where it is known.
    """

    values: Floats
    size: Floats
    known: NDArray[np.int64]

    def strength(self, least: float, share: float, noise: float, known: float) -> Floats:
        """Return the size where it counts, shape (stations,), else 0.

        A mark counts that is known in a share of the lines, has a least size, and exceeds the noise in another share of
        the lines where it is known.
        """
        seen = (self.known / max(self.values.shape[1], 1) >= known) & (self.size >= least)
        seen[seen] = (self.values[seen] > noise).sum(axis=1) / self.known[seen] >= share
        return np.where(seen, self.size, 0.0)


def roof_marks(profile: Floats) -> tuple[Marks, Marks] | None:
    """Return the steps and the valleys of heights, shape (stations, lines); None where they are too few."""
    count = len(profile)
    if count < 2 * (_REACH + _SHOULDER):
        return None
    means = station_means(profile, _REACH)  # of stations i to i + _REACH - 1
    before, behind = np.full_like(profile, np.nan), np.full_like(profile, np.nan)
    before[_REACH:], behind[: len(means)] = means[: count - _REACH], means
    step = behind - before - _slope(before, behind)
    middle = line_medians(step)
    steps = Marks(step * np.sign(middle)[:, None], np.abs(middle), np.isfinite(step).sum(axis=1))

    low = np.full_like(profile, np.nan)
    low[1:] = np.fmin(profile[1:], profile[:-1])
    left, right = np.full_like(profile, np.nan), np.full_like(profile, np.nan)
    far = _REACH + _SHOULDER
    left[far:] = means[: count - far]
    right[: len(means) - _SHOULDER] = means[_SHOULDER:]
    valley = (left + right) / 2 - low
    return steps, Marks(valley, line_medians(valley), np.isfinite(valley).sum(axis=1))


def colour_marks(shares: Floats) -> Marks | None:
    """Return the edges of colour in shares of red and blue, shape (2, stations, lines); None where there are none."""
    _, count, lines = shares.shape
    if count < 2 * _COLOUR_REACH or not np.isfinite(shares).any():
        return None
    edges = np.full((2, count, lines), np.nan)
    for edge, share in zip(edges, shares, strict=True):
        means = station_means(share, _COLOUR_REACH)
        edge[_COLOUR_REACH : 1 - _COLOUR_REACH] = means[_COLOUR_REACH:] - means[:-_COLOUR_REACH]
    middle = np.stack([line_medians(edge) for edge in edges])
    size = np.hypot(*middle)
    along = (edges * middle[:, :, None]).sum(axis=0) / np.maximum(size, 1e-12)[:, None]
    return Marks(along, size, np.isfinite(along).sum(axis=1))


def wall_strength(marks: tuple[Marks, Marks], rule: WallRule) -> Floats:
    """Return the evidence of steps and valleys for a wall before each station, m, shape (stations,)."""
    steps, valleys = marks
    strength = steps.strength(rule.step, rule.step_share, _STEP_NOISE, _KNOWN_STEP)
    return strength + valleys.strength(rule.valley, rule.valley_share, _VALLEY_NOISE, _KNOWN_VALLEY)


def colour_strength(marks: Marks, rule: WallRule) -> Floats:
    """Return the evidence of colours for a wall before each station, in metres of a step, shape (stations,)."""
    noise = _COLOUR_NOISE * rule.colour
    return _COLOUR_METRES * marks.strength(rule.colour, rule.colour_share, noise, _KNOWN_COLOUR)


def _slope(before: Floats, behind: Floats) -> Floats:
    """Return by how much a roof rises from just before a station to just behind it where no step is, m."""
    rises = np.full((2, *before.shape), np.nan)
    rises[0, _REACH:], rises[1, :-_REACH] = before[_REACH:] - before[:-_REACH], behind[_REACH:] - behind[:-_REACH]
    known = np.isfinite(rises)
    mean: Floats = np.where(known, rises, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    return mean


def raised_strength(rise: Floats, stacks: Floats | None, rule: WallRule) -> Floats:
    """Return the evidence of parapets and chimneys for a wall before each station, m, shape (stations,).

    Parameters
    ----------
    rise : ndarray, shape (stations, lines)
        See `raised_walls`.
    stacks : ndarray or None
        Stations of the chimneys; None on a flat roof.
    rule : WallRule
    """
    strength = parapet_strength(rise[:, 1:-1], rule.parapet_share, rule.parapet)
    if stacks is None:
        return repeated(strength)
    for station in stacks if rule.single else series(stacks):
        strength[round(float(station))] += _CHIMNEY_METRES
    return strength
