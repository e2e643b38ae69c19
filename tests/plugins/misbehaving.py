"""A detector that finds a few squares, or misbehaves as its parameters say."""

import ctypes
import os
import sys
import time
from dataclasses import dataclass

import numpy as np

import roofbench as rb
from roofbench.detectors.registry import make_detector
from roofbench.scenes.builtin import hamlet


@dataclass(frozen=True, kw_only=True)
class Misbehaving(rb.Detector):
    """Squares of a given side around the centres of a lattice; misbehaves on a chosen scene."""

    name = "misbehaving"
    requires = ("points",)
    stochastic = True

    mode: str = rb.parameter("good", doc="what it does")
    only_on: str = rb.parameter("", doc="built-in scene where it does so, by its name; elsewhere it is good")
    side: float = rb.parameter(8.0, unit="m", minimum=0.1, doc="side of the squares")
    seconds: float = rb.parameter(0.0, unit="s", minimum=0, doc="time that it takes")

    def detect(self, scene, rng):
        here = not self.only_on or hamlet(int(self.only_on.removeprefix("hamlet-"))).points.x[0] == scene.points.x[0]
        if here:
            getattr(self, f"_{self.mode}")(scene)
            if self.mode == "nonsense":
                return "nonsense"
        time.sleep(self.seconds or float(os.environ.get("MISBEHAVING_SECONDS", "0")))
        x, y = np.meshgrid(np.arange(12, 120, 24.0), np.arange(12, 120, 24.0))
        centres = np.stack([x.ravel(), y.ravel()], -1) + scene.extent[:2] + rng.normal(0, 0.5, (25, 2))
        if here and self.mode == "far":
            centres = centres + 1e6
        corners = centres[:, None] + np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * self.side / 2
        return rb.Footprints.from_rectangles(corners)

    def _good(self, scene):
        pass

    _nonsense = _far = _good

    def _raises(self, scene):
        raise ZeroDivisionError("no houses\nat all")

    def _hangs(self, scene):
        time.sleep(1000)

    def _burns(self, scene):
        while time.process_time() < 1.0:
            pass

    def _meddles(self, scene):
        make_detector("ndsm").__class__.detect = lambda self, scene, rng=None: rb.Footprints.empty()

    def _exits(self, scene):
        sys.exit(7)

    def _leaves(self, scene):
        os._exit(9)

    def _crashes(self, scene):
        ctypes.string_at(0)

    def _eats(self, scene):
        hoard = []
        while True:
            hoard.append(np.ones(4_000_000))
            time.sleep(0.01)

    def _spikes(self, scene):
        np.ones(60_000_000)  # 480 MB for some hundredths of a second

    def _swallows(self, scene):
        np.ones(10**13, dtype=np.uint8)

    def _prints(self, scene):
        print("chatter" * 1000)
