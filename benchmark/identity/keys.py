"""Content keys: everything that a stored result depends on, so that equal runs are computed once.

Nouns
-----
key parts
    Everything that decides the footprints of a run: detector, its source closure, its parameters, the versions of the
    packages it imports, the scene, the seed. The *key* is their SHA-256.
source closure
    The modules that a class reaches by its imports inside its own package (and those of roofbench that it uses). Of
    each, the syntax tree without docstrings counts: comments, formatting and documentation do not change keys.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.metadata
import importlib.util
import inspect
import platform
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from ...core.digests import digest
from ...core.package import FOLDER, HOMES, NAME

__all__ = [
    "SourceClosure",
    "module_closure",
    "module_file",
    "source_closure",
]


@dataclass(frozen=True)
class SourceClosure:
    """The source that a class depends on.

    Attributes
    ----------
    modules : mapping of str to str
        Module name to the digest of its syntax tree.
    packages : mapping of str to str
        Third-party distribution to its version, and ``python``.
    """

    modules: Mapping[str, str]
    packages: Mapping[str, str]

    @property
    def digest(self) -> str:
        """Digest of both."""
        return digest({"modules": dict(self.modules), "packages": dict(self.packages)})


@lru_cache(maxsize=256)
def source_closure(plugin: type[Any]) -> SourceClosure:
    """Return the source closure of a detector, evaluator or generator class (or of any class with a source)."""
    modules: dict[str, str] = {}
    imported: set[str] = set()
    for base in plugin.__mro__:
        if base.__module__ in modules or base.__module__ in sys.stdlib_module_names or base is object:
            continue
        path = module_file(base.__module__)
        if path is None:
            modules[f"{base.__module__}:{base.__qualname__}"] = _digest_without_file(base)
        else:
            _walk(base.__module__, path, modules, imported)
    versions = {name: _version(name) for name in sorted(imported)}
    packages = {name: version for name, version in versions.items() if version is not None}
    packages["python"] = ".".join(platform.python_version_tuple()[:2])
    return SourceClosure(dict(sorted(modules.items())), packages)


@lru_cache(maxsize=16)
def module_closure(module: str) -> SourceClosure:
    """Return the source closure of a module of roofbench, such as ``scenes.synthetic``."""
    modules: dict[str, str] = {}
    imported: set[str] = set()
    name = f"{NAME}.{module}"
    path = module_file(name)
    assert path is not None, f"no module {name}"
    _walk(name, path, modules, imported)
    versions = {name: _version(name) for name in sorted(imported)}
    return SourceClosure(
        dict(sorted(modules.items())), {name: version for name, version in versions.items() if version is not None}
    )


def _walk(module: str, path: Path, modules: dict[str, str], imported: set[str]) -> None:
    """Add a module and, in turn, those that it imports."""
    waiting = [(module, path)]
    while waiting:
        name, file = waiting.pop()
        if name in modules:
            continue
        source = _read(file)
        modules[name] = source.digest
        for target in source.imports_of(name, is_package=file.name == "__init__.py"):
            top = target.partition(".")[0]
            if top in sys.stdlib_module_names:
                continue
            found = _resolve(target, module.partition(".")[0], path.parent)
            if found is not None:
                waiting.append(found)
            elif top not in (NAME, module.partition(".")[0]):
                imported.add(top)


def _resolve(target: str, home: str, folder: Path) -> tuple[str, Path] | None:
    """Return the module behind an import when it belongs to roofbench, to the plugin's package or lies beside it.

    ``package.module.name`` may be a module or a name within one. The root, which only resolves public names, is left
    out.
    """
    top = target.partition(".")[0]
    if (top in (NAME, home) and not home.startswith("roofbench_plugin_")) or top == NAME:
        for name in (target, target.rpartition(".")[0]):
            file = module_file(name) if name and name != NAME else None
            if file is not None:
                return name, file
        return None
    beside = folder / f"{top}.py"
    if home.startswith("roofbench_plugin_") and beside.is_file():
        return top, beside
    return None


@dataclass(frozen=True)
class _Source:
    digest: str
    imports: tuple[tuple[int, str, tuple[str, ...]], ...]
    api: tuple[str, ...]

    def imports_of(self, module: str, *, is_package: bool) -> Iterator[str]:
        """Yield absolute names of what the module imports: ``package.module`` and ``package.module.name``."""
        parts = module.split(".") if is_package else module.split(".")[:-1]
        for level, name, names in self.imports:
            base = ".".join([*parts[: len(parts) - level + 1], *([name] if name else [])]) if level else name
            if not names:
                yield base
            for item in names:
                yield f"{base}.{item}"
        yield from (f"{NAME}.{home}" for home in self.api)


@lru_cache(maxsize=1024)
def _read(file: Path) -> _Source:
    tree = ast.parse(file.read_bytes(), str(file))
    imports: list[tuple[int, str, tuple[str, ...]]] = []
    aliases: set[str] = set()
    names: set[str] = set()
    for node in _running(tree):
        if isinstance(node, ast.Import):
            imports += [(0, alias.name, ()) for alias in node.names]
            aliases |= {alias.asname or alias.name for alias in node.names if alias.name == NAME}
        elif isinstance(node, ast.ImportFrom):
            imports.append((node.level, node.module or "", tuple(alias.name for alias in node.names)))
            if node.module == NAME and not node.level:
                names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in aliases:
            names.add(node.attr)
    api = tuple(sorted({HOMES[name] for name in names if name in HOMES}))
    tree_text = ast.dump(_without_docstrings(tree), annotate_fields=False)
    return _Source(hashlib.sha256(tree_text.encode()).hexdigest(), tuple(imports), api)


def _running(tree: ast.AST) -> Iterator[ast.AST]:
    """Walk a tree in order, without the blocks under ``if TYPE_CHECKING``."""
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop(0)
        yield node
        children: Iterable[ast.AST] = ast.iter_child_nodes(node)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            children = node.orelse
        waiting.extend(children)


def _without_docstrings(tree: ast.Module) -> ast.Module:
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0] if node.body else None
            if (
                isinstance(first, ast.Expr)
                and isinstance(first.value, ast.Constant)
                and isinstance(first.value.value, str)
            ):
                node.body = node.body[1:]
    return tree


@lru_cache(maxsize=1024)
def module_file(name: str) -> Path | None:
    """Return the source file of a module without importing it when it is one of roofbench."""
    if name == NAME or name.startswith(NAME + "."):
        place = FOLDER.joinpath(*name.split(".")[1:])
        for file in (place.with_suffix(".py"), place / "__init__.py"):
            if file.is_file():
                return file
        return None
    loaded = sys.modules.get(name)
    path = getattr(loaded, "__file__", None)
    if path is None and loaded is None:
        try:
            spec = importlib.util.find_spec(name)
        except (ImportError, ValueError):
            return None
        path = spec.origin if spec is not None else None
    return Path(path).resolve() if path and path.endswith(".py") and Path(path).is_file() else None


def _digest_without_file(plugin: type[Any]) -> str:
    """Return the digest of a class without a file (typed at a prompt): of its source, else of its bytecode."""
    try:
        return digest(inspect.getsource(plugin))
    except (OSError, TypeError):
        functions = [inspect.unwrap(value) for value in vars(plugin).values() if inspect.isfunction(value)]
        codes = [function.__code__.co_code.hex() for function in functions]
        return digest(codes)


@lru_cache(maxsize=1)
def _distributions() -> Mapping[str, list[str]]:
    return importlib.metadata.packages_distributions()


@lru_cache(maxsize=256)
def _version(top: str) -> str | None:
    """Return the version of the distribution that provides an importable name, None when there is none."""
    try:
        return importlib.metadata.version(top)
    except importlib.metadata.PackageNotFoundError:
        found = _distributions().get(top)
        return importlib.metadata.version(found[0]) if found else None
