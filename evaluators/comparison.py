"""Comparing footprint sets in one call, and pooling the results."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Literal, overload

from shapely import Geometry, MultiPolygon, Polygon, is_valid, is_valid_reason

from ..core.display import Displayed
from ..core.errors import InputError
from ..scenes.geodata.crs import require_metric
from ..scenes.geodata.footprints import Footprints
from ..scenes.geodata.raster import Grid
from .base import Evaluation, Evaluator
from .given_footprints import GivenFootprints, GivenReference, given_sets
from .registry import ALL, DEFAULT, all_evaluators, make_evaluator

if TYPE_CHECKING:
    from .threshold_free.evaluator import ThresholdFreeEvaluation

__all__ = ["Evaluations", "evaluate", "evaluate_all", "pool"]


class Evaluations(dict[str, Evaluation], Displayed):
    """Evaluations of the same footprints by several evaluators, by name."""

    shown_by = "reports.notebook_view:evaluations_view"


@overload
def evaluate(
    detected: GivenFootprints,
    reference: GivenReference,
    *,
    area: Geometry | None = None,
    grid: Grid | None = None,
    building_id: str | None = None,
    matching: str = ...,
    gsd: float | None = ...,
    minimum_area: float = ...,
) -> ThresholdFreeEvaluation: ...


@overload
def evaluate(
    detected: GivenFootprints,
    reference: GivenReference,
    *,
    evaluator: Literal["all"],
    area: Geometry | None = None,
    grid: Grid | None = None,
    building_id: str | None = None,
    **parameters: Any,
) -> Evaluations: ...


@overload
def evaluate(
    detected: GivenFootprints,
    reference: GivenReference,
    *,
    evaluator: str | Evaluator = DEFAULT,
    area: Geometry | None = None,
    grid: Grid | None = None,
    building_id: str | None = None,
    **parameters: Any,
) -> Evaluation: ...


def evaluate(
    detected: GivenFootprints,
    reference: GivenReference,
    *,
    evaluator: str | Evaluator = DEFAULT,
    area: Geometry | None = None,
    grid: Grid | None = None,
    building_id: str | None = None,
    **parameters: Any,
) -> Evaluation | Evaluations:
    """Compare detected with reference footprints.

    Parameters
    ----------
    detected : Footprints, GeoDataFrame, GeoSeries, path, or iterable of polygons
    reference : the same, or Scene
        Both in one projected CRS, metres; bare lists and arrays of polygons are taken in the CRS of the other. A scene
        (or its folder or name) gives its reference, evaluation area and pixel grid.
    evaluator : str or Evaluator
        Name, ``name[parameter=value]``, or an evaluator; ``"all"`` for every one, see `evaluate_all`.
    area : polygon, optional
        Evaluation area: where the reference is complete.
    grid : Grid, optional
        Grid of the orthoimage, for indices counted in pixels.
    building_id : str, optional
        Column of the reference whose equal values mark the parts of one building.
    **parameters
        Parameters of the evaluator, for instance ``matching="overlap"``. (The parameter ``area`` of the default
        evaluator, how areas are measured, is set through its name: ``evaluator=f"{DEFAULT}[area=exact]"``.)

    Raises
    ------
    InputError
        What is given as detected, reference or area is no footprint set or no valid polygon.
    CRSError
        The two sets have no common CRS, or it is not in metres.
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
    if evaluator == ALL:
        return evaluate_all(detected, reference, area=area, grid=grid, building_id=building_id, **parameters)
    chosen = make_evaluator(evaluator, parameters)
    (found,), truth = given_sets([detected], reference, area, grid, building_id=building_id)
    _require_comparable(found, truth.footprints, truth.area, chosen)
    return chosen.evaluate(found, truth.footprints, area=truth.area, grid=truth.grid)


def evaluate_all(
    detected: GivenFootprints,
    reference: GivenReference,
    *,
    area: Geometry | None = None,
    grid: Grid | None = None,
    building_id: str | None = None,
    **parameters: Any,
) -> Evaluations:
    """Compare detected with reference footprints by every evaluator; see `evaluate`.

    Parameters
    ----------
    detected, reference
        As of `evaluate`.
    area : polygon, optional
    grid : Grid, optional
    building_id : str, optional
    **parameters
        Given to the evaluators that have them.

    Returns
    -------
    Evaluations
        A dictionary by the name of the evaluator, the default one first.

    Examples
    --------
    >>> import shapely
    >>> houses = Footprints.of([shapely.box(0, 0, 10, 10), shapely.box(20, 0, 30, 10)])
    >>> list(evaluate_all(houses, houses))[:3]
    ['threshold-free', 'boundary', 'iou']
    """
    (found,), truth = given_sets([detected], reference, area, grid, building_id=building_id)
    results = Evaluations()
    for evaluator in all_evaluators(parameters):
        _require_comparable(found, truth.footprints, truth.area, evaluator)
        results[evaluator.name] = evaluator.evaluate(found, truth.footprints, area=truth.area, grid=truth.grid)
    return results


def _require_comparable(detected: Footprints, reference: Footprints, area: Any, evaluator: Evaluator) -> None:
    for footprints in (detected, reference):
        if len(footprints):
            require_metric(footprints.crs, footprints.source, heights=False)
    if area is not None:
        _require_polygon(area, evaluator)


def _require_polygon(area: Any, evaluator: Evaluator) -> None:
    what = "area is the polygon inside which the reference is complete"
    if isinstance(area, str):
        raise InputError(
            f"{what}, not {area!r}: how areas are measured is chosen by evaluator='{evaluator.name}[area={area}]'"
        )
    if not isinstance(area, Polygon | MultiPolygon):
        raise InputError(f"{what}, not {type(area).__name__}: give a shapely Polygon or MultiPolygon")
    if not is_valid(area):
        raise InputError(f"{what}, but it is invalid ({is_valid_reason(area)}): repair it with shapely.make_valid")


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
