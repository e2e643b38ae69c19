import pytest

from roofbench.benchmark.suite import named_suite, read_suite, scenes_of, suite_names
from roofbench.core.errors import RoofbenchError


@pytest.fixture
def suite_file(tmp_path, misbehaving):
    def write(text):
        path = tmp_path / "my.toml"
        path.write_text(text.replace("PLUGIN", misbehaving))
        return path

    return write


GOOD = """\
name = "own"

[[scenes]]
preset = "hamlet"
seeds = [4, 7]

[[detectors]]
use = "PLUGIN"
side = 7
seeds = 3

[[evaluators]]
use = "threshold-free"
matching = "overlap"
"""


def test_a_suite_lists_scenes_detectors_and_evaluators(suite_file):
    suite = read_suite(suite_file(GOOD))
    assert suite.name == "own"
    assert [scene.name for scene in suite.scenes] == ["hamlet-4", "hamlet-7"]
    assert [(entry.label, entry.seeds) for entry in suite.detectors] == [("misbehaving[side=7]", (0, 1, 2))]
    assert [evaluator.matching for evaluator in suite.evaluators] == ["overlap"]


def test_scenes_and_seeds_are_selected(suite_file):
    suite = read_suite(suite_file(GOOD))
    assert [scene.name for scene in suite.with_scenes("*-7").scenes] == ["hamlet-7"]
    assert [scene.name for scene in suite.with_seeds(3).scenes] == ["hamlet-1", "hamlet-2", "hamlet-3"]
    with pytest.raises(RoofbenchError, match="no scene matches 'knox"):
        suite.with_scenes("knox*")


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ('name = "own"', 'nmae = "own"', r"line 1: unknown key 'nmae' \(did you mean 'name'\?\)"),
        ('"hamlet"', '"hamlt"', r"line 4: no preset 'hamlt' \(did you mean 'hamlet'\?\).* in \[\[scenes\]\] number 1"),
        ("side = 7", "side = -7", r"line 9: misbehaving: side must be at least 0.1 m, not -7 in \[\[detectors\]\]"),
        ("side = 7", "sied = 7", r"line 9: misbehaving: no parameter 'sied' \(did you mean 'side'\?\)"),
        ("seeds = 3", 'seeds = "many"', r"line 10: seeds must be a number of seeds or a list"),
        ('"threshold-free"', '"treshold-free"', r"line 13: no evaluator called 'treshold-free'"),
        ('preset = "hamlet"', 'path = "nowhere"', r"line 5: 'seeds' is not allowed for a scene with a path"),
        ("[[scenes]]", "[scenes]", r"write scenes as tables with the heading \[\[scenes\]\]"),
        ('preset = "hamlet"', "preset = ", r"no valid TOML: .*line 4"),
    ],
)
def test_a_mistake_is_named_with_its_line(suite_file, before, after, message):
    with pytest.raises(RoofbenchError, match=message):
        read_suite(suite_file(GOOD.replace(before, after)))


def test_a_list_is_a_sweep_axis(suite_file):
    varied = GOOD.replace('"hamlet"', '"knox-small"').replace("seeds = [4, 7]", "seeds = 2\nslope = [0, 5]")
    suite = read_suite(suite_file(varied))
    assert [scene.name for scene in suite.scenes] == [
        "knox-small-1[slope=0]",
        "knox-small-2[slope=0]",
        "knox-small-1[slope=5]",
        "knox-small-2[slope=5]",
    ]
    assert {scene.group for scene in suite.scenes} == {"knox-small[slope=0]", "knox-small[slope=5]"}
    with pytest.raises(RoofbenchError, match=r"line 6: .*slpe.* in \[\[scenes\]\] number 1"):
        read_suite(suite_file(varied.replace("slope", "slpe")))


def test_the_group_of_a_scene_is_its_preset_even_where_that_has_a_number():
    words = ["fairfield-1-small[seed=1]", "fairfield-small[seed=1]", "fairfield-1[seed=1,slope=5]", "hamlet[seed=1]"]
    groups = [scene.group for scene in scenes_of(words)]
    assert groups == ["fairfield-1-small", "fairfield-small", "fairfield-1[slope=5]", "hamlet"]


def test_words_name_scenes():
    (scene,) = scenes_of(["hamlet[seed=3]"])
    assert (scene.name, scene.seed, scene.word) == ("hamlet-3", 3, "hamlet[seed=3]")
    (real,) = scenes_of(["delft"])
    assert (real.name, real.word, real.group, real.contents) == ("delft", "delft", "delft", real.open().contents)
    with pytest.raises(RoofbenchError, match=r"'hamet' is not a scene, preset or suite \(did you mean 'hamlet'"):
        scenes_of(["hamet"])


@pytest.mark.parametrize("name", suite_names())
def test_suites_that_come_with_roofbench_can_be_read(name):
    assert named_suite(name).scenes


def test_the_quick_suite_has_two_real_scenes_and_names_its_detectors():
    quick = named_suite("quick")
    assert [scene.name for scene in quick.scenes[:2]] == ["delft", "ign"]
    assert [scene.kind for scene in quick.scenes] == ["shipped"] * 2 + ["preset"] * 4
    assert [entry.label for entry in quick.detectors] == ["ndsm", "original", "improved", "mpp"]


def test_a_scene_that_comes_with_roofbench_is_named_in_a_suite(suite_file):
    suite = read_suite(suite_file(GOOD.replace('preset = "hamlet"', 'name = "delft"').replace("seeds = [4, 7]\n", "")))
    assert [scene.word for scene in suite.scenes] == ["delft"]
    with pytest.raises(RoofbenchError, match=r"line 4: no scene called 'delf' comes with roofbench .*'delft'"):
        read_suite(suite_file(GOOD.replace('preset = "hamlet"', 'name = "delf"').replace("seeds = [4, 7]\n", "")))
    with pytest.raises(RoofbenchError, match=r'line 4: there is no folder .*delft; .* is named by name = "delft"'):
        read_suite(suite_file(GOOD.replace('preset = "hamlet"', 'path = "delft"').replace("seeds = [4, 7]\n", "")))
