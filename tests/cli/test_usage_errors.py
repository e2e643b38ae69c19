"""Mistakes on the command line end in one clear sentence with a remedy, and exit code 2."""

import os

import pytest
from harness.command_line import roofbench, run

MISTAKES = [
    ("rnu", "roofbench has no command 'rnu' (did you mean 'run'?)"),
    ("scenes mke", "roofbench scenes has no command 'mke' (did you mean 'make'?)"),
    ("run --jbs 3", "roofbench run has no option '--jbs' (did you mean '--jobs'?): 'roofbench run -h' lists them"),
    ("run --jobs x", "--jobs must be a whole number of at least 0, not 'x'"),
    ("run --jobs=-1", "--jobs must be a whole number of at least 0, not '-1'"),
    ("run -jobs 3", "not 'obs' (did you mean '--jobs'?)"),
    ("run --jobs", "--jobs needs a value: write '--jobs N', or see 'roofbench run -h'"),
    ("run --quiet=3", "--quiet takes no value: write --quiet alone"),
    ("run -p 3", "write parameters behind the detector, such as -d 'ndsm[height=3]'"),
    ("run --memory-limit x", "'x' is not a size: write 500M or 8G"),
    ("detect ndsm", "roofbench detect needs SCENE (scene folder"),
    ("detect ndsm", "write 'roofbench detect DETECTOR SCENE', or see 'roofbench detect -h'"),
    ("evaluate a b c", "roofbench evaluate does not take 'c' as well: write 'roofbench evaluate DETECTED REFERENCE'"),
    ("evaluate a b -f tabel", "--format must be one of table, json, csv, md, not 'tabel' (did you mean 'table'?)"),
    ("list detector", "KIND must be one of detectors, evaluators, suites, scenes, indices, not 'detector'"),
    ("new detectr x", "not 'detectr' (did you mean 'detector'?)"),
    ("gate a.json --level 3", "--level must be a number from 1e-06 to 0.5, not '3'"),
    ("scenes fetch --extent 1 2", "--extent needs values: write '--extent XMIN YMIN XMAX YMAX'"),
    ("scenes import", "roofbench scenes import needs --output FOLDER (scene folder to make): write 'roofbench scenes"),
    ("scenes fetch ahn4-bag --extent 1 2 3 x -o y", "--extent must be a number, not 'x'"),
    ("scenes import a.laz -o y --extent 1 two 3 4", "--extent must be a number, not 'two'"),
    ("run quick --rank-by Q_l", "roofbench run has no option '--rank-by' (did you mean '--index'?)"),
    ("evaluate a b --bbox 3", "roofbench evaluate has no option '--bbox': "),
    # Names, which are looked up after the words are read.
    ("run quik", "(did you mean 'quick'?)"),
    ("run delf", "(did you mean 'delft'?)"),
    ("run hamlet --index Q_k", "(did you mean 'Q_l'?); it has object.completeness"),
    ("run hamlet -d ndms", "(did you mean 'ndsm'?)"),
    ("run hamlet -e iouu", "(did you mean 'iou'?)"),
    ("run hamlet --scenes hamelt", "(did you mean 'hamlet-1'?)"),
    ("detect ndsm x.laz", "make a scene folder of it with 'roofbench scenes import'"),
    ("detect ndsm x.laz -o a.gpkg", "make a scene folder of it with 'roofbench scenes import'"),
    ("scenes make knocks -o x", "(did you mean 'knox'?)"),
    ("scenes make knox -p tree_densty=4 -o x", "no parameter 'tree_densty' (did you mean 'tree_density'?)"),
    ("scenes check delf", "(did you mean 'delft'?)"),
    ("scenes fetch ahn4bag", "(did you mean 'ahn4-bag'?)"),
    ("scenes fetch ahn", "(did you mean 'ahn4-bag'?)"),
    ("sweep ndsm hamlet --vary heigth=1,2", "(did you mean 'height'?)"),
    ("sweep ndsm knox-small --vary scene.slop=1,2", "(did you mean"),
    ("run hamlet --scheduler nowhere", "'nowhere' is not the address of a Dask scheduler: write tcp://HOST:PORT"),
    ("info ndms", "(did you mean 'ndsm'?)"),
    ("detect", "needs DETECTOR (NAME, 'NAME[parameter=value,...]' or FILE.py:CLASS)"),
    ("detect ndsm quick -o a.gpkg", "'quick' is a suite, not a scene: 'roofbench run quick' runs it by itself"),
    ("run hamlet quick", "'quick' is a suite, not a scene"),
    ("baseline save", "write 'roofbench baseline save --output FILE'"),
    ("plot gate", "needs RESULT (output of 'roofbench gate ... --format json')"),
    ("report absent.sqlite", "'roofbench run' makes one, or name it by STORE"),
    ("new suite own -o .", ". exists already: name another file"),
]


@pytest.mark.parametrize(("words", "sentence"), MISTAKES, ids=[words for words, _ in MISTAKES])
def test_a_mistake_is_one_sentence(words, sentence, tmp_path):
    answer = roofbench(*words.split(), folder=tmp_path, expect=2)
    assert sentence in answer.stderr
    assert answer.stderr.startswith("Error: ")
    assert answer.stderr.count("\n") == 1
    assert len(answer.stderr) < 700
    assert answer.stdout == ""
    assert not list(tmp_path.iterdir())


def test_a_mistyped_scene_as_reference_is_corrected(tmp_path):
    (tmp_path / "found.geojson").write_text('{"type": "FeatureCollection", "features": []}')
    answer = roofbench("evaluate", "found.geojson", "delf", folder=tmp_path, expect=2)
    assert answer.stderr == "Error: delf: no such file or scene (did you mean 'delft'?)\n"


def test_a_group_without_a_command_shows_its_help():
    for group in ("scenes", "plot", "baseline"):
        code, stdout, stderr = run(group)
        assert "Commands:" in stdout + stderr
        assert "..." not in (stdout + stderr).partition("Commands:")[2]
        assert code == 2


@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        ("rep", "report"),
        ("run qui", "quick"),
        ("run delf", "delft"),
        ("run -d or", "original"),
        ("run --index Q_l", "Q_l"),
        ("run --scenes fairf", "fairfield"),
        ("detect nd", "ndsm"),
        ("detect ndsm del", "delft"),
        ("info thre", "threshold-free"),
        ("list d", "detectors"),
        ("new ev", "evaluator"),
        ("scenes fe", "fetch"),
        ("scenes fetch ah", "ahn4-bag"),
        ("gate --against nd", "ndsm"),
        ("score --suite pap", "papers"),
    ],
)
def test_names_are_completed(typed, completed, monkeypatch, capfd):
    words = typed.split()
    monkeypatch.setenv("_ROOFBENCH_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", f"roofbench {typed}")
    monkeypatch.setenv("COMP_CWORD", str(len(words)))
    code, stdout, _ = run()
    assert os.environ["COMP_CWORD"] == str(len(words))
    assert code == 0
    assert completed in stdout.split()
