"""Which cues carry information on a cloud, decided from the data.

Nouns
-----
rating
    What a cue says of each cell: -1 roof, 0 undecided, +1 tree, NaN unknown.
separation
    Mean rating in the cells that the other cues take for trees, less the mean in those that they take for roofs: up to
    2; near 0 where a cue says the same of both.
silent cue
    One that is left out because its separation is too small. Pulses of a single-return scanner, cells of a raster and
    files in which every pulse has two returns give such cues: they would vote for one class everywhere.

Roughness is measured from the coordinates alone, whatever the sensor records of a pulse: it is the *anchor*, which is
never silent and by which the others are tested. Penetration is measured from the coordinates, too, but first returns
of dense crowns have as little of it as roofs.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...scenes.geodata.density import is_lattice

__all__ = ["ANCHOR", "IMAGE", "PENETRATION", "CueInformation", "informative_cues", "silence_of", "silent_on_rasters"]

_Floats = NDArray[np.float32]

_NONE: Mapping[str, str] = {}
#: Names of the cue that is never silent, of the other one from coordinates, and of that from an image.
ANCHOR, PENETRATION, IMAGE = "roughness", "penetration", "image vegetation"
#: Why a cue is silent that has no value where it would count.
_UNKNOWN = "it is not known of any high cell"
#: Cues from coordinates, which are silent only where they are constant, and the share of cells within `_CONSTANT` of
#: the median rating from which they are.
_GEOMETRIC = frozenset({ANCHOR})
_CONSTANT_SHARE, _CONSTANT = 0.98, 0.1
#: Least separation. Measured on five airborne clouds with and without their return numbers, and rastered: cues that
#: help reach 0.33 to 1.8, those that mislead 0.2 at most. As far below 0, a cue says the opposite of the others: colour
#: infrared that is read as red, green, blue has -0.3 to -1.2 there, bands in order -0.2 at least.
_LEAST_SEPARATION = 0.25
#: Least number of cells of each class by which a cue is tested.
_FEWEST = 50


@dataclass(frozen=True)
class CueInformation:
    """Which cues are used, and why the others are silent.

    Attributes
    ----------
    used : tuple of str
    silent : mapping of str to str
        Reason by cue.
    places : tuple of str
        Sentences on cues that are used in a part of the scene only.
    """

    used: tuple[str, ...]
    silent: Mapping[str, str]
    places: tuple[str, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """One sentence for each silent cue, and those on parts of the scene."""
        return *(f"the cue {name!r} is not used: {reason}" for name, reason in self.silent.items()), *self.places

    def with_notes(self, places: Iterable[str]) -> CueInformation:
        """Return the same with sentences on parts of the scene."""
        return replace(self, places=(*self.places, *places))


def silent_on_rasters(x: NDArray[np.float64], y: NDArray[np.float64]) -> dict[str, str]:
    """Return the cues that points on a lattice cannot have, with the reason; empty for other points."""
    return {PENETRATION: "the points are cells of a raster, nothing is seen below them"} if is_lattice(x, y) else {}


def informative_cues(
    ratings: Mapping[str, _Floats],
    among: NDArray[np.bool_],
    *,
    independent: Collection[str] = (),
    known_silent: Mapping[str, str] = _NONE,
) -> CueInformation:
    """Return which cues separate roofs from trees, each tested by the others.

    The cue of the least separation becomes silent first, and the rest is tested again without it. Where the others
    know too few trees or roofs, a cue can only be tested by what it says of roofs: it is silent when it takes most of
    them for trees.

    Parameters
    ----------
    ratings : mapping of str to ndarray of float32, shape (rows, columns)
    among : ndarray of bool, shape (rows, columns)
        Cells that are roof or tree.
    independent : collection of str
        Cues that know more than the others, which are silent only where they say the same everywhere, or the opposite.
    known_silent : mapping of str to str
        Reason by cue, of cues that cannot carry information.
    """
    ratings = {name: rating for name, rating in ratings.items() if name not in known_silent}
    untested = {ANCHOR} | set(independent)
    values = {name: rating[among] for name, rating in ratings.items()}
    silent = dict(known_silent)
    silent |= {name: _UNKNOWN for name, rating in values.items() if not np.isfinite(rating).any()}
    for name in sorted(untested - {ANCHOR} - silent.keys()):
        if name in values and _is_constant(values[name]):
            silent[name] = "it has the same value everywhere"
    used = [name for name in values if name not in silent]
    for name in sorted(set(independent) & set(used)):
        trees, of_trees, roofs, of_roofs = _opinions(name, {other: values[other] for other in used})
        if min(trees, roofs) >= _FEWEST and of_trees - of_roofs < -_LEAST_SEPARATION:
            silent[name] = f"it says the opposite of the other cues (separation {of_trees - of_roofs:.2f} of 2)"
            used.remove(name)
    while True:
        tested = {
            name: _separation(name, {other: values[other] for other in used}) for name in used if name not in untested
        }
        failed = {name: found for name, found in tested.items() if found < _LEAST_SEPARATION}
        if not failed or len(used) < 2:
            return CueInformation(tuple(used), silent)
        worst = min(failed, key=failed.__getitem__)
        silent[worst] = _reason(failed[worst])
        used.remove(worst)


def silence_of(trees: int, of_trees: float, roofs: int, of_roofs: float) -> str | None:
    """Return why a cue is silent, None where it is not, from the sums of its ratings.

    Parameters
    ----------
    trees, roofs : int
        Cells that the other cues take for trees and for roofs.
    of_trees, of_roofs : float
        Sum of the ratings of each.
    """
    if not trees + roofs:
        return _UNKNOWN
    found = _separation_of(trees, of_trees / max(trees, 1), roofs, of_roofs / max(roofs, 1))
    return None if found >= _LEAST_SEPARATION else _reason(found)


def _reason(separation: float) -> str:
    return f"it does not separate roofs from trees (separation {separation:.2f} of 2)"


def _is_constant(rating: _Floats) -> bool:
    """Return whether nearly all known ratings are the same; a few ratings are not enough to say so."""
    known = rating[np.isfinite(rating)]
    return len(known) >= _FEWEST and bool(np.mean(np.abs(known - np.median(known)) < _CONSTANT) >= _CONSTANT_SHARE)


def _separation(name: str, values: Mapping[str, _Floats]) -> float:
    """Return the separation of a cue by the mean of the others."""
    return _separation_of(*_opinions(name, values))


def _opinions(name: str, values: Mapping[str, _Floats]) -> tuple[int, float, int, float]:
    """Return number and mean rating of the cells that the mean of the other cues takes for trees, and for roofs."""
    own = values[name]
    others = [np.nan_to_num(rating) for other, rating in values.items() if other != name]
    opinion = np.mean(others, axis=0) if others else np.zeros_like(own)
    known = np.isfinite(own)
    trees, roofs = own[known & (opinion > 0)], own[known & (opinion < 0)]
    means = [float(values.mean()) if len(values) else 0.0 for values in (trees, roofs)]
    return len(trees), means[0], len(roofs), means[1]


def _separation_of(trees: int, of_trees: float, roofs: int, of_roofs: float) -> float:
    """Return the separation from numbers of cells and mean ratings; 2 where it cannot be tested and may be right."""
    if roofs >= _FEWEST and of_roofs > 0 and (trees < _FEWEST or of_trees <= of_roofs):
        return 0.0
    if trees < _FEWEST or roofs < _FEWEST:
        return 2.0
    return of_trees - of_roofs
