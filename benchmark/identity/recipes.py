"""Recipes: how a scene, a detector or an evaluator can be made again in another process or later.

A recipe is short and fits in JSON (a folder, a preset with a seed, a name with parameters), so that tasks, plans and
the store carry recipes and paths instead of megabytes.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, Self, cast

from ...core.digests import digest
from ...core.errors import ParameterError, UnknownNameError, UnsupportedError
from ...core.parameter_rules import parameter_text
from ...core.registry import Registry, nearest_hint
from ...detectors.base import Detector
from ...detectors.external.external_paths import with_relative_paths
from ...detectors.external.precomputed import Precomputed
from ...detectors.registry import DETECTORS, make_detector
from ...evaluators.base import Evaluator
from ...evaluators.registry import EVALUATORS, make_evaluator
from ...scenes.builtin import hamlet
from ...scenes.folder import MANIFEST, listed_hash, open_scene
from ...scenes.remote import copy_of, is_address
from ...scenes.scene import Scene
from ...scenes.shipped import shipped_folder, shipped_names
from ...scenes.synthetic import make_scene
from ...scenes.synthetic.presets import preset
from ...scenes.synthetic.presets import preset_names as generator_presets
from .keys import module_closure, source_closure
from .spool import read_spooled

__all__ = ["PluginRecipe", "SceneRecipe", "code_digest", "fingerprint_on", "label_of", "preset_names"]

_HAMLET = "hamlet"
_GENERATOR = "scenes.synthetic"
_BUILTIN = "scenes.builtin"
#: Detectors with paths among their parameters.
_WITH_PATHS = ("command", "precomputed")


def label_of(plugin: Detector | Evaluator) -> str:
    """Return the name with what differs from the defaults: ``ndsm[cell=0.25]``, or with the plugin's own label."""
    own = plugin.own_label() if isinstance(plugin, Detector) else ""
    if own:
        return f"{plugin.name}:{own}"
    changed = ",".join(f"{name}={parameter_text(value)}" for name, value in plugin.changed().items())
    return f"{plugin.name}[{changed}]" if changed else plugin.name


@dataclass(frozen=True)
class PluginRecipe:
    """A detector or evaluator by its selection and its parameters.

    Attributes
    ----------
    use : str
        Registered name, or ``path/to/file.py:Class``.
    parameters : mapping
        Every parameter with its value, defaults included.
    execution : mapping
        Execution options, such as the number of threads. They travel with the recipe to other processes, but are no
        part of its identity: equal recipes may differ in them.
    """

    use: str
    parameters: Mapping[str, Any]
    execution: Mapping[str, Any] = field(default_factory=dict, compare=False)

    @classmethod
    def of(cls, plugin: Detector | Evaluator) -> Self:
        """Return the recipe of an object; raise `UnsupportedError` when another process cannot import its class."""
        kind = type(plugin)
        registry: Registry = DETECTORS if isinstance(plugin, Detector) else EVALUATORS
        module = sys.modules.get(kind.__module__)
        if kind.__module__.startswith("roofbench_plugin_") and module is not None and module.__file__:
            use = f"{Path(module.__file__).resolve()}:{kind.__qualname__}"
            return cls(use, plugin.values(), plugin.execution_values())
        if plugin.name in registry.names() and registry.get(plugin.name) is kind:
            return cls(plugin.name, plugin.values(), plugin.execution_values())
        raise UnsupportedError(
            f"{kind.__qualname__} cannot be made again in another process: put it into a file and select it as "
            f"file.py:{kind.__name__}, or run with jobs=0, in this process"
        )

    def detector(self) -> Detector:
        """Return the detector."""
        return make_detector(self.use, {**self.parameters, **self.execution})

    def evaluator(self) -> Evaluator:
        """Return the evaluator."""
        return make_evaluator(self.use, {**self.parameters, **self.execution})

    def relative_to(self, folder: Path) -> Self:
        """Return the recipe with relative paths to what lies below a folder, for another clone or machine."""
        path, colon, name = self.use.rpartition(":")
        if path.endswith(".py") and Path(path).is_relative_to(folder):
            return replace(self, use=f"{os.path.relpath(path, folder)}{colon}{name}")
        if self.use in _WITH_PATHS:
            return replace(self, parameters=with_relative_paths(self.parameters, folder))
        return self

    def to_dict(self, *, execution: bool = False) -> dict[str, Any]:
        """Return what JSON holds: the identity, and with `execution` also the execution options."""
        identity = {"use": self.use, "parameters": dict(self.parameters)}
        return {**identity, "execution": dict(self.execution)} if execution else identity


@dataclass(frozen=True)
class SceneRecipe:
    """A scene by where it comes from.

    Attributes
    ----------
    kind : {"folder", "shipped", "preset", "builtin", "spooled", "memory"}
        ``shipped`` is a real scene that comes with roofbench; ``spooled`` is a scene of this process that was written
        to a file for other processes; ``memory`` one that stays in this process.
    name : str
        Name in tables: ``knox-small-3[tree_density=40]``; ``fairfield@1`` where a preset is called ``fairfield-1``.
    place : str
        Folder or its address, name of a shipped scene, preset or file.
    seed : int
        Of a preset and of the built-in scene.
    parameters : mapping
        Parameters of the generator that differ from the preset; the axes of a sweep.
    content_hash : str
        Of a scene in memory or spooled, else empty.
    tile : float
        Of a folder: side of the tiles in which detectors see it, metres; 0 where they see it whole.
    """

    kind: Literal["folder", "shipped", "preset", "builtin", "spooled", "memory"]
    name: str
    place: str
    seed: int = 0
    parameters: Mapping[str, Any] = field(default_factory=dict)
    content_hash: str = ""
    tile: float = 0.0

    @classmethod
    def of_folder(cls, folder: str | Path, *, tile: float = 0.0) -> Self:
        """Return the recipe of a scene folder; its manifest is read for the name."""
        if is_address(str(folder)):
            return cls("folder", _open_folder(str(folder)).name, str(folder), tile=tile)
        path = Path(folder).resolve()
        return cls("folder", _open_folder(str(path)).name, str(path), tile=tile)

    @classmethod
    def of_shipped(cls, name: str) -> Self:
        """Return the recipe of a real scene that comes with roofbench.

        Raises
        ------
        UnknownNameError
            No such scene; the nearest name is given.
        """
        if name not in shipped_names():
            raise UnknownNameError(
                f"no scene called {name!r} comes with roofbench{nearest_hint(name, shipped_names())}; there are "
                f"{', '.join(shipped_names())}"
            )
        return cls("shipped", name, name)

    @classmethod
    def of_preset(cls, name: str, *, seed: int, parameters: Mapping[str, Any] | None = None) -> Self:
        """Return the recipe of a synthetic scene.

        Raises
        ------
        UnknownNameError, ParameterError
            No such preset or parameter, or a value outside its range.
        """
        values = _checked_parameters(name, parameters or {})
        axes = ",".join(f"{key}={parameter_text(value)}" for key, value in values.items())
        # A preset may have a name that another one with a seed would have: fairfield-1.
        mark = "@" if f"{name}-{seed}" in preset_names() else "-"
        full_name = f"{name}{mark}{seed}" + (f"[{axes}]" if axes else "")
        return cls("builtin" if name == _HAMLET else "preset", full_name, name, seed, values)

    @classmethod
    def of_scene(cls, scene: Scene, *, spooled: Path | None = None) -> Self:
        """Return the recipe of a scene object: it stays in this process, or other processes read the spooled file."""
        kind: Literal["spooled", "memory"] = "memory" if spooled is None else "spooled"
        return cls(kind, scene.name, str(spooled or ""), content_hash=scene.content_hash)

    def relative_to(self, folder: Path) -> Self:
        """Return the recipe with a relative path to a scene below a folder, for another clone or machine."""
        if self.kind == "folder" and Path(self.place).is_relative_to(folder):
            return replace(self, place=os.path.relpath(self.place, folder))
        return self

    def absolute(self) -> Self:
        """Return the recipe with an absolute path, for a process in another working folder."""
        return replace(self, place=os.path.abspath(self.place)) if self.kind == "folder" else self

    @property
    def word(self) -> str:
        """The scene on the command line: its folder or name, or ``preset[seed=3,tree_density=40]``."""
        if self.kind in ("preset", "builtin"):
            values = {"seed": self.seed, **self.parameters}
            return f"{self.place}[{','.join(f'{name}={value}' for name, value in values.items())}]"
        return self.place if self.kind == "folder" else self.name

    @property
    def _folder(self) -> str | None:
        """Folder of the scene; None where it has none."""
        if self.kind == "shipped":
            return str(shipped_folder(self.place) or self.place)
        return self.place if self.kind == "folder" else None

    @property
    def contents(self) -> tuple[str, ...] | None:
        """The kinds of data of the scene (``points``, ``image``, ...) without reading them; None where not known."""
        if self._folder is not None:
            return _open_folder(self._folder).contents
        if self.kind == "preset":
            image = () if preset(self.place, **self.parameters).bands == "none" else ("image",)
            return ("points", "dem", "reference", *image)
        return None

    @property
    def group(self) -> str:
        """The group of the scene: the preset with its parameters but without its seed, else the name."""
        if self.kind not in ("preset", "builtin"):
            return self.name
        return self.place + self.name[len(f"{self.place}-{self.seed}") :]

    @property
    def key(self) -> str:
        """Key of the scene, known without generating it.

        Its name (from which random streams follow) with the content of its files, or with the generator's code, seed
        and parameters.
        """
        if self.kind == "builtin":
            return digest([self.name, module_closure(_BUILTIN).digest, self.seed])
        if self.kind == "preset":
            values = preset(self.place, **self.parameters).values()
            # Random streams follow from the name of the scene itself, in which there is no @.
            name = f"{self.place}-{self.seed}{self.name[len(f'{self.place}-{self.seed}') :]}"
            return digest([name, module_closure(_GENERATOR).digest, values, self.seed])
        if self.tile:
            # A tile file that is broken or missing is the failure of its tiles, not of the suite.
            return digest([self.name, listed_hash(self._folder or self.place), self.tile])
        content = self.content_hash or _open_folder(self._folder or self.place).content_hash
        return digest([self.name, content])

    @property
    def written(self) -> int:
        """When the manifest of its folder was written: an opened scene is not used beyond that; 0 without a folder."""
        return 0 if self._folder is None else _written(self._folder)

    def open(self) -> Scene:
        """Return the scene."""
        if self._folder is not None:
            return _open_folder(self._folder)
        if self.kind == "builtin":
            return hamlet(self.seed)
        if self.kind == "spooled":
            return read_spooled(Path(self.place), name=self.name)
        if self.kind == "memory":
            raise UnsupportedError(
                f"scene {self.name!r} exists in the memory of another process only: save it as a folder first"
            )
        return make_scene(self.place, seed=self.seed, **self.parameters)

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON holds."""
        return {
            "kind": self.kind,
            "name": self.name,
            "place": self.place,
            "seed": self.seed,
            "parameters": dict(self.parameters),
            "content_hash": self.content_hash,
            **({"tile": self.tile} if self.tile else {}),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Return the recipe of what `to_dict` returned."""
        return cls(**cast("dict[str, Any]", dict(values)))


def _open_folder(folder: str) -> Scene:
    """Return the scene of a folder, which is opened again after its manifest was written anew."""
    return _opened(folder, _written(folder))


def _written(folder: str) -> int:
    """Return when the manifest of a folder was written."""
    manifest = (copy_of(folder) if is_address(folder) else Path(folder)) / MANIFEST
    return manifest.stat().st_mtime_ns if manifest.is_file() else 0


@lru_cache(maxsize=8)
def _opened(folder: str, changed: int) -> Scene:
    return open_scene(folder)


def _checked_parameters(name: str, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return generator parameters as the generator takes them, or raise `ParameterError`."""
    if name not in preset_names():
        raise UnknownNameError(
            f"no preset called {name!r}{nearest_hint(name, preset_names())}: "
            "'roofbench list scenes' shows what there is"
        )
    if name != _HAMLET:
        recipe = preset(name, **parameters)
        return {key: getattr(recipe, key) for key in parameters}
    if parameters:
        raise ParameterError(f"the built-in scene {name!r} has no parameter {next(iter(parameters))!r}: only a seed")
    return {}


def preset_names() -> list[str]:
    """Return the names of the scenes that can be generated, the built-in one included."""
    return [_HAMLET, *generator_presets()]


def fingerprint_on(detector: Detector, scene: str) -> str:
    """Return the digest of what a detector reads besides a scene, which is known by its real name."""
    return detector.fingerprint_on(scene) if type(detector) is Precomputed else detector.fingerprint()


def code_digest(plugin: Detector | Evaluator) -> str:
    """Return the digest of the source that a plugin depends on."""
    return source_closure(type(plugin)).digest
