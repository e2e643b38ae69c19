"""One sandbox for all tests of hostile input."""

import pytest

from hostile.samples import make_files
from hostile.sandbox import Sandbox


@pytest.fixture(scope="session")
def sandbox():
    made = Sandbox()
    yield made
    made.close()


@pytest.fixture(scope="session")
def sound_files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sound")
    make_files(folder)
    return folder
