"""Evaluators: how two footprint sets are compared.

Nouns
-----
evaluator
    A way of comparing two footprint sets. It declares its whole vocabulary: indices with their formulas, verdict
    kinds, the index that ranks and those that are gated. Tables, maps, reports and the gate read this declaration.
evaluation
    The result of one comparison: tallies, from which every index follows, and a verdict for each object. Pooling adds
    the tallies of several evaluations and derives the indices anew.
"""

from __future__ import annotations

import functools
import operator
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

from ..core.display import Displayed
from ..core.errors import InputError, ParameterError, UnknownNameError
from ..core.parameters import Parameterised
from ..core.registry import nearest_hint
from ..core.wording import counted
from ..scenes.geodata.footprints import Footprints
from ..scenes.geodata.raster import Grid
from .index import Better, Curve, Index, IndexGroup
from .tally import Tallies
from .verdict_table import Measure, Side, VerdictKind, Verdicts

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from shapely import Geometry

__all__ = ["Better", "Evaluation", "Evaluator", "Index", "Verdicts", "mean_values"]


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Evaluation(Displayed):
    """The result of comparing two footprint sets (or of pooling several such results).

    Attributes
    ----------
    evaluator : Evaluator
    tallies : Tallies
    notes : tuple of str
        What a reader must know: objects left out, repairs, how RMSE was measured.
    find_verdicts : callable, optional
        Makes the verdicts when they are asked for; a sweep of thousands of runs may never ask.
    """

    shown_by = "reports.notebook_view:evaluation_view"

    evaluator: Evaluator
    tallies: Tallies
    notes: tuple[str, ...] = ()
    find_verdicts: Callable[[], Verdicts] | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        shown = self.evaluator.summary_indices(self.evaluator.ranking_index())[:4]
        values = {index.symbol or index.key: self.values[index.key] for index in shown}
        texts = (f"{name} {'undefined' if value is None else format(value, '.3g')}" for name, value in values.items())
        return f"<Evaluation {self.evaluator.name}: {', '.join(texts)}>"

    @cached_property
    def values(self) -> Mapping[str, float | None]:
        """Every index by its key; None where it is undefined (0/0)."""
        return {index.key: index.formula(self.tallies) for index in self.evaluator.indices}

    @cached_property
    def verdicts(self) -> Verdicts | None:
        """A verdict with its reason for every object; None of a pooled evaluation."""
        return None if self.find_verdicts is None else self.find_verdicts()

    @cached_property
    def curves(self) -> Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Every curve by its key, as x and y; bars have one x more, their bounds."""
        return {curve.key: curve.formula(self.tallies) for curve in self.evaluator.curves}

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON holds: nested by the parts of the names, ``null`` where undefined.

        Counts come first, then the index groups, then the other tallies and the curves.
        """
        content: dict[str, Any] = {"evaluator": self.evaluator.name, "parameters": self.evaluator.values()}
        tallies = self.tallies.to_dict()
        counts = {key: value for key, value in tallies.items() if key.startswith("counts.")}
        others = {key: value for key, value in tallies.items() if key not in counts}
        for key, value in [*counts.items(), *self.values.items()]:
            _place(content, key, value)
        content["tallies"] = others
        if self.evaluator.curves:
            content["curves"] = {
                key: {"x": x.tolist(), "y": [None if value != value else value for value in y.tolist()]}
                for key, (x, y) in self.curves.items()
            }
        content["notes"] = list(self.notes)
        return content


def _place(content: dict[str, Any], key: str, value: Any) -> None:
    *groups, name = key.split(".")
    for group in groups:
        content = content.setdefault(group, {})
    content[name] = value


class Evaluator(Parameterised, ABC):
    """Base of all evaluators: a frozen, keyword-only dataclass whose fields are its parameters.

    Attributes
    ----------
    name : str
    paper : str
        Where it is published; empty for none.
    groups : tuple of IndexGroup classes
        What it reports, in order; `indices` follows from them.
    indices : tuple of Index
        Every index; declared directly only where there are no groups.
    tallies_type : type of Tallies
    evaluation_type : type of Evaluation
    ranked_by : str
        Key of the index that ranks; the first index with a direction where it is empty.
    gated_by : tuple of str
        Keys of the indices that are gated; every principal index with a direction where it is empty.
    swept_by : tuple of str
        Keys of the indices that sensitivity plots show; the one that ranks where it is empty.
    summarised_by : tuple of str
        Keys of the indices that leaderboards show beside the one that ranks; the gated ones where it is empty.
    verdict_kinds : tuple of VerdictKind
        In the order of legends; empty where it gives no verdicts.
    measures : tuple of Measure
        Further columns of its verdict tables.
    curves : tuple of Curve

    Examples
    --------
    An evaluator that compares the numbers of footprints:

    >>> from dataclasses import dataclass
    >>> from .index import index, ratio
    >>> @dataclass(frozen=True, kw_only=True)
    ... class Counts(Tallies):
    ...     detected: int = 0
    ...     reference: int = 0
    >>> @dataclass(frozen=True, kw_only=True)
    ... class Numbers(IndexGroup):
    ...     key = "number"
    ...     title = "numbers"
    ...     share: float | None = index(
    ...         "share", "neither", "ratio", lambda t: ratio(t.detected, t.reference), meaning="|D|/|R|"
    ...     )
    >>> @dataclass(frozen=True, kw_only=True)
    ... class Numbering(Evaluator):
    ...     name = "numbering"
    ...     groups = (Numbers,)
    ...     tallies_type = Counts
    ...
    ...     def evaluate(self, detected, reference, *, area=None, grid=None):
    ...         return self.summarise(Counts(detected=len(detected), reference=len(reference)))
    >>> one, two = Footprints.empty(), Footprints.from_rectangles([[[0, 0], [1, 0], [1, 1], [0, 1]]])
    >>> Numbering().evaluate(two, two).values, Numbering().evaluate(two, one).values
    ({'number.share': 1.0}, {'number.share': None})
    """

    name: ClassVar[str]
    paper: ClassVar[str] = ""
    groups: ClassVar[tuple[type[IndexGroup], ...]] = ()
    indices: ClassVar[tuple[Index, ...]] = ()
    tallies_type: ClassVar[type[Tallies]]
    evaluation_type: ClassVar[type[Evaluation]] = Evaluation
    ranked_by: ClassVar[str] = ""
    gated_by: ClassVar[tuple[str, ...]] = ()
    swept_by: ClassVar[tuple[str, ...]] = ()
    summarised_by: ClassVar[tuple[str, ...]] = ()
    verdict_kinds: ClassVar[tuple[VerdictKind, ...]] = ()
    measures: ClassVar[tuple[Measure, ...]] = ()
    curves: ClassVar[tuple[Curve, ...]] = ()

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        if "groups" in cls.__dict__:
            cls.indices = tuple(index for group in cls.groups for index in group.indices())

    @abstractmethod
    def evaluate(
        self,
        detected: Footprints,
        reference: Footprints,
        *,
        area: Geometry | None = None,
        grid: Grid | None = None,
    ) -> Evaluation:
        """Compare two sets.

        Parameters
        ----------
        detected, reference : Footprints
            In one CRS.
        area : polygon, optional
            Evaluation area: where the reference is complete.
        grid : Grid, optional
            Grid of the orthoimage, for indices counted in pixels.
        """

    def summarise(
        self,
        tallies: Tallies,
        notes: Sequence[str] = (),
        *,
        find_verdicts: Callable[[], Verdicts] | None = None,
    ) -> Evaluation:
        """Return the evaluation that follows from tallies (of one scene, or added up over several)."""
        return self.evaluation_type(
            evaluator=self,
            tallies=tallies,
            notes=(*notes, *self.notes_of(tallies)),
            find_verdicts=find_verdicts,
        )

    def notes_of(self, tallies: Any) -> Sequence[str]:
        """Return what a reader must know and the tallies say, such as how many objects were left out."""
        return ()

    def pool(self, evaluations: Iterable[Evaluation]) -> Evaluation:
        """Add up several evaluations of this evaluator: counts and areas first, then the ratios."""
        every = list(evaluations)
        if not every:
            raise InputError("nothing to pool: give at least one evaluation")
        for evaluation in every:
            if evaluation.evaluator != self:
                raise InputError(
                    f"evaluations by {evaluation.evaluator} and by {self} cannot be pooled: use one evaluator with one "
                    "set of parameters"
                )
        tallies = functools.reduce(operator.add, [evaluation.tallies for evaluation in every])
        return self.summarise(tallies, [f"pooled over {counted(len(every), 'evaluation')}"])

    @classmethod
    def index(cls, name: str) -> Index:
        """Return an index by its key or its printed symbol.

        Raises
        ------
        UnknownNameError
            No index is called so; the nearest one is named.
        """
        by_key = {index.key: index for index in cls.indices}
        by_symbol = {index.symbol: index for index in reversed(cls.indices) if index.symbol}
        found = by_key.get(name) or by_symbol.get(name)
        if found is None:
            raise UnknownNameError(
                f"the evaluator {cls.name!r} has no index {name!r}{nearest_hint(name, [*by_key, *by_symbol])}; "
                f"it has {', '.join(list(by_key)[:3])} and others: 'roofbench list indices' shows all"
            )
        return found

    @classmethod
    def ranking_index(cls, name: str | None = None) -> Index:
        """Return the index that ranks: the named one, else the declared one, else the first with a direction."""
        if name or cls.ranked_by:
            return cls.index(name or cls.ranked_by)
        return next((index for index in cls.indices if index.better != "neither"), cls.indices[0])

    @classmethod
    def gated_indices(cls, names: Sequence[str] | None = None) -> tuple[Index, ...]:
        """Return the indices that are gated: those named, else those declared, else all main ones with a direction.

        Raises
        ------
        UnknownNameError, ParameterError
            An index does not exist, or has no better direction.
        """
        if not (names or cls.gated_by):
            return tuple(index for index in cls.indices if index.main and index.better != "neither")
        found = tuple(dict.fromkeys(cls.index(name) for name in names or cls.gated_by))
        for index in found:
            if index.better == "neither":
                raise ParameterError(f"{index.key} has no better direction and cannot be gated")
        return found

    @classmethod
    def swept_indices(cls, names: Sequence[str] | None = None) -> tuple[Index, ...]:
        """Return the indices that sensitivity plots show: those named, else those declared, else the one that ranks."""
        return tuple(dict.fromkeys(cls.index(name) for name in names or cls.swept_by)) or (cls.ranking_index(),)

    @classmethod
    def summary_indices(cls, ranking: Index) -> tuple[Index, ...]:
        """Return the indices that leaderboards show: the one that ranks, then those declared, else the gated ones."""
        others = tuple(map(cls.index, cls.summarised_by)) or cls.gated_indices()
        return tuple(dict.fromkeys((ranking, *others)))

    @classmethod
    def kinds_of(cls, side: Side) -> tuple[VerdictKind, ...]:
        """Return the verdict kinds of one side, in the order of legends."""
        return tuple(kind for kind in cls.verdict_kinds if kind.side == side)


def mean_values(evaluations: Sequence[Evaluation]) -> dict[str, tuple[float | None, int]]:
    """Return the mean of each index over scenes, and over how many scenes it is (undefined values are left out)."""
    means: dict[str, tuple[float | None, int]] = {}
    for key in evaluations[0].values if evaluations else ():
        defined = [value for evaluation in evaluations if (value := evaluation.values[key]) is not None]
        means[key] = (sum(defined) / len(defined) if defined else None, len(defined))
    return means
