"""Completion of names by the shell: what a word that has been started can become."""

from __future__ import annotations

from collections.abc import Iterable

__all__ = ["detectors", "evaluators", "everything", "indices", "plugins", "presets", "suites", "suites_and_scenes"]


def detectors(incomplete: str) -> list[str]:
    """Return the detectors that start so."""
    from ..detectors.registry import DETECTORS

    return _starting(DETECTORS.names(), incomplete)


def evaluators(incomplete: str) -> list[str]:
    """Return the evaluators that start so."""
    from ..evaluators.registry import EVALUATORS

    return _starting(EVALUATORS.names(), incomplete)


def everything(incomplete: str) -> list[str]:
    """Return all names that start so."""
    return [*plugins(incomplete), *suites_and_scenes(incomplete), *indices(incomplete)]


def indices(incomplete: str) -> list[str]:
    """Return the keys of indices that start so, of every evaluator."""
    from ..evaluators.registry import EVALUATORS, make_evaluator

    keys = [index.key for name in EVALUATORS.names() for index in make_evaluator(name).indices]
    return _starting(dict.fromkeys(keys), incomplete)


def plugins(incomplete: str) -> list[str]:
    """Return the detectors and evaluators that start so."""
    return [*detectors(incomplete), *evaluators(incomplete)]


def presets(incomplete: str) -> list[str]:
    """Return the synthetic scenes that start so."""
    from ..benchmark.identity.recipes import preset_names

    return _starting(preset_names(), incomplete)


def suites(incomplete: str) -> list[str]:
    """Return the suites that start so."""
    from ..benchmark.suite import suite_names

    return _starting(suite_names(), incomplete)


def suites_and_scenes(incomplete: str) -> list[str]:
    """Return the suites, scenes, presets and scene folders that start so."""
    from pathlib import Path

    from ..scenes.shipped import shipped_names

    folders = sorted(file.parent.name for file in Path().glob("*/scene.toml"))
    return [*suites(incomplete), *presets(incomplete), *_starting([*shipped_names(), *folders], incomplete)]


def _starting(names: Iterable[str], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]
