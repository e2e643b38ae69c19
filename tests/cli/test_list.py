"""``roofbench list`` and ``roofbench info``: what there is, each name with its meaning."""

import json
import re

import pytest
from harness.command_line import roofbench

import roofbench as rb
from roofbench.benchmark.catalogue import KINDS, entries, entries_of
from roofbench.core.errors import UnknownNameError
from roofbench.scenes.builtin import hamlet


@pytest.mark.parametrize("kind", KINDS)
def test_every_entry_has_a_name_and_its_whole_meaning_at_80_columns(kind, tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    text = roofbench("list", kind, folder=tmp_path).stdout
    assert max(map(len, text.splitlines())) <= 80
    found = entries(kind)
    blocks = re.split(r"\n(?! )", text.rstrip("\n"))
    assert len(blocks) == len(found) > 0
    for block, entry in zip(blocks, found, strict=True):
        assert entry.meaning
        words = block.replace("-\n", "- ").split()
        assert words[0] == entry.name
        assert "".join(words).endswith("".join(entry.meaning.split()))


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_listed_can_be_explained(kind):
    for entry in entries(kind):
        assert entry.name in [found.name for found in entries_of(entry.name)]


def test_a_list_can_be_read_by_programs(tmp_path):
    rows = json.loads(roofbench("list", "detectors", "-f", "json", folder=tmp_path).stdout)
    assert {"name", "inputs", "random", "meaning"} == set(rows[0])
    assert "ndsm" in [row["name"] for row in rows]
    assert roofbench("list", "suites", "-f", "csv", folder=tmp_path).stdout.startswith("name,scenes,")


def test_scene_folders_are_listed_beside_presets(tmp_path):
    rb.save_scene(hamlet(1), tmp_path / "village")
    assert "village" in roofbench("list", "scenes", folder=tmp_path).stdout
    assert "scene folder with points" in roofbench("info", "village", folder=tmp_path).stdout


def test_a_detector_is_explained_with_its_parameters(tmp_path):
    assert "row_share [0.85]" in roofbench("info", "rows", folder=tmp_path).stdout
    message = roofbench("info", "ndsm", folder=tmp_path).stdout
    assert "ndsm (detector)" in message
    assert "height [2.5 m], from 0.5 to 20 m" in message
    assert "doi:10.1080/2150704X.2013.846487" in roofbench("info", "mpp-printed", folder=tmp_path).stdout
    assert "Source: Awrangjeb 2010, section 3.2" in message
    assert "Example: roofbench run quick -d 'ndsm[height=1.5]'" in message


def test_a_selection_is_explained_with_the_values_of_its_mode_and_readings_apart(tmp_path):
    text = roofbench("info", "original[mode=paper,rise=0.05]", folder=tmp_path).stdout
    for shown in ("mode [paper]", "rise [0.05]", "marking [squares]", "neighbourhood [0.75 m]"):
        assert shown in text
    printed, _, readings = text.partition("Readings of what the source leaves open")
    assert "ground_tile [450 px of 0.15 m]" in printed
    assert "marking [squares]" in readings


@pytest.mark.parametrize("name", ["Q_l", "object.quality"])
def test_an_index_is_explained_by_key_and_by_symbol(name, tmp_path):
    text = roofbench("info", name, folder=tmp_path).stdout
    assert "quality: TP/(TP+FP+FN)" in text
    assert "range      0 to 1" in text


def test_an_index_of_two_evaluators_is_explained_for_both():
    assert {entry.facts["evaluator"] for entry in entries_of("object.quality")} >= {"threshold-free", "rutzinger"}


@pytest.mark.parametrize(
    ("name", "nearest"),
    [("ndms", "ndsm"), ("quik", "quick"), ("fairfeild", "fairfield"), ("object.qualty", "object.quality")],
)
def test_a_name_that_does_not_exist_is_answered_with_the_nearest(name, nearest):
    with pytest.raises(UnknownNameError, match=f"did you mean '{nearest}'"):
        entries_of(name)


def test_a_plugin_of_a_file_is_explained(misbehaving, tmp_path):
    assert "(detector)" in roofbench("info", misbehaving, folder=tmp_path).stdout
