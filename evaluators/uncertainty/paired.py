"""Two detections of one place, paired: what only one of them finds, and by how much each index differs.

Nouns
-----
fate
    What becomes of a reference in two detections A and B: found by both, only by A, only by B, or by neither. A
    reference is *found* when the evaluator counts it as correct.
paired bootstrap
    Blocks are connected over both detections and the reference, and the same blocks are drawn for A and for B. What is
    hard for both cancels out, so the interval of a difference is narrower than those of the two values suggest.

Source of the test of fates: McNemar 1947, Psychometrika 12(2), in its exact (binomial) form.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.display import Displayed
from ...core.errors import InputError
from ...scenes.geodata.crs import common_crs
from ...scenes.geodata.raster import Grid
from ..base import Evaluation, Evaluator
from ..comparison import evaluate
from ..given_footprints import GivenFootprints, GivenReference, given_sets
from ..index import Index
from ..registry import DEFAULT, make_evaluator
from ..verdict_table import CountsAs, VerdictKind
from .blocks import Blocks, spatial_blocks
from .intervals import RESAMPLES, Interval, block_tallies, interval_of, require_level, resampled_values
from .redrawn import Redraws

__all__ = [
    "FATES",
    "Difference",
    "Fate",
    "Found",
    "PairedComparison",
    "compare",
    "fates_of",
    "found_of",
    "mcnemar_p",
    "paired",
]

Fate: TypeAlias = Literal["both", "only A", "only B", "neither", "left out"]
#: In the order of tables and legends.
FATES: tuple[Fate, ...] = ("both", "only A", "only B", "neither", "left out")

#: Level of McNemar's test in percent where no interval is asked for.
_LEVEL = 95.0


class Found(NamedTuple):
    """Which references a set of detections finds.

    Attributes
    ----------
    correct, left_out : ndarray of bool, shape (number of references,)
        Which count as correct, and which do not count.
    """

    correct: NDArray[np.bool_]
    left_out: NDArray[np.bool_]


class _Verdicts(Protocol):
    """Verdicts of one side."""

    def where(self, *keys: str) -> NDArray[np.bool_]:
        """Return which objects have one of these verdicts."""


@dataclass(frozen=True, kw_only=True)
class Difference:
    """An index of A and of B, and B - A with its interval.

    Attributes
    ----------
    index : Index
    first, second : float or None
        Values of A and of B.
    ends : (float, float) or None
        Interval of B - A.
    """

    index: Index
    first: float | None
    second: float | None
    ends: Interval

    @property
    def difference(self) -> float | None:
        """B - A; None where either is undefined."""
        return None if self.first is None or self.second is None else self.second - self.first

    @property
    def conclusion(self) -> str:
        """Which one is better, where the interval excludes 0."""
        if self.difference is None:
            return "not measurable"
        if self.ends is None:
            return "no interval"
        low, high = self.ends
        if low <= 0 <= high:
            return "no significant difference"
        if self.index.better == "neither":
            return "B higher" if low > 0 else "B lower"
        return "B better" if (low > 0) == (self.index.better == "higher") else "A better"


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class PairedComparison(Displayed):
    """Two detections of one place, evaluated against one reference.

    Attributes
    ----------
    first, second : Evaluation
        Of A and of B.
    differences : tuple of Difference
        One for each index of the evaluator.
    fates : ndarray of str, shape (number of references,)
        Elements of `FATES`; None where the evaluator gives no verdicts.
    level : float
        Percent.
    blocks, groups, resamples : int
        Of the paired bootstrap.
    redrawn : Redraws, optional
        How far the differences move when the reference is redrawn.
    """

    shown_by = "reports.notebook_view:pair_view"

    first: Evaluation
    second: Evaluation
    differences: tuple[Difference, ...]
    fates: NDArray[np.object_] | None = field(repr=False)
    level: float
    blocks: int
    groups: int
    resamples: int
    redrawn: Redraws | None = None

    def __repr__(self) -> str:
        objects = ", ".join(f"{number} {fate}" for fate, number in self.objects.items() if number)
        return f"<PairedComparison by {self.evaluator.name}: {objects or 'no verdicts'}>"

    @property
    def evaluator(self) -> Evaluator:
        """The evaluator of both."""
        return self.first.evaluator

    @cached_property
    def objects(self) -> Mapping[Fate, int]:
        """Number of references of each fate; empty where there are no verdicts."""
        return {} if self.fates is None else {fate: int((self.fates == fate).sum()) for fate in FATES}

    @property
    def p_value(self) -> float | None:
        """Two-sided p of McNemar's exact test; None where the evaluator gives no verdicts."""
        return mcnemar_p(self.objects["only A"], self.objects["only B"]) if self.objects else None

    @property
    def conclusion(self) -> str:
        """What McNemar's test says of the objects."""
        p = self.p_value
        if p is None:
            return "the evaluator gives no verdicts"
        if p >= 1 - self.level / 100:
            return "no significant difference"
        return "B finds more" if self.objects["only B"] > self.objects["only A"] else "A finds more"

    @cached_property
    def references(self) -> dict[str, NDArray[Any]]:
        """Columns of the references: fate, and verdict, partner and reason of both; the footprints' own after them."""
        sides = [
            (name, verdicts) for name, found in (("a", self.first), ("b", self.second)) if (verdicts := found.verdicts)
        ]
        columns: dict[str, NDArray[Any]] = {}
        if self.fates is not None:
            columns = {"id": sides[0][1].reference_table.ids, "fate": self.fates}
        for key in ("verdict", "partner", "reason"):
            for name, verdicts in sides:
                columns[f"{key}_{name}"] = verdicts.reference_table.columns()[key]
        own = sides[0][1].reference.attributes if sides else {}
        return columns | {name: column for name, column in own.items() if name not in columns}

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON holds; A and B are ``a`` and ``b``."""
        return {
            "evaluator": self.evaluator.name,
            "parameters": self.evaluator.values(),
            "objects": {fate.lower().replace(" ", "_"): count for fate, count in self.objects.items()} or None,
            "mcnemar": None if self.p_value is None else {"p": self.p_value, "conclusion": self.conclusion},
            "level": self.level,
            "blocks": self.blocks,
            "connected_groups": self.groups,
            "resamples": self.resamples,
            **({} if self.redrawn is None else {"reference_error": self.redrawn.to_dict()}),
            "differences": {
                found.index.key: {
                    "a": found.first,
                    "b": found.second,
                    "difference": found.difference,
                    "interval": None if found.ends is None else list(found.ends),
                    "conclusion": found.conclusion,
                }
                for found in self.differences
            },
        }


def compare(
    first: GivenFootprints,
    second: GivenFootprints,
    reference: GivenReference,
    *,
    evaluator: str | Evaluator = DEFAULT,
    area: shapely.Geometry | None = None,
    grid: Grid | None = None,
    interval: float = _LEVEL,
    **parameters: Any,
) -> PairedComparison:
    """Compare two detections of one place, A and B, object by object.

    Parameters
    ----------
    first, second : Footprints, GeoDataFrame, GeoSeries, path, or iterable of polygons
        A and B, in the CRS of the reference.
    reference : the same, or Scene
    evaluator : str or Evaluator
        Name, ``name[parameter=value]``, or an evaluator.
    area : polygon, optional
        Evaluation area: where the reference is complete.
    grid : Grid, optional
        Grid of the orthoimage.
    interval : float
        Level of the intervals, percent.
    **parameters
        Parameters of the evaluator.

    Raises
    ------
    InputError
        What is given is no footprint set, or the area no valid polygon.
    CRSError
        The sets have no common CRS, or it is not in metres.
    ParameterError, UnknownNameError
        No such evaluator or parameter, or no such level.

    Examples
    --------
    >>> reference = Footprints.of([shapely.box(20 * k, 0, 20 * k + 9, 9) for k in range(12)])
    >>> found = compare(reference.take(np.arange(9)), reference.take(np.arange(2, 12)), reference)
    >>> [found.objects[fate] for fate in FATES], found.p_value
    ([7, 2, 3, 0, 0], 1.0)
    """
    require_level(interval)
    chosen = make_evaluator(evaluator, parameters)
    sets = given_sets([first, second], reference, area, grid, roles=("A", "B"))
    (a, b), (truth, area, grid) = sets
    evaluations = [evaluate(found, truth, evaluator=chosen, area=area, grid=grid) for found in (a, b)]
    if len(a) and len(b):
        common_crs(a.crs, b.crs, (a.source, b.source))
    blocks = spatial_blocks([a, b, truth])
    resampled = [
        resampled_values(
            whole, block_tallies(chosen, (found, truth), (place, 2), blocks, area=area, grid=grid), RESAMPLES
        )
        for place, (whole, found) in enumerate(zip(evaluations, (a, b), strict=True))
    ]
    found = [
        found_of(verdicts.kinds, verdicts.reference_table)
        for evaluation in evaluations
        if (verdicts := evaluation.verdicts) is not None
    ]
    fates = fates_of(found[0], found[1]) if len(found) == 2 else None
    return paired((evaluations[0], evaluations[1]), (resampled[0], resampled[1]), fates, blocks, interval)


def paired(
    evaluations: tuple[Evaluation, Evaluation],
    resampled: tuple[Mapping[str, NDArray[np.float64]], Mapping[str, NDArray[np.float64]]],
    fates: NDArray[np.object_] | None,
    blocks: Blocks,
    level: float,
) -> PairedComparison:
    """Put the comparison together from the evaluations of A and B and the values of their indices in each resample."""
    one, two = evaluations
    return PairedComparison(
        first=one,
        second=two,
        differences=tuple(
            Difference(
                index=index,
                first=one.values[index.key],
                second=two.values[index.key],
                ends=interval_of(resampled[1][index.key] - resampled[0][index.key], blocks.count, level),
            )
            for index in one.evaluator.indices
        ),
        fates=fates,
        level=level,
        blocks=blocks.count,
        groups=blocks.groups,
        resamples=RESAMPLES,
    )


def mcnemar_p(only_first: int, only_second: int) -> float:
    """Return the two-sided p of McNemar's exact test: how likely so uneven a share of the objects found once is.

    Parameters
    ----------
    only_first, only_second : int
        Numbers of objects that only A, and only B, finds.

    Examples
    --------
    >>> mcnemar_p(0, 5), mcnemar_p(3, 3), mcnemar_p(0, 0)
    (0.0625, 1.0, 1.0)
    """
    if only_first < 0 or only_second < 0:
        raise InputError(f"{min(only_first, only_second)} objects: give numbers from 0")
    from scipy import special  # importing scipy.stats takes a second

    return min(1.0, 2 * float(special.bdtr(min(only_first, only_second), only_first + only_second, 0.5)))


def found_of(kinds: Sequence[VerdictKind], verdicts: _Verdicts) -> Found:
    """Return which references count as found.

    Parameters
    ----------
    kinds : sequence of VerdictKind
        Those of the evaluator.
    verdicts : VerdictTable or SideVerdicts
        Of the references.
    """

    def counting_as(effect: CountsAs) -> NDArray[np.bool_]:
        return verdicts.where(*(kind.key for kind in kinds if kind.side == "reference" and kind.counts_as == effect))

    return Found(counting_as("correct"), counting_as("neutral"))


def fates_of(one: Found, two: Found) -> NDArray[np.object_]:
    """Return the fate of each reference from what A and what B finds."""
    a, b = one.correct, two.correct
    fates = np.full(len(a), "neither", dtype=object)
    fates[a & b], fates[a & ~b], fates[~a & b] = "both", "only A", "only B"
    fates[one.left_out | two.left_out] = "left out"
    return fates
