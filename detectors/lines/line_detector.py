"""The steps of both line detectors, from the masks to the final rectangles."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.raster import Grid, Image
from ...scenes.scene import Scene
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
from .line_parameters import PAPER_PIXEL, LineParameters
from .line_steps import line_steps
from .masks import build_masks, ground_correction, ground_heights, pulse_spacing
from .rasters import Rasters
from .segments import Segments, beyond_coverage, fit_segments, inside_first
from .trace import Adjusted, Outcome, Trace, Votes
from .vegetation import vegetation_prefix

if TYPE_CHECKING:
    from .image_edges import ImageEdges
    from .texture import Texture

__all__ = ["LineDetector"]

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
class LineDetector(LineParameters):
    """Shared steps of the detectors `original` and `improved`."""

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
        tile_side = self.tile_size * (PAPER_PIXEL if self.tile_pixel == "printed" else grid.gsd)
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
            clip=self.border == "drop",
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
        on_border = beyond_coverage(lines, rasters.masks.coverage, reach) & (self.border == "drop")
        return Segments(lines, segments.shapes), on_border

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
            strip=max(self.strip / gsd, self.least_strip),
            least_strip=min(1.0, self.least_strip),
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
