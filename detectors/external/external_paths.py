"""Paths in the parameters of `command` and `precomputed`, and the content of the files that they name.

A run may happen in another working folder, so paths are made absolute where the user gave them: on the command line
from the current folder, in a suite from the folder of its file.
"""

from __future__ import annotations

import hashlib
import os
import shlex
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from ...core.errors import InputError, ParameterError

__all__ = [
    "absolute_words",
    "content_digest",
    "files_of",
    "moved_words",
    "path_in",
    "split_words",
    "with_absolute_paths",
    "with_relative_paths",
]


def split_words(text: str, parameter: str) -> list[str]:
    """Split a text at spaces as a shell does, quotes included; nothing is expanded.

    Raises
    ------
    ParameterError
        A quote without its end.
    """
    try:
        return shlex.split(text)
    except ValueError as error:
        raise ParameterError(f"{parameter} cannot be split into words: {error}: {text!r}") from error


def path_in(word: str) -> Path | None:
    """Return the absolute path of what exists that a word names: alone, or after ``=`` as in ``--model=/trees.pt``."""
    for text in (word, word.partition("=")[2]):
        if os.path.isabs(text) and os.path.exists(text):
            return Path(text)
    return None


def absolute_words(text: str, parameter: str, folder: Path) -> str:
    """Return a text of words in which those that name a file or folder are absolute paths.

    The program at the head of `run` is searched as by a shell: a name without a slash is that of an installed program
    where there is one.
    """

    def absolute(path: str) -> str | None:
        return os.path.abspath(folder / path) if os.path.exists(folder / path) else None

    words = split_words(text, parameter)
    changed = [_with_path(word, absolute) for word in words]
    if words and parameter == "run":
        program = words[0]
        is_installed = os.path.basename(program) == program and shutil.which(program) is not None
        if is_installed or not os.path.isfile(folder / program):
            changed[0] = program
        # The word after -m is a module, not the folder of that name.
        module = words.index("-m") + 1 if "python" in os.path.basename(program) and "-m" in words else len(words)
        changed[module : module + 1] = words[module : module + 1]
    return shlex.join(changed)


def moved_words(text: str, parameter: str, old: Path, new: Path) -> str:
    """Return a text of words in which paths below the folder `old` are below `new`, where they exist there."""

    def moved(path: str) -> str | None:
        place = Path(os.path.abspath(path))
        there = new / place.relative_to(old) if place.is_relative_to(old) else place
        return str(there) if os.path.exists(there) else None

    return shlex.join(_with_path(word, moved) for word in split_words(text, parameter))


def with_absolute_paths(values: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return parameters of `command` or `precomputed` whose paths are relative to a folder, with absolute paths."""
    changed = dict(values)
    for name in ("run", "files"):
        if isinstance(values.get(name), str):
            changed[name] = absolute_words(values[name], name, folder)
    if isinstance(values.get("folder"), str) and values["folder"]:
        changed["folder"] = os.path.abspath(folder / values["folder"])
    return changed


def with_relative_paths(values: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return parameters of `command` or `precomputed` in which paths below a folder are relative to it."""

    def relative(path: str) -> str | None:
        below = os.path.isabs(path) and Path(path).is_relative_to(folder)
        return os.path.join(os.curdir, os.path.relpath(path, folder)) if below else None

    changed = dict(values)
    for name in ("run", "files"):
        if isinstance(values.get(name), str):
            changed[name] = shlex.join(_with_path(word, relative) for word in split_words(values[name], name))
    if isinstance(values.get("folder"), str) and values["folder"]:
        changed["folder"] = relative(values["folder"]) or values["folder"]
    return changed


def _with_path(word: str, changed: Callable[[str], str | None]) -> str:
    """Return a word whose path is changed: the word, or what follows ``=`` in it; `changed` gives None for no path."""
    name, equals, value = word.partition("=")
    for before, path in (("", word), (name + equals, value)):
        if path and (new := changed(path)) is not None:
            return before + new
    return word


def content_digest(paths: Iterable[Path]) -> str:
    """Return the SHA-256 of the content of files, and of all files below folders with their relative names."""
    digest = hashlib.sha256()
    for path in paths:
        for name, file in files_of(path):
            digest.update(f"{name} {_file_digest(file)}\n".encode())
    return digest.hexdigest()


def files_of(path: Path) -> Iterator[tuple[str, Path]]:
    """Yield a file with its name, or all files below a folder with their relative names."""
    if path.is_dir():
        for file in sorted(path.rglob("*")):
            if file.is_file() and file.parent.name != "__pycache__":
                yield file.relative_to(path).as_posix(), file
    else:
        yield path.name, path


def _file_digest(file: Path) -> str:
    try:
        facts = file.stat()
        return _digest_at(str(file), facts.st_mtime_ns, facts.st_size)
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror}") from error


@lru_cache(maxsize=512)
def _digest_at(file: str, modified: int, size: int) -> str:
    with open(file, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
