"""The detector `original`: rectangles from lines around areas without ground points, extended by colour.

Source: Awrangjeb, Ravanbakhsh & Fraser, "Automatic detection of residential buildings using LIDAR data and
multispectral imagery", ISPRS Journal of Photogrammetry and Remote Sensing 65 (2010). The page
docs/results/line-detectors.md lists how each open point of the print is read and what that costs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...core.conditions import Uses
from ...core.parameters import parameter
from .adjustment import adjust_to_neighbours, adjust_within_shape
from .boxes import Boxes
from .extension import band, mean_in_boxes
from .line_detector import LineDetector
from .line_modes import PAPER, PROGRAM
from .line_parameters import least_new_width
from .rasters import Rasters
from .segments import Segments

__all__ = ["Original"]

#: Distance by which an end of a line may be moved to follow its shape, point spacings: the edge of a mask is uncertain
#: by as much, since half the diagonal of a square of four points is the farthest that a place can be from a point.
_SHAPE_REACH = 0.7


@dataclass(frozen=True, kw_only=True)
class Original(LineDetector):
    """Line detector of Awrangjeb, Ravanbakhsh & Fraser (2010)."""

    name: ClassVar[str] = "original"
    paper = "Awrangjeb, Ravanbakhsh & Fraser 2010, ISPRS Journal of Photogrammetry and Remote Sensing 65(5)"
    modes: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "paper": {
            **PAPER,
            "ground": "tile-dem",
            "curve_step": 0.15,
            "adjustment_reference": "any",
            "adjustment_share": 1.0,
        },
        "program": {**PROGRAM, "adjustment_reference": "none"},
    }

    used_with: ClassVar[Mapping[str, Uses]] = {
        **LineDetector.used_with,
        "adjustment_angle": {"adjustment_reference": ("shape", "longer", "any")},
        "adjustment_radius": {"adjustment_reference": ("shape", "longer", "any")},
        "adjustment_share": {"adjustment_reference": ("shape", "longer", "any")},
    }

    adjustment_reference: str = parameter(
        "shape", choices=("shape", "longer", "any", "none"),
        doc="reference lines of the adjustment: the longest line of the same black shape if that moves the ends by at "
        "most 0.7 point spacings, otherwise longer lines nearby; longer lines nearby (the print sorts by length); all "
        "lines nearby; or none: lines stay as fitted",
        source="2010, 3.3.2; reading; program",
    )  # fmt: skip
    adjustment_share: float = parameter(
        0.5, minimum=0, maximum=1,
        doc="share of the lines, the longest first, that can be references; optional in the print, 1 is all",
        source="2010, 3.3.2",
    )  # fmt: skip
    new_width: float = least_new_width(2.0)

    def _tree_edges(self, rasters: Rasters, lines: Boxes) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        beside = mean_in_boxes(rasters.cover.vegetation, band(lines, self.band_width / rasters.gsd, 0.0))
        green = beside > self._index_limit(rasters.image)
        return green, green

    def _rotation(self, segments: Segments, rasters: Rasters) -> NDArray[np.float64]:
        if self.adjustment_reference == "none":
            return np.zeros(len(segments))
        radius, tolerance = self.adjustment_radius / rasters.gsd, float(np.radians(self.adjustment_angle))
        nearby = adjust_to_neighbours(
            segments.lines,
            radius=radius,
            tolerance=tolerance,
            longer_only=self.adjustment_reference != "any",
            share=self.adjustment_share,
        )
        if self.adjustment_reference != "shape":
            return nearby
        own = adjust_within_shape(
            segments.lines,
            segments.shapes,
            radius=radius,
            tolerance=tolerance,
            reach=_SHAPE_REACH * rasters.spacing / rasters.gsd,
            share=self.adjustment_share,
        )
        return np.where(np.isnan(own), nearby, own)
