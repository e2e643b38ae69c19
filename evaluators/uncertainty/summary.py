"""The uncertainty of one evaluation in one piece, for tables and JSON."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import shapely

from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.raster import Grid
from ..base import Evaluation
from .intervals import Intervals, block_intervals
from .redrawn import REDRAWS, Redraws, redraw_changes

__all__ = ["Uncertainty", "uncertainty_of"]


@dataclass(frozen=True, kw_only=True)
class Uncertainty:
    """Intervals, and changes under a redrawn reference; each is None where it was not asked for."""

    intervals: Intervals | None = None
    redraws: Redraws | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON holds."""
        return {
            "interval": None if self.intervals is None else self.intervals.to_dict(),
            "reference_error": None if self.redraws is None else self.redraws.to_dict(),
        }


def uncertainty_of(
    evaluation: Evaluation,
    sets: tuple[Footprints, Footprints],
    *,
    interval: float | None = None,
    reference_error: float | None = None,
    redraws: int | None = None,
    area: shapely.Geometry | None = None,
    grid: Grid | None = None,
) -> Uncertainty:
    """Return the uncertainty of an evaluation of these detections and references.

    Parameters
    ----------
    evaluation : Evaluation
    sets : tuple of Footprints
        Detections and references.
    interval : float, optional
        Level, percent.
    reference_error : float, optional
        Digitising error, m.
    redraws : int, optional
    area : polygon, optional
    grid : Grid, optional
    """
    intervals = redrawn = None
    if interval is not None:
        intervals = block_intervals(*sets, evaluator=evaluation.evaluator, area=area, grid=grid, level=interval)
    if reference_error is not None:
        redrawn = redraw_changes(
            *sets,
            error=reference_error,
            evaluator=evaluation.evaluator,
            area=area,
            grid=grid,
            redraws=redraws or REDRAWS,
        )
    return Uncertainty(intervals=intervals, redraws=redrawn)
