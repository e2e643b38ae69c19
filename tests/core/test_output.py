import errno

import pytest

from roofbench.core.errors import OutputError
from roofbench.core.output import whole_file, whole_folder


def test_a_folder_of_its_own_kind_is_replaced(tmp_path):
    for text in ("one", "two"):
        with whole_folder(tmp_path / "out", holds=("*.txt",), overwrite=True) as folder:
            (folder / f"{text}.txt").write_text(text)
    assert [file.name for file in (tmp_path / "out").iterdir()] == ["two.txt"]


@pytest.mark.parametrize("name", ["thesis.docx", "photographs/"])
def test_a_folder_that_holds_anything_else_is_never_replaced(tmp_path, name):
    own = tmp_path / "own"
    own.mkdir()
    (own / "one.txt").write_text("one")
    (own / name).mkdir() if name.endswith("/") else (own / name).write_text("years of work")
    with (
        pytest.raises(OutputError, match=f"own holds {name.rstrip('/')}, which replacing it would delete"),
        whole_folder(own, holds=("*.txt",), overwrite=True),
    ):
        pytest.fail("not reached")
    assert len(list(own.iterdir())) == 2


def test_a_device_is_no_file(tmp_path):
    import os

    os.mkfifo(tmp_path / "pipe")
    with (
        pytest.raises(OutputError, match="pipe is a device: name a file"),
        whole_file(tmp_path / "pipe", overwrite=True),
    ):
        pytest.fail("not reached")


def test_a_full_disk_is_one_sentence_and_leaves_nothing(tmp_path):
    def write():
        with whole_file(tmp_path / "big.bin") as scratch:
            scratch.write_text("half of it")
            raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(OutputError, match=r"big\.bin cannot be written: No space left"):
        write()
    assert list(tmp_path.iterdir()) == []


def test_points_that_do_not_fit_on_the_disk_are_one_sentence(tmp_path, monkeypatch):
    import laspy
    from builders import small_scenes
    from lazrs import LazrsError

    from roofbench.scenes.geodata.las_files import write_points

    def full(*_):
        raise LazrsError("IoError: Failed to call write")

    monkeypatch.setattr(laspy.LasWriter, "write_points", full)
    with pytest.raises(OutputError, match=r"points\.laz cannot be written .*is there room on the disk"):
        write_points(small_scenes.scene().points, tmp_path / "points.laz", crs=small_scenes.CRS)
