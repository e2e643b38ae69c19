"""What a version of the benchmark stands for: scenes of suites, values of evaluators, a generated scene.

``python -m tests.builders.benchmark_record`` writes it for the present version; do that after raising
`roofbench.core.package.BENCHMARK_VERSION`, never to make a test pass under the same version.
"""

import json
from pathlib import Path

import numpy as np
import shapely

import roofbench as rb
from roofbench.benchmark.suite import named_suite, suite_names
from roofbench.core.package import BENCHMARK_VERSION
from roofbench.evaluators.registry import EVALUATORS

PATH = Path(__file__).parents[1] / "data" / f"benchmark-{BENCHMARK_VERSION}.json"


def outlines():
    """Return detections and references: a match, a shift, a split, a merge, a miss, a false alarm, an L shape."""
    box = shapely.box
    angle = shapely.union(box(0, 100, 20, 110), box(0, 100, 10, 130))
    detected = [box(0, 0, 10, 10), box(21, 1, 31, 11), box(40, 0, 45, 10), box(45, 0, 50, 10), box(60, 0, 80, 10)]
    reference = [box(0, 0, 10, 10), box(20, 0, 30, 10), box(40, 0, 50, 10), box(60, 0, 70, 10), box(70, 0, 80, 10)]
    return (
        rb.Footprints.of([*detected, box(200, 0, 210, 10), box(0, 100, 20, 130)], crs="EPSG:25832"),
        rb.Footprints.of([*reference, box(300, 0, 320, 10), angle], crs="EPSG:25832"),
    )


def record():
    """Return what the present code gives."""
    detected, reference = outlines()
    values = {
        name: dict(rb.evaluate(detected, reference, evaluator=name).values)
        for name in EVALUATORS.names()
        if EVALUATORS.get(name).__module__.startswith("roofbench.")
    }
    scene = rb.make_scene("knox-small", seed=1)
    generated = {
        "points": len(scene.points),
        "references": len(scene.reference),
        "area": float(np.sum(shapely.area(scene.reference.polygons))),
        "height": float(np.mean(scene.points.z)),
    }
    suites = {name: [scene.name for scene in named_suite(name).scenes] for name in suite_names()}
    return {"suites": suites, "values": values, "generator": generated}


if __name__ == "__main__":
    PATH.write_text(json.dumps(record(), indent=1) + "\n", encoding="utf-8")
