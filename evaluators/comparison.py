"""Comparing footprint sets in one call, and pooling the results."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from shapely import Geometry

from ..scenes.errors import InputError
from ..scenes.footprints import Footprints
from ..scenes.raster import Grid
from .base import Evaluation, Evaluator
from .registry import make_evaluator

__all__ = ["evaluate", "pool"]


def evaluate(
    detected: Footprints,
    reference: Footprints,
    *,
    evaluator: str | Evaluator = "threshold-free",
    area: Geometry | None = None,
    grid: Grid | None = None,
    **parameters: Any,
) -> Evaluation:
    """Compare detected with reference footprints.

    Parameters
    ----------
    detected, reference : Footprints
        In one projected CRS, metres.
    evaluator : str or Evaluator
        Name, ``name[parameter=value]``, or an evaluator.
    area : polygon, optional
        Evaluation area: where the reference is complete.
    grid : Grid, optional
        Grid of the orthoimage, for indices counted in pixels.
    **parameters
        Parameters of the evaluator, for instance ``matching="overlap"``. (Its parameter ``area`` of the threshold-free
        evaluator, how areas are measured, is set through the name: ``"threshold-free[area=exact]"``.)

    Raises
    ------
    CRSError
        The two sets have no common CRS.
    ParameterError, UnknownNameError
        No such evaluator or parameter.

    Examples
    --------
    >>> import shapely
    >>> reference = Footprints.of([shapely.box(0, 0, 10, 10), shapely.box(20, 0, 30, 10)])
    >>> detected = Footprints.of([shapely.box(1, 0, 11, 10)])
    >>> evaluation = evaluate(detected, reference)
    >>> evaluation.object.completeness, evaluation.geometric.rmse
    (0.5, 1.0)
    """
    return make_evaluator(evaluator, parameters).evaluate(detected, reference, area=area, grid=grid)


def pool(evaluations: Iterable[Evaluation]) -> Evaluation:
    """Add up evaluations of several scenes: counts and areas first, then the ratios.

    Raises
    ------
    InputError
        No evaluation, or evaluations by different evaluators.
    """
    every = list(evaluations)
    if not every:
        raise InputError("nothing to pool: give at least one evaluation")
    return every[0].evaluator.pool(every)
