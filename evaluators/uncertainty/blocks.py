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
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ...scenes.geodata.footprints import Footprints
from ..overlay.overlaps import overlaps_between, overlaps_within

__all__ = ["MOST_BLOCKS", "Blocks", "spatial_blocks"]

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
    starts = np.cumsum([0, *map(len, sets)])
    links = [np.empty((2, 0), dtype=np.int64)]
    for place, (own, start) in enumerate(zip(sets, starts.tolist(), strict=False)):
        pairs = overlaps_within(own)
        links.append(np.stack([pairs.first, pairs.second]) + start)
        if own.building_ids is not None:
            links.append(_same_building(own.building_codes) + start)
        for other, further in zip(sets[place + 1 :], starts[place + 1 : -1].tolist(), strict=True):
            pairs = overlaps_between(own, other)
            links.append(np.stack([pairs.first + start, pairs.second + further]))
    rows, columns = np.concatenate(links, axis=1)
    total = int(starts[-1])
    graph = coo_array((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(total, total))
    groups, found = connected_components(graph, directed=False) if total else (0, np.empty(0))
    label: NDArray[np.int64] = np.asarray(found, dtype=np.int64)
    centres = np.concatenate([np.empty((0, 2)), *(own.centres for own in sets)])
    block = _halved(_group_centres(centres, label, groups), most)
    return Blocks(
        labels=tuple(np.split(block[label], starts[1:-1])),
        count=int(block.max(initial=-1)) + 1,
        groups=groups,
    )


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
