"""A published figure of sensitivity, repeated: the figure, its values and what the paper's text says about it."""

from __future__ import annotations

from matplotlib.figure import Figure

from ..benchmark.analysis.published_sweep import Curve, Finding, PublishedSweep
from .tables import Column, Table

__all__ = ["curve_table", "finding_table", "published_sweep_figure"]


def published_sweep_figure(figure: PublishedSweep, curves: dict[str, Curve], title: str) -> Figure:
    """Draw the qualities by the number of the value, as the paper does: object quality left, pixel quality right."""
    drawn = Figure(figsize=(11, 3.8))
    panels = drawn.subplots(1, 2, sharex=True)
    for name, curve in curves.items():
        for panel, means in zip(panels, (curve.by_object, curve.by_pixel), strict=True):
            panel.plot(range(1, len(means) + 1), [100 * mean for mean in means], marker="o", label=name)
    for panel, name in zip(panels, ("object quality Q_l, %", "pixel quality Q_lp, %"), strict=True):
        panel.set_title(name, fontsize=10)
        panel.set_xlabel("number of the value")
        panel.set_xticks(range(1, max((len(curve.values) for curve in curves.values()), default=1) + 1))
        panel.grid(alpha=0.3)
    panels[1].legend(fontsize=8, loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False)
    drawn.suptitle(f"{title}: figure {figure.figure} of {figure.source}", fontsize=10)
    drawn.tight_layout()
    return drawn


def curve_table(curves: dict[str, Curve]) -> Table:
    """Return one row per parameter and value, qualities in per cent."""
    columns = [Column("parameter", "left"), *(Column(name) for name in ("value", "Q_l", "Q_lp"))]
    rows = [
        [name, f"{value:g}", f"{100 * by_object:.1f}", f"{100 * by_pixel:.1f}"]
        for name, curve in curves.items()
        for value, by_object, by_pixel in zip(curve.values, curve.by_object, curve.by_pixel, strict=True)
    ]
    return Table.of(columns, rows)


def finding_table(findings: list[Finding]) -> Table:
    """Return one row per statement of the paper."""
    columns = [Column(name, "left") for name in ("the paper says", "reproduced", "measured here, points of per cent")]
    rows = [[found.statement, "yes" if found.reproduced else "no", found.measured] for found in findings]
    return Table.of(columns, rows)
