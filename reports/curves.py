"""Curves and histograms of an evaluation, such as the share of references covered against the required overlap."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from ..evaluators.base import Evaluation
from ..evaluators.index import Curve
from .format import unit_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["curve_panels", "draw_curves"]

_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
_DASHES = ("-", "--", ":", "-.")


def curve_panels(evaluation: Evaluation) -> list[tuple[Curve, ...]]:
    """Return the curves that are drawn together: lines of one panel with the same units, each histogram alone."""
    panels: list[tuple[Curve, ...]] = []
    units = groupby(evaluation.evaluator.curves, lambda curve: (curve.panel, curve.x_unit, curve.y_unit, curve.bars))
    for (*_, bars), some in units:
        found = tuple(some)
        panels += [(curve,) for curve in found] if bars else [found]
    return panels


def draw_curves(axes: Axes, evaluation: Evaluation, curves: Sequence[Curve]) -> None:
    """Draw one panel; fractions are shown in percent.

    Parameters
    ----------
    axes : matplotlib Axes
    evaluation : Evaluation
    curves : sequence of Curve
        One of the panels that `curve_panels` returns.
    """
    for curve, colour, dashes in zip(curves, _COLOURS * len(curves), _DASHES * len(curves), strict=False):
        x, y = evaluation.curves[curve.key]
        scale_x, scale_y = (100.0 if unit == "fraction" else 1.0 for unit in (curve.x_unit, curve.y_unit))
        if curve.bars:
            axes.stairs(scale_y * y, scale_x * x, fill=True, color=colour)
        else:
            axes.plot(scale_x * x, scale_y * y, color=colour, linestyle=dashes, label=curve.title)
    first = curves[0]
    axes.set_xlabel(_label((curve.x for curve in curves), first.x_unit), fontsize=8)
    axes.set_ylabel(_label((curve.y for curve in curves), first.y_unit), fontsize=8)
    if first.y_unit == "fraction":
        axes.set_ylim(0, 105)
    axes.tick_params(labelsize=8)
    axes.grid(color="#DDDDDD", linewidth=0.5)
    axes.set_axisbelow(True)
    if len(curves) > 1:
        axes.legend(fontsize=7, frameon=False)


def _label(names: Iterable[str], unit: str) -> str:
    sign = "m²" if unit == "m2" else unit_text(unit)
    name = " / ".join(dict.fromkeys(names))
    return f"{name} ({sign})" if sign else name
