"""What the threshold-free evaluation counts and measures: everything that its 15 indices and variants follow from."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..overlay.areas import AreaTally
from ..overlay.left_out import LeftOut
from ..tally import ADDED, Histogram, Tallies, histogram

__all__ = ["Buildings", "Counts", "LiteralAreas", "PairSums", "Scenes", "ThresholdFreeTallies"]


@dataclass(frozen=True, kw_only=True)
class Counts(Tallies):
    """Numbers of objects that count.

    Attributes
    ----------
    detected, reference : int
        |D| and |R|.
    true_positives, false_positives, false_negatives, multiple_detections : int
        TP, FP, FN and MD.
    overlapping_detections, cross_lapping_detections, cross_lapped_references : int
        O_d, C_ld and C_lr.
    """

    detected: int = 0
    reference: int = 0
    true_positives: int = 0
    false_positives: int = 0
    false_negatives: int = 0
    multiple_detections: int = 0
    overlapping_detections: int = 0
    cross_lapping_detections: int = 0
    cross_lapped_references: int = 0


@dataclass(frozen=True, kw_only=True)
class Buildings(Tallies):
    """Numbers of reference buildings: all, those with every part found, and those with any part found."""

    reference: int = 0
    complete_all: int = 0
    complete_any: int = 0


@dataclass(frozen=True, kw_only=True)
class Scenes(Tallies):
    """Numbers of scenes: all, and those whose areas were counted in pixels."""

    all: int = 0
    by_pixels: int = 0


@dataclass(frozen=True, kw_only=True)
class LiteralAreas(Tallies):
    """T, F and M by the literal text of section 4.2.2, m2: each entity for itself, parts of one building once."""

    true_positive: float = 0.0
    false_positive: float = 0.0
    false_negative: float = 0.0

    @classmethod
    def of(cls, areas: AreaTally) -> LiteralAreas:
        """Return T, F and M of a tally."""
        return cls(
            true_positive=areas.true_positive,
            false_positive=areas.false_positive,
            false_negative=areas.false_negative,
        )


@dataclass(frozen=True, kw_only=True)
class PairSums(Tallies):
    """Sums over the TP pairs.

    Attributes
    ----------
    pairs, pairs_by_corners : int
        All pairs, and those whose outlines are compared corner by corner.
    sum_squared : float
        Squared outline distances, m2.
    sum_squared_pixels : float
        The same in pixels, over the `pairs_with_gsd` pairs whose ground sampling distance is known.
    sum_squared_centre, sum_centre, sum_polis : float
        Squared centre distances (m2), centre distances and PoLiS (m).
    """

    pairs: int = 0
    pairs_by_corners: int = 0
    sum_squared: float = 0.0
    sum_squared_pixels: float = 0.0
    pairs_with_gsd: int = 0
    sum_squared_centre: float = 0.0
    sum_centre: float = 0.0
    sum_polis: float = 0.0


@dataclass(frozen=True, kw_only=True)
class ThresholdFreeTallies(Tallies):
    """Everything that the indices follow from; `iou` counts the IoU of each TP pair in bins of 0.001."""

    counts: Counts = field(default_factory=Counts)
    buildings: Buildings = field(default_factory=Buildings)
    scenes: Scenes = field(default_factory=Scenes)
    left_out: LeftOut = field(default_factory=LeftOut)
    areas: AreaTally = field(default_factory=AreaTally)
    literal_areas: LiteralAreas = field(default_factory=LiteralAreas, metadata=ADDED)
    geometric: PairSums = field(default_factory=PairSums)
    iou: Histogram = field(default_factory=histogram(low=0.0, high=1.0, bins=1000))
