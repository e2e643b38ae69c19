"""An evaluator that fails, unless the environment says that it is repaired."""

import os
from dataclasses import dataclass

import roofbench as rb
from roofbench.evaluators.threshold_free.evaluator import ThresholdFree


@dataclass(frozen=True, kw_only=True)
class Failing(ThresholdFree):
    """Fails in the way that is asked for."""

    name = "failing"
    mode: str = rb.parameter("raises", doc="how it fails")

    def evaluate(self, detected, reference, *, area=None, grid=None):
        if os.environ.get("ROOFBENCH_REPAIRED"):
            return super().evaluate(detected, reference, area=area, grid=grid)
        if self.mode == "crashes":
            os._exit(7)
        raise ZeroDivisionError("no roof\nat all")
