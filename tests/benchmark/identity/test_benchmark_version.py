import json

import pytest

from tests.builders.benchmark_record import PATH, record


def test_definitions_suites_and_generator_are_those_of_the_version():
    """A change needs another `BENCHMARK_VERSION` and a new record; additions do not."""
    known, now = json.loads(PATH.read_text("utf-8")), record()
    for name, scenes in known["suites"].items():
        assert now["suites"][name] == scenes, f"suite {name} has other scenes: raise BENCHMARK_VERSION"
    for evaluator, values in known["values"].items():
        for key, value in values.items():
            expected = None if value is None else pytest.approx(value, rel=1e-9, abs=1e-12)
            assert now["values"][evaluator][key] == expected, f"{evaluator} {key}: raise BENCHMARK_VERSION"
    expected = {name: pytest.approx(value, rel=1e-9) for name, value in known["generator"].items()}
    assert now["generator"] == expected, "the generator gives another scene: raise BENCHMARK_VERSION"
