"""The other evaluation systems against plain loops, and on examples worked by hand."""

import json

import numpy as np
import pytest
import shapely
from builders.footprint_sets import random_detections, random_reference
from naive.evaluation import correspondence, overlap, polis
from naive.systems import (
    band_iou,
    corners,
    covered_share,
    edge_angle_error,
    greedy,
    groups,
    hausdorff,
    iou,
    main_partner,
    matched_corners,
    orthogonality,
    touched,
    turning_distance,
)

import roofbench as rb
from roofbench.evaluators.registry import EVALUATORS

COVERAGE = ("mobj0", "rutzinger", "shan-lee", "shufelt")
SEEDS = range(30)


def sets_of(seed):
    rng = np.random.default_rng(seed)
    reference, _ = random_reference(rng, general=True)
    return random_detections(rng, reference), reference


def evaluate(name, detected, reference, **more):
    return rb.evaluate(rb.Footprints.of(detected), rb.Footprints.of(reference), evaluator=name, **more)


def house(x, width=10.0, y=0.0, depth=10.0):
    return shapely.box(x, y, x + width, y + depth)


#: Found and shifted, found twice (halves), merged, missed, false alarm.
DETECTED = [house(1), house(20, 5), house(25, 5), house(40, 21), house(200)]
REFERENCE = [house(0), house(20), house(40), house(51), house(100)]


@pytest.mark.parametrize("name", EVALUATORS.names())
@pytest.mark.parametrize("seed", range(4))
def test_every_system_pools_exactly_comes_back_from_json_and_gives_whole_verdicts(name, seed):
    one, two = evaluate(name, *sets_of(seed)), evaluate(name, *sets_of(seed + 100))
    apart = [[*left, *(shapely.affinity.translate(p, 5000, 0) for p in right)] for left, right in
             zip(sets_of(seed), sets_of(seed + 100), strict=True)]  # fmt: skip
    together, pooled = evaluate(name, *apart), rb.pool([one, two])
    for key, value in together.values.items():
        if key == "complexity.n_ratio_mean":
            continue  # a mean over scenes by definition
        assert pooled.values[key] == (None if value is None else pytest.approx(value, rel=1e-6, abs=1e-9)), key
    for index in one.evaluator.indices:
        value = one.values[index.key]
        assert value is None or index.range[0] <= value <= index.range[1] + 1e-12, index.key
    stored = json.loads(json.dumps(one.tallies.to_dict(), allow_nan=False))
    assert one.evaluator.summarise(one.evaluator.tallies_type.from_dict(stored)).values == one.values
    json.dumps(one.to_dict(), allow_nan=False)
    for side, table, footprints in one.verdicts.sides:
        assert len(table) == len(footprints)
        assert set(table.kinds) <= {kind.key for kind in one.evaluator.kinds_of(side)}
        assert all(table.reasons)
        assert set(table.measures) == {measure.key for measure in one.evaluator.measures}


@pytest.mark.parametrize("name", EVALUATORS.names())
def test_curves_have_as_many_values_as_places(name):
    for evaluation in (evaluate(name, DETECTED, REFERENCE), evaluate(name, [], [])):
        for curve in evaluation.evaluator.curves:
            x, y = curve.formula(evaluation.tallies)
            assert len(x) == len(y) + curve.bars
            assert (np.diff(x) > 0).all()


@pytest.mark.parametrize("name", EVALUATORS.names())
def test_identity_is_perfect_and_the_evaluation_area_leaves_out(name):
    evaluator = rb.make_evaluator(name)
    perfect = evaluate(name, REFERENCE, REFERENCE)
    best = {"higher": 1.0, "lower": 0.0}
    for index in evaluator.indices:
        # S-IoU falls with the number of corners, whatever the other side.
        if index.better in best and index.unit == "fraction" and index.key != "complexity.s_iou":
            assert perfect.values[index.key] == pytest.approx(best[index.better]), index.key
    partly = evaluate(name, REFERENCE, REFERENCE, area=shapely.box(-5, -5, 80, 20))
    assert partly.counts.reference == 4 if hasattr(partly, "counts") else partly.tallies.counts.reference == 4
    assert partly.tallies.left_out.reference_outside == 1
    assert partly.verdicts.reference_table.count("left out") == 1


def test_mobj0_by_hand():
    # Paired: 4 of 5 references; without: reference 100 and detection 200.
    found = evaluate("mobj0", DETECTED, REFERENCE)
    assert found.values["mobj0.metric"] == pytest.approx(4 / 6)
    assert (found.values["mobj0.paired"], found.values["mobj0.supported"]) == (0.8, 0.8)
    assert found.verdicts.reference_table.verdicts.tolist() == ["paired"] * 4 + ["FN"]
    assert evaluate("mobj0", [], []).values["mobj0.metric"] is None


@pytest.mark.parametrize("seed", SEEDS)
def test_mobj0_counts_objects_with_any_counterpart(seed):
    detected, reference = sets_of(seed)
    counts = evaluate("mobj0", detected, reference).tallies.counts
    assert counts.paired == sum(bool(touched(polygon, detected)) for polygon in reference)
    assert counts.false_positives == sum(not touched(polygon, reference) for polygon in detected)


def test_rutzinger_by_hand():
    found = evaluate("rutzinger", DETECTED, REFERENCE)
    counts = found.tallies.counts
    # Both halves are right by themselves and cover reference 20 together; the wide one covers both of its houses.
    assert (counts.reference_true_positives, counts.detection_true_positives) == (4, 4)
    assert (found.values["object.completeness"], found.values["object.correctness"]) == (0.8, 0.8)
    assert found.values["object.quality"] == pytest.approx(1 / (1 / 0.8 + 1 / 0.8 - 1))
    topology = found.tallies.topology
    assert (topology.one_to_one, topology.splits, topology.merges, topology.many_to_many) == (1, 1, 1, 0)
    assert found.tallies.reference_classes.strong == 4
    assert found.values["area.completeness"] == pytest.approx((90 + 100 + 100 + 100) / 500)
    assert found.values["area.correctness"] == pytest.approx((90 + 100 + 200) / (100 + 100 + 210 + 100))


def test_a_sliver_of_two_percent_is_no_true_positive_of_rutzinger():
    # It is one of the threshold-free evaluation: that is what the two systems disagree about.
    sliver = [house(9.8)], [house(0)]
    assert evaluate("rutzinger", *sliver).values["object.completeness"] == 0.0
    assert evaluate("threshold-free", *sliver).object.completeness == 1.0
    assert evaluate("rutzinger", *sliver, threshold=0.02).values["object.completeness"] == 1.0
    assert evaluate("rutzinger", *sliver, threshold=0.0).values["object.completeness"] == 1.0


@pytest.mark.parametrize("seed", SEEDS)
def test_rutzinger_agrees_with_plain_loops(seed):
    detected, reference = sets_of(seed)
    evaluation = evaluate("rutzinger", detected, reference)
    shares_r = [covered_share(polygon, detected) for polygon in reference]
    shares_d = [covered_share(polygon, reference) for polygon in detected]
    counts = evaluation.tallies.counts
    assert counts.reference_true_positives == sum(share >= 0.5 for share in shares_r)
    assert counts.detection_true_positives == sum(share >= 0.5 for share in shares_d)
    classes = evaluation.tallies.reference_classes
    assert classes.none == sum(share < 0.1 for share in shares_r)
    assert classes.weak == sum(0.1 <= share < 0.5 for share in shares_r)
    assert classes.partial == sum(0.5 <= share < 0.8 for share in shares_r)
    assert classes.strong == sum(share >= 0.8 for share in shares_r)
    sizes = [(len(ds), len(rs)) for ds, rs in groups(detected, reference)]
    topology = evaluation.tallies.topology
    assert topology.one_to_one == sizes.count((1, 1))
    assert topology.splits == sum(d > 1 and r == 1 for d, r in sizes)
    assert topology.merges == sum(d == 1 and r > 1 for d, r in sizes)
    assert topology.many_to_many == sum(d > 1 and r > 1 for d, r in sizes)
    (_, completeness), _ = (curve.formula(evaluation.tallies) for curve in evaluation.evaluator.curves)
    small = [share >= 0.5 for share, polygon in zip(shares_r, reference, strict=True) if 50 <= polygon.area < 75]
    assert (np.isnan(completeness[2]) and not small) or completeness[2] == pytest.approx(np.mean(small))


def test_shufelt_by_hand():
    found = evaluate("shufelt", DETECTED, REFERENCE)
    assert found.values["reference.area_under_curve"] == pytest.approx((0.9 + 1 + 1 + 1 + 0) / 5)
    assert found.values["detection.area_under_curve"] == pytest.approx((0.9 + 1 + 1 + 20 / 21 + 0) / 5)
    assert found.values["reference.at_half"] == 0.8


@pytest.mark.parametrize("seed", SEEDS)
def test_the_curve_of_shufelt_is_the_share_covered_at_least_so_much(seed):
    detected, reference = sets_of(seed)
    evaluation = evaluate("shufelt", detected, reference)
    for curve, own, others in zip(
        evaluation.evaluator.curves, (reference, detected), (detected, reference), strict=True
    ):
        x, y = curve.formula(evaluation.tallies)
        shares = np.array([covered_share(polygon, others) for polygon in own])
        if not len(shares):
            assert np.isnan(y).all()
            continue
        expected = [(shares > 0).mean(), *((shares >= t - 1e-9).mean() for t in x[1:])]
        assert y == pytest.approx(expected)
        area = evaluation.values[f"{curve.key.removesuffix('s_covered')}.area_under_curve"]
        assert area == pytest.approx(shares.mean())
        assert np.trapezoid(y, x) == pytest.approx(area, abs=0.01)


def test_shan_and_lee_by_hand():
    found = evaluate("shan-lee", DETECTED, REFERENCE)
    frame = found.verdicts.references
    assert frame["overlap"].tolist() == pytest.approx([0.9, 1.0, 100 / 210, 100 / 210, np.nan], nan_ok=True)
    assert frame["fitness"].tolist() == pytest.approx([90 / 110, 0.5, 100 / 210, 100 / 210, np.nan], nan_ok=True)
    assert frame["underlap"].tolist() == pytest.approx([0.1, 0.5, 0.0, 0.0, 1.0])
    assert frame["extralap"].tolist() == pytest.approx([0.1, 0.0, 1.1, 1.1, np.nan], nan_ok=True)
    assert found.verdicts.detections["crosslap"].tolist() == [1, 1, 1, 2, 0]
    assert (found.values["building.missed"], found.values["building.false_alarms"]) == (0.2, 0.2)
    assert found.values["building.crosslap"] == 1.0
    assert found.values["building.underlap"] == pytest.approx(1.6 / 5)


@pytest.mark.parametrize("seed", SEEDS)
def test_shan_and_lee_agree_with_plain_loops(seed):
    detected, reference = sets_of(seed)
    frame = evaluate("shan-lee", detected, reference).verdicts.references
    for row, polygon in enumerate(reference):
        partner = main_partner(polygon, detected)
        if partner is None:
            assert frame.loc[row, "underlap"] == 1.0
            assert np.isnan(frame.loc[row, "fitness"])
            continue
        shared, other = overlap(polygon, detected[partner]), detected[partner].area
        assert frame.loc[row, "underlap"] == pytest.approx(1 - shared / polygon.area, abs=1e-9)
        # Two detections may share the same area: then either is the partner.
        if sum(abs(overlap(polygon, d) - shared) < 1e-6 for d in detected) == 1:
            assert frame.loc[row, "overlap"] == pytest.approx(shared / other)
            assert frame.loc[row, "fitness"] == pytest.approx(shared / (other + polygon.area - shared))
            assert frame.loc[row, "extralap"] == pytest.approx((other - shared) / polygon.area, abs=1e-9)


def test_song_and_haithcoat_by_hand():
    notched = house(300) - house(300, 2, depth=2)  # 6 corners, 96 m2, same perimeter
    found = evaluate("song-haithcoat", [*DETECTED, notched], [*REFERENCE, house(300)])
    assert found.values["detection.rate"] == pytest.approx(5 / 6)
    assert found.values["detection.correctness"] == pytest.approx(5 / 6)
    # Main partners: the shifted house, one of the halves, twice the wide one, the notched one.
    assert found.values["overlay.matched"] == pytest.approx((90 + 50 + 100 + 100 + 96) / 500)
    assert found.values["overlay.omission"] == pytest.approx(64 / 500)
    assert found.values["overlay.commission"] == pytest.approx(1 - 436 / (100 + 50 + 210 + 210 + 96))
    assert found.values["shape.corner_difference"] == pytest.approx(2 / 5)
    assert found.values["shape.area_difference"] == pytest.approx((0 + 0.5 + 1.1 + 1.1 + 0.04) / 5)
    assert found.values["shape.perimeter_difference"] == pytest.approx((0 + 0.25 + 22 / 40 * 2 + 0) / 5)
    wide, half = 4 * np.pi * 210 / 62**2, 4 * np.pi * 50 / 30**2
    square, notch = 4 * np.pi * 100 / 40**2, 4 * np.pi * 96 / 40**2
    assert found.values["shape.compactness_ratio"] == pytest.approx(
        (1 + half / square + 2 * wide / square + notch / square) / 5
    )


@pytest.mark.parametrize("seed", SEEDS)
def test_song_and_haithcoat_agree_with_plain_loops(seed):
    detected, reference = sets_of(seed)
    values = evaluate("song-haithcoat", detected, reference).values
    partners = {r: main_partner(polygon, detected) for r, polygon in enumerate(reference)}
    pairs = [(detected[d], reference[r]) for r, d in partners.items() if d is not None]
    assert values["detection.rate"] == (len(pairs) / len(reference) if reference else None)
    if pairs and all(_has_one_best(polygon, detected) for polygon in reference):
        shared = sum(overlap(one, two) for one, two in pairs)
        assert values["overlay.matched"] == pytest.approx(shared / sum(two.area for _, two in pairs))
        assert values["overlay.commission"] == pytest.approx(1 - shared / sum(one.area for one, _ in pairs), abs=1e-9)
        difference = [abs(one.length - two.length) / two.length for one, two in pairs]
        assert values["shape.perimeter_difference"] == pytest.approx(np.mean(difference), abs=1e-9)


def _has_one_best(polygon, others):
    """Return whether no two polygons share the same largest area: then either would be the partner."""
    areas = sorted((overlap(polygon, other) for other in others), reverse=True)
    return len(areas) < 2 or areas[0] == 0 or areas[0] - areas[1] > 1e-6


def test_iou_by_hand():
    found = evaluate("iou", DETECTED, REFERENCE)
    # IoU: shifted 90/110; halves 0.5 each, of which one is matched; the wide one 100/210 with either house.
    counts = found.tallies.counts
    assert (counts.true_positives, counts.false_positives, counts.false_negatives) == (2, 3, 3)
    assert (found.values["iou.precision"], found.values["iou.recall"], found.values["iou.f1"]) == (0.4, 0.4, 0.4)
    # 0.45 would add the wide one and a house of its own, 0.55 would lose a half and its house.
    assert found.values["iou.flipped"] == pytest.approx(4 / 10)
    assert found.values["panoptic.quality"] == pytest.approx((90 / 110) / 5), "an IoU of just 0.5 is no panoptic pair"
    assert found.values["ap.ar"] == pytest.approx((2 / 5 + 6 * 1 / 5) / 10)
    one = found.verdicts
    assert one.detection_table.verdicts.tolist()[0] == "TP"
    assert one.reference_table.partner[0] == 0


def test_a_sliver_of_two_percent_is_no_true_positive_of_iou():
    assert evaluate("iou", [house(9.8)], [house(0)]).values["iou.recall"] == 0.0


@pytest.mark.parametrize("with_confidence", [False, True])
@pytest.mark.parametrize("threshold", [0.3, 0.5])
@pytest.mark.parametrize("seed", range(15))
def test_iou_agrees_with_plain_loops(seed, threshold, with_confidence):
    detected, reference = sets_of(seed)
    if not detected or not reference:
        return
    confidence = np.random.default_rng(seed).permutation(len(detected)) / 100 if with_confidence else None
    attributes = {"confidence": confidence} if with_confidence else {}
    found = rb.evaluate(
        rb.Footprints.of(detected, attributes=attributes), rb.Footprints.of(reference), evaluator="iou",
        threshold=threshold,
    )  # fmt: skip
    matches = greedy(detected, reference, confidence, threshold)
    assert found.tallies.counts.true_positives == len(matches)


def test_boundary_by_hand():
    # A square shifted by 1 m along a side: two corners lie on the other outline's lines, two are 1 m off.
    found = evaluate("boundary", [house(1)], [house(0)])
    assert found.values["boundary.polis"] == pytest.approx(0.5)
    assert found.values["boundary.hausdorff"] == pytest.approx(1.0)
    # Bands of 1 m: 36 m2 each; they share two strips of 9 m and, of the walls across, nothing else but their ends.
    assert found.values["boundary.iou"] == pytest.approx(18 / 54)
    assert found.values["complexity.c_iou"] == pytest.approx(90 / 110)
    assert found.values["complexity.n_ratio"] == 1.0
    assert found.values["regularity.edge_angle_error"] == pytest.approx(0.0)
    assert found.values["regularity.orthogonality"] == 1.0


def test_one_name_for_two_formulas_gives_two_numbers():
    # Scene: masks 100 of 120 m2, corners 4 + 6 against 4 + 4. Pairs: one perfect, one with 6 corners against 4.
    notched = house(50) - house(50, 2, depth=2)
    found = evaluate("boundary", [house(0), notched], [house(0), house(50)])
    assert found.values["complexity.c_iou"] == pytest.approx((1 + 0.96 * 0.8) / 2)
    assert found.values["complexity.c_iou_scene"] == pytest.approx(196 / 200 * (1 - 2 / 18))
    other = evaluate("boundary", [house(0)], [house(0)])
    pooled = rb.pool([found, other]).values
    assert pooled["complexity.n_ratio"] == pytest.approx(14 / 12)
    assert pooled["complexity.n_ratio_mean"] == pytest.approx((10 / 8 + 1) / 2)


@pytest.mark.parametrize("seed", SEEDS)
def test_boundary_agrees_with_plain_loops(seed):
    detected, reference = sets_of(seed)
    evaluation = evaluate("boundary", detected, reference)
    frame = evaluation.verdicts.detections
    matches, _ = correspondence(detected, reference)
    corner_distances = []
    assert set(frame.index[frame["verdict"] == "pair"]) == set(matches)
    for d, r in matches.items():
        one, two, row = detected[d], reference[r], frame.loc[d]
        assert row["polis"] == pytest.approx(polis(one, two), abs=1e-7)
        assert row["hausdorff"] == pytest.approx(hausdorff(one, two), abs=1e-7)
        assert row["boundary_iou"] == pytest.approx(band_iou(one, two, 1.0), abs=1e-7)
        factor = 1 - abs(corners(one) - corners(two)) / (corners(one) + corners(two))
        assert row["c_iou"] == pytest.approx(iou(one, two) * factor, abs=1e-7)
        simple = np.mean([(1 + np.exp(0.1 * (3 - n))) / (1 + np.exp(0.1 * (corners(one) - n))) for n in (50, 90, 500)])
        assert row["s_iou"] == pytest.approx(iou(one, two) * simple, abs=1e-7)
        assert row["edge_angle_error"] == pytest.approx(edge_angle_error(one, two), abs=1e-6)
        assert row["orthogonality"] == pytest.approx(orthogonality(one), abs=1e-9)
        assert row["turning_distance"] == pytest.approx(turning_distance(one, two), abs=1e-6)
        near = matched_corners(one, two, 1.0)
        assert row["corner_error"] == pytest.approx(np.mean(near), abs=1e-9) if near else np.isnan(row["corner_error"])
        corner_distances += near
    tallies = evaluation.tallies.corners
    assert tallies.matched == len(corner_distances)
    assert tallies.distance == pytest.approx(sum(corner_distances))
    scene = evaluation.tallies.scene
    masks = shapely.union_all(detected), shapely.union_all(reference)
    assert scene.mask_united == pytest.approx(masks[0].union(masks[1]).area)
    assert scene.mask_shared == pytest.approx(masks[0].intersection(masks[1]).area, abs=1e-6)
