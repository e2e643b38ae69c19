"""What rb.run returns: tables, Markdown, CSV and data frame of a leaderboard."""

import pytest

import roofbench as rb
from roofbench.core.errors import UnknownNameError
from roofbench.scenes.builtin import hamlet


@pytest.fixture(scope="module")
def path_of_plugin():
    from pathlib import Path

    return f"{Path(__file__).parents[1] / 'plugins' / 'misbehaving.py'}:Misbehaving"


@pytest.fixture(scope="module")
def board(path_of_plugin, tmp_path_factory):
    store = tmp_path_factory.mktemp("board") / "a.sqlite"
    return rb.run(
        scenes=["hamlet[seed=1]", "hamlet[seed=2]", "hamlet[seed=3]"],
        detectors=[
            f"{path_of_plugin}[side=4]",
            f"{path_of_plugin}[side=9]",
            f"{path_of_plugin}[mode=raises,only_on=hamlet-2]",
        ],
        seeds=2,
        store=store,
        index="pixel.quality",
    )


def entry(board, part, pooling="pooled"):
    return next(entry for entry in board.entries if part in entry.label and entry.pooling == pooling)


def test_better_detectors_come_first_and_incomplete_ones_have_no_rank(board):
    assert [entry.rank for entry in board.entries] == [1, 1, 2, 2, None, None]
    assert entry(board, "side=9").rank == 1
    failing = entry(board, "raises")
    assert (failing.scenes, failing.runs, failing.failed) == (2, 6, 2)
    assert board.notes[0] == "Too few scenes for significance tests: 6 needed, 3 available"
    assert board.notes[1:] == (
        "misbehaving[mode=raises,only_on=hamlet-2] has no rank: it has a result on 2 of 3 scenes",
    )


def test_pooled_adds_counts_and_mean_averages_scenes(board, path_of_plugin):
    evaluations = []
    for seed in (1, 2, 3):
        scene = hamlet(seed)
        for stream in (0, 1):
            detected = rb.detect(scene, path_of_plugin, side=9, seed=stream)
            evaluations.append(rb.evaluate(detected, scene.reference, grid=scene.image.grid))
    pooled = rb.pool(evaluations)
    cells = entry(board, "side=9").cells
    for key in ("object.quality", "pixel.quality", "geometric.rmse"):
        assert cells[key].value == pooled.values[key]
    qualities = [evaluation.values["object.quality"] for evaluation in evaluations]
    by_scene = [(one + two) / 2 for one, two in zip(qualities[::2], qualities[1::2], strict=True)]
    assert entry(board, "side=9", "mean").cells["object.quality"].value == pytest.approx(sum(by_scene) / 3)


def test_markdown_names_what_the_figures_are_of(board):
    text = board.to_markdown()
    assert "3 scenes (hamlet-1, hamlet-2, hamlet-3); threshold-free (matching nearest" in text
    assert "pooled" in text
    assert "mean" in text
    assert text.count("- failed: ") == 2
    assert "ZeroDivisionError: no houses at all. Repeat: `roofbench detect " in text
    header = next(line for line in text.splitlines() if line.startswith("|"))
    assert [symbol for symbol in ("C_m %", "C_rr %", "Q_lp %", "M_f", "RMSE m") if symbol not in header] == []


def test_csv_holds_fractions_and_over_how_many_scenes_they_are(board):
    frame = board.to_frame()
    row = frame[(frame["detector"] == "misbehaving") & (frame["pooling"] == "mean")].iloc[0]
    assert 0 < row["object.quality"] < 1
    assert row["object.quality:scenes"] == 3
    assert board.to_csv().splitlines()[0].startswith("rank,group,detector,parameters,pooling,scenes")


def test_ranking_by_an_unknown_index_names_the_nearest(path_of_plugin):
    with pytest.raises(UnknownNameError, match=r"did you mean 'pixel\.quality'"):
        rb.run(scenes=["hamlet"], detectors=[path_of_plugin], index="pixel.qualty")
