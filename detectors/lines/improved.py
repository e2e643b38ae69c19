"""The detector `improved`: the line detector with texture, to separate buildings from trees of similar colour.

Source: Awrangjeb, Zhang & Fraser, "Automatic building detection in complex scenes: improved detector using texture",
IAPRS XXXVIII-3/W22 (2011). The page docs/results/line-detectors.md lists how each open point of the print is read and
what that reading costs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...core.conditions import Uses
from ...core.parameters import parameter
from ...scenes.geodata.points import PointCloud
from ...scenes.geodata.raster import Grid, Image
from ..shared.cue_information import ANCHOR
from .adjustment import adjust_to_neighbours, adjust_to_shape
from .box_smoothness import Smoothness, mean_smoothness, smoothness_sums
from .boxes import Boxes, lengths, prefix_sums, widths
from .entropy import coarse_entropy, grey_levels
from .entropy_scale import EntropyScale, entropy_scale
from .extension import band, mean_in_boxes
from .image_edges import ImageEdges, extract_edges
from .line_detector import LineDetector
from .line_modes import PAPER, PROGRAM
from .line_parameters import PAPER_PIXEL
from .masks import Masks
from .orientation import Oriented, directions, gradient_sums, score_candidates
from .rasters import Rasters
from .segments import Segments
from .texture import Texture, TextureRules, texture_of, widened
from .trace import Adjusted, Votes
from .voting import cast_votes, longest_image_lines

__all__ = ["Improved"]

#: Largest pixel of the relative entropy, metres.
_ENTROPY_PIXEL = 0.25
#: Least area per pixel of edge in test 6, pixels.
_EDGE_PIXELS = 45.0
#: Smallest divisor of the vegetation index, of 255.
_LEAST_LIMIT = 1e-6


@dataclass(frozen=True, kw_only=True)
class Improved(LineDetector):
    """Line detector with texture of Awrangjeb, Zhang & Fraser (2011)."""

    name: ClassVar[str] = "improved"
    #: Point spacing of the 2010 paper. Outlines of denser points are not more certain: the positions of points err, and
    #: eaves are ragged. On closer curve points, chords get shorter than these errors, and sides break at false corners,
    #: whose directions the voting and the tests of texture refuse. `original` has neither and gains nothing.
    closest: ClassVar[float] = 0.5
    paper = "Awrangjeb, Zhang & Fraser 2011, IAPRS XXXVIII-3/W22"
    modes: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "paper": {
            **PAPER,
            "curve_step": 0.1,
            "below_ground": 1.0,
            "entropy": "mean",
            "entropy_threshold": 0.3,
            "adjustment": "longest",
            "voting": True,
            "texture": "tests",
            "vote_length": "printed",
            "texture_margin": 0.0,
            "edge_contrast": 0.0,
            "peak_ratio": 1.0,
        },
        # The program adjusts and votes on no line.
        "program": {
            **PROGRAM,
            "entropy": "share",
            "entropy_threshold": 0.3,
            "entropy_offset": 1.0,
            "green_extension": "same",
            "vegetation_side": "inside",
            "adjustment": "none",
            "voting": False,
            "texture": "tests",
            "texture_margin": 0.0,
            # sqrt(2) px of the image, for 0.15 m.
            "edge_blur": 1.41,
            "edge_contrast": 0.0,
            "peaks": "bins",
            "area_per_edge": None,
        },
    }

    used_with: ClassVar[Mapping[str, Uses]] = {
        **LineDetector.used_with,
        "adjustment_angle": {"adjustment": ("bases", "longest", "neighbours"), "voting": (True,)},
        "adjustment_radius": {"adjustment": ("neighbours",)},
        "entropy_level": {"entropy": ("share",)},
        "vote_length": {"voting": (True,)},
        "majority": {"voting": (True,)},
        "edge_blur": {"voting": (True,), "texture": ("tests",)},
        "edge_contrast": {"voting": (True,), "texture": ("tests",)},
        "texture_margin": {"texture": ("score", "tests")},
        "most_edges": {"texture": ("tests",)},
        "area_per_edge": {"texture": ("tests",)},
        "peaks": {"texture": ("tests",)},
        "peak_ratio": ({"texture": ("tests",)}, {"peaks": ("maxima",)}),
    }

    entropy_threshold: float = parameter(
        0.5, minimum=0, maximum=1, swept=(0.1, 0.3, 0.5, 0.7, 0.9),
        doc="local entropy above which green areas are trees, in the measure of `entropy`; 0.3 as printed",
        source="2011, 3.2; reading",
    )  # fmt: skip
    entropy: str = parameter(
        "relative", choices=("relative", "mean", "share"),
        doc="what `entropy_threshold` limits: the mean local entropy between that of the ground (0) and of standing "
        "green (1) in the same image, as a share of its largest possible value, or the share of pixels whose entropy "
        "is above `entropy_level`",
        source="2011, 3.2; reading; program",
    )  # fmt: skip
    entropy_level: float = parameter(
        0.8, minimum=0, maximum=1,
        doc="entropy of a pixel that counts as high, from the least (0) to the greatest (1) value of the image",
        source="program",
    )  # fmt: skip
    entropy_offset: float = parameter(
        0.0, unit="m", minimum=0, doc="distance from a line at which the strip begins whose entropy is tested",
        source="program",
    )  # fmt: skip
    green_extension: str = parameter(
        "any", choices=("any", "same"),
        doc="whether lines and rectangles extend over anything but trees, or green lines over smooth green and others "
        "over what is not green",
        source="program",
    )  # fmt: skip
    vegetation_side: str = parameter(
        "either", choices=("either", "inside"),
        doc="side of a line that is tested for vegetation", source="2011, 3.2; 2010, 3.3.1",
    )  # fmt: skip
    adjustment: str = parameter(
        "bases", choices=("bases", "longest", "neighbours", "none"),
        doc="reference of the adjustment: the longest line of the shape and, for lines at other angles, the next ones; "
        "the longest alone, as printed; any line within 50 m; none",
        source="2011, 3.3; reading",
    )  # fmt: skip
    voting: bool = parameter(
        False, doc="whether lines need a majority of votes; optional in the print", source="2011, 3.3"
    )
    vote_length: str = parameter(
        "relative", choices=("relative", "printed"),
        doc="vote v1 of a line shorter than the mean: L/mean, or the printed (mean-L)/mean",
        source="2011, 3.3; reading",
    )  # fmt: skip
    majority: float = parameter(
        0.5, minimum=0, maximum=1, doc="mean vote above which a line is kept", source="2011, 3.3"
    )
    texture: str = parameter(
        "score", choices=("score", "tests", "none"),
        doc="how candidates are tested: by a score of the directions of the brightness gradient, entropy, vegetation "
        "and smoothness of the laser points; by the six printed tests of edge orientation histograms; not at all, "
        "which the print allows",
        source="2011, 3.4; reading",
    )  # fmt: skip
    edge_blur: float = parameter(
        1.5,
        unit="px of 0.15 m",
        minimum=0,
        doc="sigma of the Gaussian before image edges are detected",
        source="2011, 3.4; reading",
    )
    edge_contrast: float = parameter(
        20.0, unit="grey levels", minimum=0, doc="smallest step in brightness that starts an image edge",
        source="2011, 3.4; reading",
    )  # fmt: skip
    texture_margin: float = parameter(
        1.0, unit="m", minimum=0, doc="distance outside a candidate up to which image edges belong to it",
        source="2011, 3.4; reading",
    )  # fmt: skip
    most_edges: float = parameter(
        90.0, unit="m", minimum=0, doc="largest total length of edges in a building (tests 2 and 5)", source="2011, 3.4"
    )
    area_per_edge: float | None = parameter(
        4.5, unit="m", minimum=0,
        doc="least area per length of edges (test 6), 45 px of 0.1 m; none: 45 px of the image",
        source="2011, 3.4; program",
    )  # fmt: skip
    peaks: str = parameter(
        "maxima", choices=("maxima", "bins"),
        doc="peaks of tests 1 and 3: local maxima, or any bins that are high enough", source="2011, 3.4; program",
    )  # fmt: skip
    peak_ratio: float = parameter(
        2.0, minimum=0, swept=(1.0, 1.5, 2.0, 2.5),
        doc="least ratio of a peak of tests 1 and 3 to the mean bin; printed: well above it",
        source="2011, 3.4; reading",
    )  # fmt: skip

    def _entropy(
        self, image: Image, masks: Masks, vegetation: NDArray[np.int32]
    ) -> tuple[NDArray[np.int32], float, EntropyScale | None]:
        grey, gsd = grey_levels(image), image.grid.gsd
        # Absolute measures are those of the image as it is, as printed.
        largest = _ENTROPY_PIXEL if self.entropy == "relative" else gsd
        entropy = coarse_entropy(grey, gsd, largest=largest)
        scale, limit = None, 255.0 * self.entropy_threshold
        if self.entropy == "relative" or self.texture == "score":
            scale = entropy_scale(entropy, vegetation, masks.primary, threshold=self._index_limit(image), gsd=gsd)
            limit = scale.absolute(self.entropy_threshold) if self.entropy == "relative" else limit
        if self.entropy == "share" and entropy.size:
            low, high = int(entropy.min()), int(entropy.max())
            entropy = (entropy > low + self.entropy_level * (high - low)).astype(np.uint8)
            limit = self.entropy_threshold
        prefix: NDArray[np.int32] = prefix_sums(entropy)
        return prefix, limit, scale

    def _cues(self) -> tuple[str, ...]:
        tested = {"score": ("gradient directions", ANCHOR), "tests": ("edge directions",), "none": ()}
        return ("image texture", *tested[self.texture])

    def _heights_matter(self) -> bool:
        return self.texture == "score"

    def _smoothness(
        self, points: PointCloud, heights: NDArray[np.float64], grid: Grid, spacing: float
    ) -> Smoothness | None:
        if self.texture != "score":
            return None
        return smoothness_sums(points, heights, grid, spacing=spacing, threshold=self.height)

    def _same_kind(self) -> bool:
        return self.green_extension == "same"

    def _tree_edges(self, rasters: Rasters, lines: Boxes) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        width, offset = self.band_width / rasters.gsd, self.entropy_offset / rasters.gsd
        sides = [(band(lines, width, 0.0), band(lines, width + offset, -offset))]
        if self.vegetation_side == "either":
            sides.append((band(lines, 0.0, width), band(lines, -offset, width + offset)))
        green, tree_edges = np.zeros(len(lines), dtype=np.bool_), np.zeros(len(lines), dtype=np.bool_)
        for beside, farther in sides:
            is_green = mean_in_boxes(rasters.cover.vegetation, beside) > self._index_limit(rasters.image)
            green |= is_green
            tree_edges |= is_green & (mean_in_boxes(rasters.cover.entropy, farther) > rasters.entropy_limit)
        return tree_edges, green

    def _rotation(self, segments: Segments, rasters: Rasters) -> NDArray[np.float64]:
        tolerance = np.radians(self.adjustment_angle)
        if self.adjustment in ("bases", "longest"):
            return adjust_to_shape(
                segments.lines, segments.shapes, tolerance=tolerance, longest_only=self.adjustment == "longest"
            )
        if self.adjustment == "neighbours":
            return adjust_to_neighbours(
                segments.lines, radius=self.adjustment_radius / rasters.gsd, tolerance=tolerance, longer_only=False
            )
        return np.zeros(len(segments))

    def _image_edges(self, rasters: Rasters) -> ImageEdges | None:
        if not (self.voting or self.texture == "tests"):
            return None
        return extract_edges(
            grey_levels(rasters.image),
            gsd=rasters.gsd,
            blur=self.edge_blur * PAPER_PIXEL / rasters.gsd,
            contrast=self.edge_contrast,
            shortest=self.minimum_side,
            smoothing=self.smoothing,
            product=self.corner_product,
            straight=(self.corner_angle, 360.0 - self.corner_angle),
        )

    def _votes(self, adjusted: Adjusted, edges: ImageEdges | None, gsd: float) -> Votes | None:
        if not self.voting:
            return None
        assert edges is not None
        image_lengths = longest_image_lines(adjusted.lines, edges.lines, half_width=self.band_width / 2 / gsd)
        return cast_votes(
            lengths(adjusted.lines) * gsd,
            adjusted.rotation,
            image_lengths * gsd,
            adjusted.shapes,
            adjusted.remaining,
            tolerance=np.radians(self.adjustment_angle),
            least=self.minimum_side,
            length_as_printed=self.vote_length == "printed",
        )

    def _majority(self, votes: Votes) -> NDArray[np.bool_]:
        return np.asarray(np.nan_to_num(votes).mean(axis=1) > self.majority)

    def _texture(self, candidates: Boxes, edges: ImageEdges | None, rasters: Rasters) -> Texture | Oriented | None:
        grid = rasters.image.grid
        if self.texture == "score":
            return self._oriented(candidates, rasters)
        if self.texture == "none":
            return None
        assert edges is not None
        rules = TextureRules(
            margin=self.texture_margin,
            least=self.minimum_side,
            most_edges=self.most_edges,
            area_per_edge=_EDGE_PIXELS * grid.gsd if self.area_per_edge is None else self.area_per_edge,
            peak_ratio=self.peak_ratio,
            any_bin=self.peaks == "bins",
        )
        return texture_of(candidates, edges, grid, rules)

    def _oriented(self, candidates: Boxes, rasters: Rasters) -> Oriented:
        """Return the measures of candidates, and their scores."""
        assert rasters.scale is not None
        assert rasters.smoothness is not None
        gradients = gradient_sums(grey_levels(rasters.image), rasters.gsd, own_pixel=rasters.own_pixel)
        around = widened(candidates, self.texture_margin / rasters.gsd)
        return score_candidates(
            directions(gradients, around),
            rasters.scale.scaled(mean_in_boxes(rasters.cover.entropy, candidates)),
            # A threshold of 0 makes everything vegetation.
            mean_in_boxes(rasters.cover.vegetation, candidates) / max(self._index_limit(rasters.image), _LEAST_LIMIT),
            mean_smoothness(rasters.smoothness, candidates),
            gradients.independent(lengths(candidates) * widths(candidates) * rasters.gsd**2),
        )
