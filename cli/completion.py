"""Shell completion of names."""

from __future__ import annotations

from collections.abc import Iterable

__all__ = [
    "detectors",
    "evaluators",
    "everything",
    "indices",
    "plugins",
    "presets",
    "recipes",
    "scenes",
    "suites",
    "suites_and_scenes",
]


def detectors(incomplete: str) -> list[str]:
    """Return the detectors that start with the typed text."""
    from ..detectors.registry import DETECTORS

    return _starting(DETECTORS.names(), incomplete)


def evaluators(incomplete: str) -> list[str]:
    """Return the evaluators that start with the typed text."""
    from ..evaluators.registry import EVALUATORS

    return _starting(EVALUATORS.names(), incomplete)


def everything(incomplete: str) -> list[str]:
    """Return all names that start with the typed text."""
    return [*plugins(incomplete), *suites_and_scenes(incomplete), *indices(incomplete)]


def indices(incomplete: str) -> list[str]:
    """Return the keys and symbols of indices of all evaluators that start with the typed text."""
    from ..evaluators.registry import EVALUATORS

    every = [index for name in EVALUATORS.names() for index in EVALUATORS.get(name).indices]
    names = [*(index.key for index in every), *(index.symbol for index in every if index.symbol)]
    return _starting(dict.fromkeys(names), incomplete)


def plugins(incomplete: str) -> list[str]:
    """Return the detectors and evaluators that start with the typed text."""
    return [*detectors(incomplete), *evaluators(incomplete)]


def presets(incomplete: str) -> list[str]:
    """Return the synthetic scenes that start with the typed text."""
    from ..benchmark.identity.recipes import preset_names

    return _starting(preset_names(), incomplete)


def recipes(incomplete: str) -> list[str]:
    """Return the recipes of open data that start with the typed text."""
    from ..scenes.fetching import open_data_names

    return _starting(open_data_names(), incomplete)


def scenes(incomplete: str) -> list[str]:
    """Return the shipped scenes, presets and scene folders that start with the typed text."""
    from pathlib import Path

    from ..scenes.shipped import shipped_names

    folders = sorted(file.parent.name for file in Path().glob("*/scene.toml"))
    return [*presets(incomplete), *_starting([*shipped_names(), *folders], incomplete)]


def suites(incomplete: str) -> list[str]:
    """Return the suites that start with the typed text."""
    from ..benchmark.suite import suite_names

    return _starting(suite_names(), incomplete)


def suites_and_scenes(incomplete: str) -> list[str]:
    """Return the suites, suite files, scenes, presets and scene folders that start with the typed text."""
    from pathlib import Path

    files = _starting(sorted(str(file) for file in Path().glob("*.toml")), incomplete)
    return [*suites(incomplete), *scenes(incomplete), *files]


def _starting(names: Iterable[str], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]
