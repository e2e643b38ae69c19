"""Plans: the runs of a suite, which of them are stored, and why the others have to be executed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

from ..core.errors import ParameterError, RoofbenchError, UnsupportedError
from ..detectors.base import Detector
from ..evaluators.base import Evaluator
from ..scenes.geodata.footprints import Footprints
from ..scenes.scene import INPUTS, Scene
from .identity.keys import source_closure
from .identity.recipes import PluginRecipe, SceneRecipe, code_digest, fingerprint_on, label_of
from .store.records import RunIdentity, RunRow, evaluation_key
from .store.writer import Store
from .suite import DetectorEntry, Suite

__all__ = [
    "KeyedEvaluator",
    "Plan",
    "PlannedRun",
    "Rerun",
    "differences",
    "identity_now",
    "make_plan",
    "plan_content",
    "scene_recipe",
    "suite_from_content",
]

#: Which runs are executed: ``missing``: those without a good result, failures included; ``never``: those that are not
#: stored at all; ``always``: all.
Rerun = Literal["missing", "never", "always"]


@dataclass(frozen=True)
class KeyedEvaluator:
    """An evaluator with the key of its evaluations in the store."""

    evaluator: Evaluator
    recipe: PluginRecipe
    key: str

    @classmethod
    def of(cls, evaluator: Evaluator) -> KeyedEvaluator:
        """Return an evaluator with its key."""
        recipe = _recipe(evaluator)
        return cls(evaluator, recipe, evaluation_key(recipe, code_digest(evaluator)))

    @property
    def code(self) -> str:
        """Digest of the source that it depends on."""
        return code_digest(self.evaluator)

    @property
    def label(self) -> str:
        """Name with changed parameters."""
        return label_of(self.evaluator)


@dataclass(frozen=True, kw_only=True)
class PlannedRun:
    """One run of a plan.

    Attributes
    ----------
    identity : RunIdentity
    entry : DetectorEntry
    scene : SceneRecipe or Scene
    todo : {"detect", "evaluate", "nothing"}
        ``evaluate``: detections are stored, an evaluation is not.
    why : str
        Reason as a sentence.
    stored : int, optional
        Run id where a run of that key is stored.
    skip : str
        Why the run will be skipped, as far as that is known without reading the scene; else empty.
    missing : tuple of KeyedEvaluator
        Evaluators whose evaluation is not stored.
    """

    identity: RunIdentity
    entry: DetectorEntry
    scene: SceneRecipe | Scene
    todo: Literal["detect", "evaluate", "nothing"]
    why: str
    stored: int | None = None
    missing: tuple[KeyedEvaluator, ...] = ()
    skip: str = ""


@dataclass(frozen=True)
class Plan:
    """The runs of a suite, ordered by scene, the evaluators, and which stored runs are repeated.

    `warnings` name the evaluators that cannot evaluate on a scene, as far as that is known before anything runs.
    """

    suite: Suite
    runs: tuple[PlannedRun, ...]
    evaluators: tuple[KeyedEvaluator, ...]
    rerun: Rerun = "missing"
    warnings: tuple[str, ...] = ()

    @property
    def keys(self) -> list[str]:
        """Run keys in order."""
        return [run.identity.key for run in self.runs]

    @property
    def left_out(self) -> tuple[PlannedRun, ...]:
        """The runs that are neither stored nor to be executed."""
        return tuple(run for run in self.runs if run.stored is None and run.todo == "nothing")

    def counts(self) -> Mapping[str, int]:
        """Return how many runs are to be detected, evaluated, or kept as stored."""
        return Counter(run.todo for run in self.runs)


def _recipe(plugin: Detector | Evaluator) -> PluginRecipe:
    """Return the recipe; for classes that exist in this process only, one whose name says so."""
    try:
        return PluginRecipe.of(plugin)
    except UnsupportedError:
        return PluginRecipe(f"(this process):{type(plugin).__qualname__}", plugin.values())


def scene_recipe(scene: SceneRecipe | Scene) -> SceneRecipe:
    """Return the recipe of either."""
    return SceneRecipe.of_scene(scene) if isinstance(scene, Scene) else scene


def make_plan(suite: Suite, store: Store, *, rerun: Rerun = "missing", only_failed: bool = False) -> Plan:
    """Compare a suite with the store.

    Parameters
    ----------
    suite : Suite
    store : Store
    rerun : {"missing", "never", "always"}
    only_failed : bool
        Repeat failed runs and evaluate stored ones; runs that are not stored are left out.
    """
    evaluators = tuple(KeyedEvaluator.of(evaluator) for evaluator in suite.evaluators)
    identities: list[tuple[RunIdentity, DetectorEntry, SceneRecipe | Scene]] = []
    parts = [(entry, _recipe(entry.detector), source_closure(type(entry.detector))) for entry in suite.detectors]
    _require_own_labels([(entry.label, detector) for entry, detector, _ in parts])
    read = lru_cache(maxsize=None)(fingerprint_on)
    for scene in suite.scenes:
        recipe = scene_recipe(scene)
        key = recipe.key
        for entry, detector, code in parts:
            fingerprint = read(entry.detector, recipe.name)
            for seed in entry.seeds:
                identity = RunIdentity(
                    detector=detector,
                    label=entry.label,
                    fingerprint=fingerprint,
                    code=code,
                    scene=recipe,
                    scene_key=key,
                    seed=seed,
                )
                identities.append((identity, entry, scene))
    unique = {identity.key: (identity, entry, scene) for identity, entry, scene in identities}
    stored = store.statuses(unique)
    good = [run_id for run_id, status, _ in stored.values() if status == "ok"]
    evaluated = {keyed.key: store.evaluated(good, keyed.key) for keyed in evaluators}
    failures = {keyed.key: store.evaluation_failures(good, keyed.key) for keyed in evaluators}
    runs = []
    for key, (identity, entry, scene) in unique.items():
        run_id, status, reason = stored.get(key, (None, None, ""))
        missing: tuple[KeyedEvaluator, ...] = ()
        todo: Literal["detect", "evaluate", "nothing"] = "nothing"
        if status is None:
            todo, why = "detect", _why_new(store, identity)
        elif rerun == "always":
            todo, why = "detect", "to be replaced"
        elif status == "failed":
            retried = rerun == "missing"
            todo = "detect" if retried else "nothing"
            why = f"failed before: {reason}" + ("" if retried else " (not tried again)")
        elif status == "skipped":
            why = f"skipped: {reason}"
        else:
            why = f"stored as run {run_id}"
            missing = tuple(keyed for keyed in evaluators if run_id not in evaluated[keyed.key])
            if missing:
                todo = "evaluate"
                why += ", not yet evaluated by " + ", ".join(keyed.label for keyed in missing)
                reasons = [failures[keyed.key][run_id] for keyed in missing if run_id in failures[keyed.key]]
                why += f" (failed before: {'; '.join(reasons)})" if reasons else ""
        if only_failed and status != "failed" and todo == "detect":
            todo, why = "nothing", f"{why} (left out: only failed runs are repeated)"
        skip = _foreseen_skip(scene, tuple(entry.detector.requires)) if todo == "detect" else ""
        runs.append(
            PlannedRun(
                identity=identity,
                entry=entry,
                scene=scene,
                todo=todo,
                why=why,
                stored=run_id,
                missing=missing,
                skip=skip,
            )
        )
    return Plan(suite, tuple(runs), evaluators, rerun, tuple(_warnings(suite)))


def _warnings(suite: Suite) -> Iterator[str]:
    """Yield which evaluators need an orthoimage on which scenes; comparing nothing with nothing shows that."""
    bare = [scene.name for scene in suite.scenes if scene.contents is not None and "image" not in scene.contents]
    for evaluator in suite.evaluators if bare else ():
        try:
            evaluator.evaluate(Footprints.empty(), Footprints.empty())
        except RoofbenchError as error:
            shown = ", ".join(bare[:4]) + (f" and {len(bare) - 4} more" if len(bare) > 4 else "")
            yield f"{label_of(evaluator)} cannot evaluate on {shown} (no orthoimage): {error}"


def _require_own_labels(entries: Sequence[tuple[str, PluginRecipe]]) -> None:
    """Raise `ParameterError` when tables could not tell two detectors of a suite apart."""
    known: dict[str, PluginRecipe] = {}
    for label, recipe in entries:
        if known.setdefault(label, recipe) != recipe:
            raise ParameterError(f"two detectors are called {label!r} in tables: give each its own label")


def _foreseen_skip(scene: SceneRecipe | Scene, requires: tuple[str, ...]) -> str:
    """Return which input a scene lacks, without reading or generating it; empty where that cannot be known."""
    contents = scene.contents
    if contents is None:
        return ""
    for need in requires:
        if need not in contents and not (need in ("colour", "brightness", "nir") and "image" in contents):
            return f"scene {scene.name!r} has no {INPUTS[need]}"
    return ""


def _why_new(store: Store, identity: RunIdentity) -> str:
    """Return what differs from the latest stored run of the same detector, scene and seed, if there is one."""
    latest = store.latest_like(identity.label, identity.scene.name, identity.seed)
    return (
        "not run yet"
        if latest is None
        else "; ".join(differences(store, latest, identity)) + " since run " + str(latest)
    )


def differences(store: Store, run_id: int, identity: RunIdentity) -> list[str]:
    """Return one sentence for each part of a stored run's key that differs from `identity`."""
    row, code = store.run(run_id), store.code(run_id)
    found = []
    now = dict(identity.detector.parameters)
    for name in sorted({*row.parameters, *now}):
        before, after = row.parameters.get(name, "absent"), now.get(name, "absent")
        if before != after:
            found.append(f"parameter {name} is {after}, was {before}")
    for kind, before, after in (
        ("source", code.modules, identity.code.modules),
        ("package", code.packages, identity.code.packages),
    ):
        for name in sorted({*before, *after}):
            if before.get(name) != after.get(name):
                change = "changed" if name in before and name in after else "added" if name in after else "removed"
                versions = (
                    f" ({before.get(name)} to {after.get(name)})" if kind == "package" and change == "changed" else ""
                )
                found.append(f"{kind} {name} {change}{versions}")
    if row.fingerprint != identity.fingerprint:
        found.append("the program or file that it reads changed")
    if row.scene_key != identity.scene_key:
        found.append("the scene changed")
    if row.benchmark != identity.benchmark:
        before = "not recorded" if row.benchmark is None else row.benchmark
        found.append(f"the version of the benchmark is {identity.benchmark}, was {before}")
    if row.seed != identity.seed:
        found.append(f"seed is {identity.seed}, was {row.seed}")
    return found


def identity_now(row: RunRow) -> RunIdentity:
    """Return the identity that a stored run would have with the present code."""
    recipe = PluginRecipe(row.detector, row.parameters)
    detector = recipe.detector()
    return RunIdentity(
        detector=PluginRecipe(row.detector, detector.values()),
        label=row.label,
        fingerprint=fingerprint_on(detector, row.recipe.name),
        code=source_closure(type(detector)),
        scene=row.recipe,
        scene_key=row.recipe.key,
        seed=row.seed,
    )


def plan_content(suite: Suite) -> dict[str, Any]:
    """Return a suite as JSON content, so that it can be resumed from the store."""
    return {
        "name": suite.name,
        "scenes": [scene_recipe(scene).to_dict() for scene in suite.scenes],
        "detectors": [
            {**_recipe(entry.detector).to_dict(execution=True), "seeds": list(entry.seeds)} for entry in suite.detectors
        ],
        "evaluators": [_recipe(evaluator).to_dict(execution=True) for evaluator in suite.evaluators],
    }


def suite_from_content(content: Mapping[str, Any]) -> Suite:
    """Return the suite of what `plan_content` returned."""
    detectors: Sequence[DetectorEntry] = [
        DetectorEntry(
            PluginRecipe(item["use"], item["parameters"], item.get("execution", {})).detector(), tuple(item["seeds"])
        )
        for item in content["detectors"]
    ]
    return Suite(
        content["name"],
        tuple(SceneRecipe.from_dict(recipe) for recipe in content["scenes"]),
        tuple(detectors),
        tuple(PluginRecipe(**recipe).evaluator() for recipe in content["evaluators"]),
    )
