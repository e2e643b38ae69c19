"""The threshold-free evaluation of sets that are too large for the memory.

Geometry is on disk, divided by place; the graph of pairs is whole. Matching, counts, areas and verdicts come from the
code that evaluates sets in memory, so the result is the same to the last object, and to the last bit for any division
and any order of the two files. (Only exact ties between candidate pairs are decided by the order of rows, as always.)
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from ...core.errors import UnsupportedError
from ..overlay.areas import tally_areas
from ..overlay.left_out import LeftOut
from ..overlay.outline_distances import PairDistances
from ..overlay.outline_store import OutlineStore
from ..overlay.partition import united_from_stores, whole_graph
from ..overlay.reference_overlaps import reference_overlap_notes
from ..verdict_table import VerdictTable
from .counting import count_buildings, count_objects, natural_overlaps, pair_sums
from .evaluator import ThresholdFree, ThresholdFreeEvaluation
from .object_graph import overlap_graph
from .tallies import LiteralAreas, Scenes, ThresholdFreeTallies
from .verdicts import find_verdicts

__all__ = ["evaluate_stores"]


def evaluate_stores(
    evaluator: ThresholdFree,
    detected: OutlineStore,
    reference: OutlineStore,
    folder: Path,
    *,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[ThresholdFreeEvaluation, Callable[[], tuple[VerdictTable, VerdictTable]]]:
    """Compare two sets on disk.

    Parameters
    ----------
    evaluator : ThresholdFree
    detected, reference : OutlineStore
        Complete, of one division.
    folder : Path
        For what is found in each part, so that an interrupted evaluation goes on.
    progress : callable
        Takes the number of finished parts and of all.

    Returns
    -------
    evaluation : ThresholdFreeEvaluation
        Without verdicts, which would need all outlines at once.
    verdicts : callable
        Returns the verdict tables of both sides.

    Raises
    ------
    UnsupportedError
        Areas by pixels.
    """
    if evaluator.area == "pixels" or evaluator.gsd is not None:
        raise UnsupportedError(
            "an evaluation in parts measures exact areas and no pixels: leave out area='pixels' and gsd="
        )
    table, within = whole_graph(detected, reference, folder, progress)
    sides = detected.objects, reference.objects
    graph = overlap_graph(
        *sides,
        table.overlaps.only_significant,
        within,
        matching=evaluator.matching,
        minimum_area=evaluator.minimum_area,
    )
    pairs = graph.correspondence.pairs
    place = table.places(*pairs, len(sides[1]))
    by_corners = sides[0].quadrilateral[pairs[0]] & sides[1].quadrilateral[pairs[1]]
    outlines = PairDistances(table.outline[place], by_corners, table.polis[place])
    del table
    match = graph.correspondence
    exact = partial(
        tally_areas,
        (sides[0].areas, sides[1].areas),
        pairs,
        graph.overlaps.area[graph.matched_overlaps],
        false_positives=np.flatnonzero(graph.detections.mask & (match.booked_on < 0)),
        false_negatives=np.flatnonzero(graph.references.mask & (match.of_reference < 0)),
        united=partial(united_from_stores, detected, reference),
    )
    tallies = ThresholdFreeTallies(
        counts=count_objects(graph),
        buildings=count_buildings(graph),
        scenes=Scenes(all=1, by_pixels=0),
        left_out=LeftOut.of(graph.detections, graph.references),
        areas=exact(within=within),
        literal_areas=LiteralAreas.of(exact(within=natural_overlaps(graph, within))),
        geometric=pair_sums(graph, outlines, None),
        iou=ThresholdFreeTallies().iou.filled(graph.pair_iou),
    )
    notes = (*reference_overlap_notes(sides[1], within[1]), *evaluator.notes_of(tallies))
    evaluation = ThresholdFreeEvaluation(evaluator=evaluator, tallies=tallies, notes=notes)
    return evaluation, lambda: find_verdicts(graph, outlines.outline)
