"""Bends: where a line of roofs changes its direction from one rectangle to the next.

Two rectangles make a bend when they meet end to end, are about equally deep there, and differ in direction. Houses
along a curved street do so one after the other, whether their roofs have a step or not; a building with wings has one
bend or two.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .arrays import Rectangles

__all__ = ["count_bends"]

#: Degrees: least and greatest change of direction; smaller ones are errors of rectangles, larger ones corners.
_LEAST, _GREATEST = 5.0, 45.0
#: Metres: narrowest house, and how far apart two ends are at most whose corners touch.
_NARROWEST, _APART = 4.0, 1.0
#: Depth of the shallower house at least, share of that of the deeper one.
_ALIKE = 0.7


def count_bends(rectangles: Rectangles, cell: float) -> tuple[int, NDArray[np.int64]]:
    """Return the number of bends between the rectangles of a block, and at how many each takes part, shape (n,).

    Parameters
    ----------
    rectangles : ndarray, shape (n, 5)
        Grid frame.
    cell : float
        Metres.
    """
    one = np.asarray(rectangles, dtype=np.float64).reshape(-1, 5)
    places, sides = one[:, :2] * cell, one[:, 2:4] * cell
    # A row runs along either side of a house: axis 2 is that of the first rectangle, axis 3 that of the second.
    angles = one[:, 4, None] + np.array([0.0, np.pi / 2])
    ways = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    gap = places[None, :] - places[:, None]
    turn = np.abs((angles[:, None, :, None] - angles[None, :, None, :] + np.pi / 2) % np.pi - np.pi / 2)
    ends = np.sign(np.einsum("ijk,iak->ija", gap, ways))[..., None] * (ways * sides[..., None] / 2)[:, None]
    far = np.sign(np.einsum("ijk,jbk->ijb", gap, ways))[..., None] * (ways * sides[..., None] / 2)[None]
    between = gap[:, :, None, None] - ends[:, :, :, None] - far[:, :, None, :]
    deep = sides[:, ::-1]
    deeper = np.maximum(deep[:, None, :, None], deep[None, :, None, :])
    shallower = np.minimum(deep[:, None, :, None], deep[None, :, None, :])
    narrower = np.minimum(sides[:, None, :, None], sides[None, :, None, :])
    meet = np.hypot(between[..., 0], between[..., 1]) <= _APART + deeper / 2 * np.sin(turn)
    bend = (turn >= np.radians(_LEAST)) & (turn <= np.radians(_GREATEST)) & meet
    bend &= (np.minimum(narrower, shallower) >= _NARROWEST) & (shallower >= _ALIKE * deeper)
    pairs = bend.any(axis=(2, 3)) & ~np.eye(len(one), dtype=np.bool_)
    return int(pairs.sum()) // 2, np.asarray(pairs.sum(axis=1), dtype=np.int64)
