"""Average precision against plain loops, against COCO's own program, and where COCO has no answer."""

import numpy as np
import pytest
import shapely
from builders.footprint_sets import random_detections, random_reference
from naive import coco
from naive.evaluation import overlap
from naive.systems import iou

import roofbench as rb
from roofbench.evaluators.average_precision import Ranking

KEYS = ("ap.ap", "ap.ap_50", "ap.ap_75", "ap.ar")


def house(x, width=10.0, y=0.0, depth=10.0):
    return shapely.box(x, y, x + width, y + depth)


def evaluate(detected, reference, scores=None, **more):
    attributes = {} if scores is None else {"confidence": np.asarray(scores)}
    found = rb.Footprints.of(detected, attributes=attributes)
    return rb.evaluate(found, rb.Footprints.of(reference), evaluator="iou", **more)


def image(detected, reference, scores, ignored=()):
    """Return what the plain loops take."""
    counts = [r for r in range(len(reference)) if r not in ignored]
    ious = [{r: iou(one, reference[r]) for r in counts if overlap(one, reference[r])} for one in detected]
    region = [max((iou(one, reference[r]) for r in ignored), default=0.0) for one in detected]
    return ious, scores, region


def town(seed):
    rng = np.random.default_rng(seed)
    reference, _ = random_reference(rng, general=seed % 2 == 0)
    detected = random_detections(rng, reference)
    if not detected or not reference:
        return town(seed + 1000)
    return detected, reference


@pytest.mark.parametrize("seed", range(12))
def test_it_is_that_of_plain_loops_over_several_scenes(seed):
    towns = [town(10 * seed + k) for k in range(3)]
    rng = np.random.default_rng(seed)
    count = sum(len(detected) for detected, _ in towns)
    ranks = (rng.permutation(count) if seed % 2 else rng.integers(0, 4, count)) / 100
    evaluations, images, begin = [], [], 0
    for detected, reference in towns:
        scores = ranks[begin : begin + len(detected)]
        begin += len(detected)
        if seed % 2 == 0:  # of equal scores the detection with the larger IoU is first
            best = [max((iou(one, two) for two in reference), default=0.0) for one in detected]
            order = sorted(range(len(detected)), key=lambda d: -best[d])
            detected, scores = [detected[d] for d in order], scores[order]
        evaluations.append(evaluate(detected, reference, scores, matching="coco"))
        images.append(image(detected, reference, scores.tolist()))
    expected = coco.evaluated(images, sum(len(reference) for _, reference in towns))
    pooled = rb.pool(evaluations)
    assert [pooled.values[key] for key in KEYS] == pytest.approx(expected)


@pytest.mark.parametrize("seed", range(8))
def test_left_out_references_are_ignore_regions_at_each_threshold(seed):
    detected, reference = town(seed)
    limit = float(np.median([polygon.area for polygon in reference]))
    ignored = [r for r, polygon in enumerate(reference) if polygon.area < limit]
    scores = np.random.default_rng(seed).permutation(len(detected)) / 100
    found = evaluate(detected, reference, scores, matching="coco", minimum_area=limit)
    expected = coco.evaluated([image(detected, reference, scores.tolist(), ignored)], len(reference) - len(ignored))
    assert [found.values[key] for key in KEYS] == pytest.approx(expected)


def settled(seed, count=60):
    """Sixty houses, each detected not at all, once or twice, with whole numbers as coordinates; ten false alarms."""
    rng = np.random.default_rng(seed)
    reference = [(30 * (k % 10), 30 * (k // 10), rng.integers(8, 20), rng.integers(8, 20)) for k in range(count)]
    detected = []
    for x, y, width, depth in reference:
        for _ in range(rng.integers(0, 3)):
            dx, dy = rng.integers(-4, 5, 2)
            detected.append((x + dx, y + dy, width + rng.integers(-2, 3), depth + rng.integers(-2, 3)))
    for _ in range(10):
        detected.append((rng.integers(0, 300), rng.integers(0, 300), 10, 10))
    return [[shapely.box(x, y, x + w, y + h) for x, y, w, h in side] for side in (detected, reference)]


#: By faster-coco-eval 1.8.0 (bounding boxes, maxDets 100 000): AP, AP at 0.5, AP at 0.75, AR.
COCO = {
    (0,): (0.0319008597775464, 0.13379751902317688, 0.01449217502395401, 0.135),
    (1,): (0.06115605137984461, 0.2865355324878735, 0.00567632388553611, 0.16333333333333333),
    (2, 3): (0.05317450266419301, 0.19596967865270304, 0.012098212512711998, 0.16),
    (4, 5, 6): (0.04519675653212076, 0.21264616792069482, 0.006520164211543104, 0.15),
}


@pytest.mark.parametrize("seeds", COCO)
def test_it_is_that_of_the_program_of_coco(seeds):
    sides = [settled(seed) for seed in seeds]
    ranks = np.random.default_rng(9).permutation(sum(len(detected) for detected, _ in sides)) / 1000
    places = np.cumsum([len(detected) for detected, _ in sides])[:-1]
    pooled = rb.pool(
        evaluate(*side, scores, matching="coco") for side, scores in zip(sides, np.split(ranks, places), strict=True)
    )
    assert [pooled.values[key] for key in KEYS] == pytest.approx(COCO[seeds], abs=1e-12)


def test_of_references_with_equal_iou_coco_takes_the_last_one():
    # The first detection has the same IoU with both; the second one overlaps the left reference only.
    reference, detected = [house(0), house(12)], [house(3, 16), house(0.5)]
    scores = [0.9, 0.8]
    coco_like = evaluate(detected, reference, scores, matching="coco", threshold=0.3)
    assert coco_like.tallies.counts.true_positives == 2
    assert evaluate(detected, reference, scores, threshold=0.3).tallies.counts.true_positives == 1


@pytest.mark.parametrize("seed", range(4))
def test_the_curves_are_those_of_each_threshold_and_their_mean_is_ap(seed):
    detected, reference = town(seed)
    found = evaluate(detected, reference)
    for place, threshold in enumerate(found.curves["f1_by_threshold"][0].tolist()):
        at = evaluate(detected, reference, threshold=threshold)
        for name in ("precision", "recall", "f1"):
            assert found.curves[f"{name}_by_threshold"][1][place] == pytest.approx(at.values[f"iou.{name}"])
    for key in ("50", "75"):
        assert found.curves[f"precision_over_recall_{key}"][1].mean() == pytest.approx(found.values[f"ap.ap_{key}"])
    assert np.isnan(evaluate([], []).curves["f1_by_threshold"][1]).all()


def test_missing_scores_rank_last_and_without_any_the_best_iou_ranks():
    detected, reference = [house(0.1), house(500), house(30)], [house(0), house(30)]
    assert evaluate(detected, reference, [0.9, np.nan, 0.8]).values["ap.ap_50"] == 1.0
    assert evaluate(detected, reference, [0.9, 0.85, np.nan]).values["ap.ap_50"] < 1.0
    assert evaluate(detected, reference).values["ap.ap_50"] == 1.0
    assert evaluate([], reference).values["ap.ap"] == 0.0
    assert evaluate(detected, []).values["ap.ap"] is None


def test_a_resampled_ranking_is_the_one_with_each_detection_repeated():
    rng = np.random.default_rng(4)
    every = [
        Ranking(rng.integers(0, 5, count) / 5, rng.integers(0, 1024, count), rng.integers(0, 1024, count) * (count > 9))
        for count in (7, 0, 12, 3)
    ]
    weights = np.array([[1, 1, 1, 1], [0, 2, 3, 1], [2, 0, 0, 0], [0, 0, 0, 0], [0, 1, 1, 1]])
    for row, found in zip(weights, Ranking().weighted_sums(every, weights), strict=True):
        expected = Ranking()
        for ranking, times in zip(every, row.tolist(), strict=True):
            for _ in range(times):
                expected = expected + ranking
        assert sorted(zip(*found._repeated(), strict=True)) == sorted(zip(*expected._repeated(), strict=True))
        assert Ranking().from_json(found.to_json()) == found
        for place in range(10):
            one, two = (side.average_precision(place, 30) for side in (found, expected))
            assert one == pytest.approx(two, abs=1e-15)
        assert found.found.tolist() == expected.found.tolist()


def test_average_precision_has_no_cap_on_the_number_of_objects():
    houses = [house(20 * (k % 100), y=20 * (k // 100)) for k in range(10_000)]
    found = evaluate(houses, houses)
    assert (found.values["ap.ap"], found.values["ap.ar"], found.values["iou.f1"]) == (1.0, 1.0, 1.0)


def test_equal_confidences_count_together_so_that_their_order_changes_nothing():
    detected, reference = town(3)
    for order in (slice(None), slice(None, None, -1)):
        values = evaluate(detected[order], reference, np.ones(len(detected))).values
        assert values["ap.ap"] == pytest.approx(evaluate(detected, reference, np.ones(len(detected))).values["ap.ap"])


def test_coco_leaves_out_a_detection_on_an_ignore_region_only_where_it_reaches_the_threshold():
    reference = [house(0), house(50, 3, depth=3)]
    detected = [house(0), house(50, 3, depth=3.2), house(52, 10)]
    spacenet, coco = (
        evaluate(detected, reference, minimum_area=20.0, matching=matching) for matching in ("spacenet", "coco")
    )
    assert spacenet.tallies.counts.detected == 1, "whatever overlaps only a left-out reference is left out"
    assert coco.tallies.counts.detected == 2, "the large one has an IoU below the threshold with it: a false positive"
    assert (spacenet.values["iou.precision"], coco.values["iou.precision"]) == (1.0, 0.5)
