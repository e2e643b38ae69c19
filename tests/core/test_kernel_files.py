import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

import roofbench
from roofbench.core import kernel_files


def test_what_is_saved_is_loaded(tmp_path):
    assert kernel_files.load(tmp_path / "new", "a") is None
    kernel_files.save(tmp_path / "new", "a", b"code")
    assert kernel_files.load(tmp_path / "new", "a") == b"code"
    kernel_files.remove(tmp_path / "new", "a")
    assert kernel_files.load(tmp_path / "new", "a") is None


@pytest.mark.parametrize("damage", [b"", b"short", b"\0" * 200])
def test_a_damaged_file_is_absent_and_removed(tmp_path, damage):
    kernel_files.save(tmp_path, "a", b"code" * 20)
    (file,) = tmp_path.iterdir()
    file.write_bytes(damage)
    assert kernel_files.load(tmp_path, "a") is None
    assert not file.exists()


def test_a_flipped_bit_is_noticed(tmp_path):
    kernel_files.save(tmp_path, "a", b"code" * 20)
    (file,) = tmp_path.iterdir()
    data = bytearray(file.read_bytes())
    data[50] ^= 1
    file.write_bytes(data)
    assert kernel_files.load(tmp_path, "a") is None


def test_many_writers_of_one_entry_leave_a_whole_one(tmp_path):
    contents = [bytes([k]) * 300_000 for k in range(8)]
    threads = [threading.Thread(target=kernel_files.save, args=(tmp_path, "a", content)) for content in contents]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        assert kernel_files.load(tmp_path, "a") in (None, *contents)
    assert kernel_files.load(tmp_path, "a") in contents
    assert len(list(tmp_path.iterdir())) == 1


def test_a_failed_save_leaves_nothing(tmp_path):
    (tmp_path / "a.kernel").mkdir()
    with pytest.raises(OSError, match="directory"):
        kernel_files.save(tmp_path, "a", b"code")
    assert [path.name for path in tmp_path.iterdir()] == ["a.kernel"]


def use(folder, name, days_ago):
    kernel_files.save(folder, name, bytes(1000))
    then = time.time() - days_ago * 86_400
    os.utime(folder / f"{name}.kernel", (then, then))


def test_cleaning_removes_what_was_not_used_for_a_month(tmp_path):
    use(tmp_path, "new", 3)
    use(tmp_path, "old", 40)
    use(tmp_path, "old but read", 40)
    kernel_files.load(tmp_path, "old but read")
    (tmp_path / "unfinished-1").touch()
    (tmp_path / "unfinished-2").touch()
    os.utime(tmp_path / "unfinished-2", (0, 0))
    (tmp_path / "of somebody else").touch()
    os.utime(tmp_path / "of somebody else", (0, 0))
    kernel_files.clean(tmp_path)
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {"new.kernel", "old but read.kernel", "unfinished-1", "of somebody else"}


def test_cleaning_bounds_the_size_and_keeps_what_was_used_last(tmp_path):
    for days in (5, 1, 4, 2, 3):
        use(tmp_path, f"{days} days", days)
    kernel_files.clean(tmp_path, largest=2500)
    assert {path.name for path in tmp_path.iterdir()} == {"1 days.kernel", "2 days.kernel"}


def test_cleaning_the_default_folder_removes_the_layout_of_the_first_version(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    old = tmp_path / "roofbench" / "numba" / "mpp_123"
    old.mkdir(parents=True)
    (old / "a.nbi").touch()
    kernel_files.clean(tmp_path / "elsewhere")
    assert old.exists()
    kernel_files.clean(kernel_files.default_folder())
    assert not (tmp_path / "roofbench" / "numba").exists()


def test_a_folder_that_is_not_there_is_clean(tmp_path):
    kernel_files.clean(tmp_path / "nowhere")
    assert not list(tmp_path.iterdir())


#: Reserves an entry, says so, and holds it until its standard input closes.
HOLDER = """
import sys
from pathlib import Path
from roofbench.core import kernel_files
held = kernel_files.reserve(Path(sys.argv[1]), "a")
print(held is not None, flush=True)
sys.stdin.read()
"""


@pytest.mark.skipif(kernel_files.fcntl is None, reason="no file locks on this platform")
def test_an_entry_is_reserved_by_one_process_until_that_ends(tmp_path):
    root = Path(roofbench.__file__).parents[1]
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(root), *filter(None, sys.path)])},
    ) as holder:
        assert holder.stdout.readline() == b"True\n"
        assert kernel_files.reserve(tmp_path, "a", patience=0.05) is None
        other = kernel_files.reserve(tmp_path, "b", patience=0.05)
        assert other is not None
        other.close()
        holder.kill()
        holder.wait()
        after = kernel_files.reserve(tmp_path, "a")
        assert after is not None
        after.close()


def test_a_folder_that_cannot_be_made_reserves_nothing(tmp_path):
    (tmp_path / "file").write_text("")
    assert kernel_files.reserve(tmp_path / "file" / "folder", "a") is None
