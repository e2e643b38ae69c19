"""The base of the evaluators that compare coverage: what counts, the minimum area and the notes are the same in all."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import shapely

from ..core.parameters import parameter
from ..scenes.geodata.footprints import Footprints
from ..scenes.geodata.raster import Grid
from .base import Evaluation, Evaluator
from .overlay.coverage import CountedSets, counted_sets
from .overlay.left_out import left_out_notes
from .overlay.reference_overlaps import input_notes
from .tally import Tallies
from .verdict_table import Verdicts

__all__ = ["CoverageEvaluator"]


@dataclass(frozen=True, kw_only=True)
class CoverageEvaluator(Evaluator):
    """An evaluator that needs no more than the sets that count and their overlaps.

    A subclass declares its vocabulary and gives `measured`; its tallies have a field ``left_out``.
    """

    minimum_area: float = parameter(
        0.0, unit="m2", minimum=0.0, doc="smaller references do not count, nor do detections that overlap only them"
    )

    @abstractmethod
    def measured(self, sets: CountedSets) -> tuple[Tallies, Callable[[], Verdicts]]:
        """Return the tallies of two sets, and how their verdicts are found."""

    def evaluate(
        self,
        detected: Footprints,
        reference: Footprints,
        *,
        area: shapely.Geometry | None = None,
        grid: Grid | None = None,
    ) -> Evaluation:
        """Compare two sets; see `Evaluator.evaluate`."""
        sets = counted_sets(detected, reference, area=area, minimum_area=self.minimum_area)
        tallies, find_verdicts = self.measured(sets)
        return self.summarise(tallies, list(input_notes(detected, reference)), find_verdicts=find_verdicts)

    def notes_of(self, tallies: Any) -> tuple[str, ...]:
        """Return how many objects were left out."""
        return tuple(left_out_notes(tallies.left_out))
