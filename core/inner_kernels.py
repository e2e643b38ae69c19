"""Kernels that only other kernels call: compiled without machine code of their own.

Nouns
-----
inner function
    What numba compiles while it compiles a kernel: other kernels, and functions of its own such as ``numpy.empty``.
    Its code becomes part of the kernel that calls it. The wrapper for calls from Python, the optimisation of the whole
    and the machine code are made once, for the outermost kernel; numba alone makes all three for every function.
placeholder
    What stands for the address of an inner function. A kernel that Python calls later is compiled again.

Methods of numba are replaced here. They differ from numba's own only while a kernel is compiled, under its global lock.
"""

from __future__ import annotations

import gc
from contextlib import nullcontext
from functools import partial
from typing import Any

from llvmlite import binding
from numba.core import compiler, cpu, dispatcher, environment, sigutils
from numba.core.compiler_lock import global_compiler_lock

from .quick_compilation import quick_compilation

__all__ = ["compile_kernel", "compiles_inner", "rebuild", "reduce"]

_CPUContext: Any = cpu.CPUContext
_Dispatcher: Any = dispatcher.Dispatcher
_get_executable = _CPUContext.get_executable
_create_wrapper = _CPUContext.create_cpython_wrapper
_create_callback = _CPUContext.create_cfunc_wrapper
_add_overload = _Dispatcher.add_overload

#: The kernels that are being compiled, outermost first.
_open: list[Any] = []


class _Placeholder:
    """Stands for the address of an inner function in the tables of numba."""


def compile_kernel(kernel: Any, signature: Any) -> Any:
    """Compile a kernel for argument types, as the method `compile` of numba does."""
    with global_compiler_lock:
        arguments = tuple(sigutils.normalize_signature(signature)[0])
        result = kernel.overloads.get(arguments)
        if result is not None and not _open and isinstance(result.entry_point, _Placeholder):
            del kernel.overloads[arguments]
        collects = gc.isenabled() and not _open
        if collects:
            gc.disable()  # numba makes very many small objects that live until the end
        _open.append(kernel)
        try:
            with nullcontext() if compiles_inner() else quick_compilation():
                return _Dispatcher.compile(kernel, signature)
        finally:
            _open.pop()
            if collects:
                gc.enable()


def compiles_inner() -> bool:
    """Return whether the kernel that is being compiled, or loaded, is called by another kernel."""
    return len(_open) > 1


def reduce(result: Any) -> tuple[Any, ...]:
    """Return the compiled form of an inner kernel as what can be pickled."""
    code = result._asdict()["library"]
    description = result.fndesc
    description.typemap = description.calltypes = None
    return (
        code.name,
        code._final_module.as_bitcode(),
        description,
        result.environment,
        result.signature,
        result.reload_init,
        tuple(result._find_referenced_environments()),
    )


def rebuild(context: Any, content: tuple[Any, ...]) -> Any:
    """Return an inner kernel from its pickled form; the environments of what it calls stay alive with it."""
    name, bitcode, description, own, signature, reload_init, environments = content
    for function in reload_init:
        function()
    library = context.codegen().create_library(name)
    library._final_module = binding.parse_bitcode(bitcode)
    library._finalized = True
    return compiler.compile_result(
        typing_context=context.typing_context,
        target_context=context,
        entry_point=_Placeholder(),
        signature=signature,
        objectmode=False,
        lifted=(),
        fndesc=description,
        library=library,
        environment=own,
        reload_init=reload_init,
        referenced_envs=environments,
    )


def _is_inner(description: Any) -> bool:
    if not _open:
        return False
    if str(description.modname).partition(".")[0] == "numba":
        return True
    function = _open[-1].py_func
    return compiles_inner() and (description.modname, description.qualname) == (
        function.__module__,
        function.__qualname__,
    )


def _wrapper(context: Any, library: Any, description: Any, *rest: Any, **named: Any) -> Any:
    """Replace `CPUContext.create_cpython_wrapper`."""
    if not _is_inner(description):
        return _create_wrapper(context, library, description, *rest, **named)
    return None


def _callback(context: Any, library: Any, description: Any, *rest: Any) -> Any:
    """Replace `CPUContext.create_cfunc_wrapper`, the wrapper for callers in C."""
    return None if _is_inner(description) else _create_callback(context, library, description, *rest)


def _executable(context: Any, library: Any, description: Any, own: Any) -> Any:
    """Replace `CPUContext.get_executable`."""
    if _is_inner(description):
        library.finalize = partial(_link, library)
        return _Placeholder()
    function = _get_executable(context, library, description, own)
    if _open:
        # An inner function finds its constants through variables that now exist for the first time.
        for variable in library._final_module.global_variables:
            found = environment.lookup_environment(variable.name)
            if found is not None:
                library.codegen.set_env(variable.name, found)
    return function


def _link(library: Any) -> None:
    """Replace `finalize` of the library of an inner function: link what it calls, without optimising it."""
    seen: set[Any] = set()
    for other in library._linking_libraries:
        if other not in seen:
            seen.add(other)
            library._reload_init.update(other._reload_init)
            library._final_module.link_in(other._get_module_for_linking(), preserve=True)
    library._final_module.verify()
    library._finalize_dynamic_globals()
    library._finalized = True


def _add(dispatcher: Any, result: Any) -> None:
    """Replace `Dispatcher.add_overload`: a placeholder is nothing that Python can call."""
    if isinstance(result.entry_point, _Placeholder):
        dispatcher.overloads[tuple(result.signature.args)] = result
    else:
        _add_overload(dispatcher, result)


_CPUContext.create_cpython_wrapper = _wrapper
_CPUContext.create_cfunc_wrapper = _callback
_CPUContext.get_executable = _executable
_Dispatcher.add_overload = _add
