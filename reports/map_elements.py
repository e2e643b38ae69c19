"""Elements that all maps share: the scale bar and the paths of polygons."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from matplotlib.patches import Rectangle
from matplotlib.path import Path
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["add_scale_bar", "polygon_paths"]


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
    # The white edge separates the bar from dark ground.
    bar = Rectangle((x, y), length / unit, 0.01 * height, facecolor="black", edgecolor="white", linewidth=0.8, zorder=6)
    axes.add_patch(bar)
    label = f"{length / 1000:g} km" if length >= 1000 else f"{length:g} m"
    background = {"facecolor": "white", "alpha": 0.8, "linewidth": 0, "pad": 1.5}
    # Left-aligned: on a narrow map the label is longer than the bar, and would cross the frame.
    axes.text(x, y + 0.02 * height, label, ha="left", va="bottom", fontsize=9, zorder=6, bbox=background)


def polygon_paths(polygons: Iterable[Any]) -> Iterator[Path]:
    """Yield a matplotlib path for each polygon or multipolygon that is not empty; holes stay open."""
    for polygon in polygons:
        rings = [np.asarray(ring.coords) for ring in shapely.get_rings(shapely.get_parts(polygon))]
        if rings:
            yield Path(np.concatenate(rings), np.concatenate([_ring_codes(len(ring)) for ring in rings]))


def _ring_codes(count: int) -> NDArray[np.uint8]:
    codes = np.full(count, Path.LINETO, dtype=np.uint8)
    codes[0], codes[-1] = Path.MOVETO, Path.CLOSEPOLY
    return codes
