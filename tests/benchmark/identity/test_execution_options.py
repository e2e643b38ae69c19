"""The number of threads travels to the process that runs a task, and is no part of what identifies the run."""

from roofbench.benchmark.execution.tasks import Task
from roofbench.benchmark.identity.keys import source_closure
from roofbench.benchmark.identity.recipes import PluginRecipe, SceneRecipe, label_of
from roofbench.benchmark.plan import plan_content, suite_from_content
from roofbench.benchmark.store.records import RunIdentity
from roofbench.benchmark.suite import DetectorEntry, Suite
from roofbench.detectors.registry import make_detector

SCENE = SceneRecipe.of_preset("hamlet", seed=1)


def identity(selection):
    detector = make_detector(selection)
    return RunIdentity(
        detector=PluginRecipe.of(detector),
        label=label_of(detector),
        fingerprint="",
        code=source_closure(type(detector)),
        scene=SCENE,
        scene_key=SCENE.key,
        seed=0,
    )


def test_key_label_and_recipe_do_not_depend_on_the_number_of_threads():
    one, two = identity("mpp"), identity("mpp[threads=2]")
    assert one.key == two.key
    assert one.label == two.label == "mpp"
    assert one.detector == two.detector
    assert one.detector.to_dict() == two.detector.to_dict()
    assert identity("mpp[cell=1]").key != one.key


def test_a_task_carries_the_number_of_threads_to_another_process():
    task = Task(scene=SCENE, detector=PluginRecipe.of(make_detector("mpp[threads=2,cell=1]")), seed=0, evaluators=())
    detector = Task.from_json(task.to_json()).detector.detector()
    assert (detector.threads, detector.cell) == (2, 1.0)


def test_a_resumed_plan_keeps_the_number_of_threads():
    suite = Suite("one", (SCENE,), (DetectorEntry(make_detector("mpp[threads=2]"), (0,)),), ())
    (entry,) = suite_from_content(plan_content(suite)).detectors
    assert entry.detector.threads == 2
