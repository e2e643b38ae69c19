"""The trace of one detection by `dempster-shafer`: every intermediate result, to show and to test."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...scenes.geodata.footprints import Footprints
from .cue_maps import CueMaps

__all__ = ["FusionTrace"]

_Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class FusionTrace:
    """All intermediate results of one detection; rasters of shape (rows, columns).

    Attributes
    ----------
    cues : CueMaps
    probabilities : dict of str to ndarray
        Per cue: probability of the classes that it speaks for, NaN where it says nothing.
    classes : ndarray of uint8
        Position of the class of each cell in `masses.CLASSES`.
    building_support, conflict : ndarray
        Support of the class building, and the conflict between the cues.
    initial, opened, accepted : ndarray of bool
        Building cells: by class, after opening and minimum area, and after the second pass over regions.
    traced : ndarray of Polygon
        Outlines of the accepted regions, all vertices.
    rejected : ndarray of Polygon
        Outlines of the regions that the second pass refused.
    footprints : Footprints
    """

    cues: CueMaps
    probabilities: dict[str, _Floats]
    classes: NDArray[np.uint8]
    building_support: _Floats
    conflict: _Floats
    initial: NDArray[np.bool_]
    opened: NDArray[np.bool_]
    accepted: NDArray[np.bool_]
    traced: NDArray[np.object_]
    rejected: NDArray[np.object_]
    footprints: Footprints
