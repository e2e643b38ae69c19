"""The digest changes with everything that compiled code depends on, and with nothing else."""

import sys
from types import ModuleType

import pytest

from roofbench.core.code_digest import UnknownCodeError, code_digest

#: Three modules: `top` calls `middle` of another module, which calls `bottom` of a third one.
CODE = {
    "house_c": """
        import enum
        import math
        from typing import NamedTuple
        import numpy as np
        from numba import njit

        LIMIT = 3.0
        TABLE = np.array([1.0, 2.0])
        SIDES = (1, ("a", None))

        class Kind(enum.IntEnum):
            FLAT = 1
            STEEP = 2

        class Frame(NamedTuple):
            width: float
            depth: float = 2.0

        @njit
        def bottom(x):
            '''Return x.'''
            return x + math.sqrt(LIMIT)

        def unused(x):
            return x

        def stub(x):
            raise NotImplementedError
        """,
    "house_b": """
        from numba import njit
        from house_c import LIMIT, SIDES, TABLE, Frame, Kind, bottom
        import house_c

        @njit(nogil=True)
        def middle(x, y=1):
            frame = Frame(x, 1.0)
            return bottom(frame.width) + LIMIT + TABLE[0] + SIDES[0] + Kind.FLAT + house_c.LIMIT
        """,
    "house_a": """
        from numba import njit
        from house_b import middle

        def make(step):
            @njit
            def top(x):
                return middle(x) + step if x > 0 else top(-x)
            return top

        top = make(2)
        """,
}


@pytest.fixture
def digest_of(monkeypatch, tmp_path):
    """Return a function that executes the modules with one text replaced, and returns the digest of `top`."""

    def digest(module="house_c", old="", new="", *, place="here"):
        loaded = {}
        for name, text in CODE.items():
            code = "\n".join(line[8:] for line in text.splitlines())
            if name == module:
                assert old in code
                code = code.replace(old, new, 1)
            loaded[name] = ModuleType(name)
            monkeypatch.setitem(sys.modules, name, loaded[name])
            exec(compile(code, str(tmp_path / place / f"{name}.py"), "exec"), vars(loaded[name]))
        return code_digest(loaded["house_a"].top)

    return digest


@pytest.mark.parametrize(
    ("module", "old", "new"),
    [
        ("house_a", "make(2)", "make(3)"),
        ("house_a", "> 0", ">= 0"),
        ("house_a", "@njit", "@njit(fastmath=True)"),
        ("house_b", "+ LIMIT +", "- LIMIT +"),
        ("house_b", "y=1", "y=2"),
        ("house_b", "nogil=True", "nogil=True, inline='always'"),
        ("house_b", "frame.width", "frame.depth"),
        ("house_c", "x + math.sqrt", "x - math.sqrt"),
        ("house_c", "math.sqrt", "math.cbrt"),
        ("house_c", "LIMIT = 3.0", "LIMIT = 3"),
        ("house_c", "LIMIT = 3.0", "LIMIT = 3.0000000000000004"),
        ("house_c", "[1.0, 2.0]", "[1.0, 2.5]"),
        ("house_c", "[1.0, 2.0]", "[1, 2]"),
        ("house_c", "np.array([1.0, 2.0])", "np.array([[1.0, 2.0]])"),
        ("house_c", "None)", "0)"),
        ("house_c", "FLAT = 1", "FLAT = 3"),
        ("house_c", "width: float\n    depth: float = 2.0", "depth: float\n    width: float = 2.0"),
        ("house_c", "depth: float = 2.0", "depth: float = 2.5"),
        ("house_c", "def bottom(x):", "def bottom(x, y=0):"),
    ],
)
def test_a_change_of_what_code_depends_on_changes_the_digest(digest_of, module, old, new):
    assert digest_of(module, old, new) != digest_of()


@pytest.mark.parametrize(
    ("module", "old", "new"),
    [
        ("house_a", "", ""),
        ("house_b", "\n@njit", "\n\n# A comment.\n@njit"),
        ("house_c", "Return x.", "Return its argument, shifted."),
        ("house_c", "def bottom(x)", "def bottom(x: float) -> float"),
        ("house_c", "return x\n", "return 2 * x\n"),
        ("house_c", "\nSIDES", "\nMORE = 4\nSIDES"),
    ],
)
def test_nothing_else_changes_the_digest(digest_of, module, old, new):
    assert digest_of(module, old, new, place="there") == digest_of()


def test_the_text_of_a_source_file_counts_when_asked_for(tmp_path):
    digests = []
    for comment in ("one", "other"):
        file = tmp_path / "typed.py"
        file.write_text(f"def double(x):  # {comment}\n    return 2 * x\n")
        names = {"__name__": "typed"}
        exec(compile(file.read_text(), str(file), "exec"), names)
        digests.append((code_digest(names["double"]), code_digest(names["double"], files=True)))
    assert digests[0][0] == digests[1][0]
    assert digests[0][1] != digests[1][1]


class Plain:
    """An object without a stable description."""


STATE = Plain()
LEVEL = 1


def uses_an_object():
    return STATE


def uses_a_level():
    return LEVEL


def test_code_that_references_an_object_of_unknown_content_has_no_digest():
    with pytest.raises(UnknownCodeError, match="no stable description"):
        code_digest(uses_an_object)


def test_code_whose_constant_changed_after_its_first_use_has_no_digest(monkeypatch):
    before = code_digest(uses_a_level)
    monkeypatch.setitem(globals(), "LEVEL", 2)
    with pytest.raises(UnknownCodeError, match="changed"):
        code_digest(uses_a_level)
    monkeypatch.undo()
    assert code_digest(uses_a_level) == before


def test_a_docstring_that_the_body_returns_counts():
    digests = set()
    for text in ("one", "other"):
        names = {"__name__": "typed"}
        exec(f"def f():\n    '''{text}'''\n    return '{text}'\n", names)
        digests.add(code_digest(names["f"]))
    assert len(digests) == 2
