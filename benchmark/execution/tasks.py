"""Tasks: what goes to a worker, as text that any executor can carry.

A *task* is one detector with its parameters, one scene, one seed, and the evaluators of the result; a few hundred bytes
of JSON.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any, Self

from ...detectors.tiling import Measured, Tile
from ..identity.recipes import PluginRecipe, SceneRecipe

__all__ = ["Task", "TilePart"]


@dataclass(frozen=True, kw_only=True)
class TilePart:
    """The part of a scene that a task is about.

    Attributes
    ----------
    tile : Tile
    halo : float
        Metres around it that the detector sees, too.
    measured : Measured
        What all tiles share.
    """

    tile: Tile
    halo: float
    measured: Measured


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
    part : TilePart, optional
        Detect on a tile instead of the whole scene, and keep what it owns.
    ahead : Tile, optional
        What the worker is given next, probably: it reads that window while it computes.
    tiles : tuple of str
        Files with the outcomes of all tiles of a city (`tile_outcomes`): they are joined, nothing is detected.
    """

    scene: SceneRecipe
    detector: PluginRecipe
    seed: int
    evaluators: tuple[PluginRecipe, ...]
    codes: tuple[str, ...] = ()
    describe_scene: bool = False
    part: TilePart | None = None
    ahead: Tile | None = None
    tiles: tuple[str, ...] = ()

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
                "part": None if self.part is None else {**asdict(self.part), "measured": self.part.measured._asdict()},
                "ahead": None if self.ahead is None else asdict(self.ahead),
                "tiles": list(self.tiles),
            }
        )

    @classmethod
    def from_json(cls, text: str) -> Self:
        """Return the task of a text that `to_json` made."""
        values = json.loads(text)
        part = values["part"]
        return cls(
            scene=SceneRecipe.from_dict(values["scene"]),
            detector=PluginRecipe(**values["detector"]),
            seed=values["seed"],
            evaluators=tuple(PluginRecipe(**recipe) for recipe in values["evaluators"]),
            codes=tuple(values["codes"]),
            describe_scene=values["describe_scene"],
            part=None if part is None else _part(**part),
            ahead=None if values["ahead"] is None else Tile(**values["ahead"]),
            tiles=tuple(values["tiles"]),
        )


def _part(tile: dict[str, Any], halo: float, measured: dict[str, Any]) -> TilePart:
    return TilePart(tile=Tile(**tile), halo=halo, measured=Measured(**measured))
