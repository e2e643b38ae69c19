import dataclasses
import os
import signal
import subprocess
import sys
import time

import psutil
import pytest

from roofbench.benchmark.execution.fork_server import CAN_FORK
from roofbench.benchmark.execution.isolation import IsolatedProcess
from roofbench.benchmark.identity.recipes import PluginRecipe
from roofbench.benchmark.store.outcomes import Outcome
from roofbench.core.processes import Limits


@pytest.fixture(scope="module")
def process():
    process = IsolatedProcess()
    yield process
    process.close()


def call(process, task, **limits):
    return Outcome.from_bytes(process.call(task.to_json(), Limits(**limits)))


@pytest.mark.parametrize(
    ("mode", "reason"),
    [
        ("raises", "ZeroDivisionError: no houses at all"),
        ("exits", "the worker process exited with code 7"),
        ("leaves", "the worker process exited with code 9"),
        ("crashes", "the worker process was killed by signal 11 (SIGSEGV)"),
        ("hangs", "time limit of 1.5 s exceeded"),
        ("swallows", "out of memory: Unable to allocate 9.09 TiB for an array with shape (10000000000000,)"),
        ("nonsense", "misbehaving returned str, not Footprints: build them by Footprints.of"),
    ],
)
def test_a_misbehaving_run_fails_alone_with_its_reason(process, task_of, mode, reason):
    outcome = call(process, task_of(mode), seconds=1.5 if mode == "hangs" else 60, memory=400_000_000)
    assert outcome.status == "failed"
    assert outcome.reason.startswith(reason)
    assert call(process, task_of()).status == "ok"


def test_a_run_that_exceeds_its_memory_limit_is_stopped(process, task_of):
    outcome = call(process, task_of("eats"), memory=400_000_000)
    assert outcome.status == "failed"
    # The watcher or, when the machine is too busy for it, the bound on allocations is first.
    assert outcome.reason.startswith(("memory limit of 400 MB exceeded: ", "out of memory"))
    assert outcome.cost.peak_memory > 400_000_000


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux counts the highest memory")
def test_a_memory_peak_between_two_checks_is_not_missed(process, task_of):
    outcome = call(process, task_of("spikes"), memory=400_000_000)
    assert outcome.status == "failed"
    assert "memory limit of 400 MB exceeded: " in outcome.reason
    assert call(process, task_of(), memory=400_000_000).status == "ok"


def test_a_failure_keeps_its_traceback(process, task_of):
    assert "_raises" in call(process, task_of("raises")).traceback
    assert "Segmentation fault" in call(process, task_of("crashes")).traceback


def test_what_a_detector_prints_does_not_disturb_the_answer(process, task_of):
    assert call(process, task_of("prints")).status == "ok"


def test_a_plugin_cannot_change_another_detector(process, task_of):
    plain = dataclasses.replace(task_of(), detector=PluginRecipe("ndsm", {}))
    found = call(process, plain).detections
    assert call(process, task_of("meddles")).status == "ok"
    assert call(process, plain).detections == found != ()


@pytest.mark.skipif(not CAN_FORK, reason="only Linux forks detector processes")
def test_what_is_forked_had_one_thread(process, task_of):
    call(process, task_of())
    (server,) = psutil.Process(process._process.pid).children()
    assert server.num_threads() == 1


def test_the_processor_time_of_detectors_counts_as_that_of_children(task_of):
    resource = pytest.importorskip("resource", reason="this system does not count it")
    process = IsolatedProcess()
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    process.call(task_of("burns").to_json(), Limits())
    running = psutil.Process(process._process.pid).children(recursive=True)
    process.close()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    # The detector ends after one second of user and system time, see `misbehaving.py`.
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime >= 1.0
    assert not any(child.is_running() for child in running)


def test_files_in_the_working_directory_do_not_replace_modules(task_of, tmp_path, monkeypatch):
    (tmp_path / "roofbench").mkdir()
    (tmp_path / "roofbench" / "__init__.py").write_text("raise SystemExit('the wrong code')")
    monkeypatch.chdir(tmp_path)
    process = IsolatedProcess()
    try:
        assert call(process, task_of()).status == "ok"
    finally:
        process.close()


def test_numeric_libraries_get_one_thread_each(process, task_of):
    call(process, task_of())
    environment = psutil.Process(process._process.pid).environ()
    assert environment["NUMBA_NUM_THREADS"] == environment["OPENBLAS_NUM_THREADS"] == "1"


def test_a_worker_exits_when_its_caller_is_killed(task_of):
    code = (
        "from roofbench.benchmark.execution.isolation import *; from roofbench.core.processes import Limits;"
        "import sys; p = IsolatedProcess(); p._running();"
        "print(p._process.pid, flush=True); p.call(sys.argv[1], Limits())"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    caller = subprocess.Popen(
        [sys.executable, "-c", code, task_of("hangs").to_json()], stdout=subprocess.PIPE, env=environment
    )
    worker = int(caller.stdout.readline())
    time.sleep(0.7)
    caller.send_signal(signal.SIGKILL)
    caller.wait()
    caller.stdout.close()
    psutil.wait_procs([psutil.Process(worker)] if psutil.pid_exists(worker) else [], timeout=10)
    assert not psutil.pid_exists(worker) or psutil.Process(worker).status() == psutil.STATUS_ZOMBIE
