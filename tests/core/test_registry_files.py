"""Plugins by file: what lies beside them is theirs."""

import sys

import pytest

from roofbench.core.errors import InputError
from roofbench.detectors.registry import make_detector

PLUGIN = """
from dataclasses import dataclass
import roofbench as rb
from {helper} import NAME

@dataclass(frozen=True, kw_only=True)
class Mine(rb.Detector):
    "A detector."
    name = NAME
    requires = ()

    def detect(self, scene, rng):
        return rb.Footprints.empty(crs=scene.crs)
"""


@pytest.fixture
def plugin(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", list(sys.path))

    def write(folder, helper):
        place = tmp_path / folder
        place.mkdir()
        (place / "mine.py").write_text(PLUGIN.format(helper=helper))
        (place / f"{helper}.py").write_text(f"NAME = 'of-{folder}'\n")
        return f"{place / 'mine.py'}:Mine"

    return write


def test_a_file_beside_a_plugin_is_found(plugin):
    assert make_detector(plugin("one", "helper_of_one")).name == "of-one"


def test_two_plugins_with_files_of_one_name_are_not_mixed(plugin):
    first, second = plugin("first", "same_helper"), plugin("second", "same_helper")
    assert make_detector(first).name == "of-first"
    with pytest.raises(InputError, match=r"second/same_helper\.py and .*first/same_helper\.py have one name"):
        make_detector(second)
