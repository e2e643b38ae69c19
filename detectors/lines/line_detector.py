"""The steps of both line detectors, from the masks to the final rectangles."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import cv2
import numpy as np
from numpy.typing import NDArray

from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.points import PointCloud
from ...scenes.geodata.raster import Grid, Image
from ...scenes.scene import Scene
from ..shared.cue_information import IMAGE
from ..steps import Step
from .adjustment import by_length, rotate
from .box_smoothness import Smoothness
from .boxes import UX, UY, Boxes, box_corners, lengths, prefix_sums, widths
from .colours import Colours
from .contours import trace_shapes
from .corners import find_corners
from .duplicates import DuplicateRules, find_duplicates
from .entropy_scale import EntropyScale
from .extension import Cover, Growth, band, extend_lines, last_step, mean_in_boxes
from .final_rectangles import FinalRules, final_rectangles
from .initial_rectangles import INSIDE, TOO_NARROW, InitialRules, initial_rectangles
from .line_parameters import PAPER_PIXEL, LineParameters
from .line_steps import line_steps
from .masks import Masks, build_cell_masks, build_masks, ground_correction, ground_heights, pulse_spacing
from .rasters import Rasters, refined
from .segments import Segments, beyond_coverage, fit_segments, inside_first
from .trace import Adjusted, Outcome, Trace, Votes
from .vegetation import vegetation_prefix

if TYPE_CHECKING:
    from .image_edges import ImageEdges
    from .orientation import Oriented
    from .texture import Texture

__all__ = ["LineDetector"]

#: The edge of a mask lies half a pixel outside the centres of its border pixels.
_OUTSET = 0.5
#: Distance of curve points, point spacings: the paper's pixel of 0.15 m at its spacing.
_CURVE_STEP = 0.3
#: Least length of a part of a side that is tested, point spacings: its first step then contains ten points or more.
_EXTENSION_PART = 3.5
#: Root mean square distance from its line above which a segment contains a missed corner: in point spacings, and in
#: pixels, because the staircase of a mask is no corner.
_MISSED_CORNER, _STAIRCASE = 0.4, 0.5
#: Distance by which a side of an initial rectangle may err, point spacings: what lies farther inside is roof.
_SIDE_ERROR = 1.0
#: Share of a length that is left for rounding.
_ROUNDING = 1e-6
#: Note on grey images.
_GREY = "the image is grey: no line is tested for vegetation, and roofs are followed by brightness alone"
#: Raster that stands for unused entropy.
_NO_ENTROPY = np.zeros((0, 1), dtype=np.int32)


@dataclass(frozen=True, kw_only=True)
class LineDetector(LineParameters):
    """Shared steps of the detectors `original` and `improved`.

    Attributes
    ----------
    closest : float
        Point spacing below which curve points and corners of outlines do not follow the spacing, metres.
    """

    closest: ClassVar[float] = 0.0

    def run(self, rasters: Rasters) -> Trace:
        """Run all steps that follow the masks, keeping the intermediate results."""
        segments, outcomes = self._fitted_lines(rasters)
        tree_edges, green = self._tree_edges(rasters, segments.lines)
        smooth_green = green & ~tree_edges & (outcomes == Outcome.RECTANGLE)
        outcomes = np.where((outcomes == Outcome.RECTANGLE) & tree_edges, Outcome.VEGETATION, outcomes)

        rotation = np.full(len(segments), np.nan)
        remaining = np.flatnonzero(outcomes == Outcome.RECTANGLE)
        rotation[remaining] = self._rotation(segments.take(remaining), rasters)
        outcomes[remaining[np.isnan(rotation[remaining])]] = Outcome.UNADJUSTED
        remaining = np.flatnonzero(outcomes == Outcome.RECTANGLE)
        lines = segments.lines.copy()
        lines[remaining] = self._extended(rasters, rotate(lines[remaining], rotation[remaining]), green[remaining])

        edges = self._image_edges(rasters)
        adjusted = Adjusted(lines, segments.shapes, rotation, outcomes == Outcome.RECTANGLE)
        votes = self._votes(adjusted, edges, rasters.gsd)
        if votes is not None:
            outcomes[adjusted.remaining & ~self._majority(votes)] = Outcome.OUTVOTED
        remaining = np.flatnonzero(outcomes == Outcome.RECTANGLE)
        initial, made = self._initial_rectangles(rasters, lines[remaining], green[remaining])
        outcomes[remaining[made == INSIDE]] = Outcome.INSIDE
        outcomes[remaining[made == TOO_NARROW]] = Outcome.NARROW
        candidates, candidate_of = self._final_rectangles(rasters, initial)
        texture = self._texture(candidates, edges, rasters)
        buildings = np.ones(len(candidates), dtype=np.bool_) if texture is None else texture.buildings
        duplicates = np.zeros(len(candidates), dtype=np.bool_)
        duplicates[buildings] = find_duplicates(
            candidates[buildings],
            DuplicateRules(
                self.new_share,
                float(np.radians(self.parallel_angle)),
                self.same_overlap,
                self.new_width / rasters.gsd if self.new_share > 0 else 0.0,
            ),
        )
        return Trace(
            image=rasters.image,
            masks=rasters.masks,
            vegetation=rasters.cover.vegetation,
            fitted=segments.lines,
            lines=lines,
            shapes=segments.shapes,
            outcomes=outcomes,
            smooth_green=smooth_green,
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
    def _rotation(self, segments: Segments, rasters: Rasters) -> NDArray[np.float64]:
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

    def _texture(self, candidates: Boxes, edges: ImageEdges | None, rasters: Rasters) -> Texture | Oriented | None:
        """Return the texture of the candidates; none where it is not tested."""
        return None

    def _cues(self) -> tuple[str, ...]:
        """Return the names of the cues besides height and the vegetation of the image."""
        return ()

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
        record: dict[str, Any] = dict(found.counts())
        grey = scene.image is not None and not scene.image.shows_vegetation
        record["cues"] = ["height", *self._cues(), *([] if grey else [IMAGE])]
        if grey:
            record["notes"] = [_GREY]
        return Footprints.from_rectangles(rectangles, crs=scene.crs, metadata=record, source=self.name)

    def measured(self, scene: Scene) -> Mapping[str, float]:
        """Return the pulse spacing, unless it is given."""
        if self.spacing is not None or scene.points is None or scene.image is None or not len(scene.points):
            return {}
        return {"spacing": pulse_spacing(scene.points, scene.image.grid)}

    def steps(self, scene: Scene, rng: np.random.Generator) -> Iterator[Step]:
        """Return the masks, the lines, the rectangles and, where used, the votes and the histograms."""
        return line_steps(self.trace(scene))

    def _rasters(self, scene: Scene) -> Rasters:
        points, image = scene.points, scene.image
        assert points is not None
        assert image is not None
        image = image.in_colour()
        spacing = self.spacing or pulse_spacing(points, image.grid)
        own_pixel = image.grid.gsd
        image = refined(image, self.largest_pixel)
        grid = image.grid
        tile_side = self.ground_tile * (PAPER_PIXEL if self.tile_pixel == "printed" else own_pixel)
        surface = None if self.ground == "tile-mode" or not len(points) else scene.heights.ground
        ground = ground_heights(points, surface, method=self.ground, tile_side=tile_side)
        if self.ground == "point-dem" and self.below_ground < 1 and len(points):
            deciding = None if self._heights_matter() else self.height
            ground += ground_correction(points, ground, self.below_ground, deciding=deciding)
        masks = self._masks(points, ground + self.height, grid, spacing)
        vegetation = vegetation_prefix(image, self.vegetation)
        entropy, limit, scale = self._entropy(image, masks, vegetation)
        cover = Cover(prefix_sums(masks.primary), vegetation, entropy)
        bands = [image.bands.index(name) for name in ("red", "green", "blue")]
        rgb = image.values[:3] if bands == [0, 1, 2] else image.values[bands]
        if self.colour_smoothing > 0:
            rgb = np.stack([cv2.GaussianBlur(band, (3, 3), self.colour_smoothing) for band in rgb])
        colours = Colours.of(rgb, tenths=self.colour_bins == "tenths")
        smooth = self._smoothness(points, points.z - ground, grid, spacing)
        return Rasters(image, masks, cover, colours, spacing, limit, scale, own_pixel, smooth)

    def _masks(self, points: PointCloud, thresholds: NDArray[np.float64], grid: Grid, spacing: float) -> Masks:
        clip = self.border == "drop"
        if self.marking == "cells":
            return build_cell_masks(points, thresholds, grid, spacing=spacing, clip=clip)
        side = 1.5 * spacing if self.neighbourhood is None else self.neighbourhood
        return build_masks(points, thresholds, grid, neighbourhood=side, nearest=self.marking == "nearest", clip=clip)

    def _index_limit(self, image: Image) -> float:
        """Return the threshold of the vegetation index of an image."""
        chosen = self.nir_threshold if "nir" in image.bands else None
        return self.vegetation_threshold if chosen is None else chosen

    def _entropy(
        self, image: Image, masks: Masks, vegetation: NDArray[np.int32]
    ) -> tuple[NDArray[np.int32], float, EntropyScale | None]:
        """Return the row prefix sums of the entropy, the mean above which green areas are trees, and its scale."""
        return _NO_ENTROPY, 0.0, None

    def _heights_matter(self) -> bool:
        """Return whether more is asked of heights above ground than whether they exceed the threshold."""
        return False

    def _smoothness(
        self, points: PointCloud, heights: NDArray[np.float64], grid: Grid, spacing: float
    ) -> Smoothness | None:
        """Return the smoothness of the points, whose heights are above ground; none where it is not used."""
        return None

    def _growth(self, rasters: Rasters) -> Growth:
        stop = 0.8 * rasters.spacing if self.extension_stop is None else self.extension_stop
        part = self.extension_part or max(self.extension, _EXTENSION_PART * rasters.spacing)
        return Growth(
            step=self.extension / rasters.gsd,
            least_step=max(stop / rasters.gsd, 1.0),
            black_share=self.extension_black,
            part=part / rasters.gsd,
            vegetation=self._index_limit(rasters.image),
            entropy=rasters.entropy_limit,
            same_kind=self._same_kind(),
        )

    def _same_kind(self) -> bool:
        return False

    def _fitted_lines(self, rasters: Rasters) -> tuple[Segments, NDArray[np.int64]]:
        """Return the lines around the black shapes, and their outcomes so far."""
        gsd = rasters.gsd
        black = rasters.masks.primary
        least = self.minimum_side - 2 * _OUTSET * gsd
        # An outline is at least twice as long as a line along it, there and back.
        shortest = max(self.minimum_side, 2 * least * (1 - _ROUNDING))
        curves = trace_shapes(black, shortest=shortest, gsd=gsd, sample=self._sample(rasters))
        points, corners, offsets = find_corners(
            curves,
            sigma=self.smoothing,
            product=self.corner_product,
            straight=(self.corner_angle, 360.0 - self.corner_angle),
        )
        missed = self.missed_corner or max(_MISSED_CORNER * max(rasters.spacing, self.closest), _STAIRCASE * gsd)
        segments = fit_segments(
            curves, points, corners, offsets, shortest=self.minimum_side / gsd - 2 * _OUTSET, deviation=missed / gsd
        )
        reach = max(1.0, self.inside_reach * PAPER_PIXEL / gsd)
        lines = inside_first(segments.lines, black, reach=reach, outset=_OUTSET)
        outcomes = np.full(len(lines), Outcome.RECTANGLE, dtype=np.int64)
        if self.inside_test == "strip":
            lines, has_side = self._directed(rasters, lines)
            outcomes[~has_side] = Outcome.NO_SIDE
        if self.border == "drop":
            outcomes[beyond_coverage(lines, rasters.masks.coverage, reach)] = Outcome.BORDER
        return Segments(lines, segments.shapes), outcomes

    def _directed(self, rasters: Rasters, lines: Boxes) -> tuple[Boxes, NDArray[np.bool_]]:
        """Return the lines directed towards the strip that is black, and which of them have one."""
        width = self.band_width / rasters.gsd
        inner = mean_in_boxes(rasters.cover.black, band(lines, width, 0.0))
        outer = mean_in_boxes(rasters.cover.black, band(lines, 0.0, width))
        directed = lines.copy()
        directed[outer > inner, UX : UY + 1] *= -1
        return directed, np.maximum(inner, outer) >= self.extension_black

    def _initial_rectangles(
        self, rasters: Rasters, lines: Boxes, green: NDArray[np.bool_]
    ) -> tuple[Boxes, NDArray[np.int64]]:
        """Return the initial rectangles, and the index of the one of each line, `INSIDE` or `TOO_NARROW`."""
        gsd, growth = rasters.gsd, self._growth(rasters)
        if self.rectangle_extension is not None:
            growth = growth._replace(step=self.rectangle_extension / gsd)
        rules = InitialRules(
            depth=self.initial_width / gsd,
            least_side=(self.minimum_side if self.least_rectangle is None else self.least_rectangle) / gsd,
            margin=last_step(growth) + 1.0 if self.inside_margin is None else self.inside_margin / gsd,
            inside_share=self.inside_share,
        )
        initial, made = initial_rectangles(rasters.cover, growth, rules, lines, green, by_length(lines))
        return initial, made

    def _final_rectangles(self, rasters: Rasters, initial: Boxes) -> tuple[Boxes, NDArray[np.int64]]:
        """Return the final rectangles, and the index of the one of each initial rectangle, or `DROPPED`."""
        gsd = rasters.gsd
        strip = max(self.strip / gsd, self.least_strip)
        rules = FinalRules(
            reduction=self.reduction,
            part_share=self.part_share,
            total_share=self.total_share,
            strip=strip,
            # The first strip is tried in any case.
            least_strip=min(1.0 if self.strip_stop is None else self.strip_stop / gsd, strip),
            colour_share=self.colour_similarity,
            black_share=self.black_share,
            gap_share=self.gap_share,
            rise=self.rise,
            whole_initial=self.compare == "whole",
            filled_share=self.filled_share,
            independent=self.final_order == "independent",
            rises_after_gap=self.rise_from == "gap",
            colour_margin=math.inf if self.colour_from == "shrunk" else _SIDE_ERROR * rasters.spacing / gsd,
        )
        longest_first = np.argsort(-np.maximum(lengths(initial), widths(initial)), kind="stable")
        final, final_of = final_rectangles(
            rasters.colours, rasters.masks.primary, rasters.masks.secondary, rules, initial, longest_first
        )
        return final, final_of

    def _sample(self, rasters: Rasters) -> float:
        if self.curve_step is not None:
            return self.curve_step
        return max(_CURVE_STEP * max(rasters.spacing, self.closest), rasters.gsd / 3)

    def _extended(self, rasters: Rasters, lines: Boxes, green: NDArray[np.bool_]) -> Boxes:
        depth = self.extension / rasters.gsd
        extended: Boxes = extend_lines(rasters.cover, self._growth(rasters), lines, depth, green)
        return extended
