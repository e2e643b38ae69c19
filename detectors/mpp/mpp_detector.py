"""The detector ``mpp``: a marked point process of rectangles on a point cloud.

After Yu, Li, Guan & Wang (2013), "A marked point process for automated building detection from lidar point-clouds",
Remote Sensing Letters 4(11), 1127-1136: a repaired model with roofs, texture and party walls, whose energy a search
lowers; ``optimiser=rjmcmc`` samples it (docs/results/mpp.md says what was changed and why). The algorithm as printed is
the detector ``mpp-printed``.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Self

import numpy as np

from ...core.errors import ParameterError
from ...scenes.geodata.footprints import Footprints
from ...scenes.scene import Scene
from ..base import Detector
from ..shared.cue_information import PENETRATION
from ..shared.known_returns import known_returns
from ..steps import Step
from .annealing import join_traces
from .arrays import Mask, Rectangles
from .cells import cell_size, has_points
from .energy import rectangle_energies
from .memory import release_memory
from .mpp_steps import mpp_steps
from .outcome import as_footprints, fit_roofs
from .parameters import MPPParameters
from .preparation import Prepared, prepare, survey_textures, weights_of
from .scores import mean_evidence
from .squares import side_of
from .tables import NO_TABLES
from .threads import started_threads
from .whole_scene import find_rectangles, total_energy

__all__ = ["MPP"]

#: Share of the least evidence of a building where roughness is the only cue of the points: one cue gives less than two.
_LEAST_OF_ONE_CUE = 0.8

#: Parameters of earlier versions, and what to do instead.
_REMOVED = {
    "mode": "the printed algorithm is the detector 'mpp-printed'; 'optimiser=rjmcmc' samples the repaired model",
    "false_alarm_ratio": "it belongs to the detector 'mpp-printed'",
    "iterations": "it belongs to the detector 'mpp-printed'; with optimiser=rjmcmc set effort",
    "workers": "set the execution option threads",
    "tile": "the squares in which it works follow from largest_side",
    "outline": "choose the level part, building or block",
    **dict.fromkeys(
        ("furniture", "hot", "cold", "intensity", "jump_share", "split_share", "data_births"),
        "no value of it moved a result by more than another seed did, and it is a constant now: leave it out",
    ),
}


@dataclass(frozen=True, kw_only=True)
class MPP(MPPParameters, Detector):
    """Rectangles of a marked point process on the points, found by a search of its energy or sampled by RJMCMC.

    An image is read where the points do not record the number of returns (`image_cue`), and around blocks that may be
    rows (`wall_colours`).
    """

    name: ClassVar[str] = "mpp"
    paper = "after Yu, Li, Guan & Wang 2013, Remote Sensing Letters 4(11), doi:10.1080/2150704X.2013.846487"
    requires: ClassVar[tuple[str, ...]] = ("points",)
    numbers: ClassVar[tuple[str, ...]] = ("part_of",)
    place_streams: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "stochastic", self.optimiser == "rjmcmc")

    @classmethod
    def build(cls, values: Mapping[str, Any] | None = None) -> Self:
        """Build from a mapping; parameters of earlier versions are refused with what replaces them."""
        for name in values or {}:
            if name in _REMOVED:
                raise ParameterError(f"mpp: no parameter {name!r}: {_REMOVED[name]}")
        return super().build(values)

    def detect(self, scene: Scene, rng: np.random.Generator) -> Footprints:
        """Return footprints of the chosen `level`, with the attributes of `outcome.as_footprints`."""
        return self._run(scene, rng)[0]

    def steps(self, scene: Scene, rng: np.random.Generator) -> Iterator[Step]:
        """Yield heights, evidence, boxes, the convergence of the sampler and the result of the same run."""
        found, prepared = self._run(scene, rng)
        if prepared is None:
            return
        yield from mpp_steps(prepared, found.polygons, found.metadata.get("trace"))

    @property
    def halo(self) -> float:  # type: ignore[override]
        """The side of a square (`squares`) and half the longest diagonal of a rectangle, metres."""
        return side_of(self.largest_side) + math.sqrt(0.5) * self.largest_side

    def measured(self, scene: Scene) -> Mapping[str, float]:
        """Return the cell size, unless it is given."""
        points = scene.points
        if self.cell is not None or points is None or not len(points):
            return {}
        return {"cell": cell_size(points.x, points.y, scene.extent)}

    def survey(self, scene: Scene) -> Mapping[str, Any]:
        """Return the textures from which the classes of roofs and crowns are estimated."""
        return survey_textures(self, scene)

    def _evident(self, prepared: Prepared, rectangles: Rectangles) -> Mask:
        """Return which rectangles look like a roof on the whole, not only in sum.

        Textures of neighbours resemble each other, so that the best of many windows in a crown sums up to a roof.
        """
        least = self.least_evidence * self.texture_limit * min(self.texture_weight, 1.0)
        if PENETRATION not in prepared.cues.used:
            least *= _LEAST_OF_ONE_CUE
        if least == 0:
            return np.ones(len(rectangles), dtype=np.bool_)
        evidence = mean_evidence(
            rectangles, prepared.height, prepared.state, prepared.score, prepared.background, weights_of(self)
        )
        return least <= evidence

    def _run(self, scene: Scene, rng: np.random.Generator) -> tuple[Footprints, Prepared | None]:
        seed = int(rng.integers(2**63))
        seen = scene.for_detection()
        seen.require(self.requires)
        began = time.perf_counter()
        assert seen.points is not None
        if not has_points(seen.points.z):
            return Footprints.empty(crs=scene.crs, source=self.name), None
        known = known_returns(seen.points, seen.extent)
        points = known.points
        with started_threads(self.threads) as threads:
            prepared = prepare(self, points, seen, threads)
            ready = time.perf_counter()
            rectangles, results = find_rectangles(self, prepared, seed, threads)
        rectangles = rectangles[self._evident(prepared, rectangles)]
        done = time.perf_counter()
        energies = rectangle_energies(prepared.tables, rectangles, prepared.model)
        fits = fit_roofs(prepared, rectangles)
        record: dict[str, Any] = {
            "cell": prepared.grid.gsd,
            "background": {
                field.name: getattr(prepared.background, field.name)
                for field in fields(prepared.background)
                if field.name != "evidence"
            },
            "cues": list(prepared.cues.used),
            "notes": list(prepared.cues.with_notes(known.notes).notes),
            "boxes": len(prepared.boxes),
            "energy": total_energy(prepared, rectangles, energies),
            "seconds": {"preparation": ready - began, "search": done - ready},
        }
        if self.stochastic:
            record |= {"seed": seed, "trace": join_traces(results)}
        # Outlines are made from the cells alone: the memory of the tables is released for them.
        prepared = replace(prepared, tables=NO_TABLES)
        release_memory(prepared.height.size)
        found = as_footprints(
            prepared,
            rectangles,
            fits,
            energies,
            level=self.level,
            crs=scene.crs,
            record=record,
            source=self.name,
        )
        return found, prepared
