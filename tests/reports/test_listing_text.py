"""Listings of stored runs: as text, CSV and JSON, in pieces, equal to what the table type makes of the rows."""

import csv
import io
import json

import pytest

from roofbench.benchmark.identity.keys import SourceClosure
from roofbench.benchmark.identity.recipes import PluginRecipe, SceneRecipe
from roofbench.benchmark.store import listing as listings
from roofbench.benchmark.store.listing import list_runs
from roofbench.benchmark.store.outcomes import Cost, Outcome
from roofbench.benchmark.store.records import RunIdentity
from roofbench.benchmark.store.writer import Store
from roofbench.reports.listing_text import format_listing


def fill(path, labels, reason=""):
    """Store one run for each label, every second one failed."""
    with Store(path) as store:
        for number, label in enumerate(labels):
            scene = SceneRecipe.of_preset("hamlet", seed=number + 1)
            identity = RunIdentity(
                detector=PluginRecipe("ndsm", {"height": 2.5}),
                label=label,
                fingerprint=label,
                code=SourceClosure({"module": "digest"}, {"numpy": "2"}),
                scene=scene,
                scene_key=scene.key,
                seed=number,
            )
            cost = Cost(seconds=1.25 * number, cpu_seconds=0.5, peak_memory=10**8)
            failed = Outcome(status="failed", reason=reason)
            store.record(identity, Outcome(status="ok", cost=cost) if number % 2 == 0 else failed, version="1")
    return path


def text_of(path, form, **chosen):
    return "".join(format_listing(list_runs(path, **chosen), form))


@pytest.fixture(params=[1, 2, 5000])
def _at_once(request, monkeypatch):
    monkeypatch.setattr(listings, "_AT_ONCE", request.param)


@pytest.mark.usefixtures("_at_once")
def test_all_forms_hold_all_runs_whatever_the_size_of_the_pieces(tmp_path):
    path = fill(tmp_path / "runs.sqlite", ["one", "two", "a-long-label"], "no roof")
    heading, rule, *lines, total = text_of(path, "table").splitlines()
    assert " ".join(heading.split()) == "run key status detector scene seed found seconds CPU s MB benchmark reason"
    assert set(rule) == {"─", " "}
    assert [line.split()[3] for line in lines] == ["a-long-label", "two", "one"]
    assert lines[1].endswith("no roof")
    assert {line.index("hamlet") for line in lines} == {heading.index("scene")}
    assert total == f"3 of 3 runs in {path}"
    rows = list(csv.DictReader(io.StringIO(text_of(path, "csv"))))
    records = json.loads(text_of(path, "json"))
    assert [row["label"] for row in rows] == [record["label"] for record in records] == ["a-long-label", "two", "one"]
    assert [float(row["seconds"]) for row in rows] == [2.5, 0.0, 0.0]


@pytest.mark.usefixtures("_at_once")
def test_an_empty_choice_is_still_a_table_and_a_list(tmp_path):
    path = fill(tmp_path / "runs.sqlite", ["one"])
    assert text_of(path, "table", detector="x*").splitlines()[-1] == f"0 of 1 run in {path}"
    assert text_of(path, "csv", detector="x*").startswith("id,key,status,label,")
    assert json.loads(text_of(path, "json", detector="x*")) == []


def test_control_characters_become_spaces_and_lines_stay_whole(tmp_path):
    path = fill(tmp_path / "runs.sqlite", ["one", "two"], "first\nsecond \x1b[31mred")
    text = text_of(path, "table")
    assert len(text.splitlines()) == 5
    assert "\x1b" not in text
    assert "first second" in text


def test_wide_characters_keep_the_columns_aligned(tmp_path):
    path = fill(tmp_path / "runs.sqlite", ["one", "屋根"])
    lines = text_of(path, "table").splitlines()
    assert lines[2].index("hamlet") + 2 == lines[3].index("hamlet")  # two characters, each two columns wide
