"""Registries: classes found by name, and the error for an unknown name.

A *registry* maps names to classes without importing them: built-in ones are given as ``"module:Class"``, others come
from entry points of installed packages or from a file named by the user (``path/to/file.py:Class``).
"""

from __future__ import annotations

import difflib
import importlib
import importlib.metadata
import importlib.util
import re
import sys
from collections.abc import Iterable, Mapping
from contextlib import redirect_stdout
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

from .errors import InputError, ParameterError, UnknownNameError
from .package import NAME

__all__ = ["Registry", "nearest_hint", "parse_assignment", "parse_selection", "split_list"]

#: Letters from which on the beginning of a name means the name.
_LEAST_BEGINNING = 3
#: Folders of plugins that were named by their file.
_plugin_folders: set[str] = set()

_SELECTION = re.compile(r"^(?P<name>[^\[\]]+?)(?:\[(?P<parameters>.*)\])?$", re.DOTALL)
#: Commas that are followed by an even number of double quotes.
_OUTSIDE_QUOTES = re.compile(r',(?=(?:[^"]*"[^"]*")*[^"]*$)')


def nearest_hint(name: str, known: Iterable[str]) -> str:
    """Return ``" (did you mean 'x'?)"`` for the nearest known name, or an empty text.

    >>> nearest_hint("ndms", ["mpp", "ndsm"]), nearest_hint("ahn", ["ahn4-bag"]), nearest_hint("x", ["ndsm"])
    (" (did you mean 'ndsm'?)", " (did you mean 'ahn4-bag'?)", '')
    """
    names = list(known)
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    # The beginning of a long name is not similar to it by the share of common letters.
    near = near or [other for other in names if len(name) >= _LEAST_BEGINNING and other.startswith(name)]
    return f" (did you mean {near[0]!r}?)" if near else ""


def parse_assignment(text: str) -> tuple[str, str]:
    """Read ``name=value``; everything after the first ``=`` belongs to the value.

    >>> parse_assignment("height = 2.5")
    ('height', '2.5')
    """
    name, equals, value = text.partition("=")
    if not equals or not name.strip():
        raise ParameterError(f"cannot read {text!r}: write NAME=VALUE")
    return name.strip(), value.strip()


def parse_selection(text: str) -> tuple[str, dict[str, str]]:
    """Read ``name[parameter=value,parameter=value]``.

    >>> parse_selection("original[ground_tile=400, ground=tile-dem]")
    ('original', {'ground_tile': '400', 'ground': 'tile-dem'})
    """
    match = _SELECTION.match(text.strip())
    if match is None:
        raise ParameterError(f"cannot read the selection {text!r}: write name or name[parameter=value,...]")
    values: dict[str, str] = {}
    for item in _OUTSIDE_QUOTES.split(match["parameters"] or ""):
        if item.strip():
            try:
                key, value = parse_assignment(item)
            except ParameterError:
                raise ParameterError(f"cannot read {item.strip()!r} in {text!r}: write parameter=value") from None
            if key in values:
                raise ParameterError(f"{text!r} gives {key} twice: give it once")
            values[key] = value[1:-1] if len(value) > 1 and value[0] == value[-1] == '"' else value
    return match["name"].strip(), values


def split_list(text: str) -> list[str]:
    """Split at commas outside brackets.

    >>> split_list("ndsm[cell=0.5,height=2],original")
    ['ndsm[cell=0.5,height=2]', 'original']
    """
    return [part.strip() for part in re.split(r",(?![^\[]*\])", text) if part.strip()]


class Registry:
    """Classes by name, imported when asked for.

    Parameters
    ----------
    kind : str
        What is registered, for messages: ``"detector"``.
    group : str
        Entry point group of installed plugins: ``"roofbench.detectors"``.
    base : type
        Class that every registered one derives from.
    builtin : mapping of str to str
        Name to ``"module:Class"``, the module relative to the roofbench package.
    """

    def __init__(self, kind: str, group: str, base: type, builtin: Mapping[str, str]) -> None:
        self.kind = kind
        self._group = group
        self._base = base
        self._builtin = dict(builtin)
        self._added: dict[str, type[Any]] = {}

    def names(self) -> list[str]:
        """Return all names: built in, installed, added."""
        return sorted({*self._builtin, *self._entry_points(), *self._added})

    def is_builtin(self, name: str) -> bool:
        """Whether a name is that of a class of roofbench itself."""
        return name in self._builtin

    def get(self, name: str) -> type[Any]:
        """Return the class called `name`; ``path/to/file.py:Class`` loads and adds it."""
        if ".py" in name and (":" in name or name.endswith(".py")):
            return self.add_file(name)
        if name in self._added:
            return self._added[name]
        if name in self._builtin:
            module, _, attribute = self._builtin[name].partition(":")
            return self._checked(getattr(importlib.import_module(f"{NAME}.{module}"), attribute), name)
        found = self._entry_points().get(name)
        if found is not None:
            _never_load_stale_kernels()
            return self._checked(found.load(), name)
        raise UnknownNameError(
            f"no {self.kind} called {name!r}{nearest_hint(name, self.names())}; there are {', '.join(self.names())}"
        )

    def add(self, plugin: type[Any]) -> type[Any]:
        """Add a class under its ``name``; a name that is taken by another class is refused.

        A class of an installed package may be added from its file as well, as tests of the package do.
        """
        plugin = self._checked(plugin, plugin.__name__)
        name: str = plugin.name
        installed = self._entry_points().get(name)
        taken = name in self._builtin or (installed is not None and not _same_source(installed.load(), plugin))
        other = self._added.get(name)
        if taken or (other is not None and _origin(other) != _origin(plugin)):
            raise ParameterError(f"a {self.kind} called {name!r} exists already: give {plugin.__name__} another name")
        self._added[name] = plugin
        return plugin

    def add_file(self, selection: str) -> type[Any]:
        """Load ``path/to/file.py[:Class]``; without a class name the file must hold exactly one of this kind."""
        path_text, _, attribute = selection.partition(".py")
        path, attribute = Path(path_text + ".py"), attribute.lstrip(":")
        module = _load_file(path, self.kind)
        if attribute:
            if not hasattr(module, attribute):
                raise UnknownNameError(f"{path} has no class {attribute!r}{nearest_hint(attribute, vars(module))}")
            return self.add(getattr(module, attribute))
        found = self._defined_in(module)
        if len(found) != 1:
            raise UnknownNameError(f"{path} holds {len(found)} {self.kind} classes, not one: name it as {path}:Class")
        return self.add(found[0])

    def add_all(self, path: Path) -> list[type[Any]]:
        """Load a Python file and add every class of this kind that it defines; there may be none."""
        return [self.add(plugin) for plugin in self._defined_in(_load_file(path, self.kind))]

    def _defined_in(self, module: ModuleType) -> list[type[Any]]:
        return [
            value
            for value in vars(module).values()
            if isinstance(value, type) and issubclass(value, self._base) and value.__module__ == module.__name__
        ]

    def _entry_points(self) -> dict[str, importlib.metadata.EntryPoint]:
        return _installed(self._group)

    def _checked(self, plugin: Any, name: str) -> type[Any]:
        if not (isinstance(plugin, type) and issubclass(plugin, self._base)):
            article = "an" if self.kind[0] in "aeiou" else "a"
            raise ParameterError(
                f"{name} is not {article} {self.kind}: it must derive from roofbench.{self._base.__name__}"
            )
        if not isinstance(getattr(plugin, "name", None), str):
            raise ParameterError(f"{name} has no name: set the class attribute 'name'")
        return plugin


@cache
def _installed(group: str) -> dict[str, importlib.metadata.EntryPoint]:
    """Return the entry points of a group; the search reads a file of every installed package, so it is done once."""
    return {entry.name: entry for entry in importlib.metadata.entry_points(group=group)}


def _same_source(one: type[Any], two: type[Any]) -> bool:
    """Return whether two classes have one name and the same source file, or copies of it."""
    files = [getattr(sys.modules.get(plugin.__module__), "__file__", None) for plugin in (one, two)]
    if one.__qualname__ != two.__qualname__ or not all(files):
        return False
    contents = [Path(str(file)).read_bytes() for file in files]
    return contents[0] == contents[1]


def _origin(plugin: type[Any]) -> tuple[str, str]:
    return plugin.__module__, plugin.__qualname__


def _load_file(path: Path, kind: str) -> ModuleType:
    """Import a Python file the user names; its module name holds its full path so that two files never mix.

    As for a script, the files beside it can be imported.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file; name the Python file that holds the {kind}")
    name = "roofbench_plugin_" + re.sub(r"\W", "_", str(path.resolve()))
    if name in sys.modules:
        return sys.modules[name]
    _find_files_beside(path.resolve())
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    _never_load_stale_kernels()
    try:
        # Standard output is for data: what a plugin prints is a message.
        with redirect_stdout(sys.stderr):
            spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        raise InputError(f"{path} cannot be imported: {type(error).__name__}: {error}") from error
    return module


def _find_files_beside(path: Path) -> None:
    """Put the folder of a plugin on the module path; refuse it where a file beside it has a name that is taken.

    The file of another plugin would be imported in its place, and two versions of a detector would be one.
    """
    folder = path.parent
    for file in folder.glob("*.py"):
        loaded = getattr(sys.modules.get(file.stem), "__file__", None)
        if loaded and file != path and str(Path(loaded).parent) in _plugin_folders - {str(folder)}:
            raise InputError(
                f"{file} and {loaded} have one name, and a plugin beside each is used: rename one of them, or use one "
                "plugin at a time"
            )
    _plugin_folders.add(str(folder))
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))


def _never_load_stale_kernels() -> None:
    """Let kernels of plugins be compiled again when a kernel changes that they import from another module."""
    from .kernels import track_dependencies_of_numba  # numba is slow to load: only where there are plugins

    track_dependencies_of_numba()
