"""Maps of comparisons in parts: the maps of whole files where objects can be seen, else maps of cells.

Of a nation no object is seen on a map, and its outlines do not fit into the memory. A cell map shows in square cells
what its objects amount to: object quality, or what only one of two detections finds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from matplotlib.colors import Colormap, LinearSegmentedColormap
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..evaluators.base import Evaluation
from ..evaluators.in_parts import FileComparison, FileStores, SideVerdicts
from ..evaluators.uncertainty.paired_files import PairedFiles
from ..evaluators.verdict_table import Verdicts
from .format import shortened
from .map_elements import add_scale_bar
from .pair_map import pair_figure
from .pair_text import objects_line
from .verdict_map import verdict_figure
from .verdict_style import FATE_LOOKS

__all__ = ["file_figure", "paired_files_figure"]

#: Most footprints that are drawn one by one.
_MOST_DRAWN = 100_000
#: Cells along the longer side of a cell map.
_CELLS = 200


def file_figure(comparison: FileComparison, *, title: str) -> Figure:
    """Return the map of two files: of every object as `verdict_figure`, or of the object quality in cells."""
    files, sides = comparison.files, comparison.verdicts()
    if files.count <= _MOST_DRAWN:
        return verdict_figure(_with_verdicts(comparison.evaluation, sides, files, (0, 1)), title=title)
    detected, reference = (store.objects.centres for store in files.stores)
    evaluator = comparison.evaluation.evaluator
    correct, wrong = (
        [kind.key for kind in evaluator.kinds_of("reference") if kind.counts_as == counted]
        for counted in ("correct", "wrong")
    )
    false = [kind.key for kind in evaluator.kinds_of("detection") if kind.counts_as == "wrong"]
    right = reference[sides[1].where(*correct)]
    every = [reference[sides[1].where(*correct, *wrong)], detected[sides[0].where(*false)]]
    ratio = f"{'+'.join(correct)} / ({' + '.join([*correct, *false, *wrong])})"
    heading = f"{shortened(title, 150)}\nobject quality, {ratio}, by cell"
    return _cell_figure([right], every, heading, "object quality (%)", ("viridis", (0, 100)))


def paired_files_figure(found: PairedFiles, *, title: str) -> Figure:
    """Return the map of two detections: of every object as `pair_figure`, or of what only one finds in cells."""
    files, comparison = found.files, found.comparison
    if files.count <= _MOST_DRAWN:
        sides = [
            _with_verdicts(evaluation, found.verdicts(place), files, (place, 2))
            for place, evaluation in enumerate((comparison.first, comparison.second))
        ]
        return pair_figure(replace(comparison, first=sides[0], second=sides[1]), title=title)
    assert comparison.fates is not None
    centres = files.stores[2].objects.centres
    one, two = (centres[comparison.fates == fate] for fate in ("only A", "only B"))
    counted = centres[comparison.fates != "left out"]
    heading = f"{shortened(title, 170)}\n{objects_line(comparison)}"
    colours = [FATE_LOOKS["only A"].colour, "#FFFFFF", FATE_LOOKS["only B"].colour]
    colour_map = LinearSegmentedColormap.from_list("only one", colours)
    label = "references that only B finds less those that only A finds (%)"
    return _cell_figure([two, one], [counted], heading, label, (colour_map, (-100, 100)))


def _with_verdicts(
    evaluation: Evaluation,
    sides: tuple[SideVerdicts, SideVerdicts],
    files: FileStores,
    places: tuple[int, int],
) -> Evaluation:
    """Return an evaluation of files with its verdicts and footprints."""
    verdicts = Verdicts(
        kinds=evaluation.evaluator.verdict_kinds,
        measures=evaluation.evaluator.measures,
        detection_table=sides[0].whole(),
        reference_table=sides[1].whole(),
        detected=files.footprints(places[0]),
        reference=files.footprints(places[1]),
    )
    return replace(evaluation, find_verdicts=lambda: verdicts)


def _cell_figure(
    signed: Sequence[NDArray[np.float64]],
    every: Sequence[NDArray[np.float64]],
    heading: str,
    label: str,
    scale: tuple[str | Colormap, tuple[float, float]],
) -> Figure:
    """Return a map of square cells.

    Parameters
    ----------
    signed : sequence of ndarray, shape (n, 2)
        Centres of the objects that are counted for a cell, and of those that are counted against it.
    every : sequence of ndarray, shape (n, 2)
        Centres of all objects that the count is divided by; the first ones, the references, decide what is shown.
    heading, label : str
    scale : tuple
        Colour map, and the least and largest percentage.
    """
    shown = next(points for points in (*every, np.zeros((1, 2))) if len(points))
    low, high = shown.min(axis=0), shown.max(axis=0)
    size = max(float((high - low).max()) / _CELLS, 1.0)
    columns, rows = (np.floor((high - low) / size).astype(int) + 1).tolist()

    def counts(points: NDArray[np.float64]) -> NDArray[np.int64]:
        inside = ((points >= low) & (points <= high)).all(axis=1)
        cells = np.floor((points[inside] - low) / size).astype(np.int64)
        found: NDArray[np.int64] = np.bincount(cells[:, 1] * columns + cells[:, 0], minlength=rows * columns)
        return found.reshape(rows, columns)

    total = np.sum([counts(points) for points in every], axis=0)
    difference = counts(signed[0]) - (counts(signed[1]) if len(signed) > 1 else 0)
    share = np.full((rows, columns), np.nan)
    share[total > 0] = 100 * difference[total > 0] / total[total > 0]
    figure = Figure(figsize=(13, 9), dpi=100, layout="constrained")
    figure.suptitle(heading, x=0.01, ha="left", fontsize=10, parse_math=False)
    axes = figure.subplots()
    extent = (low[0], low[0] + columns * size, low[1], low[1] + rows * size)
    colour_map, (least, most) = scale
    picture = axes.imshow(
        share, origin="lower", extent=extent, cmap=colour_map, vmin=least, vmax=most, interpolation="nearest"
    )
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_facecolor("#EEEEEE")
    add_scale_bar(axes)
    figure.colorbar(picture, ax=axes, label=f"{label}; cells of {size:,.0f} m, grey without objects", shrink=0.8)
    return figure
