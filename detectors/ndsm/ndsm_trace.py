"""The trace of one detection by `ndsm`: every intermediate result, to show and to test."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...scenes.geodata.footprints import Footprints
from ..shared.cues import CellCues

__all__ = ["NDSMTrace"]

_Floats = NDArray[np.float32]
_Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class NDSMTrace:
    """All intermediate results of one detection; rasters of shape (rows, columns).

    Attributes
    ----------
    cues : CellCues
    high : ndarray of bool
        Cells where at least half of the points are high.
    cue_likeness : dict of str to ndarray of float32
        Per cue: -1 roof, +1 tree, NaN unknown.
    likeness : ndarray of float32
        Their mean over the neighbourhood.
    roof, mask : ndarray of bool
        High cells that look like a roof, before and after cleaning.
    traced : ndarray of Polygon
        Outlines of the mask, all vertices.
    footprints : Footprints
    """

    cues: CellCues
    high: _Mask
    cue_likeness: dict[str, _Floats]
    likeness: _Floats
    roof: _Mask
    mask: _Mask
    traced: NDArray[np.object_]
    footprints: Footprints
