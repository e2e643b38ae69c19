"""Party walls: where the roof of a row of houses is cut across, seen in the heights and colours of its cells.

Nouns
-----
profile
    Heights inside a rectangle on a lattice (`lattices`), one row for each station along its longer side, one column
    for each line across; NaN where the cell is not high. The outermost lines are left out: eaves and gutters. Where
    the roofs repeat obliquely to the row (`shears`), the lattice has that shear, provided that a wall along it is
    certain and that the probable ones are `_SHARPER` times as strong as those perpendicular to the row.
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
from .lattices import DECIMALS, SPACING, Lattice, lattice_of
from .profiles import line_medians
from .raised_walls import chimneys, parapet_strength, repeated, rises, series
from .shears import likely_shear
from .wall_colours import Colours, colours_at
from .wall_marks import Marks, colour_marks, roof_marks

__all__ = [
    "CERTAIN",
    "PROBABLE",
    "Profile",
    "Wall",
    "WallRule",
    "colour_strength",
    "most_walls",
    "party_walls",
    "profile_of",
    "raised_strength",
    "wall_strength",
]

#: Metres: narrowest house, smallest depth of a rectangle with walls (the front or the rear half of a row often has one
#: of its own), widest house of a row (median).
_NARROWEST, _SHALLOWEST, _WIDEST = 4.0, 2.5, 12.0
#: How many times as strong oblique walls are as those perpendicular to the row.
_SHARPER = 1.2
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
    sides = np.sort(np.round(np.asarray(rectangles).reshape(-1, 5)[:, 2:4] * grid.gsd, DECIMALS), axis=1)
    room = np.floor(sides[:, 1] / _NARROWEST).astype(np.int64) - 1
    return np.where(sides[:, 0] < _SHALLOWEST, 0, np.maximum(room, 0))


class Profile(NamedTuple):
    """What is known of the roofs of a rectangle for any rule.

    Attributes
    ----------
    lattice : Lattice
    roof : tuple of Marks or None
        Steps and valleys, without what stands on the roofs.
    colours : Marks or None
    rise : ndarray, shape (stations, lines), or None
        See `raised_walls`.
    chimneys : ndarray or None
        Stations of the chimneys; None on a flat roof.
    strengths : dict
        The evidence of all marks by rule, as far as it was asked for.
    """

    lattice: Lattice
    roof: tuple[Marks, Marks] | None
    colours: Marks | None
    rise: Floats | None
    chimneys: Floats | None
    strengths: dict[WallRule, Floats]


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
    lattice = lattice_of(rectangle, grid)
    if lattice.length < 2 * _NARROWEST or lattice.depth < _SHALLOWEST:
        return None

    def read(lattice: Lattice, roof: Floats, row: NDArray[np.int64], column: NDArray[np.int64]) -> Profile:
        inner = np.s_[..., 1:-1]
        edges = rise = stacks = None
        around = colours() if lattice.depth <= _DEEPEST else None
        if around is not None:
            shares = colours_at(around, row, column)
            edges = colour_marks(np.where(np.isfinite(roof), shares, np.nan)[inner])
        if lattice.depth <= _DEEPEST and structures is not None:
            rise = rises(roof + structures[row, column] / 100.0)
            stacks = chimneys(rise) if _is_pitched(roof) else None
        return Profile(lattice, roof_marks(roof[inner]), edges, rise, stacks, {})

    def roof_at(row: NDArray[np.int64], column: NDArray[np.int64], inside: NDArray[np.bool_]) -> Floats:
        return np.where(inside & (state[row, column] == HIGH), height[row, column] / 100.0, np.nan)

    row, column, inside = lattice.cells(grid)
    roof = roof_at(row, column, inside)
    straight = read(lattice, roof, row, column)
    shear = likely_shear(roof[:, 1:-1]) if lattice.depth <= _DEEPEST else 0.0
    if not shear:
        return straight
    lattice = lattice._replace(shear=shear)
    row, column, inside = lattice.cells(grid)
    oblique = read(lattice, roof_at(row, column, inside), row, column)
    sharper = _total(oblique, PROBABLE) >= _SHARPER * _total(straight, PROBABLE)
    return oblique if sharper and _total(oblique, CERTAIN) > 0 else straight


def _total(profile: Profile, rule: WallRule) -> float:
    """Return the strength of all walls together, m."""
    strength = _strength(profile, rule)
    return float(strength[_stations(profile, strength)].sum())


def _is_pitched(roof: Floats) -> bool:
    section = line_medians(roof[:, 1:-1].T, np.nan)
    section = section[np.isfinite(section)]
    least = max(_PITCHED, _PITCH * SPACING * roof.shape[1] / 2)
    return len(section) > 0 and bool(np.ptp(section) >= least)


def party_walls(profile: Profile | None, rule: WallRule, grid: Grid) -> list[Wall]:
    """Return the party walls across the longer side of a rectangle, in order; none where houses would be wide."""
    if profile is None:
        return []
    stations = _stations(profile, _strength(profile, rule))
    found = [station * SPACING for station in sorted(stations)]
    if not found or np.median(np.diff([0.0, *found, profile.lattice.length])) > _WIDEST:
        return []
    return [Wall(*profile.lattice.wall(at, grid)) for at in found]


def _strength(profile: Profile, rule: WallRule) -> Floats:
    """Return the evidence of all marks for a wall before each station, m, shape (stations,)."""
    if rule in profile.strengths:
        return profile.strengths[rule]
    strength = np.zeros(profile.lattice.stations) if profile.roof is None else wall_strength(profile.roof, rule)
    if profile.colours is not None:
        strength += colour_strength(profile.colours, rule)
    if profile.rise is not None:
        strength += raised_strength(profile.rise, profile.chimneys, rule)
    profile.strengths[rule] = strength
    return strength


def _stations(profile: Profile, strength: Floats) -> list[int]:
    """Return the stations of walls: the strongest first, apart from each other and from the ends."""
    found: list[int] = []
    for station in np.argsort(-strength, kind="stable")[: np.count_nonzero(strength > 0)].tolist():
        at = station * SPACING
        inside = _NARROWEST <= at <= profile.lattice.length - _NARROWEST
        if inside and all(abs(station - other) * SPACING >= _NARROWEST for other in found):
            found.append(station)
    return found


def wall_strength(marks: tuple[Marks, Marks], rule: WallRule) -> Floats:
    """Return the evidence of steps and valleys for a wall before each station, m, shape (stations,)."""
    steps, valleys = marks
    strength = steps.strength(rule.step, rule.step_share, _STEP_NOISE, _KNOWN_STEP)
    return strength + valleys.strength(rule.valley, rule.valley_share, _VALLEY_NOISE, _KNOWN_VALLEY)


def colour_strength(marks: Marks, rule: WallRule) -> Floats:
    """Return the evidence of colours for a wall before each station, in metres of a step, shape (stations,)."""
    noise = _COLOUR_NOISE * rule.colour
    return _COLOUR_METRES * marks.strength(rule.colour, rule.colour_share, noise, _KNOWN_COLOUR)


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
