"""The layout of the code: packages are listed, imports run downwards, and the public names exist."""

import tomllib
from pathlib import Path

import house
import pytest

import roofbench
from roofbench.core.package import VERSION

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
HOUSE = house.House()


@pytest.mark.parametrize("rule", house.RULES, ids=lambda rule: rule.__name__)
def test_the_layout_is_kept(rule):
    broken = rule(HOUSE)
    assert not broken, f"{rule.__doc__} Broken by: {sorted(broken)}"


PLANTED = {
    "imports_run_downwards": {"scenes/a.py": "from ..detectors.b import c", "detectors/b.py": "__all__ = ['c']"},
    "sub_rooms_run_downwards": {"scenes/geodata/a.py": "from ..ground import b", "scenes/ground/b.py": ""},
    "sub_rooms_have_floors": {"scenes/attic/a.py": ""},
    "no_circles": {
        "core/a.py": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from . import b",
        "core/b.py": "def f():\n    from .c import d",
        "core/c.py": "from .a import e",
    },
    "one_name_per_room": {"scenes/geodata/a.py": "", "scenes/a.py": ""},
    "relative_imports": {"core/a.py": "import roofbench.core"},
    "modules_list_their_names": {"core/a.py": "b = 1"},
    "names_are_listed_at_home": {
        "core/a.py": "from . import b\nb.hidden()\nfrom .b import other",
        "core/b.py": "__all__ = ['c']\nc = 1",
    },
    "few_arguments": {
        "core/a.py": "class A:\n    def f(self, a, b, c, d, e, *f, g, h, **i): ...",
        "core/b.py": "def f(a, b, c, d, e, f, g, h): ...",
    },
    "short_modules": {"core/a.py": "\n" * 451, "core/b.py": "\n" * 450},
    "detectors_do_not_draw": {"detectors/a.py": "def f():\n    from matplotlib.figure import Figure"},
    "one_home_for_kernels": {"core/kernels.py": "from numba import njit", "scenes/a.py": "import numba"},
    "kernels_say_what_they_change": {
        "scenes/a.py": "@kernel\ndef silent(x):\n    x[0] = 1",
        "scenes/b.py": "@kernel\ndef fill(x):\n    'Fill x.'\n    x[0] += 1\ndef plain(x):\n    x[0] = 1",
    },
    "annotated_kernels": {
        "scenes/a.py": "@kernel\ndef bare(x): ...\n@kernel(inline='always')\ndef half(x: int): ...",
        "scenes/b.py": "@kernel\ndef whole(x: int) -> int: ...\ndef plain(x): ...",
    },
}


@pytest.mark.parametrize("rule", house.RULES, ids=lambda rule: rule.__name__)
def test_each_rule_finds_what_breaks_it(rule, tmp_path):
    for name, text in PLANTED[rule.__name__].items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    found = rule(house.House(tmp_path))
    expected = {
        "imports_run_downwards": {"scenes/a.py -> detectors/b.py"},
        "sub_rooms_run_downwards": {"scenes/geodata/a.py -> scenes/ground/b.py"},
        "sub_rooms_have_floors": {"scenes/attic"},
        "no_circles": {"core/a.py", "core/b.py", "core/c.py"},
        "one_name_per_room": {"scenes/geodata/a.py", "scenes/a.py"},
        "names_are_listed_at_home": {"core/a.py -> core/b.py: hidden", "core/a.py -> core/b.py: other"},
        "few_arguments": {"core/a.py: A.f"},
        "one_home_for_kernels": {"scenes/a.py"},
        "kernels_say_what_they_change": {"scenes/a.py: silent"},
        "annotated_kernels": {"scenes/a.py: bare", "scenes/a.py: half"},
    }.get(rule.__name__, {next(iter(PLANTED[rule.__name__]))})
    assert found == expected


def test_every_public_name_is_there():
    for name in roofbench.__all__:
        assert getattr(roofbench, name) is not None
    assert set(roofbench.__all__) <= set(dir(roofbench))
    with pytest.raises(AttributeError, match="no attribute 'detekt'"):
        _ = roofbench.detekt


def test_the_version_is_said_once():
    assert PROJECT["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "roofbench.core.package.VERSION"}
    assert roofbench.__version__ == VERSION
