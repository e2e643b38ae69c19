"""The detector `original`: lines around the laser's voids, extended by colour.

Source: Awrangjeb, Ravanbakhsh & Fraser, "Automatic detection of residential buildings using LIDAR data and
multispectral imagery", ISPRS Journal of Photogrammetry and Remote Sensing 65 (2010). The page
docs/line-detectors.md tells how each open point of the print is read and what that costs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...scenes.parameters import parameter
from .adjustment import adjust_to_neighbours, rotate
from .detector import LineDetector, Rasters
from .extension import band, mean_in_boxes
from .trace import Fate, Trace

__all__ = ["Original"]


@dataclass(frozen=True, kw_only=True)
class Original(LineDetector):
    """Line detector of Awrangjeb, Ravanbakhsh & Fraser (2010)."""

    name: ClassVar[str] = "original"

    adjustment_radius: float = parameter(
        50.0,
        unit="m",
        minimum=0,
        doc="largest distance of the centres of a line and its reference",
        source="2010, 3.3.2",
    )
    adjustment_reference: str = parameter(
        "longer", choices=("longer", "any"),
        doc="which lines a line is turned to: longer ones, for which the print sorts them by length, or any near it",
        source="2010, 3.3.2; reading",
    )  # fmt: skip

    def run(self, rasters: Rasters) -> Trace:
        """Run all steps that follow the masks, keeping the intermediate results."""
        gsd = rasters.gsd
        segments, fates = self._fitted_lines(rasters)
        beside = mean_in_boxes(rasters.cover.vegetation, band(segments.lines, self.band_width / gsd, 0.0))
        fates[(fates == Fate.RECTANGLE) & (beside > self.vegetation_threshold)] = Fate.VEGETATION

        lines = segments.lines.copy()
        alive = np.flatnonzero(fates == Fate.RECTANGLE)
        rotation = adjust_to_neighbours(
            lines[alive],
            radius=self.adjustment_radius / gsd,
            tolerance=np.radians(self.adjustment_angle),
            longer_only=self.adjustment_reference == "longer",
        )
        fates[alive[np.isnan(rotation)]] = Fate.UNADJUSTED
        adjusted = ~np.isnan(rotation)
        alive = alive[adjusted]
        lines[alive] = self._extended(rasters, rotate(lines[alive], rotation[adjusted]))

        initial, initial_fates, final = self._rectangles(rasters, lines, fates)
        return Trace(
            image=rasters.image,
            masks=rasters.masks,
            vegetation=rasters.cover.vegetation,
            fitted=segments.lines,
            lines=lines,
            shapes=segments.shapes,
            fates=fates,
            rescued=np.zeros(len(fates), dtype=np.bool_),
            initial=initial,
            initial_fates=initial_fates,
            candidates=final,
            kept=np.ones(len(final), dtype=np.bool_),
        )
