"""Blocks of connected groups of sets whose overlaps were found part by part; see `spatial_blocks`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..overlay.partition import PartGraph
from .blocks import Blocks, linked_blocks

__all__ = ["part_blocks"]


def part_blocks(pairs: PartGraph, couples: Sequence[tuple[int, int]]) -> Blocks:
    """Divide the stores of `pairs` into blocks of whole connected groups; `couples` are all couples of their places."""
    links = {}
    for place in range(len(pairs.stores)):
        within = pairs.within(place)
        links[place, place] = np.stack([within.first, within.second])
    for one, two in couples:
        overlaps = pairs.between(one, two).overlaps
        links[one, two] = np.stack([overlaps.first, overlaps.second])
    sides = [store.objects for store in pairs.stores]
    return linked_blocks(links, [side.building_codes for side in sides], [side.centres for side in sides])
