"""One sandbox for all tests of hostile input."""

import pytest

from hostile.sandbox import Sandbox


@pytest.fixture(scope="session")
def sandbox():
    made = Sandbox()
    yield made
    made.close()
