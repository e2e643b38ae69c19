"""Records of the results store: the identity of a run, and rows as they are read.

A *run key* is a digest of everything that determines the detections, an *evaluation key* of an evaluator with its
parameters and code.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import shapely

from ...core.digests import digest
from ...core.package import BENCHMARK_VERSION
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.raster import Grid
from ..identity.keys import SourceClosure
from ..identity.recipes import PluginRecipe, SceneRecipe
from .cells import decoding, json_of
from .outcomes import Status

__all__ = ["RunIdentity", "RunRow", "StoredScene", "evaluation_key"]


def evaluation_key(recipe: PluginRecipe, code: str) -> str:
    """Return the key of an evaluator with its parameters and code."""
    return digest([recipe.use, dict(recipe.parameters), code])


@dataclass(frozen=True, kw_only=True)
class RunIdentity:
    """The parts of a run's key.

    Attributes
    ----------
    detector : PluginRecipe
    label : str
        Name with changed parameters, for tables; not part of the key.
    fingerprint : str
        Digest of what the detector reads besides the scene.
    code : SourceClosure
    scene : SceneRecipe
    scene_key : str
    seed : int
    benchmark : int
        Version of the definitions, the suites and the generator.
    """

    detector: PluginRecipe
    label: str
    fingerprint: str
    code: SourceClosure
    scene: SceneRecipe
    scene_key: str
    seed: int
    benchmark: int = BENCHMARK_VERSION

    @property
    def key(self) -> str:
        """SHA-256 of the parts."""
        return digest(
            {
                "detector": self.detector.use.rpartition("/")[2],
                "parameters": dict(self.detector.parameters),
                "fingerprint": self.fingerprint,
                "code": self.code.digest,
                "scene": self.scene_key,
                "seed": self.seed,
                "benchmark": self.benchmark,
            }
        )


class RunRow(NamedTuple):
    """A stored run without its detections; a tuple, because many of them are made.

    `benchmark` is None in stores that did not record it.
    """

    id: int
    key: str
    detector: str
    label: str
    parameters_text: str
    fingerprint: str
    seed: int
    scene: str
    recipe_text: str
    scene_id: int
    scene_key: str
    scene_group: str
    version: str
    benchmark: int | None
    status: Status
    reason: str
    traceback: str
    finished: str
    seconds: float
    cpu_seconds: float
    peak_memory: int
    detected: int | None

    @property
    def parameters(self) -> Mapping[str, Any]:
        """Every parameter of the detector, defaults included."""
        values: Mapping[str, Any] = json_of(self.parameters_text, f"the stored run {self.id}")
        return values

    @property
    def recipe(self) -> SceneRecipe:
        """The recipe of its scene."""
        with decoding(f"the stored scene of run {self.id}"):
            return SceneRecipe.from_dict(json.loads(self.recipe_text))


@dataclass(frozen=True, kw_only=True)
class StoredScene:
    """A stored scene; `reference` is None before the scene was opened for the first time, or when it has none."""

    id: int
    key: str
    name: str
    recipe: SceneRecipe
    content_hash: str | None
    crs: str | None
    extent: tuple[float, float, float, float] | None
    grid: Grid | None
    area: shapely.Geometry | None
    reference: Footprints | None
    facts: Mapping[str, Any]
    point_count: int | None
