"""Sweeps: how a detector's quality depends on one of its parameters, or on a property of the scenes.

Nouns
-----
axis
    A parameter of the detector (``ground_tile``) or of the generator (``scene.tree_density``) with its values; None is
    the default.
point
    One value on one axis, the others at their defaults; or, in a grid, one value on every axis.
"""

from __future__ import annotations

import itertools
import math
import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from ...core.errors import ParameterError
from ...core.registry import nearest_hint, parse_assignment
from ...detectors.base import Detector
from ...evaluators.base import Index
from ...scenes.scene import Scene
from ..execution.executors import Execution
from ..execution.runner import run_plan
from ..identity.recipes import SceneRecipe
from ..plan import KeyedEvaluator, Plan, PlannedRun, Rerun, make_plan
from ..store.outcomes import Outcome
from ..store.records import RunRow
from ..store.writer import Store
from ..suite import DetectorEntry, Suite
from .break_down import BreakDown, find_break_down
from .inference import bootstrap_interval

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "Axis",
    "Point",
    "Sweep",
    "axis_of",
    "break_downs",
    "make_sweep",
    "run_sweep",
]

_SCENE = "scene."


@dataclass(frozen=True)
class Axis:
    """A varied parameter, ``ground_tile`` or ``scene.slope``, and its values in order."""

    name: str
    values: tuple[Any, ...]

    @property
    def of_scene(self) -> bool:
        """Whether it is an axis of the generator."""
        return self.name.startswith(_SCENE)


@dataclass(frozen=True)
class Point:
    """A point of a sweep: the axis that is varied (``grid`` for all) and the values of the varied axes."""

    axis: str
    values: Mapping[str, Any]


@dataclass(frozen=True)
class Sweep:
    """Points, each with the plan of its runs, and one plan with every run once."""

    axes: tuple[Axis, ...]
    detectors: tuple[Detector, ...]
    points: tuple[tuple[Point, Detector, Plan], ...]
    plan: Plan


def axis_of(text: str) -> Axis:
    """Read ``ground_tile=400,450,500`` or ``scene.slope=0:20:5`` (from, to, step, the end included).

    >>> axis_of("scene.slope=0:20:5").values
    (0, 5, 10, 15, 20)
    """
    name, listed = parse_assignment(text)
    words = [word.strip() for word in listed.split(",") if word.strip()]
    if not words:
        raise ParameterError(f"cannot read vary={text!r}: write NAME=VALUE,VALUE,... or NAME=FROM:TO:STEP")
    values: list[Any] = []
    for word in words:
        values += _range(word, text) if word.count(":") == 2 else [_value(word)]
    if len(set(values)) != len(values):
        raise ParameterError(f"vary={text!r} names a value twice")
    return Axis(name, tuple(values))


def _value(word: str) -> Any:
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            continue
    return {"true": True, "false": False}.get(word.lower(), word)


def _range(word: str, text: str) -> list[Any]:
    start, end, step = (_value(part) for part in word.split(":"))
    numbers = all(isinstance(number, int | float) and not isinstance(number, bool) for number in (start, end, step))
    if not numbers or not step or (end - start) / step < 0 or (end - start) / step > 10_000:
        raise ParameterError(f"cannot read {word!r} in vary={text!r}: write FROM:TO:STEP")
    count = math.floor((end - start) / step + 1e-9) + 1
    return [start + place * step for place in range(count)]


def make_sweep(
    suite: Suite, axes: Sequence[Axis], store: Store, *, grid: bool = False, rerun: Rerun = "missing"
) -> Sweep:
    """Plan a sweep of the suite's detectors over its scenes.

    Parameters
    ----------
    suite : Suite
        Its detectors and scenes are the defaults; one axis at a time is varied.
    axes : sequence of Axis
    store : Store
    grid : bool
        Vary all axes together.
    rerun : {"missing", "never", "always"}

    Raises
    ------
    ParameterError
        An axis that no detector has, a value outside its range, or a generator axis without a synthetic scene.
    """
    _check_axes(suite, axes)
    points: list[tuple[Point, Detector, Plan]] = []
    for entry in suite.detectors:
        for point in _points(axes, grid=grid):
            own = {name: value for name, value in point.values.items() if not name.startswith(_SCENE)}
            if not own.keys() <= entry.detector.parameters().keys():
                continue  # another detector's axis
            detector = entry.detector.replaced(own)
            part = replace(suite, scenes=_scenes(suite, point), detectors=(DetectorEntry(detector, entry.seeds),))
            points.append((point, entry.detector, make_plan(part, store, rerun=rerun)))
    runs = {run.identity.key: run for _, _, plan in points for run in plan.runs}
    ordered = sorted(runs.values(), key=lambda run: run.identity.scene.name)  # workers keep their open scene
    evaluators = points[0][2].evaluators
    detectors = tuple(entry.detector for entry in suite.detectors)
    return Sweep(tuple(axes), detectors, tuple(points), Plan(suite, tuple(ordered), evaluators, rerun))


def _check_axes(suite: Suite, axes: Sequence[Axis]) -> None:
    known = {name for entry in suite.detectors for name in entry.detector.parameters()}
    synthetic = any(not isinstance(scene, Scene) and scene.kind == "preset" for scene in suite.scenes)
    if not axes:
        raise ParameterError("nothing is varied: give vary=NAME=VALUE,VALUE,...")
    for axis in axes:
        if axis.of_scene and not synthetic:
            raise ParameterError(
                f"{axis.name} is an axis of the generator, but no scene of {suite.name!r} is synthetic"
            )
        if not axis.of_scene and axis.name not in known:
            names = ", ".join(entry.detector.name for entry in suite.detectors)
            raise ParameterError(
                f"{names}: no parameter {axis.name!r}{nearest_hint(axis.name, known)} to vary; an axis of the "
                f"generator is written {_SCENE}NAME"
            )


def _points(axes: Sequence[Axis], *, grid: bool) -> Iterator[Point]:
    if grid:
        for values in itertools.product(*(axis.values for axis in axes)):
            yield Point("grid", dict(zip((axis.name for axis in axes), values, strict=True)))
        return
    for axis in axes:
        for value in axis.values:
            yield Point(axis.name, {axis.name: value})


def _scenes(suite: Suite, point: Point) -> tuple[SceneRecipe | Scene, ...]:
    """Return the scenes at a point; those that are not synthetic are left out of a sweep of the generator."""
    varied = {name.removeprefix(_SCENE): value for name, value in point.values.items() if name.startswith(_SCENE)}
    if not varied:
        return suite.scenes
    return tuple(
        SceneRecipe.of_preset(scene.place, seed=scene.seed, parameters={**scene.parameters, **varied})
        for scene in suite.scenes
        if not isinstance(scene, Scene) and scene.kind == "preset"
    )


def run_sweep(
    sweep: Sweep,
    store: Store,
    *,
    execution: Execution | None = None,
    progress: Callable[[PlannedRun, Outcome], None] | None = None,
) -> tuple[pd.DataFrame, tuple[RunRow, ...]]:
    """Execute missing runs; return the tidy table and every run of the sweep.

    Returns
    -------
    table : DataFrame
        One row per detector, point, evaluator and index: columns ``detector``, ``axis``, one per varied axis,
        ``evaluator``, ``index``, ``symbol``, ``unit``, ``mean`` over scenes, ``low`` and ``high`` (95 % bootstrap
        interval over scenes), ``scenes`` (where it is defined), ``runs``, ``failed``, ``skipped``.
    rows : tuple of RunRow
    """
    result = run_plan(sweep.plan, store, execution=execution, progress=progress)
    return sweep_table(sweep, store, {row.key: row for row in result.rows}), result.rows


def sweep_table(sweep: Sweep, store: Store, rows: Mapping[str, RunRow]) -> pd.DataFrame:
    """Return the tidy table of stored runs; see `run_sweep`."""
    import pandas as pd

    good = [row.id for row in rows.values() if row.status == "ok"]
    records: list[dict[str, Any]] = []
    for keyed in sweep.plan.evaluators:
        values = store.index_values(good, keyed.key)
        for point, detector, plan in sweep.points:
            records += _records(point, detector, keyed, [rows[key] for key in plan.keys if key in rows], values)
    names = [axis.name for axis in sweep.axes]
    columns = ["detector", "axis", *names, "evaluator", "index", "symbol", "unit", "mean", "low", "high", "scenes"]
    return pd.DataFrame.from_records(records, columns=[*columns, "runs", "failed", "skipped"])


def _records(
    point: Point,
    detector: Detector,
    keyed: KeyedEvaluator,
    rows: Sequence[RunRow],
    values: Mapping[int, Mapping[str, float | None]],
) -> Iterator[dict[str, Any]]:
    common = {
        "detector": DetectorEntry(detector).label,
        "axis": point.axis,
        **point.values,
        "evaluator": keyed.label,
        "runs": len(rows),
        "failed": sum(row.status == "failed" for row in rows),
        "skipped": sum(row.status == "skipped" for row in rows),
    }
    for index in keyed.evaluator.indices:
        by_scene: dict[str, list[float]] = {}
        for row in rows:
            value = values.get(row.id, {}).get(index.key)
            if value is not None:
                by_scene.setdefault(row.scene, []).append(value)
        means = [statistics.fmean(found) for found in by_scene.values()]
        low, high = bootstrap_interval(means) or (None, None)
        yield {
            **common,
            "index": index.key,
            "symbol": index.symbol,
            "unit": index.unit,
            "mean": statistics.fmean(means) if means else None,
            "low": low,
            "high": high,
            "scenes": len(means),
        }


def break_downs(table: pd.DataFrame, axes: Sequence[Axis], index: Index, level: float) -> list[BreakDown]:
    """Return where each detector's mean of an index first passes a level for the worse, per numeric axis.

    Only axes that were varied alone count: on a grid there is no single place.
    """
    found = []
    chosen = table[table["index"] == index.key]
    for detector in dict.fromkeys(chosen["detector"]):
        for axis in axes:
            if not all(isinstance(value, int | float) and not isinstance(value, bool) for value in axis.values):
                continue
            line = chosen[(chosen["detector"] == detector) & (chosen["axis"] == axis.name)].dropna(subset=["mean"])
            points = [(float(place), float(value)) for place, value in zip(line[axis.name], line["mean"], strict=True)]
            place = find_break_down(points, detector=str(detector), axis=axis.name, index=index, level=level)
            found += [] if place is None else [place]
    return found
