"""An evaluator with its own verdicts: a detection hits when its centre lies in a reference, grazes or strays."""

from dataclasses import dataclass, field

import numpy as np
import shapely

from roofbench.evaluators.base import Evaluator
from roofbench.evaluators.index import IndexGroup, index, ratio
from roofbench.evaluators.tally import Tallies
from roofbench.evaluators.verdict_table import Measure, VerdictKind, Verdicts, VerdictTable


@dataclass(frozen=True, kw_only=True)
class Counts(Tallies):
    detected: int = 0
    reference: int = 0
    hits: int = 0
    strays: int = 0
    found: int = 0


@dataclass(frozen=True, kw_only=True)
class ToyTallies(Tallies):
    counts: Counts = field(default_factory=Counts)


@dataclass(frozen=True, kw_only=True)
class Shares(IndexGroup):
    key = "share"
    title = "shares of darts"

    hits: float | None = index(
        "hits",
        "higher",
        "fraction",
        lambda t: ratio(t.counts.hits, t.counts.detected),
        symbol="H_t",
        meaning="detections whose centre lies in a reference",
    )
    strays: float | None = index(
        "strays",
        "lower",
        "fraction",
        lambda t: ratio(t.counts.strays, t.counts.detected),
        symbol="S_t",
        meaning="detections that touch no reference",
    )
    found: float | None = index(
        "found",
        "higher",
        "fraction",
        lambda t: ratio(t.counts.found, t.counts.reference),
        symbol="F_d",
        meaning="references that hold the centre of a detection",
    )


@dataclass(frozen=True, kw_only=True)
class Darts(Evaluator):
    """Counts detections like darts."""

    name = "darts"
    groups = (Shares,)
    tallies_type = ToyTallies
    ranked_by = "share.hits"
    gated_by = ("share.hits", "share.strays")
    verdict_kinds = (
        VerdictKind(key="hit", label="dart in a house", side="detection", role="correct", counts_as="correct"),
        VerdictKind(key="graze", label="dart at a house", side="detection", role="partial", counts_as="duplicate"),
        VerdictKind(key="stray", label="dart in the grass", side="detection", role="excess", counts_as="wrong"),
        VerdictKind(key="safe", label="house without a dart", side="reference", role="missing", counts_as="wrong"),
        VerdictKind(key="pierced", label="house with a dart", side="reference", role="outline", counts_as="correct"),
    )
    measures = (Measure(key="gap", title="gap to the wall", unit="m"),)

    def evaluate(self, detected, reference, *, area=None, grid=None):
        points = shapely.points(detected.centres)
        tree = shapely.STRtree(reference.polygons)
        dart, house = tree.query(points, predicate="intersects")
        hit = np.isin(np.arange(len(detected)), dart)
        touching = np.isin(np.arange(len(detected)), tree.query(detected.polygons, predicate="intersects")[0])
        pierced = np.isin(np.arange(len(reference)), house)
        counts = Counts(
            detected=len(detected),
            reference=len(reference),
            hits=int(hit.sum()),
            strays=int((~touching).sum()),
            found=int(pierced.sum()),
        )
        partner = np.full(len(detected), -1)
        partner[dart] = reference.ids[house]

        def find():
            verdict = np.where(hit, "hit", np.where(touching, "graze", "stray"))
            return Verdicts(
                kinds=self.verdict_kinds,
                measures=self.measures,
                detection_table=VerdictTable.of(
                    verdict,
                    kinds=("hit", "graze", "stray"),
                    ids=detected.ids,
                    partner=partner,
                    reasons=[f"dart says {word}" for word in verdict],
                    measures={"gap": shapely.distance(points, shapely.union_all(reference.polygons))},
                ),
                reference_table=VerdictTable.of(
                    np.where(pierced, "pierced", "safe"),
                    kinds=("safe", "pierced"),
                    ids=reference.ids,
                    reasons=["a house"] * len(reference),
                    measures={"gap": np.full(len(reference), np.nan)},
                ),
                detected=detected,
                reference=reference,
            )

        return self.summarise(ToyTallies(counts=counts), find_verdicts=find)
