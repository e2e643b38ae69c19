"""Evaluations in parts: the same to the last bit for any division and order, and the same as in memory."""

import dataclasses

import numpy as np
import pytest
import shapely
from builders.footprint_sets import random_detections, random_reference
from builders.outlines import stars
from hypothesis import given, settings
from hypothesis import strategies as st

import roofbench as rb
from roofbench.core.errors import InputError, UnsupportedError
from roofbench.evaluators.overlay.outline_store import Division, OutlineStore
from roofbench.evaluators.threshold_free.evaluator import ThresholdFree
from roofbench.evaluators.threshold_free.partitioned import evaluate_stores
from roofbench.scenes.geodata.outline_batch import OutlineBatch


@pytest.fixture
def in_memory(monkeypatch):
    """Make small sets be evaluated by the compiled code of large ones."""
    for name in ("overlaps._MANY_FOOTPRINTS", "outline_distances._MANY_PAIRS"):
        monkeypatch.setattr(f"roofbench.evaluators.overlay.{name}", 0)
    monkeypatch.setattr("roofbench.evaluators.overlay.areas._MANY_MEMBERS", -1)


def scene(seed):
    """Rectangles, L shapes and stars that overlap each other, far from the origin of the CRS."""
    rng = np.random.default_rng(seed)
    reference, building = random_reference(rng, general=bool(seed % 2))
    detected = random_detections(rng, reference)
    crowd = list(stars(seed, 12, 9).polygons)
    reference, building = [*reference, *crowd[:6]], [*building, *range(1000, 1006)]
    far = (4e5, 5.6e6) if seed % 3 else (0.0, 0.0)

    def move(polygon):
        # A little out of place, so that no two pairs are equally near: such ties go to the lower row.
        return shapely.affinity.translate(polygon, *(rng.normal(0, 0.01, 2) + far))

    return [move(p) for p in [*detected, *crowd[6:]]], [move(p) for p in reference], np.array(building)


def store(folder, division, polygons, codes=None, batch=1000):
    side = OutlineStore(folder, division)

    def batches():
        for begin in range(0, len(polygons), batch):
            part = OutlineBatch.of(rb.Footprints.of(polygons[begin : begin + batch]))
            yield dataclasses.replace(part, ids=part.ids + begin)

    side.write(batches())
    side.finish(codes, source="test")
    return OutlineStore(folder, division)


def in_parts(folder, division, detected, reference, building, evaluator=None, batch=1000):
    sides = (
        store(folder / "detected", division, detected, batch=batch),
        store(folder / "reference", division, reference, building, batch=batch),
    )
    return evaluate_stores(evaluator or ThresholdFree(), *sides, folder / "pairs")


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    parts=st.integers(1, 9),
    tile=st.sampled_from([3.0, 17.0, 100.0, 1e4]),
    batch=st.integers(1, 40),
)
def test_no_division_and_no_order_changes_a_bit(tmp_path_factory, seed, parts, tile, batch):
    folder = tmp_path_factory.mktemp("parts")
    detected, reference, building = scene(seed)
    whole, _ = in_parts(folder / "whole", Division(1), detected, reference, building)
    order = [np.random.default_rng(seed + 1).permutation(len(side)) for side in (detected, reference)]
    shuffled = [[side[row] for row in rows] for side, rows in zip((detected, reference), order, strict=True)]
    divided, verdicts = in_parts(folder / "divided", Division(parts, tile), *shuffled, building[order[1]], batch=batch)
    assert divided.tallies.to_dict() == whole.tallies.to_dict()
    assert [len(side) for side in verdicts()] == [len(detected), len(reference)]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("matching", ["nearest", "one-pass", "overlap"])
def test_it_is_the_evaluation_in_memory(tmp_path, in_memory, seed, matching):
    detected, reference, building = scene(seed)
    evaluator = ThresholdFree(matching=matching, minimum_area=20.0 if seed == 3 else 0.0)
    sides = rb.Footprints.of(detected), rb.Footprints.of(reference, building_ids=building)
    expected = evaluator.evaluate(*sides)
    codes = sides[1].building_codes
    found, verdicts = in_parts(tmp_path, Division(5, 30.0), detected, reference, codes, evaluator, batch=7)
    assert found.tallies.to_dict() == expected.tallies.to_dict()
    assert found.notes == expected.notes
    tables = expected.verdicts.detection_table, expected.verdicts.reference_table
    for side, table in zip(verdicts(), tables, strict=True):
        assert side.whole().to_bytes() == table.to_bytes()
        assert side.table(slice(3, 9)).reasons[:] == table.reasons[3:9]
        assert side.table(slice(3, 9)).partner.tolist() == table.partner[3:9].tolist()


def test_small_sets_agree_to_rounding(tmp_path):
    detected, reference, building = scene(2)
    expected = rb.evaluate(rb.Footprints.of(detected), rb.Footprints.of(reference, building_ids=building))
    found, _ = in_parts(tmp_path, Division(4, 20.0), detected, reference, building)
    assert found.counts == expected.counts
    for key, value in expected.tallies.areas.to_dict().items():
        assert found.tallies.areas.to_dict()[key] == pytest.approx(value, rel=1e-9)


def test_an_outline_over_all_tiles_meets_every_house(tmp_path):
    houses = [shapely.box(50 * k, 50 * (k % 7), 50 * k + 10, 50 * (k % 7) + 10) for k in range(60)]
    country = shapely.box(-100, -100, 4000, 500)
    found, verdicts = in_parts(tmp_path, Division(7, 10.0), [*houses[:-1], country], houses, None)
    assert (found.counts.true_positives, found.counts.overlapping_detections) == (60, 60)
    assert verdicts()[0].where("TP").sum() == 60


@pytest.mark.parametrize("empty", [0, 1])
def test_an_empty_side_is_a_result(tmp_path, empty):
    sides = [[shapely.box(0, 0, 10, 10)], [shapely.box(1, 0, 11, 10)]]
    sides[empty] = []
    found, verdicts = in_parts(tmp_path, Division(3), *sides, None)
    assert (found.counts.detected, found.counts.reference) == (len(sides[0]), len(sides[1]))
    assert [len(side) for side in verdicts()] == [len(side) for side in sides]


def test_an_interrupted_evaluation_goes_on(tmp_path, monkeypatch):
    detected, reference, building = scene(4)
    expected, _ = in_parts(tmp_path / "whole", Division(6, 20.0), detected, reference, building)
    done = []

    def stop(finished, total):
        done.append(finished)
        if finished == 3:
            raise KeyboardInterrupt

    sides = [
        store(tmp_path / name, Division(6, 20.0), side, codes)
        for name, side, codes in (("detected", detected, None), ("reference", reference, building))
    ]
    with pytest.raises(KeyboardInterrupt):
        evaluate_stores(ThresholdFree(), *sides, tmp_path / "pairs", progress=stop)
    from roofbench.evaluators.overlay import partition

    kept = {int(file.stem) for file in (tmp_path / "pairs").glob("[0-9].npz")}
    assert len(kept) >= 3
    measured = []
    original = partition._pairs_of_part
    monkeypatch.setattr(partition, "_pairs_of_part", lambda *args: measured.append(args[2]) or original(*args))
    found, _ = evaluate_stores(ThresholdFree(), *sides, tmp_path / "pairs")
    assert set(measured) == set(range(6)) - kept
    assert found.tallies.to_dict() == expected.tallies.to_dict()


def test_a_half_written_store_is_written_anew(tmp_path):
    side = OutlineStore(tmp_path / "side", Division(2))

    def broken():
        yield OutlineBatch.of(rb.Footprints.of([shapely.box(0, 0, 1, 1)]))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        side.write(broken())
    assert not side.complete
    again = store(tmp_path / "side", Division(2), [shapely.box(0, 0, 10, 10)])
    assert again.complete
    assert again.objects.areas.tolist() == [100.0]


def test_pixels_are_refused(tmp_path):
    with pytest.raises(UnsupportedError, match="exact areas, not pixels"):
        in_parts(tmp_path, Division(2), [], [], None, ThresholdFree(area="pixels", gsd=0.5))


def test_a_stack_without_end_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("roofbench.evaluators.overlay.partition._MOST_PAIRS", 100)
    stack = [shapely.box(0, 0, 10 + k, 10) for k in range(30)]
    with pytest.raises(InputError, match="test: footprints of one part of the plane lie on each other"):
        in_parts(tmp_path, Division(2), stack, stack, None)
