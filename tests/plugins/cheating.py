"""A detector that regenerates the truth from the name of the scene."""

from dataclasses import dataclass

import roofbench as rb


@dataclass(frozen=True, kw_only=True)
class Cheating(rb.Detector):
    """The reference of the scene that has this name."""

    name = "cheating"

    def detect(self, scene, rng):
        preset, _, seed = scene.name.rpartition("-")
        return rb.make_scene(preset, seed=int(seed)).reference if preset else rb.Footprints.empty()
