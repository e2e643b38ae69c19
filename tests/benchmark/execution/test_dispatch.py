"""Which run goes to which worker."""

from types import SimpleNamespace

from roofbench.benchmark.execution.dispatch import Dispatcher


def waiting(*names):
    """Runs called scene.detector."""
    parts = (name.split(".") for name in names)
    return [SimpleNamespace(identity=SimpleNamespace(scene_key=scene, label=label)) for scene, label in parts]


def name(run):
    return run and f"{run.identity.scene_key}.{run.identity.label}"


def test_a_worker_keeps_its_scene_and_takes_the_detector_that_runs_nowhere_else():
    dispatcher = Dispatcher(waiting("1.a", "1.b", "1.c", "2.a", "2.b", "2.c"))
    left, right = object(), object()
    order = [name(dispatcher.next_for(slot)) for slot in (left, right, left, left, right, right)]
    assert order == ["1.a", "2.b", "1.c", "1.b", "2.a", "2.c"]
    assert dispatcher.next_for(left) is None


def test_one_worker_does_everything_in_order():
    names = ["1.a", "1.b", "2.a", "2.b"]
    dispatcher = Dispatcher(waiting(*names))
    assert [name(dispatcher.next_for(0)) for _ in names] == names


def test_a_worker_without_a_scene_of_its_own_helps_with_the_longest_queue():
    dispatcher = Dispatcher(waiting("1.a", "1.b", "1.c"))
    assert [name(dispatcher.next_for(slot)) for slot in (0, 1, 0)] == ["1.a", "1.b", "1.c"]
