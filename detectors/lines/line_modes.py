"""The modes of the line detectors: defaults as printed, and as in the authors' own program.

Both name the parameters that differ from the default readings. Parameters of one detector alone are beside its class.
Of the program, these rules are not followed: its least squares of y on x are undefined for steep lines; the first and
last bin of the orientation histograms are always one; the masks on cells of 0.25 m are resampled to the image; where
the DEM has no value, the ground is that of all detectors (`Scene.heights`); test 5 takes the highest bin of any edge,
not of the longest one; and the inside point of a line need not be in the rectangle that contains the line.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

__all__ = ["PAPER", "PROGRAM"]

#: Every reading at its printed form, in metres for pixels of 0.15 m.
PAPER: Mapping[str, Any] = {
    "largest_pixel": 1000.0,
    "marking": "squares",
    "neighbourhood": 0.75,
    "missed_corner": 1000.0,
    "vegetation": "pseudo-ndvi",
    "extension_stop": 0.4,
    "extension_part": 1000.0,
    "inside_margin": 0.0,
    "inside_share": 1.0,
    "colour_from": "shrunk",
    "rise": 0.0,
    "new_share": 0.0,
    "same_overlap": 1.0,
}

#: As printed, where the authors' own program does not differ; its masks have pixels of 0.25 m and no neighbourhood.
PROGRAM: Mapping[str, Any] = {
    **{name: value for name, value in PAPER.items() if name != "neighbourhood"},
    "ground": "point-dem",
    "below_ground": 1.0,
    "marking": "cells",
    "curve_step": 0.25,
    "inside_test": "strip",
    "band_width": 2.0,
    "vegetation": "sigma",
    "nir_threshold": 25.5,
    "rectangle_extension": 1.5,
    "least_rectangle": 2.0,
    "reduction": 0.3,
    "filled_share": 0.7,
    "colour_bins": "tenths",
    "colour_smoothing": 0.5,
    "strip_stop": 0.35,
    "final_order": "independent",
    "rise_from": "gap",
}
