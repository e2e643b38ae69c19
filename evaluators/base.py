"""Evaluators: how two footprint sets are compared.

Nouns
-----
index
    One number that an evaluator reports, declared as `Index` with symbol, direction, unit and source.
tallies
    Counts and sums of one evaluation (TP, areas in m2, sums of squared distances) from which indices follow, and which
    add up over scenes.
samples
    Values of one evaluation that are kept one by one (IoU of each pair), because a median cannot be added up.
evaluation
    Tallies, samples and a verdict per object. Pooling adds tallies, joins samples and derives the indices anew.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..core.errors import InputError
from ..core.parameters import Parameterised
from ..scenes.geodata.footprints import Footprints
from ..scenes.geodata.raster import Grid

if TYPE_CHECKING:
    import pandas as pd
    from shapely import Geometry

__all__ = ["Better", "Evaluation", "Evaluator", "Index", "Samples", "Tallies", "Verdicts", "mean_values"]

#: Which way an index improves.
Better: TypeAlias = Literal["higher", "lower", "neither"]
#: What adds up over scenes, and what is kept one by one.
Tallies: TypeAlias = Mapping[str, float]
Samples: TypeAlias = Mapping[str, NDArray[np.float64]]


@dataclass(frozen=True, kw_only=True)
class Index:
    """One reported number.

    Attributes
    ----------
    key : str
        Dotted name in JSON, tables and the store: ``"object.quality"``.
    title, symbol : str
        Name in words and the paper's symbol: ``"quality"``, ``"Q_l"``.
    better : {"higher", "lower", "neither"}
    unit : str
        ``"fraction"`` (printed as percent), ``"ratio"``, ``"m"``, ``"px"`` or ``"count"``.
    range : tuple of float
        Lowest and highest value it can take.
    meaning, source : str
        The formula in words, and where it is defined.
    main : bool
        Whether it is one of the evaluator's principal indices, shown in every table; the others are variants.
    """

    key: str
    title: str
    symbol: str
    better: Better
    unit: str
    range: tuple[float, float]
    meaning: str
    source: str
    main: bool = True


@dataclass(frozen=True, eq=False)
class Verdicts:
    """Why each object is right or wrong: one row per detection and per reference.

    Columns ``id``, ``verdict``, ``partner``, ``distance``, ``overlap_area``, ``iou``, ``rmse``, ``reason``,
    ``geometry`` (shapely), further ones as the evaluator needs. They become data frames when somebody asks: a sweep
    stores the verdicts of thousands of runs without any.

    Attributes
    ----------
    detection_columns, reference_columns : mapping of str to array, masked array or list
    """

    detection_columns: Mapping[str, Any]
    reference_columns: Mapping[str, Any]

    @cached_property
    def detections(self) -> pd.DataFrame:
        """One row per detection; whole numbers that are masked are <NA>."""
        return _frame(self.detection_columns)

    @cached_property
    def references(self) -> pd.DataFrame:
        """One row per reference; see `detections`."""
        return _frame(self.reference_columns)


def _frame(columns: Mapping[str, Any]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(
        {
            name: pd.arrays.IntegerArray(column.data, np.ma.getmaskarray(column)) if np.ma.isMA(column) else column
            for name, column in columns.items()
        }
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class Evaluation:
    """The result of comparing two footprint sets (or of pooling several such results).

    Attributes
    ----------
    evaluator : Evaluator
    tallies : mapping of str to float
    samples : mapping of str to ndarray
    values : mapping of str to float or None
        Every index of the evaluator by its key; None where it is undefined (0/0).
    notes : tuple of str
        What a reader must know: objects left out, repairs, how RMSE was measured.
    """

    evaluator: Evaluator
    tallies: Tallies
    samples: Samples = field(default_factory=dict)
    values: Mapping[str, float | None] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def verdicts(self) -> Verdicts | None:
        """A verdict with its reason for every object; None of a pooled evaluation."""
        return None

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON holds: nested by the parts of the index keys, ``null`` where undefined."""
        nested: dict[str, Any] = {"evaluator": self.evaluator.name, "parameters": self.evaluator.values()}
        for key, value in self.values.items():
            *groups, name = key.split(".")
            place = nested
            for group in groups:
                place = place.setdefault(group, {})
            place[name] = value
        nested["tallies"] = dict(self.tallies)
        nested["notes"] = list(self.notes)
        return nested


class Evaluator(Parameterised, ABC):
    """Base of all evaluators: a frozen, keyword-only dataclass whose fields are its parameters.

    Attributes
    ----------
    name : str
    indices : tuple of Index
        What it reports, in order.
    """

    name: ClassVar[str]
    indices: ClassVar[tuple[Index, ...]]

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

    @abstractmethod
    def summarise(self, tallies: Tallies, samples: Samples, notes: Sequence[str] = ()) -> Evaluation:
        """Return the evaluation that follows from tallies and samples (of one scene, or added up over several)."""

    def pool(self, evaluations: Iterable[Evaluation]) -> Evaluation:
        """Add up several evaluations of this evaluator: counts and areas first, then the ratios."""
        every = list(evaluations)
        if not every:
            raise InputError("nothing to pool: give at least one evaluation")
        tallies: dict[str, float] = {}
        samples: dict[str, list[NDArray[np.float64]]] = {}
        for evaluation in every:
            if evaluation.evaluator != self:
                raise InputError(
                    f"evaluations by {evaluation.evaluator} and by {self} cannot be pooled: use one evaluator with one "
                    "set of parameters"
                )
            for key, value in evaluation.tallies.items():
                tallies[key] = tallies.get(key, 0) + value
            for key, array in evaluation.samples.items():
                samples.setdefault(key, []).append(array)
        joined = {key: np.concatenate(arrays) for key, arrays in samples.items()}
        return self.summarise(tallies, joined, [f"pooled over {len(every)} evaluations"])


def mean_values(evaluations: Sequence[Evaluation]) -> dict[str, tuple[float | None, int]]:
    """Return the mean of each index over scenes, and over how many scenes it is (undefined values are left out)."""
    means: dict[str, tuple[float | None, int]] = {}
    for key in evaluations[0].values if evaluations else ():
        defined = [value for evaluation in evaluations if (value := evaluation.values[key]) is not None]
        means[key] = (sum(defined) / len(defined) if defined else None, len(defined))
    return means
