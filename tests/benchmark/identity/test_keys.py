import importlib.util
import sys

import pytest

from roofbench.benchmark.identity import keys
from roofbench.benchmark.identity.keys import source_closure
from roofbench.detectors.streams import random_stream_entropy
from roofbench.evaluators.threshold_free.evaluator import ThresholdFree


def load(path, name):
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def plugin(tmp_path):
    numbers = iter(range(100))

    def build(source, helper="LIMIT = 3\n"):
        folder = tmp_path / str(next(numbers))
        folder.mkdir()
        (folder / "helper_of_plugin.py").write_text(helper)
        (folder / "plug.py").write_text(source)
        keys.module_file.cache_clear()
        sys.path.insert(0, str(folder))
        try:
            return load(folder / "plug.py", f"roofbench_plugin_{folder.name}").Plain
        finally:
            sys.path.remove(str(folder))
            sys.modules.pop("helper_of_plugin", None)

    return build


SOURCE = "import roofbench as rb\nimport scipy\nimport helper_of_plugin\n\nclass Plain:\n    base = rb.Footprints\n"


def same_code(one, two):
    return list(one.modules.values()) == list(two.modules.values())


def test_comments_and_docstrings_do_not_change_a_closure(plugin):
    commented = SOURCE.replace("class Plain:\n", 'class Plain:\n    """Plain."""\n\n    # why\n')
    assert same_code(source_closure(plugin(SOURCE)), source_closure(plugin(commented)))


def test_code_changes_a_closure(plugin):
    one, two = source_closure(plugin(SOURCE)), source_closure(plugin(SOURCE + "    limit = 3\n"))
    assert not same_code(one, two)


def test_a_file_beside_the_plugin_counts(plugin):
    one, two = source_closure(plugin(SOURCE)), source_closure(plugin(SOURCE, helper="LIMIT = 4\n"))
    assert one.modules["helper_of_plugin"] != two.modules["helper_of_plugin"]


def test_the_parts_of_roofbench_that_a_plugin_uses_count_and_others_do_not(plugin):
    closure = source_closure(plugin(SOURCE))
    assert "roofbench.scenes.geodata.footprints" in closure.modules
    assert not any("evaluators" in module or "benchmark" in module for module in closure.modules)


def test_versions_of_imported_packages_count(plugin):
    assert {"numpy", "shapely", "scipy", "python"} <= set(source_closure(plugin(SOURCE)).packages)


def test_an_evaluator_depends_on_its_own_modules_and_on_no_detector():
    modules = source_closure(ThresholdFree).modules
    assert "roofbench.evaluators.overlay.areas" in modules
    assert not any("detectors" in module for module in modules)


def test_random_streams_differ_by_seed_scene_and_detector():
    streams = {
        tuple(random_stream_entropy(*key))
        for key in [(0, "a", "b"), (1, "a", "b"), (0, "c", "b"), (0, "a", "c"), (0, "b", "a")]
    }
    assert len(streams) == 5
