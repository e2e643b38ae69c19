"""Blocks never cut what belongs together, and the tallies of blocks add up to those of the whole."""

import functools
import operator

import numpy as np
import pytest
import shapely
from builders.footprint_sets import random_detections, random_reference
from harness.effort import examples
from hypothesis import given
from hypothesis import strategies as st

import roofbench as rb
from roofbench.evaluators.registry import EVALUATORS, make_evaluator
from roofbench.evaluators.uncertainty.blocks import spatial_blocks
from roofbench.evaluators.uncertainty.intervals import block_tallies

#: Follow from no sum over blocks: a mean over scenes, and how many scenes there are.
OF_SCENES = {"scenes.all", "scenes.by_pixels", "scene.scenes_with_corners", "scene.n_ratios"}


def random_sets(seed, *, clusters=4):
    """Return detections and references of several small scenes beside each other."""
    rng = np.random.default_rng(seed)
    detected, reference, building = [], [], []
    for number in range(clusters):
        polygons, ids = random_reference(rng, general=True)
        shift = [300 * (number % 2), 300 * (number // 2)]
        for side, found in ((reference, polygons), (detected, random_detections(rng, polygons))):
            side += [shapely.transform(polygon, lambda xy, shift=shift: xy + shift) for polygon in found]
        building += [f"{number}-{one}" for one in ids]
    return rb.Footprints.of(detected), rb.Footprints.of(reference, building_ids=building)


def naive_groups(sets):
    """Return the connected groups by looking at every pair of objects, again and again."""
    polygons = np.concatenate([own.polygons for own in sets])
    ids = [
        (place, own.building_ids[row]) if own.building_ids is not None else None
        for place, own in enumerate(sets)
        for row in range(len(own))
    ]
    label = list(range(len(polygons)))
    changed = True
    while changed:
        changed = False
        for i, one in enumerate(polygons):
            for j, two in enumerate(polygons[:i]):
                linked = (ids[i] is not None and ids[i] == ids[j]) or one.intersection(two).area > 0
                if linked and label[i] != label[j]:
                    label[i] = label[j] = min(label[i], label[j])
                    changed = True
    return label


@examples(10)
@given(st.integers(0, 10**6), st.sampled_from([2, 3, 128]))
def test_no_block_cuts_a_connected_group(seed, most):
    sets = random_sets(seed)
    blocks = spatial_blocks(sets, most=most)
    groups, block = naive_groups(sets), np.concatenate(blocks.labels).tolist()
    assert blocks.groups == len(set(groups))
    assert blocks.count == min(most, blocks.groups) == len(set(block))
    assert all(len({b for b, g in zip(block, groups, strict=True) if g == group}) == 1 for group in set(groups))


@pytest.mark.parametrize("name", EVALUATORS.names())
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_tallies_of_blocks_add_up_to_those_of_the_whole(name, seed):
    sets = random_sets(seed, clusters=6)
    area = shapely.box(10, -20, 480, 700)
    evaluator = make_evaluator(name)
    blocks = spatial_blocks(sets, most=7)
    every = block_tallies(evaluator, sets, (0, 1), blocks, area=area)
    total = functools.reduce(operator.add, every)
    whole = evaluator.evaluate(*sets, area=area)
    pooled = evaluator.summarise(total)
    for key, value in whole.tallies.to_dict().items():
        if isinstance(value, int | float) and key not in OF_SCENES:
            assert total.to_dict()[key] == pytest.approx(value, rel=1e-9, abs=1e-6), key
    for key, value in whole.values.items():
        if key != "complexity.n_ratio_mean":
            assert pooled.values[key] == (None if value is None else pytest.approx(value, rel=1e-6, abs=1e-9)), key


def test_blocks_are_compact_and_of_equal_numbers_of_groups():
    houses = rb.Footprints.of(
        [shapely.box(20 * k, 20 * row, 20 * k + 9, 20 * row + 9) for k in range(16) for row in range(4)]
    )
    blocks = spatial_blocks([houses, houses], most=8)
    (one, two) = blocks.labels
    assert one.tolist() == two.tolist()
    assert np.bincount(one).tolist() == [8] * 8
    extents = [np.ptp(houses.centres[one == number], axis=0) for number in range(8)]
    assert np.max(extents) <= 60


def test_nothing_has_no_block():
    blocks = spatial_blocks([rb.Footprints.empty(), rb.Footprints.empty()])
    assert (blocks.count, blocks.groups) == (0, 0)
