"""Sensitivities: lines of a sweep, found among stored runs or read from the table that ``roofbench sweep`` writes.

All points of a line are over the same scenes: values that lack some of them are left out of the line, and named.

A stored run lies on an axis of the generator when its preset was changed in that one parameter. Unchanged runs of the
same scenes give the default's point. Runs of a detector that differ in one parameter alone lie on the axis of that
parameter; the default need not be among them.
"""

from __future__ import annotations

import itertools
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...core.errors import InputError, RoofbenchError
from ...core.parameter_rules import parameter_text
from ...detectors.registry import make_detector
from ...evaluators.base import Index
from ...evaluators.registry import make_evaluator
from ...scenes.synthetic.presets import preset, preset_names
from ...scenes.synthetic.recipe import SceneParameters
from ..plan import KeyedEvaluator
from ..store.records import RunRow
from .break_down import find_break_down
from .inference import bootstrap_interval
from .report_data import Sensitivity, SensitivityPoint

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["read_sweep_table", "stored_sensitivities"]

_MOST_LINES = 200

Values = Mapping[int, Mapping[str, float | None]]


def stored_sensitivities(
    rows: Sequence[RunRow], values: Values, keyed: KeyedEvaluator, *, level: float, chosen: Sequence[str] = ()
) -> list[Sensitivity]:
    """Return the sweeps that stored runs make up: axes with at least two values.

    Parameters
    ----------
    rows : sequence of RunRow
        Of status ``ok``.
    values : mapping of int to mapping
        Index values by run.
    keyed : KeyedEvaluator
    level : float
        Value of the first index at which a detector counts as broken down.
    chosen : sequence of str
        Keys or symbols of indices; those that the evaluator declares by default.
    """
    rows = [row for row in rows if row.id in values]
    indices = keyed.evaluator.swept_indices(chosen)
    lines = []
    for axis, unit, default, label, by_value in itertools.chain(_scene_axes(rows), _detector_axes(rows)):
        common, left_out = _over_common_scenes(by_value, by_seed=axis.startswith("scene."))
        for index in indices:
            points = tuple(_point(value, own, values, index) for value, own in _in_order(common))
            if sum(point.mean is not None for point in points) < 2:
                continue
            line = Sensitivity(
                detector=label,
                axis=axis,
                unit=unit,
                index=index,
                points=points,
                default=default,
                left_out=left_out,
                scenes=max(len({row.scene for row in own}) for own in common.values()),
            )
            lines.append(_with_break_down(line, level) if index is indices[0] else line)
    return lines[:_MOST_LINES]


def read_sweep_table(path: Path, *, indices: Sequence[str] = (), level: float = 0.8) -> list[Sensitivity]:
    """Read a table that ``roofbench sweep -o`` wrote; only axes that were varied alone can be drawn.

    Raises
    ------
    InputError
        No such file, or no such table.
    """
    import pandas as pd

    if not path.is_file():
        raise InputError(f"{path}: no such sweep table; 'roofbench sweep ... -o {path.name}' writes one")
    try:
        table = pd.read_parquet(path) if path.suffix.lower() == ".parquet" else pd.read_csv(path)
    except (ValueError, OSError, ImportError) as error:
        raise InputError(f"{path}: cannot be read as a sweep table: {' '.join(str(error).split())[:200]}") from error
    needed = {"detector", "axis", "evaluator", "index", "mean", "low", "high", "scenes"}
    if not needed <= set(table.columns):
        missing = ", ".join(sorted(needed - set(table.columns)))
        raise InputError(f"{path}: no sweep table, it has no column {missing}; 'roofbench sweep ... -o' writes one")
    lines: list[Sensitivity] = []
    for (evaluator, detector, axis), own in table.groupby(["evaluator", "detector", "axis"], sort=False):
        if axis in own.columns:
            lines += _lines_of(own, str(evaluator), str(detector), str(axis), indices, level)
    if not lines:
        raise InputError(f"{path}: holds no axis that was varied alone: sweep without grid=True")
    return lines


def _lines_of(
    table: pd.DataFrame, evaluator: str, detector: str, axis: str, chosen: Sequence[str], level: float
) -> list[Sensitivity]:
    lines = []
    shown = make_evaluator(evaluator).swept_indices(chosen)
    for index in shown:
        own = table[table["index"] == index.key]
        points = tuple(
            SensitivityPoint(
                _axis_value(row[axis]),
                _number(row["mean"]),
                _number(row["low"]),
                _number(row["high"]),
                int(row["scenes"]),
            )
            for row in own.to_dict("records")
        )
        if points:
            unit, default = _facts_of(axis, detector.partition("[")[0])
            line = Sensitivity(detector=detector, axis=axis, unit=unit, index=index, points=points, default=default)
            lines.append(_with_break_down(line, level) if index is shown[0] else line)
    return lines


def _axis_value(value: Any) -> Any:
    """Return a value of a column as the sweep wrote it: pandas turns whole numbers beside gaps into floats."""
    value = value.item() if hasattr(value, "item") else value
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _number(value: Any) -> float | None:
    return None if value is None or value != value else float(value)


Axis = tuple[str, str, Any, str, dict[Any, list[RunRow]]]


def _scene_axes(rows: Sequence[RunRow]) -> Iterable[Axis]:
    """Yield the axes of the generator: name, unit, default, label of the line, runs by value."""
    plain: dict[tuple[str, str], list[RunRow]] = {}
    varied: dict[tuple[str, str, str], dict[Any, list[RunRow]]] = {}
    for row in rows:
        recipe = row.recipe
        if recipe.kind != "preset":
            continue
        if not recipe.parameters:
            plain.setdefault((row.label, recipe.place), []).append(row)
        elif len(recipe.parameters) == 1:
            ((name, value),) = recipe.parameters.items()
            varied.setdefault((name, recipe.place, row.label), {}).setdefault(value, []).append(row)
    for (name, place, label), by_value in varied.items():
        unit, default = _facts_of(f"scene.{name}", place)
        if default is not None and default not in by_value:
            seeds = {row.recipe.seed for own in by_value.values() for row in own}
            same = [row for row in plain.get((label, place), ()) if row.recipe.seed in seeds]
            by_value = {**by_value, default: same} if same else by_value
        if len(by_value) > 1:
            yield f"scene.{name}", unit, None, f"{label} on {place}", by_value


def _detector_axes(rows: Sequence[RunRow]) -> Iterable[Axis]:
    """Yield the axes of the detectors: runs that differ in one parameter alone, whatever the others are."""
    settings = {row.id: dict(row.parameters) for row in rows}
    own: dict[str, list[RunRow]] = {}
    for row in rows:
        own.setdefault(row.detector, []).append(row)
    for detector, found in own.items():
        names = dict.fromkeys(name for row in found for name in settings[row.id])
        varied = [name for name in names if len({repr(settings[row.id].get(name)) for row in found}) > 1]
        for name in varied:
            lines: dict[str, list[RunRow]] = {}
            for row in found:
                others = sorted((other, repr(settings[row.id].get(other))) for other in varied if other != name)
                lines.setdefault(repr(others), []).append(row)
            for alike in lines.values():
                by_value: dict[Any, list[RunRow]] = {}
                for row in alike:
                    by_value.setdefault(settings[row.id].get(name), []).append(row)
                facts = _facts_beside(detector, settings[alike[0].id], name) if len(by_value) > 1 else None
                if facts is not None:
                    label, unit, default = facts
                    yield name, unit, default, label, by_value


def _facts_beside(detector: str, parameters: Mapping[str, Any], axis: str) -> tuple[str, str, Any] | None:
    """Return the label of a line without the parameter of its axis, and the unit and default of that parameter.

    None for a parameter of free text, such as a folder: its values are no points of a line.
    """
    short = detector.rpartition(":")[2]
    try:
        made = make_detector(detector, parameters)
    except RoofbenchError:
        # A plugin that is not loaded, or parameters of an earlier version.
        return short, "", None
    rule = made.parameters()[axis]
    if rule.type is str and not rule.choices:
        return None
    others = ",".join(f"{name}={parameter_text(value)}" for name, value in made.changed().items() if name != axis)
    label = f"{short}[{others}]" if others else short
    return label, rule.unit, made.defaults()[axis]


def _over_common_scenes(
    by_value: Mapping[Any, list[RunRow]], *, by_seed: bool
) -> tuple[dict[Any, list[RunRow]], tuple[Any, ...]]:
    """Return the runs of one set of scenes by value, and the values that lack some of these scenes.

    The set is the one that keeps most points, counted over values and scenes. Scenes that differ in the varied
    parameter correspond by their seed.
    """

    def scene(row: RunRow) -> int | str:
        return row.recipe.seed if by_seed else row.scene

    sets = {value: frozenset(map(scene, rows)) for value, rows in by_value.items()}

    def kept(chosen: frozenset[int | str]) -> tuple[bool, int]:
        values = sum(chosen <= found for found in sets.values())
        return values > 1, values * len(chosen)

    chosen = max(sets.values(), key=kept)
    common = {
        value: [row for row in rows if scene(row) in chosen]
        for value, rows in by_value.items()
        if chosen <= sets[value]
    }
    return common, tuple(value for value in by_value if value not in common)


def _facts_of(axis: str, owner: str) -> tuple[str, Any]:
    """Return unit and default of an axis; empty and None where they are not known here."""
    name = axis.removeprefix("scene.")
    try:
        if axis != name:
            known = SceneParameters.parameters()
            return known[name].unit, preset(owner).values()[name] if owner in preset_names() else None
        detector = make_detector(owner)
        return detector.parameters()[name].unit, detector.values()[name]
    except (RoofbenchError, KeyError):
        return "", None


def _in_order(by_value: Mapping[Any, list[RunRow]]) -> list[tuple[Any, list[RunRow]]]:
    numbers = all(isinstance(value, int | float) and not isinstance(value, bool) for value in by_value)
    return sorted(by_value.items(), key=lambda item: item[0] if numbers else str(item[0]))


def _point(value: Any, rows: Sequence[RunRow], values: Values, index: Index) -> SensitivityPoint:
    """Return the mean over scenes, each the mean over seeds of the detector."""
    by_scene: dict[str, list[float]] = {}
    for row in rows:
        found = values[row.id].get(index.key)
        if found is not None:
            by_scene.setdefault(row.scene, []).append(found)
    means = [statistics.fmean(found) for found in by_scene.values()]
    low, high = bootstrap_interval(means) or (None, None)
    return SensitivityPoint(value, statistics.fmean(means) if means else None, low, high, len(means))


def _with_break_down(line: Sensitivity, level: float) -> Sensitivity:
    """Return the line with the place where its mean first passes the level for the worse; only numbers have places."""
    known = [(point.value, point.mean) for point in line.points if point.mean is not None]
    if any(not isinstance(place, int | float) or isinstance(place, bool) for place, _ in known):
        return line
    found = find_break_down(known, detector=line.detector, axis=line.axis, index=line.index, level=level)
    return replace(line, break_down=found)
