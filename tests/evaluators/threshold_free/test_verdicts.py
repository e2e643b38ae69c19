"""Every object says what it counts as, and why."""

import numpy as np
import pytest
import shapely
from builders.footprint_sets import random_detections, random_reference
from naive.evaluation import centre, correspondence, outline_distance

import roofbench as rb
from roofbench.evaluators.threshold_free.object_graph import object_graph
from roofbench.evaluators.threshold_free.verdicts import MEASURES, find_verdicts


def verdicts(detected, reference, building=None, **more):
    evaluation = rb.evaluate(rb.Footprints.of(detected), rb.Footprints.of(reference, building_ids=building), **more)
    return evaluation.verdicts


def house(x, y=0.0, width=10.0, depth=10.0):
    return shapely.box(x, y, x + width, y + depth)


def test_a_found_building_has_its_shift_iou_and_corner_distance():
    found = verdicts([house(2)], [house(0)])
    (detection,) = found.detections.itertuples()
    assert (detection.verdict, detection.partner) == ("TP", 0)
    assert detection.reason == "found reference 0, shifted 2.0 m"
    assert detection.distance == detection.rmse == pytest.approx(2)
    assert detection.overlap_area == pytest.approx(80)
    assert detection.iou == pytest.approx(80 / 120)
    assert found.references.loc[0, "reason"] == "found by detection 0, shifted 2.0 m"


def test_a_false_alarm_and_a_missed_building_have_no_partner():
    found = verdicts([house(100)], [house(0)])
    assert found.detections.loc[0, "verdict"] == "FP"
    assert found.detections.loc[0, "reason"] == "false alarm: overlaps no reference"
    assert found.references.loc[0, "verdict"] == "FN"
    assert found.references.loc[0, "reason"] == "missed: no detection overlaps it"
    assert found.detections["partner"].isna().all()
    assert np.isnan(found.detections.loc[0, "distance"])


def test_two_houses_in_one_detection_are_merged():
    found = verdicts([shapely.box(0, 0, 20, 10)], [house(0, width=9), house(11, width=9)])
    assert found.references["verdict"].tolist() == ["TP", "FN"]
    assert found.references.loc[1, "reason"] == "merged with reference 0 into detection 0, which covers 100 % of it"
    assert "also covers part of reference 1" in found.detections.loc[0, "reason"]


def test_a_house_in_three_pieces_is_split():
    found = verdicts([house(0, width=3), house(3.5, width=3), house(7, width=3)], [house(0)])
    assert found.detections["verdict"].tolist() == ["MD", "TP", "MD"]
    piece = "piece of reference 0, which is split into 3 detections and represented by detection 1"
    assert found.detections["reason"].tolist() == [piece, found.detections.loc[1, "reason"], piece]
    assert found.detections.loc[1, "reason"].endswith("; the reference is split into 3 detections")
    assert found.references.loc[0, "reason"].endswith("; split into 3 detections")


def test_a_house_found_twice_is_not_split_but_has_a_duplicate():
    found = verdicts([house(1), house(0)], [house(0)])
    assert found.detections["reason"].tolist() == [
        "duplicate of detection 1 on reference 0",
        "found reference 0, shifted 0.0 m; the reference is detected 2 times",
    ]
    assert found.references.loc[0, "reason"] == "found by detection 1, shifted 0.0 m; detected 2 times"


def test_a_shifted_row_is_not_called_split():
    found = verdicts([house(1), house(11), house(21)], [house(0), house(10), house(20)])
    assert not found.detections["reason"].str.contains("split").any()
    assert found.references["reason"].tolist() == [
        "found by detection 0, shifted 1.0 m; the detection also covers part of reference 1",
        "found by detection 1, shifted 1.0 m; the detection also covers part of reference 2"
        "; detection 0 of another reference covers part of it",
        "found by detection 2, shifted 1.0 m; detection 1 of another reference covers part of it",
    ]


def test_a_missed_house_that_a_neighbour_grazes_says_how_little_is_covered():
    found = verdicts([house(0, width=10.2)], [house(0), house(10.15)])
    assert found.references.loc[1, "reason"].endswith("into detection 0, which covers less than 1 % of it")


def test_objects_are_named_by_their_row_in_the_source():
    found = verdicts([shapely.Polygon(), house(1)], [shapely.Point(0, 0), house(0)])
    assert found.detections["id"].tolist() == [1]
    assert found.detections.loc[0, "reason"] == "found reference 1, shifted 1.0 m"


def test_left_out_objects_are_marked():
    area = shapely.box(-5, -5, 30, 30)
    found = verdicts([house(0), house(100)], [house(0), house(101), house(12, width=2, depth=2)], area=area)
    assert found.detections["verdict"].tolist() == ["TP", "left out"]
    assert found.references["verdict"].tolist() == ["TP", "left out", "FN"]
    assert "outside the evaluation area" in found.references.loc[1, "reason"]
    small = verdicts([house(12, width=2, depth=2)], [house(12, width=2, depth=2)], minimum_area=5)
    assert small.references.loc[0, "reason"] == "left out: smaller than the minimum area"
    assert small.detections.loc[0, "reason"] == "left out: overlaps only references that are left out"


def test_a_pooled_evaluation_has_no_verdicts():
    one = rb.evaluate(rb.Footprints.of([house(0)]), rb.Footprints.of([house(0)]))
    assert rb.pool([one, one]).verdicts is None
    assert rb.pool([one, one]).counts.true_positives == 2


def test_parts_of_one_building_overlap_naturally():
    wings = [house(0, width=20), house(5, width=6, depth=30)]
    together = rb.evaluate(rb.Footprints.of(wings), rb.Footprints.of(wings, building_ids=[7, 7]))
    apart = rb.evaluate(rb.Footprints.of(wings), rb.Footprints.of(wings))
    assert together.object.detection_overlap_rate == together.object.detection_cross_lap_rate == 0
    assert together.object.reference_cross_lap_rate == 0
    assert apart.object.detection_overlap_rate == apart.object.detection_cross_lap_rate == 1
    assert together.values["building.complete_all"] == 1


def test_one_pass_matching_leaves_a_reference_that_sweeping_finds():
    # Both detections are nearest to the left reference; the right one overlaps the second detection only.
    detected = [house(0), house(1.0, width=12)]
    reference = [house(0.2), house(10.5)]
    swept = rb.evaluate(rb.Footprints.of(detected), rb.Footprints.of(reference))
    literal = rb.evaluate(rb.Footprints.of(detected), rb.Footprints.of(reference), matching="one-pass")
    assert swept.counts.true_positives == 2
    assert literal.counts.true_positives == 1
    assert literal.verdicts.references.loc[1, "reason"] == (
        "missed: detection 1 overlaps it (25 %) but is assigned to reference 0"
    )


@pytest.mark.parametrize("seed", range(25))
def test_verdicts_partners_and_measures_are_those_of_plain_loops(seed):
    rng = np.random.default_rng(seed)
    reference, building = random_reference(rng, general=True)
    detected = random_detections(rng, reference)
    graph = object_graph(rb.Footprints.of(detected), rb.Footprints.of(reference, building_ids=building))
    rows = zip(*(side.tolist() for side in graph.correspondence.pairs), strict=True)
    outline = np.array([outline_distance(detected[d], reference[r]) for d, r in rows])
    table, reference_table = (side.whole() for side in find_verdicts(graph, outline))
    matches, nearest = correspondence(detected, reference)
    for d in range(len(detected)):
        expected = "TP" if d in matches else "MD" if d in nearest else "FP"
        assert table.verdicts[d] == expected
        partner = matches.get(d, nearest.get(d, -1))
        assert table.partner[d] == partner
        values = {measure.key: table.measures[measure.key][d] for measure in MEASURES}
        if partner < 0:
            assert np.isnan(list(values.values())).all()
            continue
        one, two = detected[d], reference[partner]
        assert values["distance"] == pytest.approx(np.hypot(*np.subtract(centre(one), centre(two))), abs=1e-6)
        assert values["overlap_area"] == pytest.approx(one.intersection(two).area, abs=1e-6)
        assert values["iou"] == pytest.approx(one.intersection(two).area / one.union(two).area, abs=1e-6)
        assert np.isnan(values["rmse"]) == (d not in matches)
    missed = [r for r in range(len(reference)) if r not in matches.values()]
    assert np.flatnonzero(reference_table.where("FN")).tolist() == missed
    assert all(reference_table.reasons)


def test_reasons_are_the_same_for_each_stretch_of_rows():
    rng = np.random.default_rng(3)
    reference, building = random_reference(rng, general=True)
    detected = random_detections(rng, reference)
    verdicts = rb.evaluate(rb.Footprints.of(detected), rb.Footprints.of(reference, building_ids=building)).verdicts
    for table in (verdicts.detection_table, verdicts.reference_table):
        whole = list(table.reasons)
        assert [table.reasons[row] for row in range(len(table))] == whole
        assert table.reasons[-1] == whole[-1]
        assert [*table.reasons[:5], *table.reasons[5:]] == whole
        assert table.reasons[1:9:3] == whole[1:9:3]
        with pytest.raises(IndexError):
            table.reasons[len(table)]
