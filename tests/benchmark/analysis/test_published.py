"""The papers' rows, and what can be said of their tables."""

from roofbench.benchmark.analysis.published import PUBLISHED, checks
from roofbench.benchmark.suite import named_suite

CHECKS = {(check.source, check.rule): check for check in checks()}


def check_of(source, rule):
    return next(check for (table, text), check in CHECKS.items() if table.startswith(source) and text.startswith(rule))


def test_every_row_names_a_detector_presets_and_a_source():
    for row in PUBLISHED:
        assert row.detector in ("original", "improved", "mpp", "dempster-shafer")
        assert row.presets
        assert row.source[:4] in ("2010", "2011", "2013")


def test_the_first_entry_beside_a_row_is_one_of_the_suite_of_the_papers():
    labels = {entry.label for entry in named_suite("papers").detectors}
    assert {row.entries[0] for row in PUBLISHED} <= labels


def test_rows_of_another_evaluation_say_so():
    (row,) = (row for row in PUBLISHED if row.detector == "dempster-shafer")
    assert "not by this evaluation" in row.source
    assert row.printed == {"C_m": "44.2", "Q_l": "43.1", "C_mp": "92.1", "Q_lp": "81.8"}


def test_the_table_of_2013_follows_from_counts_digit_for_digit():
    check = check_of("2013", "whole-number counts")
    assert (check.tested, check.failed) == (28, ())


def test_the_area_table_of_2010_obeys_three_identities_and_breaks_one():
    for rule in ("A_oe", "B_f", "M_f"):
        assert check_of("2010", rule).passed
    assert len(check_of("2010", "A_ce").failed) == 3


def test_the_quality_of_2010_does_not_follow_from_its_completeness_and_correctness():
    assert len(check_of("2010", "1/Q_l ").failed) == 3


def test_the_average_of_2011_counts_knox_twice():
    plain = check_of("2011, tables", "object-based indices: the average row is the mean of the rows")
    twice = next(check for (_, rule), check in CHECKS.items() if rule.endswith("Knox counted twice"))
    assert len(plain.failed) == 7
    assert (twice.tested, twice.failed) == (7, ())
