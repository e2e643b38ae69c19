"""Conformance: the rules of detectors and evaluators, checked on the built-in scene.

``roofbench check-plugin NAME`` runs these checks on a plugin before it is used on real scenes.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from ..core.errors import RoofbenchError, UnsupportedError
from ..core.parameters import Parameterised
from ..core.processes import Limits
from ..detectors.base import Detector
from ..detectors.streams import random_stream
from ..evaluators.base import Evaluation, Evaluator
from ..scenes.builtin import hamlet
from ..scenes.geodata.footprints import Footprints
from ..scenes.scene import NEUTRAL_NAME, Scene
from .execution.isolation import IsolatedProcess
from .execution.tasks import Task
from .execution.worker import detect, execute
from .identity.recipes import PluginRecipe, SceneRecipe
from .identity.spool import spool
from .store.outcomes import Outcome

__all__ = ["Check", "check_detector", "check_evaluator", "check_plugin"]

_SECONDS = 300.0
#: Names of generated scenes, with which a detector is tried on other measurements.
_BAITS = ("knox-small-1", "hamlet-2")
_SEARCH = "does not search its process for the reference"
_ELSEWHERE = "works in another process, with the same result"


@dataclass(frozen=True)
class Check:
    """A rule and its result: `problem` is empty where the rule is kept."""

    rule: str
    problem: str

    @property
    def passed(self) -> bool:
        """Whether the rule is kept."""
        return not self.problem


def check_detector(detector: Detector) -> list[Check]:
    """Return the checks of a detector, on a small synthetic scene."""
    scene = hamlet(1)
    before = scene.content_hash
    elsewhere = _elsewhere(detector)
    if elsewhere.status == "failed" and not elsewhere.machine:
        # Its process crashed, so it must not run in this one.
        return [*_declaration(detector), Check(_ELSEWHERE, elsewhere.reason)]
    return [
        *_declaration(detector),
        _check("requires names inputs that scenes have", lambda: _lacks(detector, scene)),
        _check("finds footprints that are valid and inside the scene", lambda: _found(detector, scene)),
        _check("the same seed gives the same footprints", lambda: _repeats(detector, scene)),
        _check("`stochastic` matches the behaviour", lambda: _stochastic(detector, scene)),
        _check("leaves the scene as it was", lambda: "" if _digest(scene) == before else "it changed the arrays"),
        _check("does not use the name of the scene", lambda: _ignores_names(detector, scene)),
        _check(_SEARCH, lambda: _ignores_process(elsewhere, detector, scene)),
        _check("opens and generates no scene with a reference", lambda: _makes_no_scene(detector, scene)),
        _check("a scene without buildings raises no error", lambda: _found(detector, _meadow(scene))),
        _check(_ELSEWHERE, lambda: _as_here(elsewhere, detector, scene)),
    ]


def check_evaluator(evaluator: Evaluator) -> list[Check]:
    """Return the checks of an evaluator."""
    reference = hamlet(1).reference
    assert reference is not None
    moved = Footprints.of(shapely.transform(reference.polygons[3:], lambda xy: xy + 1.0), crs=reference.crs)
    empty = Footprints.empty(crs=reference.crs)

    def evaluated(detected: Footprints, truth: Footprints) -> Evaluation:
        return evaluator.evaluate(detected, truth)

    return [
        *_declaration(evaluator),
        _check("reports every index that it declares, and no other", lambda: _indices(evaluated(moved, reference))),
        _check("values lie in the declared range", lambda: _range(evaluated(moved, reference))),
        _check("a perfect result and empty sets raise no error", lambda: _edges(evaluated, reference, empty)),
        _check("indices follow from tallies", lambda: _summary(evaluated(moved, reference))),
        _check("order of the objects does not matter", lambda: _order(evaluated, moved, reference)),
        _check("pooling one evaluation changes nothing", lambda: _pooling(evaluated(moved, reference))),
        _check("the result is JSON", lambda: _json(evaluated(moved, reference))),
    ]


def _check(rule: str, problem: Callable[[], str]) -> Check:
    try:
        return Check(rule, problem())
    except RoofbenchError as error:
        return Check(rule, str(error))
    except (Exception, SystemExit) as error:
        return Check(rule, " ".join(f"{type(error).__name__}: {error}".split()))


def _declaration(plugin: Parameterised) -> Iterator[Check]:
    kind = type(plugin)
    frozen = getattr(getattr(kind, "__dataclass_params__", None), "frozen", False)
    yield Check("is a frozen dataclass", "" if frozen else "decorate it with @dataclass(frozen=True, kw_only=True)")
    doc = (kind.__doc__ or "").strip()
    yield Check("has a docstring", "" if doc and not doc.startswith(kind.__name__ + "(") else "describe what it does")
    silent = [name for name, rule in kind.parameters().items() if not rule.doc]
    yield Check("documents its parameters", f"no doc= for {', '.join(silent)}" if silent else "")


def _lacks(detector: Detector, scene: Scene) -> str:
    return scene.for_detection().lacks(detector.requires) or ""


def _found(detector: Detector, scene: Scene) -> str:
    detect(scene, detector)
    return ""


def _same(one: Footprints, two: Footprints) -> bool:
    return bool(np.array_equal(shapely.to_wkb(one.polygons), shapely.to_wkb(two.polygons)))


def _repeats(detector: Detector, scene: Scene) -> str:
    return "" if _same(detect(scene, detector), detect(scene, detector)) else "draw random numbers from rng only"


def _stochastic(detector: Detector, scene: Scene) -> str:
    differ = not _same(detect(scene, detector, seed=0), detect(scene, detector, seed=1))
    if differ and not detector.stochastic:
        return "another seed gives other footprints: set stochastic = True"
    if detector.stochastic and not differ:
        return "another seed gives the same footprints: set stochastic = False"
    return ""


def _ignores_names(detector: Detector, scene: Scene) -> str:
    """Try the detector on the scene under names from which a generator could make the truth of another scene."""
    expected = _wkb_under(NEUTRAL_NAME, detector, scene)
    for name in _BAITS:
        try:
            same = _wkb_under(name, detector, scene) == expected
        except Exception:
            same = False
        if not same:
            return (
                f"under the name {name!r} it finds other footprints in the same measurements: a name leads to the "
                "reference, so scenes have none in a run"
            )
    return ""


def _ignores_process(outcome: Outcome, detector: Detector, scene: Scene) -> str:
    """Try the attack: detect in a process that holds a reference, which is wrong, and in one that never held one."""
    if outcome.status != "ok":
        return ""  # reported by the rule of the other process
    reference = scene.reference
    assert reference is not None
    for shift in (3.0, 7.0):
        bait = Footprints.of(shapely.transform(reference.polygons, lambda xy, by=shift: xy + by), crs=scene.crs)
        held = Scene(
            scene.name, scene.extent, crs=scene.crs, points=scene.points, image=scene.image, dem=scene.dem,
            reference=bait,
        )  # fmt: skip
        with tempfile.TemporaryDirectory(prefix="roofbench-") as folder:
            spooled = SceneRecipe.of_scene(held, spooled=spool(held, Path(folder)))
            # As a run with jobs=0 does it: frames and the opened scenes of the worker hold the reference.
            task = Task(scene=spooled, detector=PluginRecipe.of(detector), seed=0, evaluators=())
            found = execute(task, detector=detector)
        if found.status != "ok":
            return found.reason
        if found.detections != outcome.detections:
            return (
                "it finds other footprints where its process holds a reference than in a process that never held one. "
                "A detector that runs in this process (rb.detect, jobs=0) can reach all its memory; trust results of "
                "isolated runs only (jobs=1 or more)"
            )
    return ""


def _makes_no_scene(detector: Detector, scene: Scene) -> str:
    """Try the detector where each new scene with a reference is noted: the generator and real scenes are at hand."""
    made: list[str] = []
    original = Scene.__init__

    def noting(self: Scene, name: str, *more: Any, **layers: Any) -> None:
        if layers.get("reference") is not None:
            made.append(name)
        original(self, name, *more, **layers)

    seen = scene.for_detection()
    setattr(Scene, "__init__", noting)  # noqa: B010 - a plain assignment is an error for mypy
    try:
        detector.detect(seen, random_stream(0, scene.name, detector.name))
    finally:
        setattr(Scene, "__init__", original)  # noqa: B010
    if not made:
        return ""
    return (
        f"while it detects, it makes the scene {made[0]!r}, which has a reference: a generator, or the folder of a "
        "real scene, gives the truth of the same measurements"
    )


def _wkb_under(name: str, detector: Detector, scene: Scene) -> list[bytes]:
    seen = scene.for_detection()
    seen.name = name
    found: list[bytes] = shapely.to_wkb(
        detector.detect(seen, random_stream(0, scene.name, detector.name)).polygons
    ).tolist()
    return found


def _digest(scene: Scene) -> str:
    fresh = Scene(
        scene.name,
        scene.extent,
        crs=scene.crs,
        points=scene.points,
        image=scene.image,
        dem=scene.dem,
        reference=scene.reference,
    )
    return fresh.content_hash


def _meadow(scene: Scene) -> Scene:
    """Return the scene with only the points near the ground, and a grey image."""
    cloud, dem, image = scene.points, scene.dem, scene.image
    assert cloud is not None
    assert dem is not None
    assert image is not None
    low = cloud.z - dem.sample(cloud.x, cloud.y) < 0.3
    grey = type(image)(np.full_like(image.values, 120), image.bands, image.grid)
    return Scene("meadow", scene.extent, crs=scene.crs, points=cloud.take(low), image=grey, dem=dem)


def _elsewhere(detector: Detector) -> Outcome:
    """Return the outcome of the detector in a process of its own."""
    recipe = PluginRecipe.of(detector)
    task = Task(scene=SceneRecipe.of_preset("hamlet", seed=1), detector=recipe, seed=0, evaluators=())
    process = IsolatedProcess()
    try:
        return Outcome.from_bytes(process.call(task.to_json(), Limits(_SECONDS)))
    finally:
        process.close()


def _as_here(outcome: Outcome, detector: Detector, scene: Scene) -> str:
    if outcome.status != "ok":
        return outcome.reason
    same = list(outcome.detections) == shapely.to_wkb(detect(scene, detector).polygons).tolist()
    return "" if same else "the footprints differ: something depends on threads or on the state of the process"


def _indices(evaluation: Evaluation) -> str:
    declared = {index.key for index in evaluation.evaluator.indices}
    differing = declared ^ set(evaluation.values)
    return f"differing: {', '.join(sorted(differing))}" if differing else ""


def _range(evaluation: Evaluation) -> str:
    for index in evaluation.evaluator.indices:
        value = evaluation.values[index.key]
        if value is not None and not index.range[0] - 1e-9 <= value <= index.range[1] + 1e-9:
            return f"{index.key} is {value}, declared from {index.range[0]} to {index.range[1]}"
    return ""


def _edges(evaluated: Callable[..., Evaluation], reference: Footprints, empty: Footprints) -> str:
    for one, two in ((reference, reference), (empty, reference), (reference, empty), (empty, empty)):
        evaluated(one, two)
    return ""


def _summary(evaluation: Evaluation) -> str:
    stored = json.loads(json.dumps(evaluation.tallies.to_dict(), allow_nan=False))
    evaluator = evaluation.evaluator
    rebuilt = evaluator.summarise(evaluator.tallies_type.from_dict(stored))
    return "" if dict(rebuilt.values) == dict(evaluation.values) else "summarise gives other values than evaluate"


def _order(evaluated: Callable[..., Evaluation], detected: Footprints, reference: Footprints) -> str:
    straight = evaluated(detected, reference).values
    turned = evaluated(
        detected.take(np.arange(len(detected))[::-1]), reference.take(np.arange(len(reference))[::-1])
    ).values
    for key, value in straight.items():
        other = turned[key]
        same = value == other or (value is not None and other is not None and abs(value - other) < 1e-9 * abs(value))
        if not same:
            return f"{key} is {value} and, with the objects reversed, {other}"
    return ""


def _pooling(evaluation: Evaluation) -> str:
    pooled = evaluation.evaluator.pool([evaluation])
    return "" if dict(pooled.values) == dict(evaluation.values) else "pooled values differ"


def _json(evaluation: Evaluation) -> str:
    json.dumps(evaluation.to_dict(), allow_nan=False)
    return ""


def check_plugin(plugin: Detector | Evaluator) -> list[Check]:
    """Return the checks of either kind."""
    if isinstance(plugin, Detector):
        return check_detector(plugin)
    if isinstance(plugin, Evaluator):
        return check_evaluator(plugin)
    raise UnsupportedError(f"{plugin!r} is neither a detector nor an evaluator")
