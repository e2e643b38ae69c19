"""Quick compilation: slow parts of numba's compiler, replaced while a kernel is compiled.

Most of the time of a compilation is spent in Python, on work that does not change the result: colours of messages that
are never printed, events without listeners, comparisons of all options, repeated inference of the types of
``float * float``, and variables that live at the start of each block, which only generators and object mode use. The
replacements here return what numba's own methods return; only the message of a slice assignment of the wrong shape has
no shapes. They are in place while `quick_compilation` is entered, under numba's global lock.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from types import BuiltinFunctionType
from typing import Any

from llvmlite.binding import ffi
from numba.core import base, compiler_machinery, errors, ir, postproc, registry, targetconfig, transforms, typeinfer
from numba.core import types as numba_types
from numba.core.runtime import context as runtime
from numba.core.types import functions
from numba.core.typing import context as typing_context
from numba.core.typing import typeof
from numba.np import arrayobj

__all__ = ["quick_compilation"]

# Parts of numba and llvmlite without complete type stubs.
_types: Any = numba_types
_arrayobj: Any = arrayobj
_errors: Any = errors
_ir: Any = ir
_lock: Any = ffi.lib._lock
_cpu: Any = registry.cpu_target
_BaseFunction: Any = functions.BaseFunction
_TargetConfig: Any = targetconfig.TargetConfig
_ConfigStack: Any = targetconfig.ConfigStack
_PostProcessor: Any = postproc.PostProcessor
_BaseContext: Any = base.BaseContext
_TypingContext: Any = typing_context.BaseContext
_NRTContext: Any = runtime.NRTContext
_canonicalize: Any = transforms.canonicalize_cfg
_call_type = _BaseFunction.get_call_type
_post_process = _PostProcessor.run
_refresh = _BaseContext.refresh
_value_type = _TypingContext.resolve_value_type
_count_references = _NRTContext._call_incref_decref

#: Functions of numbers whose types follow from those of their arguments alone.
_SCALAR = frozenset(
    {function for module in (operator, math) for function in vars(module).values() if callable(function)}
    | {abs, bool, float, int, max, min, round}
)
_known: dict[Any, tuple[Any, Any]] = {}
_declared: dict[Any, tuple[dict[str, Any], int]] = {}
_refreshed: dict[int, int] = {}


@contextmanager
def quick_compilation() -> Iterator[None]:
    """Replace slow methods of numba inside the block; the caller holds numba's global lock."""
    before = [(owner, name, owner.__dict__[name]) for owner, name, _ in _replacements()]
    callbacks = _lock._cblist
    try:
        with _lock._lock:  # no call of LLVM is under way, so each event that starts also ends
            _lock._cblist = []
        for owner, name, replacement in _replacements():
            setattr(owner, name, replacement)
        yield
    finally:
        for owner, name, original in before:
            setattr(owner, name, original)
        with _lock._lock:
            _lock._cblist = callbacks


@cache
def _replacements() -> list[tuple[Any, str, Any]]:
    """Return owner, name and replacement of what is replaced."""
    _cpu.typing_context.refresh()
    # The text with both shapes takes a second to compile.
    templates = _cpu.typing_context.resolve_value_type(_arrayobj.raise_with_shape_context).templates
    shape_error = staticmethod(_arrayobj.ol_raise_with_shape_context_generic)
    plain = _Plain()
    return [
        (_BaseFunction, "get_call_type", _call_type_of_scalars),
        (_TargetConfig, "__eq__", _equal_options),
        (_TargetConfig, "__hash__", _hash_of_options),
        (_TargetConfig, "values", _values_of_options),
        (_ir.Inst, "_rec_list_vars", _variables),
        (_PostProcessor, "run", _variable_lifetimes),
        (_BaseContext, "refresh", _refresh_after_growth),
        (_TypingContext, "resolve_value_type", _type_of_value),
        (_NRTContext, "_call_incref_decref", _references),
        (_errors, "_termcolor_inst", plain),
        *((module, "_termcolor", plain) for module in (compiler_machinery, functions, ir, typeinfer, typeof)),
        *((template, "_overload_func", shape_error) for template in templates),
    ]


class _Plain:
    """The colour scheme of messages that stay as they are."""

    @staticmethod
    def code(text: str) -> str:
        return text

    errmsg = filename = indicate = highlight = reset = code


def _call_type_of_scalars(self: Any, context: Any, arguments: Any, named: Any) -> Any:
    """Replace `BaseFunction.get_call_type`: the types of a function of numbers are inferred once."""
    if named or self.typing_key not in _SCALAR or not all(map(_is_number, arguments)):
        return _call_type(self, context, arguments, named)
    key = self, context, tuple(arguments), _ConfigStack.top_or_none()
    if key not in _known:
        signature = _call_type(self, context, arguments, named)
        if signature is None:
            return None
        _known[key] = signature, self._impl_keys[signature.args]
    signature, self._impl_keys[signature.args] = _known[key]
    return signature


def _is_number(kind: Any) -> bool:
    return isinstance(kind, _types.Number | _types.Boolean | _types.IntegerLiteral | _types.BooleanLiteral)


def _defaults(options: Any) -> tuple[dict[str, Any], int]:
    """Return the defaults of a class of options, and the hash of their names."""
    if options not in _declared:
        defaults = {name: option.default for name, option in options.options.items()}
        _declared[options] = defaults, hash(tuple(sorted(defaults)))
    return _declared[options]


def _values_of_options(self: Any) -> dict[str, Any]:
    return {**_defaults(type(self))[0], **self._values}


def _hash_of_options(self: Any) -> int:
    return _defaults(type(self))[1]


def _equal_options(self: Any, other: Any) -> Any:
    if not isinstance(other, _TargetConfig):
        return NotImplemented
    return self._values == other._values or _values_of_options(self) == _values_of_options(other)


def _variables(self: Any, value: Any) -> list[Any]:
    """Replace `Inst._rec_list_vars`."""
    found: list[Any] = []
    items = value.values() if isinstance(value, dict) else value if isinstance(value, list | tuple) else (value,)
    for item in items:
        kind = type(item)
        if kind is _ir.Var:
            found.append(item)
        elif kind is str or kind is _ir.Loc or item is None:
            continue
        elif isinstance(item, _ir.Inst):
            found.extend(item.list_vars())
        elif isinstance(item, dict | list | tuple):
            found.extend(_variables(self, item))
    return found


def _variable_lifetimes(self: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
    """Replace `PostProcessor.run`: lifetimes are computed when they are used."""
    if self.func_ir.is_generator:
        _post_process(self, emit_dels, extend_lifetimes)
        return
    self.func_ir.blocks = _canonicalize(self.func_ir.blocks)
    self.func_ir.variable_lifetime = postproc.VariableLifetime(self.func_ir.blocks)
    self.func_ir.generator_info = None
    if emit_dels:
        self._insert_var_dels(extend_lifetimes=extend_lifetimes)


def _refresh_after_growth(self: Any) -> None:
    """Replace `BaseContext.refresh`: registries without new entries are not read again."""
    shared = id(self._registries)  # by the contexts of all compilations
    if _refreshed.get(shared) != _entries(self):
        _refresh(self)
        _refreshed[shared] = _entries(self)


def _entries(context: Any) -> int:
    """Return the number of entries in the registries of a context and of its typing context."""
    both = context, context.typing_context
    loaders = [item for one in both for item in one._registries.items()]
    return sum(len(getattr(registry, name)) for registry, loader in loaders for name in loader.registry_items)


def _type_of_value(self: Any, value: Any) -> Any:
    """Replace `BaseContext.resolve_value_type`: an operator is no array and no number."""
    kind = self._get_global_type(value) if type(value) is BuiltinFunctionType else None
    return _value_type(self, value) if kind is None else kind


def _references(self: Any, builder: Any, kind: Any, value: Any, function: str) -> None:
    """Replace `NRTContext._call_incref_decref`: a number is not counted."""
    if not _is_number(kind):
        _count_references(self, builder, kind, value, function)
