"""Every command of README and docs runs, and prints what its page shows.

``ROOFBENCH_COMMANDS=nightly`` also runs the blocks marked `nightly`.
"""

import doctest
import os

import pytest

from documentation import commands
from documentation.commands import ROOT, Session, blocks_of, files_of, pages
from documentation.files import FILES

NIGHTLY = os.environ.get("ROOFBENCH_COMMANDS") == "nightly"
WITH_COMMANDS = [page for page in pages() if blocks_of(page)]


def is_run(block):
    return block.mark == "" or (NIGHTLY and block.mark == "nightly")


@pytest.mark.timeout(7200 if NIGHTLY else 300)
@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("page", WITH_COMMANDS, ids=lambda page: str(page.relative_to(ROOT)))
def test_the_commands_of_a_page_print_what_it_shows(page, tmp_path, monkeypatch):
    blocks = [block for block in blocks_of(page) if is_run(block)]
    if not blocks:
        pytest.skip("all of its commands are marked, nightly or not run")
    monkeypatch.setenv("COLUMNS", "80")
    folder = tmp_path / "session"
    folder.mkdir()
    for name in files_of(page):
        FILES[name](folder)
    session = Session(folder)
    wrong = [text for block in blocks for text in session.run(block)]
    assert wrong == [], "\n\n".join(wrong)


def test_blocks_that_are_not_run_say_why():
    marks = [block.mark for page in pages() for block in blocks_of(page)]
    assert {mark for mark in marks if mark.startswith("not run")} - {"not run: "} != set()
    assert [mark for mark in marks if mark.startswith("not run") and len(mark) < 20] == []
    assert sum(mark.startswith("not run") for mark in marks) < len(marks) / 3


def test_a_line_that_is_not_printed_is_found():
    assert doctest.testmod(commands).failed == 0


def test_a_command_that_fails_and_one_that_prints_something_else_are_found(tmp_path):
    page = ROOT / "README.md"
    block = commands.Block(page, 1, "console", "$ roofbench list planets\n$ roofbench --version\nroofbench 0.0.1\n")
    failed, other = Session(tmp_path).run(block)
    assert "exit code 2" in failed
    assert "roofbench 0.0.1" in other
