"""The parameters of both line detectors, with the values of the papers and of our readings.

Parameters that a paper prints in pixels of its images are declared in those (`PAPER_PIXEL`, 0.15 m) or in metres, never
in pixels of the scene, so that the values do not depend on the ground sampling distance.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from ...core.conditions import ABOVE_ZERO, Uses
from ...core.errors import ParameterError
from ...core.parameters import parameter
from ..base import Detector

__all__ = ["PAPER_PIXEL", "LineParameters", "least_new_width"]

#: Ground sampling distance that the 2010 paper's pixel counts refer to, metres.
PAPER_PIXEL = 0.15


def least_new_width(default: float) -> Any:
    """Return the parameter `new_width`, whose default differs between the detectors."""
    return parameter(
        default, unit="m", minimum=0, swept=(0.0, 1.0, 2.0, 3.0),
        doc="least width of what a final rectangle adds to all larger ones; with less it is a duplicate; 0 tests none, "
        "as printed",
        source="2010, 3.3.1: a building is at least 3 m wide; reading",
    )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class LineParameters(Detector):
    """Parameters of the detectors `original` and `improved`.

    The printed forms have no value for the rule at the border of the points (`border`), for strips narrower than two
    pixels (`least_strip`) and for the pixels of the tiles (`tile_pixel`): their readings hold in every mode.
    """

    requires: ClassVar[tuple[str, ...]] = ("points", "brightness")
    halo: ClassVar[float] = 150.0
    used_with: ClassVar[Mapping[str, Uses]] = {
        "below_ground": {"ground": ("point-dem",)},
        "ground_tile": {"ground": ("tile-dem", "tile-mode")},
        "tile_pixel": {"ground": ("tile-dem", "tile-mode")},
        "neighbourhood": {"marking": ("nearest", "squares")},
        "new_width": {"new_share": (ABOVE_ZERO,)},
        "parallel_angle": {"new_share": (ABOVE_ZERO,)},
    }

    mode: str = parameter(
        "default", choices=("default", "paper", "program"),
        doc="set of defaults: the readings that detect best, each point as printed, or as in the authors' own program; "
        "parameters given beside it override it",
    )  # fmt: skip
    ground: str = parameter(
        "point-dem",
        choices=("tile-dem", "tile-mode", "point-dem"),
        doc="ground height: mean DEM of the tile (2010), most frequent height of the tile's points (conference "
        "version), or DEM under the point (2011 and the authors' program)",
        source="2010, 3.2; conference version, 3.1; 2011, 3.1; program",
    )
    below_ground: float = parameter(
        0.1, minimum=0, maximum=1, swept=(0.05, 0.1, 0.2, 1.0),
        doc="largest share of the surrounding points that may lie below the ground before it is lowered "
        "(`ground=point-dem`); 1 never lowers it, as printed",
        source="2011, 3.1; reading",
    )  # fmt: skip
    ground_tile: float = parameter(
        450, unit="px of 0.15 m", minimum=20, swept=(400, 450, 500, 550, 600),
        doc="side of the tiles with one ground height each", source="2010, 3.2 and 4.4.1",
    )  # fmt: skip
    tile_pixel: str = parameter(
        "printed", choices=("printed", "image"),
        doc="pixel that `ground_tile` counts: 0.15 m as in the papers, or that of the image", source="reading",
    )  # fmt: skip
    spacing: float | None = parameter(
        None, unit="m", minimum=0.01,
        doc="distance of neighbouring pulses that lengths follow; none: measured as the median of the scene",
        source="reading",
    )  # fmt: skip
    largest_pixel: float = parameter(
        0.25, unit="m", minimum=0.01,
        doc="side of the largest pixel on which the steps run, a coarser image is interpolated; 1000 keeps the pixels "
        "of the image, as printed",
        source="2010: pixels of 0.15 m; reading",
    )  # fmt: skip
    height: float = parameter(
        2.5, unit="m", minimum=0, doc="least height above ground of a building", source="2010, 3.2"
    )
    marking: str = parameter(
        "nearest", choices=("nearest", "squares", "cells"),
        doc="how points mark the masks: the nearest point decides; each point marks a square, as printed, or a square "
        "of cells of 0.25 m whatever the image",
        source="2010, 3.2; reading; program",
    )  # fmt: skip
    neighbourhood: float | None = parameter(
        None, unit="m", minimum=0,
        doc="side of the square that a point marks, and largest distance of the nearest point; none: 1.5 point "
        "spacings, the paper's 5 px of 0.15 m",
        source="2010, 3.2",
    )  # fmt: skip
    border: str = parameter(
        "drop", choices=("drop", "keep"),
        doc="whether areas beyond the border of the points, black in the primary mask because they have no points, and "
        "the lines along them are dropped",
        source="reading",
    )  # fmt: skip
    minimum_side: float = parameter(
        3.0, unit="m", minimum=0, doc="least length and width of a building; shorter edges and lines are dropped",
        source="2010, 3.3.1",
    )  # fmt: skip
    smoothing: float = parameter(
        3.0, unit="curve points", minimum=0, doc="sigma of the Gaussian along a curve", source="2010, 3.3.1"
    )
    curve_step: float | None = parameter(
        None, unit="m", minimum=0.01,
        doc="distance of curve points; none: 0.3 point spacings, at least a third of a pixel",
        source="2010, 3.3.1: pixels of 0.15 m at a spacing of 0.5 m; reading",
    )  # fmt: skip
    corner_product: float = parameter(
        0.2, minimum=0, maximum=1, doc="least product of the three normalised accumulated chord distances",
        source="CPDA, 2009",
    )  # fmt: skip
    corner_angle: float = parameter(
        157.0, unit="deg", minimum=90, maximum=180,
        doc="interior angles from this value to 360 minus it (203) are not corners", source="CPDA, 2009",
    )  # fmt: skip
    missed_corner: float | None = parameter(
        None, unit="m", minimum=0.01,
        doc="RMS distance of a curve from its line above which it is split; none: 0.4 point spacings, at least half a "
        "pixel; 1000 never splits, as printed",
        source="reading",
    )  # fmt: skip
    inside_reach: float = parameter(
        3.0,
        unit="px of 0.15 m",
        minimum=0,
        doc="distance of the inside point from its line",
        source="2010, 3.3.1; reading",
    )
    inside_test: str = parameter(
        "point", choices=("point", "strip"),
        doc="side of a line with the building: where the inside point is black, or a share `extension_black` of the "
        "strip of `band_width`; lines without one are dropped",
        source="2010, 3.3.1; program",
    )  # fmt: skip
    vegetation: str = parameter(
        "green-red", choices=("green-red", "pseudo-ndvi", "sigma"),
        doc="index on images without near infrared: 2(G-R)/(G+R), the printed (R-G)/(R+G), or its standard deviation "
        "by the noise of the image, 0..100",
        source="2010, 4.3; reading; program",
    )  # fmt: skip
    nir_threshold: float | None = parameter(
        None, minimum=0, maximum=255, doc="threshold of the NDVI (0..255) with near infrared; none: "
        "`vegetation_threshold`",
        source="program",
    )  # fmt: skip
    vegetation_threshold: float = parameter(
        48.0, minimum=0, maximum=255, swept=(32, 40, 48, 56, 64),
        doc="mean vegetation index (0..255) above which an area is vegetation", source="2010, 3.3.1 and 4.4.1",
    )  # fmt: skip
    band_width: float = parameter(
        3.0, unit="m", minimum=0.1, doc="width of the rectangle beside a line in which the vegetation index is tested",
        source="2010, 3.3.1",
    )  # fmt: skip
    adjustment_angle: float = parameter(
        22.5, unit="deg", minimum=0, maximum=45, doc="largest rotation of a line to be parallel or perpendicular",
        source="2010, 3.3.2",
    )  # fmt: skip
    adjustment_radius: float = parameter(
        50.0, unit="m", minimum=0, doc="largest distance of a line and its reference in the adjustment to neighbours",
        source="2010, 3.3.2",
    )  # fmt: skip
    extension: float = parameter(
        3.0, unit="m", minimum=0.1,
        doc="depth and first step of the extension of lines, and first step of that of initial rectangles",
        source="2010, 3.3.2",
    )  # fmt: skip
    extension_stop: float | None = parameter(
        None, unit="m", minimum=0.01,
        doc="step below which the extension of a line or initial rectangle ends; none: 0.8 point spacings",
        source="2010, 3.3.2: 0.4 m at a spacing of 0.5 m",
    )  # fmt: skip
    extension_black: float = parameter(
        0.7, minimum=0, maximum=1, swept=(0.6, 0.7, 0.8, 0.9), doc="least share of black in a step of that extension",
        source="2010, 3.3.2",
    )  # fmt: skip
    rectangle_extension: float | None = parameter(
        None, unit="m", minimum=0.1,
        doc="first step of the extension of initial rectangles; none: that of lines, as printed",
        source="2010, 3.3.3; program",
    )  # fmt: skip
    extension_part: float | None = parameter(
        None, unit="m", minimum=0.1,
        doc="least length of a part of a side that is tested; none: the first step, at least 3.5 point spacings; 1000: "
        "the whole side",
        source="2010, 3.3.2: 3 m, and 3.3.3: the same technique for sides; reading",
    )  # fmt: skip
    initial_width: float = parameter(
        1.5, unit="m", minimum=0.1, doc="width of a rectangle before it is extended", source="2010, 3.3.3"
    )
    inside_margin: float | None = parameter(
        None, unit="m", minimum=0,
        doc="distance outside a rectangle up to which a line counts as inside; none: last step of its extension + one "
        "pixel; 0 as printed",
        source="2010, 3.3.3; reading",
    )  # fmt: skip
    inside_share: float = parameter(
        0.9, minimum=0, maximum=1,
        doc="least share of its length inside a rectangle for a line to count as inside, with its midpoint",
        source="2010, 3.3.3; reading",
    )  # fmt: skip
    least_rectangle: float | None = parameter(
        None, unit="m", minimum=0, doc="least length and width of an initial rectangle; none: `minimum_side`",
        source="2010, 3.3.3; program",
    )  # fmt: skip
    reduction: float = parameter(
        0.15, minimum=0, maximum=0.9, swept=(0.10, 0.15, 0.20, 0.25, 0.30),
        doc="share by which length and width of initial rectangles shrink", source="2010, 3.4.1 and 4.4.1",
    )  # fmt: skip
    filled_share: float = parameter(
        0.0, minimum=0, maximum=1,
        doc="least share of a shrunk initial rectangle that is black in the secondary mask; 0: not tested, as printed",
        source="program",
    )  # fmt: skip
    colour_bins: str = parameter(
        "printed", choices=("printed", "tenths"),
        doc="bins of the colour histograms: 10 of Y, 20 of I and Q, or 0.1 wide for all three",
        source="2010, 3.4.1; program",
    )  # fmt: skip
    colour_smoothing: float = parameter(
        0.0, unit="px", minimum=0, maximum=5, doc="sigma of the Gaussian over 3 x 3 pixels that smooths the colours",
        source="program",
    )  # fmt: skip
    part_share: float = parameter(
        0.97,
        minimum=0,
        maximum=1,
        doc="least share of a part of a colour histogram in its range",
        source="2010, 3.4.1",
    )
    total_share: float = parameter(
        0.90, minimum=0, maximum=1, doc="least share of the rectangle in the parts used", source="2010, 3.4.1"
    )
    strip: float = parameter(
        0.35, unit="m", minimum=0.01, doc="first step of the final extension", source="2010, 3.4.2"
    )
    least_strip: float = parameter(
        2.0, unit="px", minimum=0.1, doc="least first step of the final extension on coarse images", source="reading"
    )
    strip_stop: float | None = parameter(
        None, unit="m", minimum=0.01,
        doc="strip below which the final extension of a side ends; none: one pixel, as printed",
        source="2010, 3.4.2; program",
    )  # fmt: skip
    final_order: str = parameter(
        "sequence", choices=("sequence", "independent"),
        doc="whether each side is extended from what the sides before it reached, or all from the same rectangle",
        source="2010, 3.4.2; program",
    )  # fmt: skip
    colour_from: str = parameter(
        "initial", choices=("initial", "shrunk"),
        doc="from where the colours of strips are tested: a point spacing inside the sides of the initial rectangle, "
        "since the points prove the roof farther inside, or from the shrunk rectangle on, as printed",
        source="2010, 3.4.2; reading",
    )  # fmt: skip
    colour_similarity: float = parameter(
        0.4, minimum=0, maximum=1, swept=(0.2, 0.3, 0.4, 0.5, 0.6),
        doc="least share of a step in the dominant range of Y, I and Q each", source="2010, 3.4.2 and 4.4.1",
    )  # fmt: skip
    black_share: float = parameter(
        0.9, minimum=0, maximum=1, swept=(0.6, 0.7, 0.8, 0.9, 1.0),
        doc="least share of a step that is black in the secondary mask", source="2010, 3.4.2 and 4.4.1",
    )  # fmt: skip
    gap_share: float = parameter(
        0.1,
        minimum=0,
        maximum=1,
        doc="primary black below which the next rise ends the extension of a side",
        source="2010, 3.4.2",
    )
    rise: float = parameter(
        0.1, minimum=0, maximum=1, doc="largest increase of primary black that does not count as a rise; 0 as printed",
        source="2010, 3.4.2; reading",
    )  # fmt: skip
    rise_from: str = parameter(
        "start", choices=("start", "gap"),
        doc="whether primary black must never rise, as printed, or not after it fell below `gap_share`",
        source="2010, 3.4.2; program",
    )  # fmt: skip
    compare: str = parameter(
        "shrunk", choices=("shrunk", "whole"),
        doc="size of an initial rectangle in the test that drops it wholly inside a final one",
        source="2010, 3.4; reading",
    )  # fmt: skip
    new_share: float = parameter(
        0.2, minimum=0, maximum=1, swept=(0.0, 0.1, 0.2, 0.3),
        doc="least share of a final rectangle outside the larger ones at an oblique angle to it; with less it is a "
        "duplicate; 0 keeps all, as printed",
        source="2010, 3.4: parts adjoin at right angles; reading",
    )  # fmt: skip
    new_width: float = least_new_width(0.0)
    same_overlap: float = parameter(
        0.5, minimum=0, maximum=1, swept=(0.4, 0.5, 0.6, 0.8, 1.0),
        doc="largest intersection over union of two final rectangles at any angle; with more the smaller one is a "
        "duplicate; 1 keeps all, as printed",
        source="2010, 3.4; reading",
    )  # fmt: skip
    parallel_angle: float = parameter(
        3.0, unit="deg", minimum=0, maximum=45,
        doc="largest angle between final rectangles that are parallel or perpendicular",
        source="2010, 3.4; reading",
    )  # fmt: skip

    @classmethod
    def build(cls, values: Mapping[str, Any] | None = None) -> Self:
        """Build from a mapping; the former name of `ground_tile` is refused with the new one."""
        if "tile_size" in (values or {}):
            raise ParameterError(f"{cls.name}: no parameter 'tile_size': it is called ground_tile now")
        return super().build(values)
