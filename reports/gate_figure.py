"""The gate as a picture: the paired difference of every index with its interval, against the margin."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from .gate_text import GateResult, IndexVerdict
from .inline_svg import FAINT, INK, new_figure, shortened, style_axes

__all__ = ["gate_figure"]

#: Verdict to (colour, marker).
_STYLE = {
    "better": ("#009E73", "^"),
    "worse": ("#D55E00", "v"),
    "equal": ("#0072B2", "o"),
    "undecided": ("#E69F00", "D"),
    "not measurable": ("#7f7f7f", "x"),
}


def gate_figure(result: GateResult) -> Figure:
    """Return a panel per detector: a line per index, differences in units of its margin, positive is better."""
    detectors = list(dict.fromkeys(verdict.detector for verdict in result.verdicts))
    most = max((len(_of(result, detector)) for detector in detectors), default=1)
    columns = min(2, max(len(detectors), 1))
    rows = -(-max(len(detectors), 1) // columns)
    figure = new_figure(4.8 * columns + 0.6, rows * (0.34 * most + 1.0) + 0.5)
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes in grid.flat[len(detectors) :]:
        axes.set_visible(False)
    for axes, detector in zip(grid.flat, detectors, strict=False):
        style_axes(axes)
        mine = _of(result, detector)
        n = sorted({verdict.scenes for verdict in mine})
        span = f"{n[0]}" if len(n) == 1 else f"{n[0]}–{n[-1]}"
        axes.set_title(f"{shortened(detector)}: n = {span} paired scenes", loc="left", fontsize=10)
        axes.axvspan(-1, 1, color=FAINT, alpha=0.45, linewidth=0)
        axes.axvline(0, color=INK, linewidth=0.8)
        for place, verdict in enumerate(mine):
            colour, marker = _STYLE[verdict.verdict]
            unit = verdict.margin or 1.0
            if verdict.low is not None and verdict.high is not None:
                axes.plot(
                    [verdict.low / unit, verdict.high / unit], [place, place], color=colour, linewidth=2, alpha=0.6
                )
            if verdict.effect is not None:
                axes.plot(verdict.effect / unit, place, marker=marker, color=colour, markersize=6.5, linestyle="none")
        axes.set_yticks(range(len(mine)), [f"{verdict.index.title}: {verdict.verdict}" for verdict in mine])
        axes.set_ylim(len(mine) - 0.4, -0.6)
        axes.set_xlabel("mean paired difference in margins\n(positive is better; bars: 95 %)")
    return figure


def _of(result: GateResult, detector: str) -> Sequence[IndexVerdict]:
    return [verdict for verdict in result.verdicts if verdict.detector == detector]
