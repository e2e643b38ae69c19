"""Code digests: everything that the compiled form of a function depends on, as one SHA-256.

Nouns
-----
reference
    What a function reads from outside its own body: global names, closure variables, default values, and names that it
    takes from a module (``module.name``).
code closure
    A function with all functions that it references, directly or through others. The digest covers the bytecode of
    each, how each is to be compiled, and the values of all referenced constants. Comments, docstrings, line numbers,
    annotations and the folder of the code are no part of it.
opaque
    The standard library, numpy and numba. What is referenced there counts by its name alone; the versions of these
    packages belong to the key of a cache.
"""

from __future__ import annotations

import builtins
import dis
import enum
import hashlib
import sys
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

__all__ = ["UnknownCodeError", "code_digest"]

_OPAQUE = {"numpy", "numba", "llvmlite", "builtins", *sys.stdlib_module_names} - {"__main__"}
#: Where numba's objects keep the Python function that they were made of.
_WRAPPED = ("py_func", "_defn", "_dispatcher")

#: A description, and the functions that it refers to by their position in this list.
_Described = tuple[Any, list[FunctionType]]
#: What each function referenced when it was first described in this process.
_first_described: WeakKeyDictionary[FunctionType, _Described] = WeakKeyDictionary()


class UnknownCodeError(Exception):
    """The digest of a function cannot be known.

    It references an object that has no stable description, or a reference changed after the function was first
    described in this process: what is compiled then may be a mixture of both states.
    """


def code_digest(*functions: Any, files: bool = False) -> str:
    """Return the digest of the code closure of functions, 64 hexadecimal digits.

    Parameters
    ----------
    *functions : function, numba dispatcher, or value to be described
        Functions with everything that they need, and what else the digest is to cover.
    files : bool
        Whether the text of every source file in the closure counts, too. It covers code that acts without being
        referenced, such as ``numba.extending.overload``.

    Raises
    ------
    UnknownCodeError
        The digest cannot be known.
    """
    numbers: dict[int, int] = {}
    closure: list[FunctionType] = []

    def number(function: FunctionType) -> int:
        position = numbers.setdefault(id(function), len(closure))
        if position == len(closure):
            closure.append(function)
        return position

    hashed = hashlib.sha256()
    roots = _Description(())
    root = roots.of(functions)
    hashed.update(repr((root, [number(function) for function in roots.references])).encode())
    for function in closure:  # grows while it is walked
        description, references = _function(function)
        hashed.update(repr((description, [number(reference) for reference in references])).encode())
    if files:
        for path in sorted({function.__code__.co_filename for function in closure}):
            hashed.update(_file_digest(path).encode())
    return hashed.hexdigest()


def _function(function: FunctionType) -> _Described:
    """Return the description of one function, the same as the first time or not at all."""
    code = function.__code__
    described = _Description(tuple(sorted(_names(code))))
    parts: list[Any] = [function.__module__, function.__qualname__, _code(code, function.__doc__)]
    parts.append(described.of((function.__defaults__, function.__kwdefaults__)))
    for name in sorted(_globals(code)):
        if name in function.__globals__:
            parts.append((name, described.of(function.__globals__[name])))
        elif hasattr(builtins, name):
            parts.append((name, "builtin"))
        else:
            parts.append((name, "missing"))
    for name, cell in zip(code.co_freevars, function.__closure__ or (), strict=True):
        try:
            parts.append((name, described.of(cell.cell_contents)))
        except ValueError:  # an empty cell: not assigned yet
            parts.append((name, "missing"))
    now = parts, described.references
    before = _first_described.setdefault(function, now)
    if before[0] != now[0] or any(a is not b for a, b in zip(before[1], now[1], strict=True)):
        raise UnknownCodeError(f"{function.__qualname__}: a reference changed after the first use")
    return now


class _Description:
    """Describe values as nested tuples of text and numbers; functions go to a list and are described by position.

    Parameters
    ----------
    names : tuple of str
        Names that the describing function uses; of a module, only these attributes are described.
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        self.references: list[FunctionType] = []
        self._names = names
        self._modules: set[str] = set()

    def of(self, value: Any) -> Any:
        """Return the description of a value, or raise `UnknownCodeError`."""
        kind = type(value)
        if value is None or value is Ellipsis or kind in (bool, int, float, complex, str, bytes):
            return kind.__name__, repr(value)
        if isinstance(value, np.ndarray | np.generic):
            return self._array(np.asarray(value), kind.__name__)
        if isinstance(value, enum.Enum):
            return self._class(kind), value.name
        if isinstance(value, tuple):
            return "tuple" if kind is tuple else self._class(kind), [self.of(item) for item in value]
        if isinstance(value, list):
            return "list", [self.of(item) for item in value]
        if isinstance(value, set | frozenset):
            return "set", sorted((self.of(item) for item in value), key=repr)
        if isinstance(value, dict):
            return "dict", [(self.of(key), self.of(item)) for key, item in value.items()]
        if isinstance(value, ModuleType):
            return self._module(value)
        if isinstance(value, type):
            return self._class(value)
        return self._function_or_object(value)

    def _array(self, array: np.ndarray[Any, Any], kind: str) -> Any:
        if array.dtype.hasobject:
            raise UnknownCodeError("an array of Python objects has no stable description")
        content = hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()
        return kind, str(array.dtype.descr), array.shape, array.flags.c_contiguous, array.flags.f_contiguous, content

    def _module(self, module: ModuleType) -> Any:
        name = module.__name__
        if _is_opaque(name) or name in self._modules:
            return "module", name
        self._modules.add(name)
        return "module", name, [(key, self.of(vars(module)[key])) for key in self._names if key in vars(module)]

    def _class(self, kind: type) -> Any:
        name = (kind.__module__, kind.__qualname__)
        if _is_opaque(kind.__module__) or issubclass(kind, BaseException):
            return name
        if issubclass(kind, enum.Enum):
            return *name, [(member.name, self.of(member.value)) for member in kind]
        if issubclass(kind, tuple) and hasattr(kind, "_fields"):
            return *name, kind._fields, self.of(getattr(kind, "_field_defaults", {}))
        raise UnknownCodeError(f"the class {kind.__qualname__} has no stable description")

    def _function_or_object(self, value: Any) -> Any:
        function, options = _unwrapped(value)
        if function is not None:
            if _is_opaque(function.__module__):
                return function.__module__, function.__qualname__
            if not any(function is known for known in self.references):
                self.references.append(function)
            position = next(k for k, known in enumerate(self.references) if known is function)
            return type(value).__name__, position, self.of(options)
        if isinstance(value, BuiltinFunctionType):
            return value.__module__, value.__qualname__
        text = repr(value)
        if _is_opaque(type(value).__module__) and " at 0x" not in text:
            return type(value).__qualname__, text
        raise UnknownCodeError(f"{text[:80]} has no stable description")


def _unwrapped(value: Any) -> tuple[FunctionType | None, dict[str, Any]]:
    """Return the Python function in a function or numba object, and how numba is to compile it."""
    options: dict[str, Any] = {}
    for _ in range(4):
        if isinstance(value, FunctionType):
            return value, options
        options |= getattr(value, "targetoptions", {}) | getattr(value, "locals", {})
        inner = [getattr(value, name) for name in _WRAPPED if hasattr(value, name)]
        if not inner:
            break
        value = inner[0]
    return None, {}


def _is_opaque(module: str | None) -> bool:
    return module is not None and module.partition(".")[0] in _OPAQUE


@lru_cache(maxsize=4096)
def _code(code: CodeType, docstring: str | None = None) -> Any:
    """Return what a code object does, without its docstring, file, lines and the names of its local annotations."""
    constants = [_code(item) if isinstance(item, CodeType) else _constant(item) for item in code.co_consts]
    if docstring is not None and code.co_consts and code.co_consts[0] == docstring and not _loads_first(code):
        constants[0] = _constant(None)
    counts = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags
    names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
    return code.co_code.hex(), constants, counts, names, code.co_exceptiontable.hex()


def _constant(value: Any) -> Any:
    return _Description(()).of(value)


def _loads_first(code: CodeType) -> bool:
    """Return whether the first constant, where a docstring is kept, is used in the body as well."""
    return any(step.opcode in dis.hasconst and step.arg == 0 for step in dis.get_instructions(code))


@lru_cache(maxsize=4096)
def _globals(code: CodeType) -> frozenset[str]:
    """Return the global names that a code object and the functions in it read."""
    loads = {"LOAD_GLOBAL", "LOAD_NAME"}
    own = {step.argval for step in dis.get_instructions(code) if step.opname in loads}
    return frozenset(own.union(*(_globals(inner) for inner in _inner(code))))


@lru_cache(maxsize=4096)
def _names(code: CodeType) -> frozenset[str]:
    """Return all names in a code object and the functions in it: globals and attributes."""
    return frozenset(code.co_names).union(*(_names(inner) for inner in _inner(code)))


def _inner(code: CodeType) -> Iterator[CodeType]:
    return (item for item in code.co_consts if isinstance(item, CodeType))


def _file_digest(path: str) -> str:
    """Return the digest of a source file; empty for code that was typed at a prompt."""
    try:
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()
    except OSError:
        return ""
