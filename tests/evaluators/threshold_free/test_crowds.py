"""Many footprints in one place: copies are cheap, and a stack without end is refused instead of filling the memory."""

import numpy as np
import pytest
import shapely

import roofbench as rb
from roofbench.core.errors import InputError
from roofbench.evaluators.overlay import overlaps as overlap
from roofbench.evaluators.overlay.overlaps import overlaps_between, overlaps_within

HOUSE = shapely.box(0, 0, 10, 8)
ROUND = shapely.Point(5, 4).buffer(4)


@pytest.mark.parametrize("outline", [HOUSE, ROUND], ids=["rectangle", "general outline"])
def test_copies_share_all_their_area(outline):
    copies = rb.Footprints.of([outline, shapely.box(4, 0, 14, 8), outline])
    within = overlaps_within(copies)
    assert list(zip(within.first.tolist(), within.second.tolist(), strict=True)) == [(0, 1), (0, 2), (1, 2)]
    expected = shapely.area(shapely.intersection(copies.polygons[within.first], copies.polygons[within.second]))
    np.testing.assert_allclose(within.area, expected, rtol=1e-12)
    assert within.area[1] == outline.area


@pytest.mark.parametrize("outline", [HOUSE, ROUND], ids=["rectangle", "general outline"])
def test_a_thousand_copies_are_one_detection_and_multiples_of_it(outline):
    result = rb.evaluate(rb.Footprints.of([outline] * 1000), rb.Footprints.of([outline]))
    assert (result.counts.true_positives, result.counts.multiple_detections) == (1, 999)
    assert result.counts.overlapping_detections == 1000
    assert result.pixel.quality == 1


def test_a_stack_without_end_is_refused_in_words():
    step = 0.001 * np.arange(20_000)
    stack = rb.Footprints.of(shapely.box(-step, -step, 10 + step, 8 + step), source="stack.gpkg")
    with pytest.raises(InputError, match=r"stack\.gpkg: its 20000 footprints lie on each other"):
        overlaps_within(stack)


def test_a_stack_on_one_side_is_refused_too(monkeypatch):
    monkeypatch.setattr(overlap, "_MOST_PAIRS", 1000)
    street = rb.Footprints.of([shapely.box(20 * k, 0, 20 * k + 10, 8) for k in range(300)])
    assert len(overlaps_between(street, street)) == 300, "many footprints, each in its place, are no stack"
    with pytest.raises(InputError, match="lie on each other or on others"):
        overlaps_between(rb.Footprints.of([HOUSE] * 40), rb.Footprints.of([HOUSE] * 40))
