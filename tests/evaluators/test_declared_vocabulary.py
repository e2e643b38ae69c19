"""An evaluator with other verdicts and indices reaches every table, map, report, gate and sweep by its declaration."""

import json
import re
from pathlib import Path

import numpy as np
import pyogrio
import pytest
from harness.command_line import roofbench

import roofbench as rb
from roofbench.benchmark.identity import provenance
from roofbench.evaluators.registry import EVALUATORS
from roofbench.scenes.builtin import hamlet

TOY = f"{Path(__file__).parents[1] / 'plugins' / 'toy_evaluator.py'}:Darts"
HAMLETS = ["hamlet[seed=1]", "hamlet[seed=2]"]


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    folder = tmp_path_factory.mktemp("toy")
    answer = roofbench("run", *HAMLETS, "-d", "ndsm", "-e", TOY, "-j", 0, "-o", "out", "--wide", folder=folder)
    return folder, answer.stdout


def test_the_leaderboard_ranks_by_the_declared_index_and_names_its_symbols(stored):
    _, printed = stored
    assert all(symbol in printed for symbol in ("H_t %", "S_t %", "F_d %"))
    assert "ranked by hits" in printed
    assert "Q_l" not in printed


def test_the_report_draws_and_names_the_declared_verdicts(stored):
    folder, _ = stored
    page = (folder / "out" / "report.html").read_text()
    data = json.loads(re.search(r'<script[^>]*type="application/json"[^>]*>(.*?)</script>', page, re.DOTALL)[1])
    assert [kind["key"] for kind in data["kinds"]] == ["hit", "graze", "stray", "safe", "pierced"]
    assert data["measures"] == [{"title": "gap to the wall", "unit": "m", "decimals": 2}]
    overlay = data["scenes"][0]["overlays"][0]
    assert set(overlay["detections"]["verdicts"]) <= {0, 1, 2}
    assert set(overlay["references"]["verdicts"]) <= {3, 4}
    # Errors are strays and grazes with their own area, and houses without a dart.
    assert data["errors"]
    assert "shares of darts" in page
    assert not re.search(r"\bQ_l|\bTP\b|threshold-free", page)


def test_a_picture_of_a_stored_scene_counts_the_declared_verdicts(stored):
    folder, _ = stored
    roofbench("plot", "scene", "hamlet-1", "--store", "roofbench.sqlite", "-o", "scene.svg", folder=folder)
    assert (folder / "scene.svg").stat().st_size > 0


def test_an_export_carries_the_declared_verdicts(stored):
    folder, _ = stored
    roofbench("export", 1, "-o", "run.gpkg", folder=folder)
    detections = pyogrio.read_dataframe(folder / "run.gpkg", layer="detections")
    assert set(detections["verdict"]) <= {"hit", "graze", "stray"}
    assert detections["gap"].notna().all()


def test_a_sweep_shows_the_declared_index(stored):
    folder, _ = stored
    answer = roofbench(
        "sweep", "ndsm", *HAMLETS, "--vary", "height=2,6", "-e", TOY, "-j", 0, "-o", "sweep.csv", folder=folder
    )
    assert "hits" in answer.stdout
    assert "share.strays" in (folder / "sweep.csv").read_text()


def test_the_gate_holds_the_declared_indices(tmp_path, monkeypatch, misbehaving):
    monkeypatch.setattr(provenance, "_git", lambda *arguments: None)
    provenance.code_version.cache_clear()
    (tmp_path / "toy.toml").write_text(
        'name = "toy"\n[[scenes]]\npreset = "hamlet"\nseeds = 9\n'
        f'[[detectors]]\nuse = "{misbehaving}"\n[[evaluators]]\nuse = "{TOY}"\n'
    )
    roofbench("baseline", "save", "-o", "b.json", "--suite", "toy.toml", "-j", 0, folder=tmp_path)
    answer = roofbench("gate", "b.json", "-j", 0, folder=tmp_path)
    provenance.code_version.cache_clear()
    assert "passed: 2 equal" in answer.stdout
    assert "hits" in answer.stdout
    assert "strays" in answer.stdout


def test_a_comparison_of_two_files_prints_writes_and_draws_them(tmp_path):
    reference = hamlet(1).reference
    moved = rb.Footprints.of(reference.polygons[4:], crs=reference.crs)
    far = rb.Footprints.of(
        [*moved.polygons, rb.Footprints.from_rectangles([[[0, 0], [9, 0], [9, 9], [0, 9]]]).polygons[0]],
        crs=reference.crs,
    )
    rb.write_footprints(far, tmp_path / "found.gpkg")
    rb.write_footprints(reference, tmp_path / "register.gpkg")
    answer = roofbench(
        *("evaluate", "found.gpkg", "register.gpkg", "-e", TOY, "-f", "json"),
        *("--verdicts", "verdicts.geojson", "--plot", "map.png"),
        folder=tmp_path,
    )
    content = json.loads(answer.stdout)
    assert content["counts"]["strays"] == 1
    assert content["share"]["hits"] == pytest.approx(len(moved) / len(far))
    layer = pyogrio.read_dataframe(tmp_path / "verdicts.geojson")
    assert set(layer["verdict"]) == {"hit", "stray", "safe", "pierced"}
    assert (tmp_path / "map.png").stat().st_size > 0


@pytest.mark.parametrize("form", ["table", "md", "csv", "json"])
def test_all_evaluators_are_printed_in_one_table(tmp_path, form):
    reference = hamlet(1).reference
    rb.write_footprints(reference, tmp_path / "a.gpkg")
    answer = roofbench("evaluate", "a.gpkg", "a.gpkg", "-e", "all", "-f", form, folder=tmp_path)
    for name in EVALUATORS.names():
        assert name in answer.stdout
    if form == "json":
        content = json.loads(answer.stdout)
        assert content["iou"]["iou"]["f1"] == 1.0
        assert len(content["shufelt"]["curves"]["references_covered"]["y"]) == 101
    refused = roofbench("evaluate", "a.gpkg", "a.gpkg", "-e", "all", "--plot", "a.png", folder=tmp_path, expect=2)
    assert "show one evaluator" in refused.stderr


def test_no_other_room_knows_the_vocabulary_of_an_evaluator():
    words = re.compile(r"threshold[-_]free|object\.quality|[\"'](TP|MD|FP|FN)[\"']")
    rooms = [Path(rb.__file__).parent / room for room in ("core", "scenes", "detectors", "benchmark", "reports", "cli")]
    files = [path for room in rooms for kind in ("py", "js", "j2", "toml") for path in room.rglob(f"*.{kind}")]
    assert len(files) > 100
    assert not [path.name for path in files if words.search(path.read_text(encoding="utf-8"))]


def test_an_index_is_found_by_key_and_symbol_and_an_unknown_one_names_the_nearest():
    evaluator = rb.make_evaluator(TOY)
    assert evaluator.index("H_t") is evaluator.index("share.hits")
    assert evaluator.ranking_index("F_d").key == "share.found"
    with pytest.raises(rb.RoofbenchError, match=r"no index 'share\.hit' \(did you mean 'share\.hits'\?\)"):
        evaluator.index("share.hit")


@pytest.mark.parametrize("name", sorted({*EVALUATORS.names()} - {"darts"}))
def test_every_declaration_is_whole(name):
    evaluator = rb.make_evaluator(name)
    keys = [index.key for index in evaluator.indices]
    assert len(set(keys)) == len(keys)
    symbols = [index.symbol for index in evaluator.indices if index.symbol]
    assert len(set(symbols)) == len(symbols)
    assert all(index.meaning and index.source and index.unit for index in evaluator.indices)
    assert evaluator.ranking_index().better != "neither"
    assert evaluator.gated_indices()
    assert set(evaluator.swept_indices()) <= set(evaluator.indices)
    empty = evaluator.evaluate(rb.Footprints.empty(), rb.Footprints.empty())
    assert list(empty.values) == keys
    for kind in evaluator.verdict_kinds:
        assert kind in evaluator.kinds_of(kind.side)
    assert evaluator.tallies_type.from_dict(json.loads(json.dumps(empty.tallies.to_dict()))) == empty.tallies
    assert np.isfinite([value for value in empty.values.values() if value is not None]).all()
