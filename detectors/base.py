"""Detectors: what finds buildings in a scene.

A *detector* is a frozen, keyword-only dataclass whose fields are its parameters and its execution options (see
`core.parameters`): the number of threads, for instance, which changes the time and never the result.
`Detector.detect` turns a scene into footprints. It sees measurements only (`Scene.for_detection`) and draws every
random number from the generator it is given, so that the same seed gives the same footprints on any machine and with
any number of workers.
"""

from __future__ import annotations

import functools
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..core.errors import UnsupportedError
from ..core.parameters import Parameterised
from ..scenes.geodata.footprints import Footprints
from ..scenes.scene import Scene
from .steps import Step
from .streams import random_stream

__all__ = ["Declaration", "Detector"]


class Declaration(NamedTuple):
    """What a runner must know of a detector; processes in which its code must not run know no more."""

    name: str
    requires: tuple[str, ...]
    numbers: tuple[str, ...]
    place_streams: bool

    @classmethod
    def of(cls, detector: Detector) -> Declaration:
        """Return the declaration of a detector."""
        return cls(detector.name, tuple(detector.requires), tuple(detector.numbers), detector.place_streams)


class Detector(Parameterised, ABC):
    """Base of all detectors: derive, decorate with ``@dataclass(frozen=True, kw_only=True)``, set `name`.

    Attributes
    ----------
    name : str
        Name on the command line and in tables.
    requires : tuple of str
        Inputs without which it is skipped: ``points``, ``image``, ``colour``, ``nir``, ``dem``.
    paper : str
        Where it is published; empty for none.
    stochastic : bool
        Whether different seeds give different footprints.
    halo : float
        Metres around a tile that it sees besides the tile, when a city is detected by tiles (`detectors.tiling`):
        wider than half a building and than whatever decides a footprint from afar.
    numbers : tuple of str
        Attributes that number buildings within one result; they are made unique over tiles.
    place_streams : bool
        Whether its random streams already follow from absolute places, so that all tiles may share one seed.
    """

    name: ClassVar[str]
    requires: ClassVar[tuple[str, ...]] = ("points",)
    paper: ClassVar[str] = ""
    stochastic: ClassVar[bool] = False
    halo: ClassVar[float] = 150.0
    numbers: ClassVar[tuple[str, ...]] = ()
    place_streams: ClassVar[bool] = False

    def __init_subclass__(cls, **more: Any) -> None:
        super().__init_subclass__(**more)
        for name in ("detect", "steps"):
            if name in cls.__dict__:
                setattr(cls, name, _with_default_stream(cls.__dict__[name]))

    @abstractmethod
    def detect(self, scene: Scene, rng: np.random.Generator) -> Footprints:
        """Return the footprints of the buildings in a scene; none is a valid result.

        Parameters
        ----------
        scene : Scene
        rng : numpy.random.Generator
            Every random number comes from it. Callers may leave it out: a detector is then given the stream of seed 0,
            as `roofbench.detect` uses it.
        """

    def measured(self, scene: Scene) -> Mapping[str, float]:
        """Return parameters that are unset and that `detect` would measure on this scene, such as a cell size.

        Tiles of a city share these values, so that no seam separates two cell sizes.
        """
        return {}

    def survey(self, scene: Scene) -> Mapping[str, Any]:
        """Return numbers (nested lists of whole numbers) that `detect` would count on all of a scene, in its `core`.

        Those of several parts of a city add up; `detect` finds the sums in `Scene.whole` and uses them instead of what
        it would count on a tile.
        """
        return {}

    def fingerprint(self) -> str:
        """Return a digest of what it reads besides the scene (a program, footprints made elsewhere); empty for none.

        It is part of the key of stored runs: when it changes, they are computed anew.
        """
        return ""

    def code_files(self) -> tuple[Path, ...]:
        """Return the files and folders outside Python that it runs or reads and that belong to its code.

        A baseline keeps a copy of small ones, so that the gate can time the old program beside the new one.
        """
        return ()

    def own_label(self) -> str:
        """Return its name in tables where it is not the name with changed parameters; empty for most."""
        return ""

    def steps(self, scene: Scene, rng: np.random.Generator) -> Iterator[Step]:
        """Yield the intermediate results of the same detection as data (`detectors.steps`); nothing is drawn here.

        ``roofbench detect --steps`` draws them.
        """
        raise UnsupportedError(f"the detector {self.name!r} shows no intermediate steps")


def _with_default_stream(method: Callable[..., Any]) -> Callable[..., Any]:
    """Return `Detector.detect` or `Detector.steps` as it is called without ``rng``: with the stream of seed 0."""

    @functools.wraps(method)
    def called(self: Detector, scene: Scene, rng: np.random.Generator | None = None) -> Any:
        return method(self, scene, random_stream(0, scene.name, self.name) if rng is None else rng)

    return called
