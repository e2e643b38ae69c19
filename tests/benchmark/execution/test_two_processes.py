"""Two processes on one store, and a clock that jumps: the same runs, each once, as of one process at rest."""

import random
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing

import pytest
from harness.clock import jumping_clock
from harness.effort import of
from harness.killed_sweeps import content, count_runs, start_sweep


def finished(process):
    _, errors = process.communicate(timeout=250)
    assert process.returncode == 0, errors.decode()


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    store = tmp_path_factory.mktemp("alone") / "runs.sqlite"
    finished(start_sweep(store, 1, 3))
    return content(store)


@pytest.mark.slow
@pytest.mark.parametrize("number", range(of(1, 5)))
def test_two_processes_fill_one_store_as_one_does(number, alone, tmp_path):
    store = tmp_path / "runs.sqlite"
    first = start_sweep(store, 1, 3)
    time.sleep(random.Random(number).uniform(0, 2))
    second = start_sweep(store, 1, 3)
    finished(first)
    finished(second)
    assert content(store) == alone
    with closing(sqlite3.connect(store)) as opened:
        assert opened.execute("PRAGMA integrity_check").fetchall() == [("ok",)]


@pytest.mark.parametrize("number", range(of(0, 5)))
def test_a_process_that_is_killed_does_not_stop_the_other(number, alone, tmp_path):
    store = tmp_path / "runs.sqlite"
    first, second = start_sweep(store, 1, 3), start_sweep(store, 1, 3)
    while count_runs(store) < 2 and first.poll() is None:
        time.sleep(0.05)
    time.sleep(random.Random(number).uniform(0, 0.5))
    first.send_signal(signal.SIGKILL)
    first.communicate()
    finished(second)
    assert content(store) == alone


@pytest.mark.slow
def test_a_clock_that_jumps_changes_no_result(alone, tmp_path, monkeypatch):
    store = tmp_path / "runs.sqlite"
    for name, value in jumping_clock(tmp_path).items():
        monkeypatch.setenv(name, value)
    shown = subprocess.run(
        [sys.executable, "-c", "import time; print([time.time() for _ in range(9)])"], capture_output=True, check=True
    )
    assert sorted(times := eval(shown.stdout)) != times, "the clock does not jump"
    finished(start_sweep(store, 1, 3))
    monkeypatch.delenv("LD_PRELOAD")
    assert content(store) == alone
