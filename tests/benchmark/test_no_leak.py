"""What a detector cannot know: the reference, the classes, the seed, the name of the scene, the store and the suite."""

import gc
import types
from pathlib import Path

import builders.small_scenes as small_scenes
import numpy as np
import pytest
from harness.command_line import roofbench

import roofbench as rb
from roofbench.benchmark.conformance import check_detector
from roofbench.benchmark.identity.recipes import SceneRecipe
from roofbench.benchmark.identity.spool import read_spooled, spool
from roofbench.benchmark.store.writer import Store
from roofbench.detectors.registry import make_detector
from roofbench.detectors.streams import random_stream, random_stream_entropy
from roofbench.scenes.builtin import hamlet

PLUGINS = Path(__file__).parents[1] / "plugins"
#: Beyond these the walk would reach the whole interpreter.
SHARED = (type, types.ModuleType, types.BuiltinFunctionType, types.BuiltinMethodType)


def reachable(start):
    """Yield every object that can be reached from one: attributes, items, closures, and what arrays are views of."""
    seen, waiting = {}, [start]
    while waiting:
        thing = waiting.pop()
        if id(thing) in seen or isinstance(thing, SHARED):
            continue
        seen[id(thing)] = thing
        yield thing
        waiting += gc.get_referents(thing)
        waiting += list(vars(thing).values()) if hasattr(thing, "__dict__") else []
        if isinstance(thing, np.ndarray) and thing.base is not None:
            waiting.append(thing.base)


def scenes(tmp_path):
    small = small_scenes.scene()
    rb.save_scene(small, tmp_path / "folder")
    return {
        "memory": small,
        "folder": rb.open_scene(tmp_path / "folder"),
        "spooled": read_spooled(spool(small, tmp_path), name="spooled-7"),
        "builtin": hamlet(7),
        "preset": SceneRecipe.of_preset("knox-small", seed=7).open(),
        "window": rb.open_scene(tmp_path / "folder").window((500_005, 5_700_005, 500_030, 5_700_030)),
    }


@pytest.fixture(scope="module")
def every_scene(tmp_path_factory):
    return scenes(tmp_path_factory.mktemp("scenes"))


@pytest.mark.parametrize("kind", ["memory", "folder", "spooled", "builtin", "preset", "window"])
def test_nothing_leads_from_a_scene_for_detection_to_the_truth(every_scene, kind, tmp_path):
    scene = every_scene[kind]
    seen = scene.for_detection()
    make_detector("ndsm").detect(seen, np.random.default_rng(0))  # fills whatever a scene caches
    things = list(reachable(seen))
    assert len(things) > 20
    secret = {id(scene), id(scene.reference), id(scene.reference.polygons), id(scene.facts)}
    if scene.points.classification is not None:
        secret.add(id(scene.points.classification))
    for thing in things:
        assert id(thing) not in secret
        assert not isinstance(thing, rb.Footprints | Path | SceneRecipe)
        assert not callable(thing) or isinstance(thing, rb.Scene)
        if isinstance(thing, np.ndarray):
            assert thing.dtype.names is None or "classification" not in thing.dtype.names
        if isinstance(thing, str):
            assert scene.name not in thing
            assert str(tmp_path.parent) not in thing
    assert seen.name == "scene"
    assert (seen.reference, seen.area, seen.facts) == (None, None, {})


def test_the_walk_finds_what_is_hidden():
    secret = small_scenes.scene().reference
    held = rb.Scene("scene", (0, 0, 1, 1), points=lambda: secret)
    assert any(thing is secret for thing in reachable(held))


def test_a_random_stream_is_that_of_the_name_and_does_not_show_it():
    scene, detector = hamlet(3), make_detector("mpp")
    other = rb.Scene("hamlet-4", scene.extent)
    first, again, different = (random_stream(0, place.name, detector.name) for place in (scene, scene, other))
    assert first.random() == again.random() != different.random()
    entropy = random_stream_entropy(0, "hamlet-3", "mpp")
    assert (
        np.random.default_rng(np.random.SeedSequence(entropy)).random()
        == random_stream(0, scene.name, detector.name).random()
    )
    assert first.bit_generator.seed_seq.entropy not in (entropy, *entropy)


def test_a_plugin_that_uses_the_name_finds_nothing_and_is_reported(tmp_path):
    cheating = make_detector(f"{PLUGINS / 'cheating.py'}:Cheating")
    assert len(rb.detect(rb.make_scene("knox-small", seed=1), cheating)) == 0
    broken = {check.rule: check.problem for check in check_detector(cheating) if not check.passed}
    assert list(broken) == ["does not use the name of the scene"]
    assert "under the name 'knox-small-1' it finds other footprints" in broken["does not use the name of the scene"]


def test_an_isolated_detector_sees_neither_store_nor_suite(tmp_path, monkeypatch):
    place = tmp_path / "secret-place"
    place.mkdir()
    (place / "secret-suite.toml").write_text(
        f'[[scenes]]\npreset = "hamlet"\nseeds = [5]\n\n[[detectors]]\nuse = "{PLUGINS / "curious.py"}:Curious"\n'
    )
    monkeypatch.setenv("PWD", str(place))
    monkeypatch.setenv("OLDPWD", str(place))
    roofbench("run", "secret-suite.toml", "--store", "secret-store.sqlite", folder=place)
    with Store(place / "secret-store.sqlite") as store:
        (row,) = store.runs()
        metadata = store.metadata(row.id)
    assert metadata["files"] == []
    assert metadata["scene"][0] == "scene"
    for text in (str(metadata["environment"]), str(metadata["arguments"]), metadata["folder"], str(metadata["scene"])):
        assert "secret" not in text
        assert "hamlet" not in text


SPY = f"{PLUGINS / 'spying.py'}:Spying"


def spied(folder, search, *options):
    """Return what the spying detector learnt on the built-in scene, in a run by a suite and store with known names."""
    (folder / "wombat-suite.toml").write_text(
        f'[[scenes]]\npreset = "hamlet"\nseeds = [5]\n\n[[detectors]]\nuse = "{SPY}"\nsearch = "{search}"\n'
    )
    roofbench("run", "wombat-suite.toml", "--store", "wombat-store.sqlite", *options, folder=folder)
    with Store(folder / "wombat-store.sqlite") as store:
        (row,) = store.runs()
        return row, store.metadata(row.id)


def test_a_detector_that_searches_its_process_finds_nothing(tmp_path):
    """Frames, threads, modules, all objects; environment, command line, folder and files, those of the parent, too."""
    place = tmp_path / "wombat-place"
    place.mkdir()
    row, learnt = spied(place, "all")
    assert (row.status, row.detected) == ("ok", 0)
    assert learnt == {"references": 0, "recipes": [], "secrets": []}


@pytest.mark.parametrize("search", ["frames", "objects"])
def test_the_search_would_find_the_reference_in_a_process_that_holds_it(search):
    scene = hamlet(5)
    assert len(scene.reference)
    found = rb.detect(scene, make_detector(SPY, {"search": search}))
    assert len(found)
    assert found.metadata["references"]


def test_a_spying_plugin_is_reported_by_its_check():
    broken = {check.rule: check.problem for check in check_detector(make_detector(SPY)) if not check.passed}
    assert "does not search its process for the reference" in broken
    assert "runs in this process" in broken["does not search its process for the reference"]


@pytest.mark.parametrize(
    ("plugin", "rule"),
    [
        ("Generating", "opens and generates no scene with a reference"),
        ("Remembering", "does not search its process for the reference"),
    ],
)
def test_a_plugin_that_reaches_the_truth_without_a_name_is_reported(plugin, rule):
    detector = make_detector(f"{PLUGINS / 'generating.py'}:{plugin}")
    broken = {check.rule for check in check_detector(detector) if not check.passed}
    assert rule in broken
