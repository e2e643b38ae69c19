"""Kernels: functions that numba compiles, and the cache of their compiled form.

Nouns
-----
kernel
    A function under the decorator `kernel`. It is compiled at its first call with arguments of given types, releases
    the interpreter lock, and its compiled form is kept on disk.
entry
    The compiled form of one kernel for argument types, a processor and the versions of numba, llvmlite and numpy. Its
    name holds the code digest of the kernel (see `core.code_digest`): a kernel or constant that changes in any module
    changes the name, and equal code in two checkouts shares the entry.

Entries are in ``NUMBA_CACHE_DIR`` where that is set, else in the user's cache. Where the folder cannot be written,
every process compiles anew.
"""

from __future__ import annotations

import hashlib
import re
import sys
import warnings
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import IO, Any

import llvmlite
import numba
import numpy as np
from numba.core import ccallback, config, dispatcher, serialize, sigutils
from numba.core import types as numba_types
from numba.core.caching import CompileResultCacheImpl, FunctionCache, NullCache
from numba.core.compiler_lock import global_compiler_lock
from numba.np.ufunc import ufuncbuilder, wrappers

from . import inner_kernels, kernel_files
from .code_digest import UnknownCodeError, code_digest

__all__ = ["cache_folder", "kernel", "track_dependencies_of_numba"]

# Parts of numba without complete type stubs.
_Dispatcher: Any = dispatcher.Dispatcher
_CFunc: Any = ccallback.CFunc
_types: Any = numba_types

#: Settings of numba, from its environment variables, that change what is compiled.
_SETTINGS = (
    "OPT",
    "BOUNDSCHECK",
    "DEBUGINFO_DEFAULT",
    "DISABLE_INTEL_SVML",
    "LOOP_VECTORIZE",
    "SLP_VECTORIZE",
)


def kernel(function: Any = None, *, inline: str = "never") -> Any:
    """Compile a function with numba at its first call; the compiled form is kept under the digest of its code.

    Parameters
    ----------
    function : function
        Python that numba compiles without the interpreter.
    inline : {"never", "always"}
        ``"always"`` copies the body into each caller before types are inferred.

    Examples
    --------
    >>> @kernel
    ... def double(value):
    ...     return 2 * value
    >>> double(4)
    8
    """
    if function is None:
        return lambda function: kernel(function, inline=inline)
    # The address of a kernel is never taken, so the wrapper for callers in C is not compiled.
    compiled: Any = numba.njit(function, nogil=True, inline=inline, no_cfunc_wrapper=True)
    if isinstance(compiled, _Dispatcher):  # it is the function itself under NUMBA_DISABLE_JIT
        compiled._cache = _KernelCache(compiled, files=False)
        compiled.get_call_template = partial(_call_without_literals, compiled)
        compiled.compile = partial(_compile, compiled)
    return compiled


def _call_without_literals(compiled: Any, arguments: Any, named: Any) -> Any:
    """Resolve a call from another kernel; numba would compile a kernel again for each constant that it is called with.

    `numba.literally` and the like do not work in kernels therefore.
    """
    plain = tuple(_types.unliteral(kind) for kind in arguments)
    return _Dispatcher.get_call_template(
        compiled, plain, {name: _types.unliteral(kind) for name, kind in named.items()}
    )


def _compile(compiled: Any, signature: Any) -> Any:
    """Compile a kernel for argument types, or take the entry that another process is writing."""
    with global_compiler_lock:
        try:
            return inner_kernels.compile_kernel(compiled, signature)
        finally:
            compiled._cache.end_reservation()


def cache_folder() -> Path:
    """Return the folder of the entries."""
    return Path(config.CACHE_DIR) / "roofbench" if config.CACHE_DIR else kernel_files.default_folder()


def track_dependencies_of_numba() -> None:
    """Make numba's own ``njit(cache=True)`` use this cache, in modules imported before and from now on.

    Plugins use numba as they like; its own cache does not see a change of a kernel that is imported from another
    module. ``vectorize``, ``guvectorize`` and ``cfunc`` compile anew in each process: theirs has the same fault.
    """
    if _Dispatcher.enable_caching is _enable_caching:
        return
    _Dispatcher.enable_caching = _enable_caching
    ufuncbuilder.UFuncDispatcher.enable_caching = _CFunc.enable_caching = _stay_without_cache
    wrappers.GufWrapperCache = lambda py_func: NullCache()
    for module in list(sys.modules.values()):
        for value in list(getattr(module, "__dict__", {}).values()):
            if isinstance(value, _Dispatcher) and type(value._cache) is FunctionCache:
                _enable_caching(value)


def _enable_caching(dispatcher: Any) -> None:
    dispatcher._cache = _KernelCache(dispatcher, files=True)


def _stay_without_cache(wrapper: Any) -> None:
    """Replace ``enable_caching`` where no cache sees the dependencies, and do nothing."""


class _KernelCache(FunctionCache):
    """The cache of one kernel, as numba's dispatcher calls it.

    Parameters
    ----------
    dispatcher : numba Dispatcher
    files : bool
        Whether the text of the source files belongs to the key, see `code_digest`.
    """

    _cleaned = False
    _warned = False

    def __init__(self, dispatcher: Any, *, files: bool) -> None:
        self._dispatcher = dispatcher
        self._files = files
        self._impl = _Results(dispatcher.py_func)
        self._names: dict[Any, str] = {}
        self._reserved: IO[bytes] | None = None
        self.enable()

    @property
    def cache_path(self) -> str:
        return str(cache_folder())

    def flush(self) -> None:
        """Forget nothing on disk: an entry is right as long as its key is asked for."""

    def end_reservation(self) -> None:
        """Let other processes compile or load what this one reserved."""
        reserved, self._reserved = self._reserved, None
        if reserved is not None:
            reserved.close()

    def _load_overload(self, sig: Any, target_context: Any) -> Any:
        if not self._enabled:
            return None
        try:
            name = self._names[sig] = self._name(sig, target_context.codegen())
        except UnknownCodeError:
            return None
        content = kernel_files.load(cache_folder(), name)
        if content is None and not self._files and not inner_kernels.compiles_inner():
            # Only the outermost kernel is reserved: two processes never wait for each other.
            self._reserved = kernel_files.reserve(cache_folder(), name)
            content = kernel_files.load(cache_folder(), name)
        if content is None:
            return None
        try:
            loaded = serialize.loads(content)
            if inner_kernels.compiles_inner():
                return inner_kernels.rebuild(target_context, loaded)
            return self._impl.rebuild(target_context, loaded)
        except Exception:
            # The checksum is right, so another environment wrote it; whatever is wrong with it, compiling helps.
            kernel_files.remove(cache_folder(), name)
            return None

    def _save_overload(self, sig: Any, data: Any) -> None:
        name = self._names.pop(sig, None)
        if not self._enabled or name is None or not self._impl.check_cachable(data):
            return
        folder = cache_folder()
        try:
            reduce = inner_kernels.reduce if inner_kernels.compiles_inner() else self._impl.reduce
            kernel_files.save(folder, name, serialize.dumps(reduce(data)))
        except OSError as error:
            if not _KernelCache._warned:
                _KernelCache._warned = True
                warnings.warn(
                    f"compiled kernels cannot be kept in {folder} ({error.strerror}): every process compiles them "
                    "again; set NUMBA_CACHE_DIR to a writable folder",
                    RuntimeWarning,
                    stacklevel=2,
                )
            return
        if not _KernelCache._cleaned:
            _KernelCache._cleaned = True
            kernel_files.clean(folder)

    def _name(self, sig: Any, codegen: Any) -> str:
        """Return the name of the entry for argument types."""
        arguments, result = sigutils.normalize_signature(sig)
        described = [list(_description(item)) for item in (*arguments, result) if item is not None]
        code = code_digest(self._dispatcher, described, files=self._files)
        settings = [(name, repr(getattr(config, name, None))) for name in _SETTINGS]
        versions = numba.__version__, llvmlite.__version__, np.__version__, sys.implementation.cache_tag
        inner = inner_kernels.compiles_inner()
        key = repr((code, len(arguments), codegen.magic_tuple(), versions, settings, inner))
        title = re.sub(r"[^\w.]", "", self._dispatcher.py_func.__qualname__)[-60:]
        return f"{title}-{hashlib.sha256(key.encode()).hexdigest()[:40]}"


class _Results(CompileResultCacheImpl):
    """Turn a compiled function into what can be pickled and back, without looking for a folder."""

    def __init__(self, function: Any) -> None:
        self._lineno = function.__code__.co_firstlineno
        self._locator = SimpleNamespace(_py_file=function.__code__.co_filename)  # named by a warning of numba


def _description(kind: Any) -> Iterator[Any]:
    """Yield everything that a type of numba stands for.

    Its name alone does not hold the fields of a named tuple, nor the code of a function.
    """
    if isinstance(kind, _types.Dispatcher):
        yield kind.dispatcher
        return
    if isinstance(kind, _types.BaseNamedTuple):
        yield kind.instance_class
    if isinstance(kind, _types.BaseTuple):
        yield [list(_description(item)) for item in kind]
    elif isinstance(kind, _types.Optional):
        yield "optional"
        yield from _description(kind.type)
    else:
        yield kind
