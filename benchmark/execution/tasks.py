"""Tasks: what goes to a worker, as text that any executor can carry.

A *task* is one detector with its parameters, one scene, one seed, and the evaluators of the result; a few hundred bytes
of JSON.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Self

from ..identity.recipes import PluginRecipe, SceneRecipe

__all__ = ["Task"]


@dataclass(frozen=True, kw_only=True)
class Task:
    """A run to be executed.

    Attributes
    ----------
    scene, detector : recipes
    seed : int
        Of the detector's random stream; 0 when it draws no random numbers.
    evaluators : tuple of PluginRecipe
    codes : tuple of str
        Digest of the source of each evaluator, where the caller knows it.
    describe_scene : bool
        Whether the outcome should describe the scene and its reference, because they are not stored yet.
    """

    scene: SceneRecipe
    detector: PluginRecipe
    seed: int
    evaluators: tuple[PluginRecipe, ...]
    codes: tuple[str, ...] = ()
    describe_scene: bool = False

    def to_json(self) -> str:
        """Return the task as text."""
        return json.dumps(
            {
                "scene": self.scene.to_dict(),
                "detector": self.detector.to_dict(execution=True),
                "seed": self.seed,
                "evaluators": [recipe.to_dict(execution=True) for recipe in self.evaluators],
                "codes": list(self.codes),
                "describe_scene": self.describe_scene,
            }
        )

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Return the task of a text that `to_json` made."""
        values = json.loads(text)
        return cls(
            scene=SceneRecipe.from_dict(values["scene"]),
            detector=PluginRecipe(**values["detector"]),
            seed=values["seed"],
            evaluators=tuple(PluginRecipe(**recipe) for recipe in values["evaluators"]),
            codes=tuple(values["codes"]),
            describe_scene=values["describe_scene"],
        )
