"""Fixtures for all rooms, and the profile of the property tests."""

from pathlib import Path

import pytest
from harness.effort import use_profile

from roofbench.benchmark.execution.tasks import Task
from roofbench.benchmark.identity.recipes import PluginRecipe, SceneRecipe
from roofbench.detectors.registry import DETECTORS
from roofbench.evaluators.registry import EVALUATORS

use_profile()


def pytest_collection_modifyitems(items):
    """Run the slow tests first: one worker compiles the kernels of whole detectors while the other takes the rest."""
    items.sort(key=lambda item: item.get_closest_marker("slow") is None)


MISBEHAVING = f"{Path(__file__).parent / 'plugins' / 'misbehaving.py'}:Misbehaving"


def pytest_make_parametrize_id(val, argname):
    """Name long values by their length: older versions of pytest write all of them, a hundred million bytes of one."""
    return f"{argname}-of-{len(val)}" if isinstance(val, str | bytes) and len(val) > 300 else None


@pytest.fixture(autouse=True)
def plugins_of_this_test_only(monkeypatch):
    """Forget the plugins that a test adds: ``-e all`` would use them in the next one."""
    for registry in (DETECTORS, EVALUATORS):
        monkeypatch.setattr(registry, "_added", dict(registry._added))


@pytest.fixture
def misbehaving():
    return MISBEHAVING


@pytest.fixture
def task_of():
    def build(mode="good", *, seed=0, scene_seed=0, evaluators=("threshold-free",), **parameters):
        return Task(
            scene=SceneRecipe.of_preset("hamlet", seed=scene_seed),
            detector=PluginRecipe(MISBEHAVING, {"mode": mode, **parameters}),
            seed=seed,
            evaluators=tuple(PluginRecipe(name, {}) for name in evaluators),
        )

    return build
