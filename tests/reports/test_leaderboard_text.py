"""Leaderboards as text: the summary fits a terminal, other formats hold every index."""

import csv
import io
import json

import pytest
from builders.report_builder import make_report
from rich.console import Console

from roofbench.evaluators.registry import EVALUATORS, make_evaluator
from roofbench.reports.leaderboard_text import show_leaderboards, summary_table


@pytest.fixture
def shown():
    def printed(form, *boards, width=80, **options):
        console = Console(file=io.StringIO(), width=width)
        show_leaderboards(boards, form, console, **options)
        return console.file.getvalue()

    return printed


BOARD = make_report(("improved", "mpp")).boards[0]


def test_the_summary_has_one_line_per_detector_and_one_per_scene(shown):
    text = shown("table", BOARD)
    lines = text.splitlines()
    assert max(map(len, lines)) <= 80
    assert [line.split()[:2] for line in lines if line.split()[1:2] in (["improved"], ["mpp"])][:2] == [
        ["1", "improved"],
        ["2", "mpp"],
    ]
    assert "mean" not in text
    assert "hamlet-2" in text
    assert "mean" in shown("table", BOARD, width=400, wide=True)


@pytest.mark.parametrize("name", EVALUATORS.names())
def test_the_summary_of_every_evaluator_starts_with_the_index_that_ranks(name):
    evaluator = make_evaluator(name)
    for ranking in (evaluator.ranking_index(), evaluator.indices[-1]):
        summary = evaluator.summary_indices(ranking)
        assert summary[0] == ranking
        assert len(set(summary)) == len(summary) <= 6


def test_csv_and_json_hold_every_index_of_both_poolings(shown):
    rows = list(csv.DictReader(io.StringIO(shown("csv", BOARD))))
    assert [(row["detector"], row["pooling"]) for row in rows] == [
        ("improved", "pooled"),
        ("improved", "mean"),
        ("mpp", "pooled"),
        ("mpp", "mean"),
    ]
    (content,) = json.loads(shown("json", BOARD))["leaderboards"]
    assert content["rank_by"] == "object.quality"
    assert [entry["detector"] for entry in content["entries"]] == ["improved", "improved", "mpp", "mpp"]
    for index in BOARD.indices:
        assert index.key in rows[0]
        assert content["entries"][0][index.key] == BOARD.entries[0].cells[index.key].value
    assert content["by_scene"]["hamlet-1"] == {"improved": 0.5, "mpp": 0.5}
    assert len(json.loads(shown("json", BOARD, BOARD))["leaderboards"]) == 2


def test_markdown_is_a_section_with_the_summary_or_every_index(shown):
    assert shown("md", BOARD).startswith("## A report\n")
    assert len(shown("md", BOARD, wide=True)) > len(shown("md", BOARD))


def test_the_heads_of_columns_stand_on_their_rule():
    head, *_ = summary_table(BOARD).to_text().split("────", 1)
    lines = head.splitlines()
    assert lines[-1].split()[:3] == ["rank", "detector", "%"]
    assert "quality" in lines[-2]
