"""Verdict tables keep every column through bytes, and bytes that are no table are refused in one sentence."""

import json
import struct
import zlib

import numpy as np
import pytest
import shapely
from hypothesis import example, given
from hypothesis import strategies as st

import roofbench as rb
from roofbench.core.errors import InputError
from roofbench.evaluators.verdict_table import Measure, VerdictKind, Verdicts, VerdictTable

KINDS = ("TP", "FP", "left out")
rows = st.lists(
    st.tuples(st.integers(-(2**63), 2**63 - 1), st.sampled_from(KINDS), st.integers(-1, 2**40), st.floats(), st.text()),
    max_size=20,
)


def table(some):
    ids, verdicts, partner, gap, reasons = zip(*some, strict=True) if some else [()] * 5
    return VerdictTable.of(
        list(verdicts), kinds=KINDS, ids=ids, partner=partner, measures={"gap": gap}, reasons=reasons
    )


@given(rows)
@example([(1, "FP", -1, float("nan"), "a lone surrogate \ud800 and ü")])
def test_a_table_comes_back_from_its_bytes_as_it_was(some):
    before = table(some)
    after = VerdictTable.from_bytes(before.to_bytes())
    assert (after.kinds, after.reasons) == (before.kinds, before.reasons)
    for name, column in before.columns().items():
        assert after.columns()[name].tolist() == column.tolist() or name == "gap"
    np.testing.assert_array_equal(after.measures["gap"], before.measures["gap"])
    assert after.to_bytes() == before.to_bytes()


def test_columns_are_typed_and_a_missing_partner_is_masked():
    columns = table([(5, "TP", 7, 0.5, "found"), (6, "FP", -1, np.nan, "false alarm")]).columns()
    assert list(columns) == ["id", "verdict", "partner", "gap", "reason"]
    assert columns["id"].dtype == np.int64
    assert columns["partner"].tolist() == [7, None]
    assert columns["verdict"].tolist() == ["TP", "FP"]


def test_objects_are_chosen_and_counted_by_verdict():
    found = table([(k, verdict, -1, 0.0, "") for k, verdict in enumerate(["TP", "FP", "TP"])])
    assert found.where("TP").tolist() == [True, False, True]
    assert (found.count("TP"), found.count("TP", "FP"), found.count("unheard of"), found.count()) == (2, 3, 0, 0)
    assert np.isnan(found.measure("absent")).all()


@pytest.mark.parametrize("length", [0, 5, 21, 24, 60, -1])
def test_cut_off_bytes_are_refused(length):
    content = table([(1, "TP", 2, 0.5, "found")] * 50).to_bytes()
    with pytest.raises(InputError, match=r"stored verdicts are damaged .*roofbench score"):
        VerdictTable.from_bytes(content[:length])


@given(st.data())
def test_changed_bytes_are_refused_or_read_but_never_a_crash(data):
    content = bytearray(table([(1, "TP", 2, 0.5, "found"), (2, "FP", -1, 0.1, "wrong")]).to_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    try:
        found = VerdictTable.from_bytes(bytes(content))
    except InputError:
        return
    assert len(found.verdicts) == len(found)


def made(header, columns):
    text = json.dumps(header).encode()
    return b"roofbench-verdicts-1\n" + struct.pack("<I", len(text)) + text + zlib.compress(columns)


HEADER = {"rows": 1, "kinds": ["TP"], "measures": [], "text": 0}
ROW = struct.pack("<qBqq", 1, 0, -1, 0)


def test_the_smallest_table_is_read():
    assert VerdictTable.from_bytes(made(HEADER, ROW)).verdicts.tolist() == ["TP"]


@pytest.mark.parametrize(
    ("change", "columns"),
    [
        ({"rows": -1}, ROW),
        ({"rows": 10**15}, ROW),
        ({"rows": "1"}, ROW),
        ({"rows": 2}, ROW),
        ({"kinds": "TP"}, ROW),
        ({"kinds": [1]}, ROW),
        ({"kinds": ["TP"] * 2}, ROW),
        ({"kinds": []}, ROW),
        ({"kinds": None}, ROW),
        ({"text": 3}, ROW + b"abc"),
        ({"text": 3}, struct.pack("<qBqq", 1, 0, -1, -3) + b"abc"),
        ({"text": 1}, struct.pack("<qBqq", 1, 0, -1, 1) + b"\xff"),
        ({}, ROW + b"more"),
        ({}, bytes(10**8)),
    ],
)
def test_headers_and_columns_that_contradict_each_other_are_refused(change, columns):
    with pytest.raises(InputError, match="stored verdicts are damaged"):
        VerdictTable.from_bytes(made({**HEADER, **change}, columns))


def test_columns_of_different_lengths_and_unknown_kinds_are_errors_of_the_evaluator():
    with pytest.raises(ValueError, match="different lengths"):
        VerdictTable.of(["TP"], kinds=KINDS, reasons=[])
    with pytest.raises(KeyError):
        VerdictTable.of(["XX"], kinds=KINDS, reasons=[""])


def verdicts(detected, reference, kinds=None):
    shown = [VerdictKind(key=key, label=key, side=side, role="correct", counts_as="correct") for key in KINDS
             for side in ("detection", "reference")]  # fmt: skip
    tables = [
        VerdictTable.of(["TP"] * len(side), kinds=KINDS, ids=side.ids, reasons=["because"] * len(side))
        for side in (detected, reference)
    ]
    return Verdicts(
        kinds=tuple(shown) if kinds is None else kinds,
        measures=(Measure(key="gap", title="gap", unit="m"),),
        detection_table=tables[0],
        reference_table=tables[1],
        detected=detected,
        reference=reference,
    )


HOUSES = rb.Footprints.of(
    [shapely.box(0, 0, 9, 9), shapely.box(20, 0, 29, 9)],
    crs="EPSG:25832",
    attributes={"height": [3.0, 4.0], "verdict": ["own", "column"]},
)


def test_frames_carry_geometry_crs_and_the_attributes_of_the_footprints():
    frame = verdicts(HOUSES, rb.Footprints.empty()).detections
    assert frame.crs.to_epsg() == 25832
    assert frame.geometry.area.tolist() == [81.0, 81.0]
    assert frame["height"].tolist() == [3.0, 4.0]
    assert frame["verdict"].tolist() == ["TP", "TP"], "an attribute never replaces a column of the verdicts"
    assert frame["partner"].isna().all()
    assert len(verdicts(HOUSES, rb.Footprints.empty()).references) == 0


def test_verdicts_of_other_footprints_and_undeclared_verdicts_are_refused():
    one = verdicts(HOUSES, HOUSES)
    with pytest.raises(InputError, match="2 verdicts for 0 detections"):
        Verdicts(**{**vars_of(one), "detected": rb.Footprints.empty()})
    with pytest.raises(InputError, match="does not declare the verdict 'FP'"):
        verdicts(HOUSES, HOUSES, kinds=one.kinds[:2])


def vars_of(one):
    return {name: getattr(one, name) for name in one.__dataclass_fields__}
