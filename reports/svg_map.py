"""Maps as small SVG elements for notebooks: outlines over a picture, a scale bar, and colours of their own.

No drawing library is loaded, and nothing is fetched: an element shows itself in any browser, offline.
"""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from .overlay_json import path_data

__all__ = ["MapLayer", "crowded_window", "svg_map"]

#: Longer side of a map, pixels, and the shape of the flattest one.
_SIDE, _FLATTEST = 420, 0.35
#: Outlines that a map draws at most: more make the notebook large and are too small to see.
_MOST = 2000


@dataclass(frozen=True)
class MapLayer:
    """Outlines that are drawn alike.

    Attributes
    ----------
    polygons : ndarray of shapely geometries
    fill, line : str
        CSS colours; ``"none"`` draws nothing.
    opacity : float
        Of the fill.
    dashed : bool
    """

    polygons: NDArray[np.object_]
    fill: str
    line: str
    opacity: float = 0.5
    dashed: bool = False


def crowded_window(polygons: NDArray[np.object_]) -> tuple[float, float, float, float] | None:
    """Return the extent around the median outline that holds as many outlines as a map draws; None to draw them all."""
    if len(polygons) <= _MOST:
        return None
    xmin, ymin, xmax, ymax = shapely.bounds(polygons).T
    centres = (xmin + xmax) / 2, (ymin + ymax) / 2
    x, y = (float(np.median(centre)) for centre in centres)
    distance = np.maximum(np.abs(centres[0] - x), np.abs(centres[1] - y))
    half = float(np.partition(distance, _MOST)[_MOST])
    return x - half, y - half, x + half, y + half


def svg_map(
    layers: Sequence[MapLayer],
    extent: tuple[float, float, float, float],
    *,
    description: str,
    picture: str = "",
    margin: bool = True,
) -> str:
    """Return an ``<svg>`` element.

    Parameters
    ----------
    layers : sequence of MapLayer
        The first is at the bottom.
    extent : tuple of float
        ``(xmin, ymin, xmax, ymax)``, metres.
    description : str
        What is seen, for those who cannot see it.
    picture : str
        ``data:`` address of a picture of the extent, below the layers.
    margin : bool
        Leave room around the extent.
    """
    xmin, ymin, xmax, ymax = _not_flat(extent) if margin else extent
    width, height = 10 * (xmax - xmin), 10 * (ymax - ymin)  # path data is in decimetres
    scale = _SIDE / max(width, height)
    window = shapely.box(xmin, ymin, xmax, ymax)
    line = 1 / scale
    parts = []
    if picture:
        parts.append(
            f'<image href="{html.escape(picture)}" width="{width:.0f}" height="{height:.0f}" '
            'preserveAspectRatio="none"/>'
        )
    for layer in layers:
        visible = layer.polygons[shapely.intersects(layer.polygons, window)]
        shape = "".join(path_data(visible, (xmin, ymin, xmax, ymax)))
        if shape:
            dashes = f' stroke-dasharray="{4 * line:.1f} {3 * line:.1f}"' if layer.dashed else ""
            parts.append(
                f'<path d="{shape}" fill="{layer.fill}" fill-opacity="{layer.opacity:g}" fill-rule="evenodd" '
                f'stroke="{layer.line}" stroke-width="{line:.2f}"{dashes}/>'
            )
    parts.append(_scale_bar(width, height, line))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
        f'width="{width * scale:.0f}" height="{height * scale:.0f}" role="img" '
        f'aria-label="{html.escape(description)}" style="background:#fff;border:1px solid #ccc;max-width:100%">'
        f"{''.join(parts)}</svg>"
    )


def _not_flat(extent: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    """Return the extent with a margin, and widened where one side is much shorter than the other."""
    xmin, ymin, xmax, ymax = extent
    longest = max(xmax - xmin, ymax - ymin, 1.0)
    least = _FLATTEST * longest
    across, along = (max(0.0, least - side) / 2 + 0.01 * longest for side in (xmax - xmin, ymax - ymin))
    return xmin - across, ymin - along, xmax + across, ymax + along


def _scale_bar(width: float, height: float, line: float) -> str:
    """Return a bar of a round length, at most a third of the width, with its length in metres."""
    longest = width / 30  # m
    power = 10.0 ** math.floor(math.log10(longest))
    metres = power * max(step for step in (1, 2, 5) if step * power <= longest)
    x, y = 8 * line, height - 8 * line
    text = f"{metres:g} m" if metres < 1000 else f"{metres / 1000:g} km"
    return (
        f'<path d="M{x:.0f} {y:.0f}h{10 * metres:.0f}" stroke="#fff" stroke-width="{5 * line:.1f}"/>'
        f'<path d="M{x:.0f} {y:.0f}h{10 * metres:.0f}" stroke="#111" stroke-width="{2 * line:.1f}"/>'
        f'<text x="{x:.0f}" y="{y - 5 * line:.0f}" font-size="{11 * line:.0f}" font-family="sans-serif" fill="#111" '
        f'stroke="#fff" stroke-width="{2.5 * line:.1f}" paint-order="stroke">{text}</text>'
    )
