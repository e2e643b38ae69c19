"""The parameters and steps that both line detectors share.

Parameters that a paper prints in pixels of its images are declared in those (`PAPER_PIXEL`, 0.15 m) or in metres, never
in pixels of the scene, so that the values do not depend on the ground sampling distance.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...core.parameters import parameter
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.raster import Grid, Image
from ...scenes.scene import Scene
from ..base import Detector
from ..steps import Step
from .adjustment import by_length, rotate
from .boxes import Boxes, box_corners, lengths, prefix_sums, widths
from .colours import Colours
from .contours import trace_shapes
from .corners import find_corners
from .duplicates import find_duplicates
from .extension import Cover, Growth, extend_lines, last_step
from .final_rectangles import FinalRules, final_rectangles
from .initial_rectangles import INSIDE, TOO_NARROW, initial_rectangles
from .line_steps import line_steps
from .masks import build_masks, ground_correction, ground_heights, pulse_spacing
from .rasters import Rasters
from .segments import Segments, beyond_coverage, fit_segments, inside_first
from .trace import Adjusted, Outcome, Trace, Votes
from .vegetation import vegetation_prefix

if TYPE_CHECKING:
    from .image_edges import ImageEdges
    from .texture import Texture

__all__ = ["PAPER_PIXEL", "LineDetector"]

#: Ground sampling distance that the 2010 paper's pixel counts refer to, metres.
PAPER_PIXEL = 0.15
#: The edge of a mask lies half a pixel outside the centres of its border pixels.
_OUTSET = 0.5
#: Distance of curve points, point spacings: the paper's pixel of 0.15 m at its spacing of 0.5 m.
_CURVE_STEP = 0.3
#: Least length of a part of a side that is tested, point spacings: its first step then contains ten points or more.
_EXTENSION_PART = 3.5
#: Root mean square distance from its line above which a segment contains a missed corner: in point spacings, and in
#: pixels, because the staircase of a mask is no corner.
_MISSED_CORNER, _STAIRCASE = 0.4, 0.5
#: Raster that stands for unused entropy.
_NO_ENTROPY = np.zeros((0, 1), dtype=np.int32)


@dataclass(frozen=True, kw_only=True)
class LineDetector(Detector):
    """Parameters and shared steps of the detectors `original` and `improved`."""

    requires: ClassVar[tuple[str, ...]] = ("points", "colour")

    ground: str = parameter(
        "tile-dem",
        choices=("tile-dem", "tile-mode", "point-dem"),
        doc="ground height: mean DEM of the tile, most frequent height of the tile's points, or DEM under the point",
        source="2010, 3.2; conference version, 3.1; 2011, 3.1",
    )
    below_ground: float = parameter(
        0.1, minimum=0, maximum=1, swept=(0.05, 0.1, 0.2, 1.0),
        doc="largest share of the surrounding points that may lie below the ground before it is lowered "
        "(`ground=point-dem`); 1 never lowers it, as printed",
        source="2011, 3.1; reading",
    )  # fmt: skip
    tile_size: float = parameter(
        450, unit="px of 0.15 m", minimum=20, swept=(400, 450, 500, 550, 600),
        doc="side of the tiles with one ground height each", source="2010, 3.2 and 4.4.1",
    )  # fmt: skip
    height: float = parameter(
        2.5, unit="m", minimum=0, doc="least height above ground of a building", source="2010, 3.2"
    )
    marking: str = parameter(
        "nearest", choices=("nearest", "squares"),
        doc="how points mark the masks: the nearest point decides, or each point marks a square, as printed",
        source="2010, 3.2; reading",
    )  # fmt: skip
    neighbourhood: float | None = parameter(
        None, unit="m", minimum=0,
        doc="side of the square that a point marks, and largest distance of the nearest point; none: 1.5 point "
        "spacings, the paper's 5 px of 0.15 m",
        source="2010, 3.2",
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
        doc="interior angles from this value to 360 minus it (203) are no corner", source="CPDA, 2009",
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
    vegetation: str = parameter(
        "green-red", choices=("green-red", "pseudo-ndvi"),
        doc="index on images without near infrared: 2(G-R)/(G+R), or the printed (R-G)/(R+G)",
        source="2010, 4.3; reading",
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
        3.0, unit="m", minimum=0.1, doc="depth and first step of the extension of lines and initial rectangles",
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
    reduction: float = parameter(
        0.15, minimum=0, maximum=0.9, swept=(0.10, 0.15, 0.20, 0.25, 0.30),
        doc="share by which length and width of initial rectangles shrink", source="2010, 3.4.1 and 4.4.1",
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
        0.1, minimum=0, maximum=1, doc="largest increase of primary black that is no rise; 0 as printed",
        source="2010, 3.4.2; reading",
    )  # fmt: skip
    compare: str = parameter(
        "shrunk", choices=("shrunk", "whole"),
        doc="size of an initial rectangle in the test that drops it wholly inside a final one",
        source="2010, 3.4; reading",
    )  # fmt: skip
    new_share: float = parameter(
        0.1, minimum=0, maximum=1, swept=(0.0, 0.05, 0.1, 0.2),
        doc="least share of a final rectangle outside the larger ones at an oblique angle to it; with less it is a "
        "duplicate; 0 keeps all, as printed",
        source="2010, 3.4: parts adjoin at right angles; reading",
    )  # fmt: skip
    parallel_angle: float = parameter(
        3.0, unit="deg", minimum=0, maximum=45,
        doc="largest angle between final rectangles that are parallel or perpendicular",
        source="2010, 3.4; reading",
    )  # fmt: skip

    def run(self, rasters: Rasters) -> Trace:
        """Run all steps that follow the masks, keeping the intermediate results."""
        segments, on_border = self._fitted_lines(rasters)
        tree_edges, green = self._tree_edges(rasters, segments.lines)
        outcomes = np.where(on_border, Outcome.BORDER, np.where(tree_edges, Outcome.VEGETATION, Outcome.RECTANGLE))

        rotation = np.full(len(segments), np.nan)
        remaining = np.flatnonzero(outcomes == Outcome.RECTANGLE)
        rotation[remaining] = self._rotation(segments.take(remaining), rasters.gsd)
        outcomes[remaining[np.isnan(rotation[remaining])]] = Outcome.UNADJUSTED
        remaining = np.flatnonzero(outcomes == Outcome.RECTANGLE)
        lines = segments.lines.copy()
        lines[remaining] = self._extended(rasters, rotate(lines[remaining], rotation[remaining]))

        edges = self._image_edges(rasters)
        adjusted = Adjusted(lines, segments.shapes, rotation, outcomes == Outcome.RECTANGLE)
        votes = self._votes(adjusted, edges, rasters.gsd)
        if votes is not None:
            outcomes[adjusted.remaining & ~self._majority(votes)] = Outcome.OUTVOTED
        remaining = np.flatnonzero(outcomes == Outcome.RECTANGLE)
        initial, made = self._initial_rectangles(rasters, lines[remaining])
        outcomes[remaining[made == INSIDE]] = Outcome.INSIDE
        outcomes[remaining[made == TOO_NARROW]] = Outcome.NARROW
        candidates, candidate_of = self._final_rectangles(rasters, initial)
        texture = self._texture(candidates, edges, rasters.image.grid)
        buildings = np.ones(len(candidates), dtype=np.bool_) if texture is None else np.any(texture.passed, axis=1)
        duplicates = np.zeros(len(candidates), dtype=np.bool_)
        duplicates[buildings] = find_duplicates(
            candidates[buildings], least=self.new_share, tolerance=np.radians(self.parallel_angle)
        )
        return Trace(
            image=rasters.image,
            masks=rasters.masks,
            vegetation=rasters.cover.vegetation,
            fitted=segments.lines,
            lines=lines,
            shapes=segments.shapes,
            outcomes=outcomes,
            smooth_green=green & ~tree_edges & ~on_border,
            initial=initial,
            candidate_of=candidate_of,
            candidates=candidates,
            duplicates=duplicates,
            kept=buildings & ~duplicates,
            votes=votes,
            texture=texture,
        )

    @abstractmethod
    def _tree_edges(self, rasters: Rasters, lines: Boxes) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return which lines are tree edges, and which are green, whatever their texture."""

    @abstractmethod
    def _rotation(self, segments: Segments, gsd: float) -> NDArray[np.float64]:
        """Return the angle that adjusts each line, radians, NaN for lines that are dropped."""

    def _image_edges(self, rasters: Rasters) -> ImageEdges | None:
        """Return the edges of the image; none where nothing asks for them."""
        return None

    def _votes(self, adjusted: Adjusted, edges: ImageEdges | None, gsd: float) -> Votes | None:
        """Return the votes on each line; none without voting."""
        return None

    def _majority(self, votes: Votes) -> NDArray[np.bool_]:
        """Return which lines have a majority."""
        return np.ones(len(votes), dtype=np.bool_)

    def _texture(self, candidates: Boxes, edges: ImageEdges | None, grid: Grid) -> Texture | None:
        """Return the texture of the candidates; none where it is not tested."""
        return None

    def trace(self, scene: Scene) -> Trace:
        """Detect, and return every intermediate result."""
        scene.require(self.requires)
        return self.run(self._rasters(scene))

    def detect(self, scene: Scene, rng: np.random.Generator) -> Footprints:
        """Return the rectangles of the buildings; overlapping ones are parts of one building, or duplicates."""
        found = self.trace(scene)
        corners = box_corners(found.final)
        x, y = found.grid.to_world(corners[..., 1], corners[..., 0])
        rectangles = np.stack([x, y], axis=-1)
        return Footprints.from_rectangles(rectangles, crs=scene.crs, metadata=found.counts(), source=self.name)

    def steps(self, scene: Scene, rng: np.random.Generator) -> Iterator[Step]:
        """Return the masks, the lines, the rectangles and, where used, the votes and the histograms."""
        return line_steps(self.trace(scene))

    def _rasters(self, scene: Scene) -> Rasters:
        points, image = scene.points, scene.image
        assert points is not None
        assert image is not None
        grid = image.grid
        tile_side = self.tile_size * PAPER_PIXEL
        spacing = pulse_spacing(points, grid)
        surface = None if self.ground == "tile-mode" or not len(points) else scene.heights.ground
        ground = ground_heights(points, surface, method=self.ground, tile_side=tile_side)
        if self.ground == "point-dem" and self.below_ground < 1 and len(points):
            ground += ground_correction(points, ground, self.below_ground)
        masks = build_masks(
            points,
            ground + self.height,
            grid,
            neighbourhood=1.5 * spacing if self.neighbourhood is None else self.neighbourhood,
            nearest=self.marking == "nearest",
        )
        cover = Cover(prefix_sums(masks.primary), vegetation_prefix(image, self.vegetation), self._entropy(image))
        bands = [image.bands.index(name) for name in ("red", "green", "blue")]
        rgb = image.values[:3] if bands == [0, 1, 2] else image.values[bands]
        return Rasters(image, masks, cover, Colours(rgb, float(np.iinfo(rgb.dtype).max)), spacing)

    def _entropy(self, image: Image) -> NDArray[np.int32]:
        return _NO_ENTROPY

    def _growth(self, rasters: Rasters) -> Growth:
        stop = 0.8 * rasters.spacing if self.extension_stop is None else self.extension_stop
        part = self.extension_part or max(self.extension, _EXTENSION_PART * rasters.spacing)
        return Growth(
            step=self.extension / rasters.gsd,
            least_step=max(stop / rasters.gsd, 1.0),
            black_share=self.extension_black,
            part=part / rasters.gsd,
            vegetation=self.vegetation_threshold,
            entropy=self._entropy_limit(),
        )

    def _entropy_limit(self) -> float:
        return 0.0

    def _fitted_lines(self, rasters: Rasters) -> tuple[Segments, NDArray[np.bool_]]:
        """Return the lines around the black shapes, and which of them are on the border of the points or the image."""
        gsd = rasters.gsd
        black = rasters.masks.primary
        curves = trace_shapes(black, shortest=self.minimum_side, gsd=gsd, sample=self._sample(rasters))
        points, corners, offsets = find_corners(
            curves,
            sigma=self.smoothing,
            product=self.corner_product,
            straight=(self.corner_angle, 360.0 - self.corner_angle),
        )
        missed = self.missed_corner or max(_MISSED_CORNER * rasters.spacing, _STAIRCASE * gsd)
        segments = fit_segments(
            curves, points, corners, offsets, shortest=self.minimum_side / gsd - 2 * _OUTSET, deviation=missed / gsd
        )
        reach = max(1.0, self.inside_reach * PAPER_PIXEL / gsd)
        lines = inside_first(segments.lines, black, reach=reach, outset=_OUTSET)
        return Segments(lines, segments.shapes), beyond_coverage(lines, rasters.masks.coverage, reach)

    def _initial_rectangles(self, rasters: Rasters, lines: Boxes) -> tuple[Boxes, NDArray[np.int64]]:
        """Return the initial rectangles, and the index of the one of each line, `INSIDE` or `TOO_NARROW`."""
        gsd, growth = rasters.gsd, self._growth(rasters)
        initial, made = initial_rectangles(
            rasters.cover,
            growth,
            lines,
            by_length(lines),
            self.initial_width / gsd,
            self.minimum_side / gsd,
            last_step(growth) + 1.0 if self.inside_margin is None else self.inside_margin / gsd,
            self.inside_share,
        )
        return initial, made

    def _final_rectangles(self, rasters: Rasters, initial: Boxes) -> tuple[Boxes, NDArray[np.int64]]:
        """Return the final rectangles, and the index of the one of each initial rectangle, or `DROPPED`."""
        gsd = rasters.gsd
        rules = FinalRules(
            reduction=self.reduction,
            part_share=self.part_share,
            total_share=self.total_share,
            strip=max(self.strip / gsd, 2.0),
            least_strip=1.0,
            colour_share=self.colour_similarity,
            black_share=self.black_share,
            gap_share=self.gap_share,
            rise=self.rise,
            whole_initial=self.compare == "whole",
        )
        longest_first = np.argsort(-np.maximum(lengths(initial), widths(initial)), kind="stable")
        final, final_of = final_rectangles(
            rasters.colours, rasters.masks.primary, rasters.masks.secondary, rules, initial, longest_first
        )
        return final, final_of

    def _sample(self, rasters: Rasters) -> float:
        if self.curve_step is not None:
            return self.curve_step
        return max(_CURVE_STEP * rasters.spacing, rasters.gsd / 3)

    def _extended(self, rasters: Rasters, lines: Boxes) -> Boxes:
        extended: Boxes = extend_lines(rasters.cover, self._growth(rasters), lines, self.extension / rasters.gsd)
        return extended
