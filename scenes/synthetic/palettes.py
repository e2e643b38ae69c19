"""Colours of things in full sunlight: red, green, blue, near infrared, 0..1, as an aerial camera records them.

Each palette is a list of (weight, colour); a drawn colour varies in lightness and a little in hue.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["BRICK", "GROUND", "LAWNS", "PALETTES", "Colour", "Palette", "draw_colour", "shaded"]

Colour = tuple[float, float, float, float]
Palette = Sequence[tuple[float, Colour]]

#: Chimneys and parapets.
BRICK: Colour = (0.50, 0.34, 0.28, 0.44)

PALETTES: dict[str, Palette] = {
    "australian": (
        (5.0, (0.58, 0.42, 0.36, 0.52)),  # terracotta tiles
        (3.0, (0.51, 0.38, 0.34, 0.46)),  # weathered terracotta
        (3.5, (0.40, 0.34, 0.31, 0.40)),  # brown concrete tiles
        (3.5, (0.47, 0.46, 0.45, 0.46)),  # grey concrete tiles
        (1.6, (0.30, 0.31, 0.32, 0.31)),  # charcoal
        (1.6, (0.77, 0.76, 0.71, 0.74)),  # cream steel
        (1.2, (0.67, 0.69, 0.70, 0.64)),  # galvanised steel
    ),
    "central-european": (
        (6.0, (0.54, 0.38, 0.31, 0.50)),  # red clay tiles
        (4.0, (0.46, 0.33, 0.29, 0.44)),  # weathered red
        (3.0, (0.37, 0.31, 0.29, 0.37)),  # brown
        (2.0, (0.34, 0.33, 0.34, 0.34)),  # slate, dark concrete
        (0.8, (0.52, 0.51, 0.50, 0.48)),  # fibre cement
    ),
    "north-american": (
        (3.0, (0.59, 0.58, 0.55, 0.57)),  # gravel
        (3.0, (0.43, 0.42, 0.41, 0.42)),  # old gravel
        (2.0, (0.25, 0.25, 0.26, 0.25)),  # tar
        (2.0, (0.82, 0.82, 0.80, 0.74)),  # white membrane
        (1.0, (0.51, 0.45, 0.40, 0.48)),  # brown ballast
        (0.6, (0.47, 0.53, 0.50, 0.50)),  # copper
    ),
    "halls": (
        (4.0, (0.74, 0.75, 0.74, 0.70)),  # light steel
        (3.0, (0.60, 0.61, 0.61, 0.58)),  # galvanised
        (2.0, (0.49, 0.47, 0.44, 0.48)),  # rusted, dusty
        (1.0, (0.45, 0.50, 0.52, 0.47)),  # blue grey
        (1.0, (0.82, 0.82, 0.78, 0.78)),  # cream
    ),
    "painted-green": (
        (2.0, (0.36, 0.46, 0.34, 0.58)),
        (2.0, (0.30, 0.41, 0.31, 0.52)),
        (1.0, (0.45, 0.53, 0.41, 0.62)),
    ),
    "planted": (
        (2.0, (0.41, 0.47, 0.27, 0.68)),
        (1.0, (0.48, 0.48, 0.30, 0.64)),
        (1.0, (0.36, 0.45, 0.26, 0.72)),
    ),
    "walls": (
        (3.0, (0.62, 0.50, 0.42, 0.52)),
        (3.0, (0.72, 0.69, 0.63, 0.66)),
        (2.0, (0.50, 0.40, 0.34, 0.45)),
        (1.0, (0.60, 0.61, 0.62, 0.60)),
    ),
    "facades": (
        (2.0, (0.44, 0.47, 0.50, 0.46)),
        (2.0, (0.58, 0.55, 0.50, 0.55)),
        (1.5, (0.30, 0.35, 0.40, 0.34)),
        (1.0, (0.52, 0.40, 0.33, 0.46)),
        (1.0, (0.70, 0.69, 0.66, 0.66)),
    ),
    "cars": (
        (4.0, (0.86, 0.86, 0.86, 0.80)),
        (3.0, (0.66, 0.67, 0.69, 0.62)),
        (2.5, (0.17, 0.17, 0.19, 0.18)),
        (1.5, (0.40, 0.41, 0.43, 0.40)),
        (1.0, (0.55, 0.13, 0.13, 0.45)),
        (1.0, (0.16, 0.25, 0.47, 0.30)),
    ),
    "leaves": (
        (3.0, (0.31, 0.41, 0.23, 0.72)),
        (3.0, (0.27, 0.37, 0.20, 0.66)),
        (2.0, (0.37, 0.46, 0.25, 0.76)),
        (2.5, (0.38, 0.40, 0.31, 0.62)),
        (1.0, (0.25, 0.32, 0.22, 0.58)),
        (2.0, (0.42, 0.40, 0.31, 0.56)),
        (1.5, (0.44, 0.38, 0.30, 0.52)),
    ),
    "needles": (
        (2.0, (0.17, 0.25, 0.18, 0.46)),
        (1.0, (0.21, 0.28, 0.18, 0.50)),
    ),
    "autumn": (
        (2.0, (0.56, 0.42, 0.18, 0.58)),
        (1.5, (0.52, 0.28, 0.16, 0.54)),
        (1.0, (0.42, 0.24, 0.24, 0.52)),
        (1.0, (0.47, 0.41, 0.33, 0.46)),  # nearly bare
    ),
}

#: Ground covers in the order of `groundcover`: see `clutter.Cover`.
GROUND: NDArray[np.float32] = np.array(
    [
        (0.42, 0.42, 0.43, 0.38),
        (0.66, 0.64, 0.60, 0.60),
        (0.60, 0.57, 0.53, 0.55),
        (0.58, 0.54, 0.48, 0.54),
        (0.35, 0.62, 0.68, 0.08),
        (0.53, 0.43, 0.33, 0.48),
        (0.56, 0.55, 0.54, 0.52),
        (0.66, 0.59, 0.42, 0.60),
        (0.33, 0.42, 0.22, 0.72),
        (0.42, 0.43, 0.28, 0.60),
    ],
    dtype=np.float32,
)

#: Green grass, dry grass.
LAWNS: NDArray[np.float32] = np.array([(0.37, 0.45, 0.25, 0.72), (0.60, 0.55, 0.38, 0.58)], dtype=np.float32)


def draw_colour(palette: Palette, which: float, lightness: float, tint: float) -> Colour:
    """Return a colour of the palette; `which`, `lightness` and `tint` are uniform draws in [0, 1)."""
    weights = np.cumsum([weight for weight, _ in palette])
    base = palette[int(np.searchsorted(weights, which * weights[-1], side="right"))][1]
    factor = 0.84 + 0.32 * lightness
    shift = (tint - 0.5) * 0.05
    red, green, blue, nir = (min(max(value * factor, 0.04), 0.95) for value in base)
    return red + shift, green, blue - shift, nir


def shaded(colour: Colour, factor: float) -> Colour:
    """Return a darker (or lighter) colour."""
    red, green, blue, nir = colour
    return red * factor, green * factor, blue * factor, nir * factor
