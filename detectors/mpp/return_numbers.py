"""Whether the number of returns of a pulse separates roofs from trees on a cloud.

A roof returns a pulse once. Where most points of smooth high cells are parts of multiple returns, the numbers do not
describe the surface: some files write two returns for every pulse. Openness is then counted without them (see `cells`).
"""

from __future__ import annotations

import math

from ...scenes.geodata.points import PointCloud
from ..shared.cue_information import ANCHOR, PENETRATION, CueInformation, silent_on_rasters
from .arrays import Integers
from .textures import LOG_HIGH, LOG_LOW, OPENNESS_BINS, ROUGHNESS_BINS

__all__ = ["MULTIPLE", "cues_of"]

#: Name of the cue, as in the detector ``ndsm``.
MULTIPLE = "multiple returns"
#: Roughness in metres below which a cell is smooth, and least number of smooth cells for a test.
_SMOOTH, _FEWEST = 0.15, 100
#: Share of smooth cells that may be open by half or more. On five airborne clouds it is 0.0 to 0.2.
_MOST_OPEN = 0.5


def cues_of(points: PointCloud, counts: Integers) -> CueInformation:
    """Return which cues the textures of a scene are made of.

    Parameters
    ----------
    points : PointCloud
    counts : ndarray of int64, shape (192,)
        Number of cells of each bin (`textures`), of the whole scene.
    """
    silent = silent_on_rasters(points.x, points.y)
    used = (ANCHOR,) if silent else (ANCHOR, PENETRATION)
    returns = points.number_of_returns
    if returns is None or not (returns > 1).any():
        return CueInformation(used, silent)
    counts = counts.reshape(ROUGHNESS_BINS, OPENNESS_BINS)
    last = math.ceil((math.log(_SMOOTH) - LOG_LOW) / (LOG_HIGH - LOG_LOW) * ROUGHNESS_BINS)
    smooth, opened = counts[:last].sum(), counts[:last, OPENNESS_BINS // 2 :].sum()
    if smooth >= _FEWEST and opened > _MOST_OPEN * smooth:
        reason = f"{opened / smooth:.0%} of the smooth surfaces have it, too"
        return CueInformation(used, {**silent, MULTIPLE: reason})
    return CueInformation((*used, MULTIPLE), silent)
