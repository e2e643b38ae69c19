"""Where a filtered ground is unsure: far from any ground point, or raised within walls.

Nouns
-----
far
    Cells with points whose nearest cell with a ground point lies more than `_FAR` metres away: the middle of a hall,
    dense forest. The ground there is interpolated.
raised
    Parts of the ground that a closed ring of steps of `_STEP` metres down to the rest surrounds, or nearly half of one
    where the border of the scene cuts them. A terrace held by walls all around looks like that, and so does a roof that
    the filter left.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..geodata.raster import Elevation

__all__ = ["doubt_note", "doubtful_ground"]

#: Metres, see above: a hall of 80 m width has its middle 40 m from the ground beside it.
_FAR, _STEP = 40.0, 2.0
#: Square metres: smaller raised parts are noise.
_SMALLEST = 100.0
#: Share of the outline of a part that must be steps where the border of the scene is the rest of it: a roof cut at a
#: corner has half, the upper side of a cliff through the scene a third.
_RINGED = 0.45
#: Share of the scene from which on a note is written.
_SHARE = 0.001


def doubtful_ground(ground: Elevation, seen: NDArray[np.bool_], covered: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the cells where a filtered ground is unsure, shape (rows, columns).

    Parameters
    ----------
    ground : Elevation
        The filtered ground.
    seen : ndarray of bool, shape (rows, columns)
        Cells with a point on the ground.
    covered : ndarray of bool, shape (rows, columns)
        Cells with any point; without one (water) nothing is said.
    """
    import cv2

    far = np.zeros(seen.shape, dtype=bool)
    if seen.any():
        away = cv2.distanceTransform((~seen).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        far = covered & (away * ground.grid.gsd > _FAR)
    return np.asarray(far | _raised(ground))


def _raised(ground: Elevation) -> NDArray[np.bool_]:
    """Return the parts of the ground within rings of steps down."""
    import cv2

    ring = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    values = ground.values.astype(np.float32)
    fall, rise = values - cv2.erode(values, ring), cv2.dilate(values, ring) - values
    # A steep slope rises as much as it falls.
    top = fall - rise > _STEP
    if not top.any():
        return np.zeros(values.shape, dtype=bool)
    _, labels, statistics, _ = cv2.connectedComponentsWithStats((~top).astype(np.uint8), connectivity=4)
    inner = statistics[:, cv2.CC_STAT_AREA] * ground.grid.gsd**2 >= _SMALLEST
    beside = cv2.dilate(top.astype(np.uint8), cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))) > 0
    on_border = np.ones(values.shape, dtype=bool)
    on_border[1:-1, 1:-1] = False
    stepped, cut = (np.bincount(labels[part], minlength=len(inner)) for part in (beside, on_border & ~beside))
    inner &= stepped >= _RINGED * (stepped + cut)
    inner[0] = False
    # Steps at the top of a pit surround it, too; the ring of a raised part is as high as the part itself.
    numbers = np.flatnonzero(inner)
    outer = cv2.dilate(np.where(top, values, -np.inf).astype(np.float32), ring)
    for number in numbers.tolist():
        part = labels == number
        rim = part & np.isfinite(outer)
        inner[number] = bool(rim.any()) and float(np.median((outer - values)[rim])) < 0.5 * _STEP
    return np.asarray(inner[labels])


def doubt_note(doubtful: NDArray[np.bool_]) -> str | None:
    """Return a note on the doubtful share of a scene; None where there is next to none."""
    share = float(doubtful.mean()) if doubtful.size else 0.0
    if share < _SHARE:
        return None
    where = "far from any ground point, or raised within walls"
    return f"the filtered ground is uncertain on {share:.1%} of the scene: {where}"
