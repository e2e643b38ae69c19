"""Kernels that other kernels call are compiled as a part of those, and behave as if compiled alone."""

import gc

import numba
import numpy as np
import pytest
from numba.core import event

from roofbench.core.kernels import kernel

from .test_kernels import edit, python, write


@kernel
def double(x):
    return 2.0 * x


@kernel
def checked(x):
    if x < 0.0:
        raise ValueError("x is negative")
    return np.full(3, double(x)).sum()


@kernel
def twice_checked(x):
    return checked(x) + checked(x + 1.0)


@kernel
def factorial(n):
    return 1 if n < 2 else n * factorial(n - 1)


@kernel
def factorials(n):
    return factorial(n) + factorial(n + 1)


@numba.njit
def foreign(x):
    return double(x) + 1.0


@kernel
def calls_foreign(x):
    return foreign(x) + double(x)


def test_inner_kernels_can_be_called_from_python_before_and_after():
    assert twice_checked(1.0) == 6.0 + 12.0
    assert checked(2.0) == 12.0
    assert double(3.0) == 6.0
    assert twice_checked(2.0) == 12.0 + 18.0


def test_errors_of_inner_kernels_keep_their_message():
    with pytest.raises(ValueError, match="x is negative"):
        twice_checked(-0.5)
    with pytest.raises(ValueError, match="x is negative"):
        checked(-0.5)


def test_recursion():
    assert factorials(5) == 120 + 720
    assert factorial(6) == 720


def test_functions_of_numba_and_kernels_call_each_other():
    assert calls_foreign(2.0) == 9.0
    assert foreign(3.0) == 7.0
    assert double.py_func(3.0) == double(3.0)


def test_no_machine_code_is_made_for_what_only_kernels_call(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    made = []

    @kernel
    def inner(x):
        return x + 1.0

    @kernel
    def outer(x):
        return inner(x) * 2.0

    with event.install_listener("numba:compile", Compiled(made)):
        assert outer(1.0) == 4.0
    assert made.count("inner") == made.count("outer") == 1
    assert not has_wrapper(inner)
    assert has_wrapper(outer)
    assert inner(1.0) == 2.0
    assert has_wrapper(inner)


def has_wrapper(compiled):
    (result,) = compiled.overloads.values()
    names = [function.name for function in result._asdict()["library"].get_defined_functions()]
    return result.fndesc.llvm_cpython_wrapper_name in names


class Compiled(event.Listener):
    def __init__(self, names):
        self.names = names

    def on_start(self, event):
        self.names.append(event.data["dispatcher"].py_func.__name__)

    def on_end(self, event):
        pass


def test_garbage_is_collected_again_after_a_failure():
    @kernel
    def impossible(x):
        return x.nothing

    with pytest.raises(numba.core.errors.TypingError):
        impossible(1.0)
    assert gc.isenabled()


def test_kept_inner_kernels_serve_a_changed_caller(tmp_path):
    files = {
        "bottom.py": "from roofbench.core.kernels import kernel\nimport numpy as np\n@kernel\ndef bottom(x):\n"
        "    if x < 0:\n        raise ValueError('negative')\n    return np.full(2, x).sum()\n",
        "top.py": "from roofbench.core.kernels import kernel\nfrom bottom import bottom\n"
        "@kernel\ndef top(x):\n    return bottom(x) + 1.0\n",
    }
    call = (
        "from top import top\nfrom bottom import bottom\nvalue = top(1.0)\n"
        "try:\n    top(-1.0)\nexcept ValueError as e:\n"
        "    print(value, e, sum(bottom.stats.cache_hits.values()))\n"
    )
    here, cache = write(tmp_path / "here", files), tmp_path / "cache"
    assert python(call, here, cache)[0] == ["3.0", "negative", "0"]
    edit(here / "top.py", "1.0", "2.0")
    assert python(call, here, cache)[0] == ["4.0", "negative", "1"]
    assert python(call, here, cache)[0] == ["4.0", "negative", "0"]
    assert python(call + "print(bottom(4.0))", here, cache)[0][-1] == "8.0"
