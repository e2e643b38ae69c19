"""Blocks: the units that are drawn when one comparison is resampled.

Nouns
-----
connected group
    Footprints that reach each other by shared area, on either side, or by a common building id. What an object counts
    as depends only on the objects of its group, so the tallies of groups add up to those of the whole.
block
    Connected groups that lie beside each other. Neighbouring buildings are found or missed for the same reasons (trees,
    slope, point spacing), so blocks and not single objects are drawn.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ...scenes.geodata.footprints import Footprints
from ..overlay.overlaps import Overlaps, overlaps_between, overlaps_within

__all__ = ["MOST_BLOCKS", "Blocks", "linked_blocks", "spatial_blocks"]

#: Default maximum number of blocks: enough for percentiles, and few, so that a block holds neighbours that are alike.
MOST_BLOCKS = 32

#: Digits after the point (m) to which centres of groups are compared.
_DECIMALS = 6


@dataclass(frozen=True, eq=False)
class Blocks:
    """The block of every footprint of some sets.

    Attributes
    ----------
    labels : tuple of ndarray of int64, one per set, shape (n,)
        Block of each footprint, from 0.
    count : int
        Number of blocks.
    groups : int
        Number of connected groups, which no block cuts.
    """

    labels: tuple[NDArray[np.int64], ...]
    count: int
    groups: int

    def parts(self, place: int, footprints: Footprints) -> list[Footprints]:
        """Return the footprints of each block of the set at `place`."""
        order = np.argsort(self.labels[place], kind="stable")
        bounds = np.searchsorted(self.labels[place][order], np.arange(self.count + 1))
        return [footprints.take(order[low:high]) for low, high in itertools.pairwise(bounds)]


def spatial_blocks(sets: Sequence[Footprints], *, most: int = MOST_BLOCKS) -> Blocks:
    """Divide footprint sets into blocks of whole connected groups.

    Up to `most` groups, each is a block. More groups are halved along the longer side of their extent until there are
    `most` blocks, so all blocks have about the same number of groups.

    Parameters
    ----------
    sets : sequence of Footprints
        In one CRS; groups are connected over all of them.
    most : int
        Maximum number of blocks.

    Examples
    --------
    >>> import shapely
    >>> detected = Footprints.of([shapely.box(0, 0, 9, 9), shapely.box(30, 0, 39, 9)])
    >>> reference = Footprints.of([shapely.box(0, 0, 5, 9), shapely.box(5, 0, 9, 9), shapely.box(60, 0, 69, 9)])
    >>> blocks = spatial_blocks([detected, reference])
    >>> blocks.groups, [labels.tolist() for labels in blocks.labels]
    (3, [[0, 1], [0, 0, 2]])
    """
    links = {}
    for place, own in enumerate(sets):
        links[place, place] = _ends(overlaps_within(own))
        for further, other in enumerate(sets[place + 1 :], place + 1):
            links[place, further] = _ends(overlaps_between(own, other))
    codes = [None if own.building_ids is None else own.building_codes for own in sets]
    return linked_blocks(links, codes, [own.centres for own in sets], most=most)


def linked_blocks(
    links: Mapping[tuple[int, int], NDArray[np.int64]],
    codes: Sequence[NDArray[np.int64] | None],
    centres: Sequence[NDArray[np.float64]],
    *,
    most: int = MOST_BLOCKS,
) -> Blocks:
    """Divide sets whose overlaps are known into blocks of whole connected groups; see `spatial_blocks`.

    Parameters
    ----------
    links : mapping of (int, int) to ndarray of int64, shape (2, n)
        Rows of the pairs that share area, by the places of the two sets.
    codes : sequence of ndarray of int64, shape (n,)
        Building of each footprint of each set; None where each is its own.
    centres : sequence of ndarray, shape (n, 2)
        m.
    most : int
        Maximum number of blocks.
    """
    starts = np.cumsum([0, *map(len, centres)])
    total = int(starts[-1])
    every = [np.empty((2, 0), dtype=np.int64)]
    every += [rows + starts[list(places), None] for places, rows in links.items()]
    every += [_same_building(own) + starts[place] for place, own in enumerate(codes) if own is not None]
    rows, columns = np.concatenate(every, axis=1)
    del every
    graph = coo_array((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(total, total))
    groups, found = connected_components(graph, directed=False) if total else (0, np.empty(0))
    label: NDArray[np.int64] = np.asarray(found, dtype=np.int64)
    middles = np.concatenate([np.empty((0, 2)), *centres])
    block = _halved(_group_centres(middles, label, groups), most)
    return Blocks(
        labels=tuple(np.split(block[label], starts[1:-1])),
        count=int(block.max(initial=-1)) + 1,
        groups=groups,
    )


def _ends(pairs: Overlaps) -> NDArray[np.int64]:
    return np.stack([pairs.first, pairs.second])


def _same_building(codes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return links between successive parts of each building, shape (2, n)."""
    order = np.argsort(codes, kind="stable")
    same = codes[order][1:] == codes[order][:-1]
    return np.stack([order[:-1][same], order[1:][same]])


def _group_centres(centres: NDArray[np.float64], label: NDArray[np.int64], groups: int) -> NDArray[np.float64]:
    size = np.maximum(np.bincount(label, minlength=groups), 1)
    sums = [np.bincount(label, weights=axis, minlength=groups) for axis in centres.T]
    return np.stack(sums, axis=1) / size[:, None]


def _halved(centres: NDArray[np.float64], most: int) -> NDArray[np.int64]:
    """Return the block of each group: halves of halves of equal numbers, until there are `most`."""
    block = np.empty(len(centres), dtype=np.int64)
    # Numbered by place, so that the order of sets and rows does not decide which blocks are drawn.
    centres = np.round(centres, _DECIMALS)
    if len(centres) <= most:
        block[np.lexsort(centres.T)] = np.arange(len(centres))
        return block
    waiting = [(np.arange(len(centres)), most)]
    number = 0
    while waiting:
        rows, wanted = waiting.pop()
        if wanted == 1:
            block[rows] = number
            number += 1
            continue
        here = centres[rows]
        longer = int(np.argmax(np.ptp(here, axis=0)))
        order = rows[np.lexsort((here[:, 1 - longer], here[:, longer]))]
        left = wanted // 2
        cut = round(len(order) * left / wanted)
        waiting += [(order[:cut], left), (order[cut:], wanted - left)]
    return block
