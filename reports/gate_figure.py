"""The gate as a picture: the paired difference of every index with its interval, against the margin."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from ..benchmark.analysis.results import GateResult, IndexConclusion
from .format import shortened
from .inline_svg import FAINT, INK, new_figure, style_axes

__all__ = ["gate_figure"]

#: Conclusion to (colour, marker).
_STYLE = {
    "better": ("#009E73", "^"),
    "worse": ("#D55E00", "v"),
    "equal": ("#0072B2", "o"),
    "undecided": ("#E69F00", "D"),
    "not measurable": ("#7f7f7f", "x"),
}


def gate_figure(result: GateResult) -> Figure:
    """Return a panel per detector: a line per index, differences in units of its margin, positive is better."""
    detectors = list(dict.fromkeys(found.detector for found in result.conclusions))
    most = max((len(_of(result, detector)) for detector in detectors), default=1)
    columns = min(2, max(len(detectors), 1))
    rows = -(-max(len(detectors), 1) // columns)
    figure = new_figure(4.8 * columns + 0.6, rows * (0.34 * most + 1.0) + 0.5)
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes in grid.flat[len(detectors) :]:
        axes.set_visible(False)
    for axes, detector in zip(grid.flat, detectors, strict=False):
        style_axes(axes)
        own = _of(result, detector)
        n = sorted({found.scenes for found in own})
        span = f"{n[0]}" if len(n) == 1 else f"{n[0]}–{n[-1]}"
        axes.set_title(f"{shortened(detector)}: n = {span} paired scenes", loc="left", fontsize=10)
        axes.axvspan(-1, 1, color=FAINT, alpha=0.45, linewidth=0)
        axes.axvline(0, color=INK, linewidth=0.8)
        for place, found in enumerate(own):
            colour, marker = _STYLE[found.conclusion]
            unit = found.margin or 1.0
            if found.low is not None and found.high is not None:
                axes.plot([found.low / unit, found.high / unit], [place, place], color=colour, linewidth=2, alpha=0.6)
            if found.effect is not None:
                axes.plot(found.effect / unit, place, marker=marker, color=colour, markersize=6.5, linestyle="none")
        axes.set_yticks(range(len(own)), [f"{found.index.title}: {found.conclusion}" for found in own])
        axes.set_ylim(len(own) - 0.4, -0.6)
        axes.set_xlabel("mean paired difference in margins\n(positive is better; bars: 95 %)")
    return figure


def _of(result: GateResult, detector: str) -> Sequence[IndexConclusion]:
    return [found for found in result.conclusions if found.detector == detector]
