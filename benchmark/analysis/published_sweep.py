"""Published figures of sensitivity that a sweep repeats, and whether what the text says about them holds.

Nouns
-----
published sweep
    Figure of a paper in which several parameters take the values that the paper lists, one parameter at a time.
curve
    Means of an index over scenes, by value of one parameter.
statement
    A sentence of the paper's text about the figure, checked on the curves.

The scenes are the generator's presets of the same areas, so that agreement is not expected of the values, only of what
the text concludes from them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

from ...core.errors import ParameterError, UnknownNameError
from ...evaluators.registry import make_evaluator
from ..suite import DetectorEntry, Suite
from .sweep import Axis, axis_of

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "PUBLISHED_SWEEPS",
    "Curve",
    "Finding",
    "PublishedSweep",
    "axes_of",
    "curves_of",
    "published_axes",
    "published_sweep",
]

_OBJECT, _PIXEL = "object", "pixel"
#: Symbols of both qualities, as the papers print them.
_SYMBOLS = {_OBJECT: "Q_l", _PIXEL: "Q_lp"}
#: Difference of means, share of 1, below which two values count as equal: figures are read to about half a per cent.
_EQUAL = 0.0025


@dataclass(frozen=True)
class Curve:
    """Object and pixel quality (0..1) along the values of one parameter."""

    values: tuple[float, ...]
    by_object: tuple[float, ...]
    by_pixel: tuple[float, ...]

    def best(self, index: str) -> float:
        """Return the value with the highest mean; of equal ones the first."""
        means = self.by_object if index == _OBJECT else self.by_pixel
        return self.values[means.index(max(means))]

    def reaches_best(self, index: str, value: float) -> bool:
        """Return whether the mean at a value equals the highest one."""
        means = self.by_object if index == _OBJECT else self.by_pixel
        return value in self.values and means[self.values.index(value)] >= max(means) - _EQUAL

    def below_best(self, index: str, value: float) -> float:
        """Return by how much the mean at a value is below the highest one."""
        means = self.by_object if index == _OBJECT else self.by_pixel
        return max(means) - means[self.values.index(value)]

    def range(self, index: str) -> float:
        """Return the difference of the highest and the lowest mean."""
        means = self.by_object if index == _OBJECT else self.by_pixel
        return max(means) - min(means)


Curves = Mapping[str, Curve]


@dataclass(frozen=True)
class _Statement:
    text: str
    holds: Callable[[Curves], bool]
    measured: Callable[[Curves], str]


@dataclass(frozen=True)
class Finding:
    """A statement of the paper, whether it holds on the curves, and what was measured."""

    statement: str
    reproduced: bool
    measured: str


@dataclass(frozen=True)
class PublishedSweep:
    """A figure of sensitivity.

    Attributes
    ----------
    figure, detector, source : str
        Its number, the detector, and paper and section.
    parameters : tuple of str
        Varied one at a time over their declared values (`core.parameter_rules.Parameter.swept`).
    scenes : tuple of str
        Words of the default suite.
    seeds : int
        Seeds 1 to this of each scene.
    standard : mapping
        Parameters that have the paper's value where the detector's default is another.
    """

    figure: str
    detector: str
    source: str
    parameters: tuple[str, ...]
    scenes: tuple[str, ...]
    seeds: int
    standard: Mapping[str, Any]
    statements: tuple[_Statement, ...]

    def findings(self, curves: Curves) -> list[Finding]:
        """Return each statement of the paper with what the curves show."""
        return [Finding(item.text, item.holds(curves), item.measured(curves)) for item in self.statements]


def _percent(share: float) -> str:
    return f"{100 * share:.1f}"


def _ranges(curves: Curves) -> str:
    listed = (
        f"{name} {_percent(curve.range(_OBJECT))} / {_percent(curve.range(_PIXEL))}" for name, curve in curves.items()
    )
    return "range, object / pixel: " + ", ".join(listed)


def _widest(curves: Curves, name: str) -> bool:
    """Return whether a parameter changes the pixel quality more than each other one does."""
    return all(curves[name].range(_PIXEL) > other.range(_PIXEL) for key, other in curves.items() if key != name)


def _highest_at(name: str, index: str, value: float) -> _Statement:
    return _Statement(
        f"{index} quality is highest at {name} = {value:g}",
        lambda curves: curves[name].reaches_best(index, value),
        lambda curves: (
            f"highest at {curves[name].best(index):g}; at {value:g} lower by "
            f"{_percent(curves[name].below_best(index, value))}"
        ),
    )


def _compromise(name: str, value: float, highest: str, other: str) -> _Statement:
    return _Statement(
        f"at {name} = {value:g} {highest} quality is highest, {other} quality slightly below its highest",
        lambda curves: curves[name].reaches_best(highest, value) and 0 <= curves[name].below_best(other, value) < 0.03,
        lambda curves: (
            f"below the highest: {highest} {_percent(curves[name].below_best(highest, value))}, "
            f"{other} {_percent(curves[name].below_best(other, value))}"
        ),
    )


def _faster(curves: Curves) -> bool:
    curve = curves["reduction"]
    return curve.by_pixel[0] - curve.by_pixel[-1] > max(curve.by_object[0] - curve.by_object[-1], _EQUAL)


_FIGURE_8 = PublishedSweep(
    figure="8",
    detector="original",
    source="Awrangjeb, Ravanbakhsh & Fraser (2010), section 4.4.1",
    parameters=("ground_tile", "black_share", "vegetation_threshold", "reduction", "colour_similarity"),
    scenes=("fairfield-1", "fairfield-2", "fairfield-3"),
    seeds=3,
    # As printed: the ground of tiles, no tolerance, and no rules against duplicates.
    standard={
        "ground": "tile-dem",
        "colour_from": "shrunk",
        "rise": 0.0,
        "new_share": 0.0,
        "same_overlap": 1.0,
    },
    statements=(
        _Statement(
            "reduction is moderately sensitive, the other four less",
            lambda curves: _widest(curves, "reduction"),
            _ranges,
        ),
        _highest_at("reduction", _OBJECT, 0.2),
        _highest_at("reduction", _PIXEL, 0.1),
        _Statement(
            "at reduction = 0.15 both qualities are slightly below their highest",
            lambda curves: all(curves["reduction"].below_best(index, 0.15) < 0.03 for index in (_OBJECT, _PIXEL)),
            lambda curves: "below by " + " / ".join(
                _percent(curves["reduction"].below_best(index, 0.15)) for index in (_OBJECT, _PIXEL)
            ),
        ),
        _Statement(
            "with a larger reduction pixel quality drops faster than object quality",
            _faster,
            lambda curves: "from the first to the last value: object "
            f"{_percent(curves['reduction'].by_object[0] - curves['reduction'].by_object[-1])}, pixel "
            f"{_percent(curves['reduction'].by_pixel[0] - curves['reduction'].by_pixel[-1])}",
        ),
        _highest_at("colour_similarity", _OBJECT, 0.4),
        _highest_at("colour_similarity", _PIXEL, 0.4),
        _compromise("ground_tile", 450, _PIXEL, _OBJECT),
        _compromise("vegetation_threshold", 48, _PIXEL, _OBJECT),
        _compromise("black_share", 0.9, _OBJECT, _PIXEL),
    ),
)  # fmt: skip
PUBLISHED_SWEEPS: Final = (_FIGURE_8,)


def published_sweep(detector: str, figure: str) -> PublishedSweep:
    """Return the figure of a detector's paper.

    Raises
    ------
    UnknownNameError
        No such figure; the message names those there are.
    """
    for item in PUBLISHED_SWEEPS:
        if (item.detector, item.figure) == (detector, figure):
            return item
    known = ", ".join(f"figure {item.figure} of {item.detector}" for item in PUBLISHED_SWEEPS)
    raise UnknownNameError(f"{detector}: no figure {figure!r} that a sweep repeats; there is {known}")


def published_axes(suite: Suite, figure: PublishedSweep) -> tuple[Suite, list[Axis]]:
    """Return the suite with the figure's standard values where none are given, and the axes of its parameters."""
    entry = suite.detectors[0]
    suite = replace(suite, detectors=(DetectorEntry(entry.detector.with_defaults(figure.standard), entry.seeds),))
    return suite, axes_of(figure.parameters, suite)


def axes_of(texts: Iterable[str], suite: Suite) -> list[Axis]:
    """Return the axes of ``NAME=VALUES`` (see `sweep.axis_of`) or ``NAME``, which takes the declared values.

    Raises
    ------
    ParameterError
        An axis that cannot be read, or a parameter that declares no values.
    """
    return [axis_of(text) if "=" in text else _declared_axis(text, suite) for text in texts]


def _declared_axis(name: str, suite: Suite) -> Axis:
    for entry in suite.detectors:
        rule = entry.detector.parameters().get(name)
        if rule is not None and rule.swept:
            return Axis(name, tuple(rule.swept))
    raise ParameterError(f"vary={name!r} declares no values: write {name}=VALUE,VALUE,... or {name}=FROM:TO:STEP")


def curves_of(table: pd.DataFrame, figure: PublishedSweep, detector: str) -> dict[str, Curve]:
    """Return the curves of a sweep's tidy table, of one detector by label; parameters without means are left out."""
    curves = {}
    evaluator = make_evaluator()
    own = table[table["detector"] == detector]
    for name in figure.parameters:
        if name not in own:
            continue
        line = own[own["axis"] == name]
        means: dict[str, dict[Any, float]] = {}
        for index in (_OBJECT, _PIXEL):
            known = line[line["index"] == evaluator.index(_SYMBOLS[index]).key].dropna(subset=["mean"])
            means[index] = dict(zip(known[name], known["mean"], strict=True))
        values = tuple(value for value in means[_OBJECT] if value in means[_PIXEL])
        if values:
            curves[name] = Curve(
                tuple(float(value) for value in values),
                tuple(means[_OBJECT][value] for value in values),
                tuple(means[_PIXEL][value] for value in values),
            )
    return curves
