"""Figures as SVG inside a page, with the text colour and font of the page, so that they follow its theme.

Draw with `INK` for lines and text and `FAINT` for grids; both are replaced by the colours of the page.
"""

from __future__ import annotations

import io
import re
from collections.abc import Sequence

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.text import Text

__all__ = ["FAINT", "INK", "SERIES", "new_figure", "style_axes", "to_inline_svg"]

#: Placeholders that no picture contains by chance.
INK, FAINT = "#123457", "#cbd5e3"
#: Colours of lines and markers (Okabe & Ito), each with its own marker, so that they differ without colour, too.
SERIES: tuple[tuple[str, str], ...] = (
    ("#0072B2", "o"),
    ("#D55E00", "s"),
    ("#009E73", "^"),
    ("#CC79A7", "D"),
    ("#E69F00", "v"),
    ("#56B4E9", "P"),
    ("#8a7f00", "X"),
    ("#7f7f7f", "*"),
)
_METADATA = ("Date", "Creator", "Type", "Format")
_STYLE = re.compile(r"<defs>\s*<style.*?</style>\s*</defs>", re.DOTALL)
_SIZE = re.compile(r'(<svg\b[^>]*?) width="[^"]*" height="[^"]*"|(<svg\b[^>]*?) height="[^"]*" width="[^"]*"')


def new_figure(width: float, height: float) -> Figure:
    """Return a figure without background; inches, of which a page shows some 80 pixels each."""
    figure = Figure(figsize=(width, height), layout="constrained")
    figure.patch.set_alpha(0)
    return figure


def style_axes(axes: Axes) -> None:
    """Give axes the page's colours: a faint grid behind, no frame at the top and right."""
    axes.patch.set_alpha(0)
    axes.set_axisbelow(True)
    axes.grid(color=FAINT, linewidth=0.7)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(FAINT)
    axes.tick_params(colors=INK, labelsize=9, length=3, width=0.7, which="both")
    axes.xaxis.label.set_fontsize(9.5)
    axes.yaxis.label.set_fontsize(9.5)


def to_inline_svg(figure: Figure, *, name: str, description: Sequence[str] | str) -> str:
    """Return a figure as an ``<svg>`` element: text stays text, ids are made unique by `name`, same input same output.

    Parameters
    ----------
    figure : Figure
    name : str
        Letters and digits; a prefix for every id, so that figures on a page do not refer to each other's parts.
    description : str
        What is seen, for those who cannot see it.
    """
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        text.set_parse_math(False)  # a name with two dollar signs is not a formula
        if to_hex(text.get_color()) == "#000000":
            text.set_color(INK)
    file = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": name, "font.family": "DejaVu Sans"}):
        figure.savefig(file, format="svg", transparent=True, metadata=dict.fromkeys(_METADATA))
    svg = file.getvalue()
    svg = _STYLE.sub("", svg[svg.index("<svg") :])
    svg = _SIZE.sub(lambda match: match[1] or match[2], svg, count=1)
    svg = re.sub(r' (id|clip-path|xlink:href)="(url\(#|#)?', lambda m: f' {m[1]}="{m[2] or ""}{name}-', svg)
    svg = re.sub(r"font(-family)?: [^;\"]*?([\d.]+px)? ?'DejaVu Sans'[^;\"]*", _font, svg)
    svg = svg.replace(INK, "currentColor").replace(FAINT, "var(--line)")
    words = description if isinstance(description, str) else " ".join(description)
    label = words.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
    return svg.replace("<svg", f'<svg class="chart" role="img" aria-label="{label}"', 1)


def _font(match: re.Match[str]) -> str:
    return f"font-size: {match[2]}" if match[2] else "font-weight: 400"
