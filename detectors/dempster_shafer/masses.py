"""Probability masses on sets of classes, and their combination by Dempster's rule.

Nouns
-----
class
    Building, tree, grass or soil; exactly one is true of a cell.
set of classes
    A number whose bits are the classes: ``BUILDING | TREE``. `ALL` holds all of them and stands for "unknown".
evidence
    Masses on some sets that add up to 1: mapping of set to array, one value a cell.
support
    Sum of the masses of all sets within a set: what speaks for it.
conflict
    Mass that two independent pieces of evidence give to sets without a common class. It is removed, and the rest is
    scaled to 1.

Source: Rottensteiner, Trinder, Clode & Kubik (2005), Using the Dempster-Shafer method for the fusion of LIDAR data and
multi-spectral images for building detection, Information Fusion 6.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "ALL",
    "BUILDING",
    "CLASSES",
    "GRASS",
    "SOIL",
    "TREE",
    "Evidence",
    "combined",
    "evidence_for",
    "step_probability",
    "strongest_class",
    "support",
]

_Floats: TypeAlias = NDArray[np.float32]
Evidence: TypeAlias = Mapping[int, _Floats]

BUILDING, TREE, GRASS, SOIL = 1, 2, 4, 8
ALL = BUILDING | TREE | GRASS | SOIL
#: The classes in the order in which `strongest_class` numbers them.
CLASSES = (BUILDING, TREE, GRASS, SOIL)


def step_probability(values: ArrayLike, low: float, high: float, *, least: float = 0.05, most: float = 0.95) -> _Floats:
    """Return the probability that a value speaks for: a cubic step from `least` below `low` to `most` above `high`.

    P = P1 + (P2 - P1) (3 t^2 - 2 t^3) with t = (x - x1) / (x2 - x1), clipped to 0..1 (Rottensteiner et al. 2005). NaN
    stays NaN.

    Examples
    --------
    >>> step_probability([0.0, 1.5, 2.25, 3.0, 9.0], 1.5, 3.0).tolist()
    [0.05000000074505806, 0.05000000074505806, 0.5, 0.949999988079071, 0.949999988079071]
    """
    share = np.clip((np.asarray(values, dtype=np.float32) - np.float32(low)) / np.float32(high - low), 0, 1)
    step: _Floats = np.float32(least) + np.float32(most - least) * share * share * (3 - 2 * share)
    return step


def evidence_for(classes: int, probability: _Floats) -> Evidence:
    """Return the evidence of one cue: its probability for a set of classes, the rest for the other classes.

    Where the probability is NaN, nothing is known: the whole mass is on `ALL`.
    """
    known = np.isfinite(probability)
    mass = np.where(known, probability, np.float32(0))
    return {classes: mass, ALL & ~classes: np.where(known, 1 - mass, np.float32(0)), ALL: (~known).astype(np.float32)}


def combined(pieces: Iterable[Evidence], shape: tuple[int, ...]) -> tuple[Evidence, _Floats]:
    """Return the combination of independent evidence, and the conflict 0..1 that was removed on the way.

    Dempster's rule: m(C) = sum of m1(A) m2(B) over all A, B with A & B = C, divided by 1 - K, where K is that sum for
    the empty set. Where all mass is in conflict, nothing is known. The conflict of several pieces is
    1 - (1 - K1) (1 - K2) ...

    Parameters
    ----------
    pieces : iterable of Evidence
    shape : tuple of int
        Of all arrays.
    """
    total: dict[int, _Floats] = {ALL: np.ones(shape, dtype=np.float32)}
    agreed = np.ones(shape, dtype=np.float32)
    for piece in pieces:
        joint: dict[int, _Floats] = {}
        for one, mass in total.items():
            for two, other in piece.items():
                product = mass * other
                joint[one & two] = joint[one & two] + product if one & two in joint else product
        joint.pop(0, None)
        # Not one minus the conflict: rounding would remain in the sum of the masses.
        left = sum(joint.values(), start=np.zeros(shape, dtype=np.float32))
        possible = left > 1e-6
        scale = 1 / np.where(possible, left, 1)
        total = {classes: np.where(possible, mass * scale, np.float32(0)) for classes, mass in joint.items()}
        total[ALL] = np.where(possible, total.get(ALL, np.float32(0)), np.float32(1))
        agreed = agreed * left
    return total, 1 - agreed


def support(evidence: Evidence, classes: int) -> _Floats:
    """Return what speaks for a set of classes: the masses of all sets within it."""
    shape = next(iter(evidence.values())).shape
    total = np.zeros(shape, dtype=np.float32)
    for held, mass in evidence.items():
        if held & ~classes == 0:
            total = total + mass
    return total


def strongest_class(evidence: Evidence) -> NDArray[np.uint8]:
    """Return the position in `CLASSES` of the class with the largest support.

    Grass and soil compete together with building and tree, since without colours nothing separates the two: all their
    mass is then on the set of both, and none on either. Of equal ones the ground comes first, then the tree; of grass
    and soil the soil. Thus a cell without any evidence is soil, and never a building.
    """
    ground, tree, building = (support(evidence, classes) for classes in (GRASS | SOIL, TREE, BUILDING))
    grass = support(evidence, GRASS) > support(evidence, SOIL)
    best = np.where(building > np.maximum(ground, tree), 0, np.where(tree > ground, 1, np.where(grass, 2, 3)))
    return best.astype(np.uint8)
