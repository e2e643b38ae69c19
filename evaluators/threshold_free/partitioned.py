"""The threshold-free evaluation of sets that are too large for the memory.

Geometry is on disk, divided by place; the graph of pairs is whole. Matching, counts, areas and verdicts come from the
code that evaluates sets in memory, so the result is the same to the last object, and to the last bit for any division
and any order of the two files. (Only exact ties between candidate pairs are decided by the order of rows, as always.)
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.errors import UnsupportedError
from ..overlay.areas import UnionAreas, tally_areas
from ..overlay.groups import Members
from ..overlay.left_out import LeftOut
from ..overlay.outline_distances import PairDistances
from ..overlay.outline_store import OutlineStore, StoredObjects
from ..overlay.overlaps import Overlaps
from ..overlay.partition import PairTable, PartGraph, find_pairs, united_from_stores
from ..overlay.reference_overlaps import reference_overlap_notes
from .counting import count_buildings, count_objects, natural_overlaps, pair_sums
from .evaluator import ThresholdFree, ThresholdFreeEvaluation
from .object_graph import OverlapGraph, overlap_graph
from .tallies import LiteralAreas, Scenes, ThresholdFreeTallies
from .verdicts import SideVerdicts, find_verdicts

__all__ = ["Links", "block_tallies", "evaluate_links", "evaluate_stores", "link_stores", "require_exact"]


class Links(NamedTuple):
    """The graph of two sides, and the outline distances of its matched pairs."""

    graph: OverlapGraph
    outlines: PairDistances

    def verdicts(self) -> tuple[SideVerdicts, SideVerdicts]:
        """Return the verdicts of the detections and of the references."""
        return find_verdicts(self.graph, self.outlines.outline)


def require_exact(evaluator: ThresholdFree) -> None:
    """Raise `UnsupportedError` where areas are to be counted by pixels."""
    if evaluator.area == "pixels" or evaluator.gsd is not None:
        raise UnsupportedError(
            "an evaluation in parts measures exact areas, not pixels: leave out area='pixels' and gsd="
        )


def evaluate_stores(
    evaluator: ThresholdFree,
    detected: OutlineStore,
    reference: OutlineStore,
    folder: Path,
    *,
    progress: Callable[[int, int], None] = lambda done, total: None,
    executor: Executor | None = None,
) -> tuple[ThresholdFreeEvaluation, Callable[[], tuple[SideVerdicts, SideVerdicts]]]:
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
    executor : Executor, optional
        Where the parts are measured; see `find_pairs`.

    Returns
    -------
    evaluation : ThresholdFreeEvaluation
        Without verdicts, which would need all outlines at once.
    verdicts : callable
        Returns the verdicts of the detections and of the references.

    Raises
    ------
    UnsupportedError
        Areas by pixels.
    """
    require_exact(evaluator)
    pairs = find_pairs((detected, reference), [(0, 1)], folder, progress=progress, executor=executor)
    links = link_stores(evaluator, pairs, (0, 1))
    return evaluate_links(evaluator, links, (detected, reference)), links.verdicts


def link_stores(evaluator: ThresholdFree, pairs: PartGraph, places: tuple[int, int]) -> Links:
    """Match the detections and references of the stores at two places of `pairs`."""
    sides = pairs.stores[places[0]].objects, pairs.stores[places[1]].objects
    within = pairs.within(places[0]), pairs.within(places[1])
    return _linked(evaluator, sides, pairs.between(*places), within)


def evaluate_links(
    evaluator: ThresholdFree, links: Links, stores: tuple[OutlineStore, OutlineStore]
) -> ThresholdFreeEvaluation:
    """Return the evaluation, without verdicts, of the detections and references of two stores."""
    tallies = _tallied(links, partial(united_from_stores, *stores))
    notes = (*reference_overlap_notes(stores[1].objects, links.graph.within[1]), *evaluator.notes_of(tallies))
    return ThresholdFreeEvaluation(evaluator=evaluator, tallies=tallies, notes=notes)


def block_tallies(
    evaluator: ThresholdFree,
    pairs: PartGraph,
    places: tuple[int, int],
    labels: tuple[NDArray[np.int64], NDArray[np.int64]],
    count: int,
) -> list[ThresholdFreeTallies]:
    """Return the tallies of each block of whole connected groups.

    Parameters
    ----------
    evaluator : ThresholdFree
    pairs : PartGraph
    places : tuple of int
        Places of the detections and of the references in its stores.
    labels : tuple of ndarray of int64
        Block of each detection and of each reference.
    count : int
        Number of blocks.
    """
    stores = pairs.stores[places[0]], pairs.stores[places[1]]
    blocks = _Rows.of(labels[0], count), _Rows.of(labels[1], count)
    table = pairs.between(*places)
    between = _Cut.of(table.overlaps, (blocks[0], blocks[1]), count)
    within = [_Cut.of(pairs.within(place), (own, own), count) for place, own in zip(places, blocks, strict=True)]
    tallies = []
    for block in range(count):
        rows = blocks[0].of_block(block), blocks[1].of_block(block)
        sides = stores[0].objects.take(rows[0]), stores[1].objects.take(rows[1])
        here = between.of_block(block)
        part = PairTable(between.overlaps_of(block), table.outline[here], table.polis[here])
        links = _linked(evaluator, sides, part, (within[0].overlaps_of(block), within[1].overlaps_of(block)))
        tallies.append(_tallied(links, partial(_united_of_rows, stores, rows)))
    return tallies


class _Rows(NamedTuple):
    """The rows of one side by block.

    Attributes
    ----------
    label : ndarray of int64, shape (n,)
        Block of each row.
    order : ndarray of int64, shape (n,)
        Rows of the first block, then of the next one; in ascending order within each.
    start : ndarray of int64, shape (blocks + 1,)
        Where each block starts in `order`.
    place : ndarray of int64, shape (n,)
        Place of each row within its block.
    """

    label: NDArray[np.int64]
    order: NDArray[np.int64]
    start: NDArray[np.int64]
    place: NDArray[np.int64]

    @classmethod
    def of(cls, label: NDArray[np.int64], count: int) -> _Rows:
        order = np.argsort(label, kind="stable")
        start = np.searchsorted(label[order], np.arange(count + 1))
        place = np.empty(len(label), dtype=np.int64)
        place[order] = np.arange(len(label)) - start[label[order]]
        return cls(label, order, start, place)

    def of_block(self, block: int) -> NDArray[np.int64]:
        return self.order[self.start[block] : self.start[block + 1]]


class _Cut(NamedTuple):
    """Pairs by block; no block cuts a pair.

    Attributes
    ----------
    overlaps : Overlaps
    sides : tuple of _Rows
    blocks : _Rows
        Of the pairs.
    """

    overlaps: Overlaps
    sides: tuple[_Rows, _Rows]
    blocks: _Rows

    @classmethod
    def of(cls, overlaps: Overlaps, sides: tuple[_Rows, _Rows], count: int) -> _Cut:
        return cls(overlaps, sides, _Rows.of(sides[0].label[overlaps.first], count))

    def of_block(self, block: int) -> NDArray[np.int64]:
        return self.blocks.of_block(block)

    def overlaps_of(self, block: int) -> Overlaps:
        """Return the pairs of a block, in rows of the block."""
        here, every = self.of_block(block), self.overlaps
        first, second = self.sides[0].place[every.first[here]], self.sides[1].place[every.second[here]]
        return Overlaps(first, second, every.area[here], every.significant[here])


def _united_of_rows(
    stores: tuple[OutlineStore, OutlineStore],
    rows: tuple[NDArray[np.int64], NDArray[np.int64]],
    kind: str,
    members: Members,
) -> NDArray[np.float64]:
    """Return the area of the union of each group of members that are given by their place in `rows`."""
    one = rows[1 if kind == "reference" else 0][members.one]
    two = members.two.copy()
    two[two >= 0] = rows[1][two[two >= 0]]
    return united_from_stores(*stores, kind, Members(members.start, one, two))


def _linked(
    evaluator: ThresholdFree,
    sides: tuple[StoredObjects, StoredObjects],
    table: PairTable,
    within: tuple[Overlaps, Overlaps],
) -> Links:
    table = table.only_significant()
    graph = overlap_graph(
        *sides,
        table.overlaps,
        within,
        matching=evaluator.matching,
        minimum_area=evaluator.minimum_area,
    )
    pairs = graph.correspondence.pairs
    place = table.places(*pairs, len(sides[1]))
    by_corners = sides[0].quadrilateral[pairs[0]] & sides[1].quadrilateral[pairs[1]]
    return Links(graph, PairDistances(table.outline[place], by_corners, table.polis[place]))


def _tallied(links: Links, united: UnionAreas) -> ThresholdFreeTallies:
    graph = links.graph
    match = graph.correspondence
    exact = partial(
        tally_areas,
        (graph.detected.areas, graph.reference.areas),
        match.pairs,
        graph.overlaps.area[graph.matched_overlaps],
        false_positives=np.flatnonzero(graph.detections.mask & (match.assigned_to < 0)),
        false_negatives=np.flatnonzero(graph.references.mask & (match.of_reference < 0)),
        united=united,
    )
    return ThresholdFreeTallies(
        counts=count_objects(graph),
        buildings=count_buildings(graph),
        scenes=Scenes(all=1, by_pixels=0),
        left_out=LeftOut.of(graph.detections, graph.references),
        areas=exact(within=graph.within),
        literal_areas=LiteralAreas.of(exact(within=natural_overlaps(graph, graph.within))),
        geometric=pair_sums(graph, links.outlines, None),
        iou=ThresholdFreeTallies().iou.filled(graph.pair_iou),
    )
