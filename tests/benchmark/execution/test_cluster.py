"""Runs on real Dask clusters: one in this process, and one of separate scheduler and worker processes."""

import os
import signal
import socket
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import replace

import pytest
from builders.town import town_folder

from roofbench.benchmark.execution.city import City, detect_city
from roofbench.benchmark.execution.executors import Execution, slots_of
from roofbench.benchmark.execution.isolation import close_isolated
from roofbench.benchmark.execution.runner import run_plan
from roofbench.benchmark.identity.recipes import SceneRecipe
from roofbench.benchmark.plan import make_plan
from roofbench.benchmark.store.writer import Store
from roofbench.benchmark.suite import DetectorEntry, Suite
from roofbench.core.errors import InputError
from roofbench.core.processes import Limits
from roofbench.detectors.registry import make_detector
from roofbench.evaluators.registry import make_evaluator

distributed = pytest.importorskip("distributed", reason="Dask is not installed: pip install 'dask[distributed]'")
pytestmark = pytest.mark.filterwarnings("ignore")  # warnings of Dask and Tornado are theirs


@pytest.fixture
def suite(misbehaving):
    scenes = tuple(SceneRecipe.of_preset("hamlet", seed=seed) for seed in (1, 2))
    good, failing = make_detector(misbehaving), make_detector(misbehaving, {"mode": "leaves", "only_on": "hamlet-2"})
    return Suite(
        "s", scenes, (DetectorEntry(good, (0, 1, 2)), DetectorEntry(failing)), (make_evaluator("threshold-free"),)
    )


def run(suite, path, execution):
    with Store(path) as store:
        plan = make_plan(suite, store)
        result = run_plan(plan, store, execution=execution)
        values = store.index_values([row.id for row in result.ok], plan.evaluators[0].key)
        return {row.key: (row.status, row.reason, row.detected, values.get(row.id)) for row in result.rows}


def test_a_local_cluster_gives_the_same_results(suite, tmp_path):
    here = run(suite, tmp_path / "here.sqlite", Execution(jobs=1))
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=":0"
    ) as cluster:
        there = run(suite, tmp_path / "there.sqlite", Execution(scheduler=cluster.scheduler_address))
    close_isolated()  # those of the workers, which lived in this process
    assert there == here
    assert sorted(status for status, *_ in there.values()) == ["failed"] + ["ok"] * 7


def test_limits_hold_on_a_cluster(suite, tmp_path, misbehaving):
    hanging = replace(suite, detectors=(DetectorEntry(make_detector(misbehaving, {"mode": "hangs"})),))
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0"
    ) as cluster:
        execution = Execution(scheduler=cluster.scheduler_address, limits=Limits(seconds=2))
        found = run(hanging, tmp_path / "a.sqlite", execution)
    close_isolated()
    assert {reason for _, reason, *_ in found.values()} == {"time limit of 2 s exceeded"}


def address_of_worker():
    return distributed.get_worker().address


def test_each_worker_of_a_cluster_is_a_slot_for_tiles_and_reads_ahead_with_one_thread():
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, dashboard_address=":0"
    ) as cluster:
        with slots_of(1, cluster.scheduler_address, 9, by_worker=True) as slots:
            ran_on = [[slot.executor.submit(address_of_worker).result() for _ in range(3)] for slot in slots]
        assert [(slot.capacity, slot.reads_ahead) for slot in slots] == [(2, True), (2, True)]
        assert [set(addresses) for addresses in ran_on] == [{address} for address in sorted(cluster.scheduler.workers)]
        with slots_of(1, cluster.scheduler_address, 9) as slots:
            assert [(slot.capacity, slot.reads_ahead) for slot in slots] == [(5, False)]
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=":0") as cluster,
        slots_of(1, cluster.scheduler_address, 9, by_worker=True) as slots,
    ):
        assert [(slot.capacity, slot.reads_ahead) for slot in slots] == [(3, False)]


@contextmanager
def separate_processes(folder):
    """Start a scheduler and two workers as processes; yield the address and the first worker."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "DASK_DISTRIBUTED__WORKER__DAEMON": "False"}

    def start(*words):
        command = [sys.executable, "-m", "distributed.cli." + words[0], *words[1:]]
        return subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    worker = ("dask_worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", folder)
    processes = [start("dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard")]
    try:
        processes += [start(*map(str, worker)) for _ in range(2)]
        with distributed.Client(address, timeout="30s") as client:
            client.wait_for_workers(2, timeout=60)
        yield address, processes[1]
    finally:
        for process in reversed(processes):
            process.kill()
            process.wait()


class Killing:
    """A progress callback that kills a process when the first result arrives."""

    def __init__(self, victim):
        self.victim, self.killed = victim, False

    def __call__(self, *_):
        if not self.killed:
            self.victim.send_signal(signal.SIGKILL)
            self.killed = True


@pytest.mark.slow
def test_a_worker_killed_in_mid_run_does_not_stop_the_sweep(suite, tmp_path, misbehaving):
    slow = replace(suite, detectors=(DetectorEntry(make_detector(misbehaving, {"seconds": 0.5}), tuple(range(6))),))
    with separate_processes(tmp_path) as (address, victim), Store(tmp_path / "a.sqlite") as store:
        kill = Killing(victim)
        result = run_plan(make_plan(slow, store), store, execution=Execution(scheduler=address), progress=kill)
        assert kill.killed
        assert victim.wait(timeout=30) == -signal.SIGKILL
    assert [row.status for row in result.rows] == ["ok"] * 12
    here = run(slow, tmp_path / "here.sqlite", Execution(jobs=1))
    assert {row.key: row.detected for row in result.rows} == {key: found[2] for key, found in here.items()}


@pytest.mark.slow
def test_a_city_on_a_cluster_is_the_same_bytes_though_a_worker_is_killed(tmp_path):
    recipe = SceneRecipe.of_folder(town_folder(tmp_path / "town"))
    for name in ("here", "there"):
        (tmp_path / name).mkdir()
    detector, city = make_detector("ndsm[cell=0.5]"), City(tile=32.0)
    detect_city(recipe, detector, tmp_path / "here" / "city.fgb", city, execution=Execution(jobs=0))
    with separate_processes(tmp_path) as (address, victim):
        kill = Killing(victim)
        there, execution = tmp_path / "there" / "city.fgb", Execution(scheduler=address)
        result = detect_city(recipe, detector, there, city, execution=execution, progress=kill)
        assert kill.killed
        assert victim.wait(timeout=30) == -signal.SIGKILL
    assert not result.failed
    assert there.read_bytes() == (tmp_path / "here" / "city.fgb").read_bytes()


def test_a_scheduler_that_does_not_answer_is_one_sentence(suite, tmp_path, monkeypatch):
    from roofbench.benchmark.execution import executors

    monkeypatch.setattr(executors, "_CONNECT_SECONDS", 1)
    with pytest.raises(InputError, match=r"no Dask scheduler answers at tcp://127.0.0.1:1: "):
        run(suite, tmp_path / "a.sqlite", Execution(scheduler="tcp://127.0.0.1:1"))
