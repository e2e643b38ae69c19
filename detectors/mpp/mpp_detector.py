"""The detector ``mpp``: a marked point process of rectangles on a point cloud.

Yu, Li, Guan & Wang (2013), "A marked point process for automated building detection from lidar point-clouds", Remote
Sensing Letters 4(11), 1127-1136. ``mode="paper"`` is the printed algorithm; ``mode="reversible"`` a valid sampler of a
repaired model with roofs, texture and party walls (docs/mpp.md says what was changed and why).
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...core.errors import ParameterError
from ...core.parameters import execution_option, parameter
from ...scenes.geodata.footprints import Footprints
from ...scenes.scene import Scene
from ..base import Detector
from ..steps import Step
from .background import mean_evidence
from .city import join_traces, sample_city, total_energy
from .energy import own_energies
from .memory import give_back
from .mpp_steps import mpp_steps
from .outcome import as_blocks, as_buildings, fit_roofs
from .preparation import Prepared, prepare
from .printed import sample_printed
from .tables import NO_TABLES
from .workers import some_workers

__all__ = ["MPP"]

_Rectangles = NDArray[np.float64]

#: Fewer points than this are no scene.
_FEW = 20


def _are_many(z: NDArray[np.float64]) -> bool:
    """Whether a scene has enough finite heights; looks at the first ones first."""
    return any(np.count_nonzero(np.isfinite(part)) >= _FEW for part in (z[: 100 * _FEW], z))


@dataclass(frozen=True, kw_only=True)
class MPP(Detector):
    """Rectangles sampled by reversible jumps (RJMCMC) from the energy of a marked point process, without any image."""

    name: ClassVar[str] = "mpp"
    requires: ClassVar[tuple[str, ...]] = ("points",)
    stochastic: ClassVar[bool] = True

    mode: str = parameter(
        "reversible", choices=("reversible", "paper"), doc="repaired sampler, or the algorithm as printed"
    )
    cell: float | None = parameter(
        None, unit="m", minimum=0.1, maximum=5, doc="cell of the working grid; by default from the point density"
    )
    least_height: float = parameter(
        2.5, unit="m", minimum=0.5, doc="least mean height of a roof above ground", swept=(2.0, 2.5, 3.0)
    )
    least_side: float = parameter(2.0, unit="m", minimum=0.5, doc="shortest side of a building", swept=(2.0, 3.0))
    largest_side: float = parameter(120.0, unit="m", minimum=5, doc="longest side of a building")
    slender: float = parameter(
        2.5,
        minimum=1,
        doc="ratio of the sides above which a rectangle along a larger one is a part of it",
        swept=(2.0, 2.5, 3.0, 4.0, 1000.0),
    )
    part_share: float = parameter(
        0.1,
        minimum=0,
        maximum=1,
        doc="share of the area of a larger rectangle below which one along it is a part of it",
        swept=(0, 0.05, 0.1, 0.2),
    )
    price: float = parameter(
        20.0, minimum=0, doc="energy of a rectangle (gamma): what its evidence must exceed", swept=(10, 20, 40)
    )
    overlap: float = parameter(20.0, unit="1/m2", minimum=0, doc="energy of common area (omega)", swept=(5, 20, 80))
    fit_weight: float = parameter(
        0.2,
        minimum=0,
        maximum=1,
        doc="independent height measurements per m2: neighbouring heights deviate from a roof together",
        swept=(0.1, 0.2, 0.4, 1.0),
    )
    least_tau: float = parameter(
        0.15, unit="m", minimum=0.01, doc="least standard deviation of heights around a roof", swept=(0.1, 0.15, 0.3)
    )
    ground_error: float = parameter(
        0.005,
        minimum=0,
        maximum=0.1,
        doc="metres by which the ground under a building is unknown, per metre of its longest side",
        swept=(0, 0.005, 0.01),
    )
    outline: str = parameter(
        "buildings",
        choices=("buildings", "rectangles", "blocks"),
        doc="one outline a house or wing, a rectangle where one describes it; rectangles alone; or one polygon a block",
    )
    roofs: str = parameter("all", choices=("all", "flat"), doc="plane, gable and hip roofs besides flat ones, or not")
    roof_step: float = parameter(
        0.5,
        unit="m",
        minimum=0.1,
        doc="step between neighbouring cells that parts two roofs",
        swept=(0.3, 0.5, 1.0),
    )
    carried_share: float = parameter(
        0.65,
        minimum=0.5,
        maximum=1.1,
        doc="share of a roof's rim that lower roof must carry to make it a superstructure; above 1: none is one",
        swept=(0.5, 0.65, 0.8, 1.1),
    )
    furniture: float = parameter(
        40.0,
        unit="m2",
        minimum=0,
        doc="largest rough place that counts as furniture of the roof around it",
        swept=(0, 20, 40, 80),
    )
    roof_price: float = parameter(3.0, minimum=0, doc="energy per number that a roof has more than a flat one")
    texture_weight: float = parameter(
        1.0, minimum=0, doc="weight of roughness and multiple returns as evidence", swept=(0, 0.5, 1.0)
    )
    texture_limit: float = parameter(3.0, minimum=0, doc="bound of that evidence, nats per m2", swept=(2, 3, 4))
    least_evidence: float = parameter(
        0.5,
        minimum=0,
        maximum=1,
        doc="least mean evidence of a building's high cells, share of texture_limit; 0: not asked",
        swept=(0.0, 0.4, 0.5, 0.6),
    )
    low_price: float = parameter(5.0, minimum=0, doc="nats per m2 of low ground under a roof", swept=(2, 3, 5, 8))
    void_price: float = parameter(0.1, minimum=0, doc="nats per m2 without points under a roof", swept=(0.05, 0.1, 0.3))
    data_births: float = parameter(
        0.9, minimum=0, maximum=0.99, doc="share of births proposed by the data; 0: uniform", swept=(0, 0.5, 0.9)
    )
    start: str = parameter("greedy", choices=("greedy", "empty"), doc="first state of the chain")
    effort: float = parameter(0.25, minimum=0, doc="factor of the number of proposals", swept=(0, 0.25, 1, 4))
    sweeps: int = parameter(6, minimum=0, doc="sweeps of a polish, at most; 0: the chain starts empty and is all")
    hot: float = parameter(3.0, minimum=1e-3, doc="first temperature", swept=(1, 3, 10, 30))
    cold: float = parameter(0.1, minimum=1e-4, doc="last temperature")
    intensity: float = parameter(
        200.0, unit="1/km2", minimum=1e-3, doc="buildings expected before the data are seen (lambda)"
    )
    jump_share: float = parameter(0.3, minimum=0, maximum=0.9, doc="share of births and deaths among the moves")
    split_share: float = parameter(0.1, minimum=0, maximum=0.5, doc="share of splits and merges among the moves")
    tile: float = parameter(256.0, unit="m", minimum=16, doc="side of a tile, at least twice the longest side")
    false_alarm_ratio: float = parameter(
        0.5, minimum=1e-6, maximum=1, doc="p_f of the printed algorithm (equation 7); the paper gives no value"
    )
    iterations: int = parameter(30000, minimum=1, doc="T_m of the printed algorithm; the paper gives no value")
    threads: int = execution_option(1, minimum=1, doc="number of threads")

    def __post_init__(self) -> None:
        super().__post_init__()
        for low, high in (("least_side", "largest_side"), ("cold", "hot")):
            less, more = getattr(self, low), getattr(self, high)
            if less > more:
                raise ParameterError(
                    f"mpp: {low} of {less:g} is more than {high} of {more:g}: lower {low} or raise {high}"
                )

    def detect(self, scene: Scene, rng: np.random.Generator) -> Footprints:
        """Return buildings with the attributes height, tau, slope (m, m, m/m), roof and energy, and the run record.

        Blocks (`outline`) have no attributes.
        """
        return self._run(scene, rng)[0]

    def steps(self, scene: Scene, rng: np.random.Generator) -> Iterator[Step]:
        """Yield heights, evidence, boxes, convergence and result of the same run."""
        found, prepared = self._run(scene, rng)
        if prepared is None:
            return
        yield from mpp_steps(prepared, found.polygons, found.metadata["trace"])

    def _evident(self, prepared: Prepared, rectangles: _Rectangles) -> NDArray[np.bool_]:
        """Return which rectangles look like a roof on the whole, not only in sum.

        Textures of neighbours resemble each other, so that the best of many windows in a crown sums up to a roof.
        """
        least = self.least_evidence * self.texture_limit * min(self.texture_weight, 1.0)
        if least == 0:
            return np.ones(len(rectangles), dtype=np.bool_)
        return least <= mean_evidence(
            rectangles,
            prepared.height,
            prepared.state,
            prepared.score,
            prepared.background,
            fit_weight=self.fit_weight,
        )

    def _run(self, scene: Scene, rng: np.random.Generator) -> tuple[Footprints, Prepared | None]:
        seed = int(rng.integers(2**63))
        seen = scene.for_detection()
        seen.require(self.requires)
        began = time.perf_counter()
        points = seen.points
        assert points is not None
        if not _are_many(points.z):
            return Footprints.empty(crs=scene.crs, source=self.name), None
        with some_workers(self.threads) as workers:
            prepared = prepare(self, points, seen, workers)
            ready = time.perf_counter()
            if self.mode == "paper":
                rectangles, trace = sample_printed(self, prepared, points, seed)
            else:
                rectangles, results = sample_city(self, prepared, seed, workers)
                trace = join_traces(results)
                rectangles = rectangles[self._evident(prepared, rectangles)]
        done = time.perf_counter()
        energies = own_energies(prepared.tables.small, prepared.tables.large, rectangles, prepared.model)
        fits = fit_roofs(prepared, rectangles)
        record: dict[str, Any] = {
            "mode": self.mode,
            "seed": seed,
            "cell": prepared.grid.gsd,
            "background": {key: value for key, value in asdict(prepared.background).items() if key != "evidence"},
            "boxes": len(prepared.boxes),
            "energy": total_energy(prepared, rectangles, energies),
            "trace": trace,
            "seconds": {"preparation": ready - began, "sampling": done - ready},
        }
        # Outlines are made of cells alone, and take what the tables held.
        prepared = replace(prepared, tables=NO_TABLES)
        give_back()
        if self.outline == "blocks":
            found = as_blocks(prepared, rectangles, crs=scene.crs, record=record, source=self.name)
        else:
            found = as_buildings(
                prepared,
                rectangles,
                fits,
                energies,
                # The printed algorithm ends with its rectangles.
                follow_cells=self.outline == "buildings" and self.mode == "reversible",
                crs=scene.crs,
                record=record,
                source=self.name,
            )
        return found, prepared
