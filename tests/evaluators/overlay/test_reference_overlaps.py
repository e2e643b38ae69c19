"""References that overlap although they are of different buildings are named."""

import numpy as np
import pytest
import shapely

import roofbench as rb
from roofbench.evaluators.registry import EVALUATORS

HOUSE, COURT, NEXT = shapely.box(0, 0, 10, 10), shapely.box(2, 2, 6, 6), shapely.box(9, 0, 19, 10)


def notes(polygons, building=None):
    reference = rb.Footprints.of(polygons, building_ids=building)
    found = rb.evaluate(reference, reference).notes
    return [note for note in found if "different buildings" in note]


@pytest.mark.parametrize(
    ("polygons", "message"),
    [
        ([HOUSE, HOUSE], "1 pair of references of different buildings, duplicates of each other: 0 and 1"),
        ([COURT, HOUSE], "1 pair of references of different buildings, one inside the other: 0 in 1"),
        ([HOUSE, COURT], "1 pair of references of different buildings, one inside the other: 1 in 0"),
        ([HOUSE, NEXT], "1 pair of references of different buildings overlaps: 0 and 1 (10 %)"),
    ],
)
def test_each_kind_is_named(polygons, message):
    assert notes(polygons) == [message]
    assert notes(polygons, [5, 5]) == [], "parts of one building may overlap"


@pytest.mark.parametrize("name", EVALUATORS.names())
def test_every_evaluator_and_a_comparison_name_them(name):
    reference = rb.Footprints.of([HOUSE, HOUSE, NEXT])
    expected = ["duplicates of each other: 0 and 1", "0 and 2 (10 %)", "1 and 2 (10 %)"]
    found = " ".join(rb.evaluate(reference, reference, evaluator=name).notes)
    assert all(words in found for words in expected)
    paired = rb.compare(reference, rb.Footprints.of([HOUSE]), reference, evaluator=name)
    assert all(words in " ".join(paired.first.notes) for words in expected)


def test_touching_references_are_as_they_should_be():
    assert notes([shapely.box(10 * k, 0, 10 * k + 10, 10) for k in range(5)]) == []


def test_of_many_the_largest_are_named():
    row = [shapely.box(10 * k, 0, 10 * k + 10 + 0.1 * (k + 1), 10) for k in range(9)]
    (note,) = notes(row)
    assert note.startswith("8 pairs of references of different buildings overlap: 7 and 8 (7 %), 6 and 7 (7 %)")
    assert note.endswith("and 3 more")


def test_ids_are_those_of_the_source():
    reference = rb.Footprints.of([shapely.box(50, 0, 60, 10), HOUSE, NEXT]).take(np.array([1, 2]))
    assert any(note.endswith("1 and 2 (10 %)") for note in rb.evaluate(reference, reference).notes)
