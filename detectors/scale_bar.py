"""The scale bar of a map: what every picture of a place carries, those of the steps of a detector too."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from matplotlib.patches import Rectangle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["add_scale_bar"]


def add_scale_bar(axes: Axes, *, unit: float = 1.0) -> None:
    """Draw a bar of a round length, about a fifth of the map's width, in the lower left corner.

    Parameters
    ----------
    axes : Axes
        A map whose limits are set; rows may run downwards.
    unit : float
        Metres in one unit of the axes: 1 for map coordinates, the GSD for pixels.
    """
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    width, height = right - left, top - bottom
    target = abs(width) * unit / 5
    step = 10 ** math.floor(math.log10(target))
    length = max(factor * step for factor in (1, 2, 5) if factor * step <= target)
    x, y = left + 0.03 * width, bottom + 0.03 * height
    # The white edge shows it on black ground.
    bar = Rectangle((x, y), length / unit, 0.01 * height, facecolor="black", edgecolor="white", linewidth=0.8, zorder=6)
    axes.add_patch(bar)
    label = f"{length / 1000:g} km" if length >= 1000 else f"{length:g} m"
    background = {"facecolor": "white", "alpha": 0.8, "linewidth": 0, "pad": 1.5}
    middle = x + length / unit / 2
    axes.text(middle, y + 0.02 * height, label, ha="center", va="bottom", fontsize=9, zorder=6, bbox=background)
