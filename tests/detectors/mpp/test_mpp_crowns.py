"""Crowns between houses are no roof: pairs of houses whose gap of some metres is full of leaves up to the ridge."""

import numpy as np
import pytest
import shapely

import roofbench as rb

RIDGE, EAVES, WIDTH, LENGTH = 8.0, 5.2, 9.0, 12.0
SIZE = (180.0, 135.0)


def pairs_of_houses(gap, to_ground, *, crowns=True, density=6.0, seed=1):
    """Pairs of gable roofs with crowns between them, free trees elsewhere; to_ground: share of pulses that pass."""
    rng = np.random.default_rng(seed)
    centres = [(30.0 + 60 * i, 22.0 + 45 * j) for j in range(3) for i in range(3)]
    houses = [(x + side * (gap + WIDTH) / 2, y) for x, y in centres for side in (-1, 1)]
    trees = [(x, y + step, max(gap / 2, 1.2) * 1.1) for x, y in centres for step in (-4.5, -1.5, 1.5, 4.5) if crowns]
    while len(trees) < 36 * crowns + 20:
        x, y = rng.uniform(8, SIZE[0] - 8), rng.uniform(8, SIZE[1] - 8)
        if all(abs(x - a) > WIDTH / 2 + 4 or abs(y - b) > LENGTH / 2 + 4 for a, b in houses):
            trees.append((x, y, rng.uniform(1.5, 3.5)))
    many = int(density * SIZE[0] * SIZE[1])
    x, y, top = rng.uniform(0, SIZE[0], many), rng.uniform(0, SIZE[1], many), np.zeros(many)
    leaves = np.zeros(many, bool)
    for a, b, radius in trees:
        share = np.clip(1 - ((x - a) ** 2 + (y - b) ** 2) / radius**2, 0, None)
        leaves |= share > 0
        top = np.maximum(top, np.where(share > 0, RIDGE * (0.65 + 0.35 * np.sqrt(share)), 0))
    for a, b in houses:
        inside = (abs(x - a) < WIDTH / 2) & (abs(y - b) < LENGTH / 2)
        leaves &= ~inside
        top = np.where(inside, RIDGE - (RIDGE - EAVES) * abs(x - a) / (WIDTH / 2), top)
    first = top + rng.normal(0, 0.03, many) - leaves * np.minimum(rng.exponential(0.5, many), 0.5 * top)
    to_ground = leaves & (rng.random(many) < to_ground)
    parted = to_ground | (leaves & (rng.random(many) < 0.6))
    second = np.where(to_ground, rng.normal(0, 0.04, many), first - rng.uniform(0.5, 2.0, many))
    numbers = np.concatenate([1 + parted, np.full(parted.sum(), 2)]).astype(np.uint8)
    order = np.concatenate([np.ones(many), np.full(parted.sum(), 2)]).astype(np.uint8)
    cloud = rb.PointCloud(
        *(np.concatenate([values, values[parted]]) for values in (x, y)),
        np.concatenate([first, second[parted]]) + 100,
        return_number=order,
        number_of_returns=numbers,
    )
    boxes = [shapely.box(a - WIDTH / 2, b - LENGTH / 2, a + WIDTH / 2, b + LENGTH / 2) for a, b in houses]
    reference = rb.Footprints.of(np.array(boxes, dtype=object), crs="EPSG:25832")
    return rb.Scene("pairs", (0.0, 0.0, *SIZE), crs="EPSG:25832", points=cloud, reference=reference)


@pytest.mark.parametrize(("gap", "to_ground"), [(2.5, 0.0), (2.5, 0.2), (5.0, 0.0), (5.0, 0.2)])
def test_houses_stay_apart_where_crowns_as_high_as_their_ridges_fill_the_gap(gap, to_ground):
    scene = pairs_of_houses(gap, to_ground)
    for level in ("building", "block"):
        found = rb.detect(scene, f"mpp[level={level}]")
        evaluation = rb.evaluate(found, scene.reference)
        assert evaluation.object.completeness == 1.0
        assert evaluation.pixel.quality > 0.9


def test_houses_stay_apart_without_crowns():
    scene = pairs_of_houses(2.5, 0.0, crowns=False)
    assert rb.evaluate(rb.detect(scene, "mpp"), scene.reference).object.quality == 1.0
