"""The one table type and its writers."""

import csv
import io
import json

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from roofbench.reports.format import cell_width, interval_text, number_text, shortened
from roofbench.reports.tables import Column, Table, inert_cell

VALUES = st.one_of(st.none(), st.integers(), st.floats(allow_nan=False), st.text(max_size=30))
TABLES = st.integers(1, 5).flatmap(
    lambda width: st.builds(
        Table.of,
        st.just([Column(f"c{n}", "left" if n % 2 else "right", fixed=n == 0) for n in range(width)]),
        st.lists(st.lists(VALUES, min_size=width, max_size=width), max_size=6),
    )
)


def table():
    return Table.of([Column("detector", "left", fixed=True), Column("Q_l %"), Column("B_f")], [("ndsm", "49.2", None)])


@given(TABLES)
def test_a_text_line_for_the_head_the_rule_and_every_row(table):
    lines = table.to_text().split("\n")
    assert len(lines) == 2 + len(table.rows)
    assert all(line.isprintable() for line in lines)


@given(TABLES)
@example(table=Table.of([Column("a"), Column("b")], [[None, "\r"], ["\r\n", "x\ry"]]))
def test_csv_is_read_back_with_what_was_in_the_cells(table):
    head, *rows = csv.reader(io.StringIO(table.to_csv(), newline=""))
    assert head == [inert_cell(column.title) for column in table.columns]
    texts = [[inert_cell(value) if isinstance(value, str) else value for value in row] for row in table.rows]
    expected = [["" if value is None else str(value) for value in row] for row in texts]
    if len(table.columns) > 1:  # csv cannot tell a row of one empty cell from an empty line
        assert [[cell.replace("\r\n", "\n") for cell in row] for row in rows] == [
            [cell.replace("\r\n", "\n") for cell in row] for row in expected
        ]


@given(TABLES)
def test_json_has_one_object_per_row(table):
    infinite = any(value in (float("inf"), float("-inf")) for row in table.rows for value in row)
    if not infinite:
        assert json.loads(table.to_json()) == table.to_records()


def test_markup_in_cells_stays_text():
    hostile = Table.of([Column("detector|x")], [("<script>a|b*c`",), ("two\nlines",)])
    head, _, first, second = hostile.to_markdown().split("\n")
    assert head.count("|") - head.count("\\|") == 2
    assert "&lt;script&gt;a\\|b\\*c\\`" in first
    assert "two lines" in second
    assert "<script>" not in hostile.to_html()


def test_wide_tables_are_split_with_the_fixed_column_repeated():
    parts = table().to_text(width=16).split("\n")
    assert [line.split() for line in parts[::3]] == [["detector", "Q_l", "%"], ["detector", "B_f"]]


def test_a_long_name_is_cut_where_it_leaves_no_room_for_values():
    long = Table.of([Column("detector", "left", fixed=True), Column("Q_l %")], [("x" * 200, "49.2")])
    lines = long.to_text(width=60).split("\n")
    assert all(cell_width(line) <= 60 for line in lines)
    assert lines[2].endswith("49.2")


def test_wide_characters_take_two_columns():
    lines = Table.of([Column("scene", "left"), Column("n")], [("東京", 1), ("Köln", 2)]).to_text().split("\n")
    assert len({cell_width(line) for line in lines}) == 1


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [(-0.00001, "fraction", "0.0"), (-0.4, "count", "0"), (12_345, "count", "12,345"), (0.9995, "fraction", "100.0")],
)
def test_numbers_are_rounded_without_a_negative_zero(value, unit, text):
    assert number_text(value, unit) == text


def test_signed_numbers_always_have_a_sign():
    assert [number_text(value, "m", signed=True) for value in (-1, 0, 1)] == ["-1.00", "+0.00", "+1.00"]
    assert interval_text(None, 1.0, "m") == ""


@given(st.text(), st.integers(8, 60))
def test_shortened_text_is_not_longer_than_asked(text, width):
    assert len(shortened(text, width)) <= width
    assert "\n" not in shortened(text, width)


def test_texts_that_a_spreadsheet_would_compute_are_texts_in_csv():
    rows = [["=cmd|' /c calc'!A0", -1.5], ["@SUM(A1)", None], ["-x", 2], ["a=b", 3]]
    _, *lines = csv.reader(io.StringIO(Table.of([Column("=a"), Column("b")], rows).to_csv(), newline=""))
    assert lines == [["'=cmd|' /c calc'!A0", "-1.5"], ["'@SUM(A1)", ""], ["'-x", "2"], ["a=b", "3"]]
