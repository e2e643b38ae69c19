"""The detector ``mpp-printed``: the algorithm of Yu, Li, Guan & Wang (2013) as it is printed.

"A marked point process for automated building detection from lidar point-clouds", Remote Sensing Letters 4(11),
1127-1136. The print gives no value of any parameter but k0 = 1; the values here are readings (docs/results/mpp.md).
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.errors import ParameterError
from ...core.parameters import parameter
from ...scenes.geodata.footprints import Footprints, stacked
from ...scenes.geodata.points import PointCloud
from ...scenes.geodata.raster import Grid
from ...scenes.scene import Scene
from ..base import Detector
from ..steps import MapPanel, OutlineLayer, Role, Step
from ..tiling import tiles_over
from .cells import FEWEST_POINTS, cell_size, has_points
from .mpp_steps import convergence_step
from .parameters import check_sides
from .printed_chain import Operation, PrintedSchedule, PrintedTrace, run_printed
from .printed_model import ANGLE, NU, TAU, PrintedModel, sorted_points
from .random_stream import stream
from .rectangles import to_world

__all__ = ["MPPPrinted", "class_gaussians"]

_Floats = NDArray[np.float64]

_EQ5 = "Yu et al. 2013, equation 5; no value printed"
_EPSILON = "Yu et al. 2013, section 2.4 (2), epsilon; no value printed"
_EQ1 = "Yu et al. 2013, equation 1; no value printed"

#: Metres above ground below which a point counts as ground, and above which as a tree or a roof, in the estimates.
_GROUND_BELOW, _OBJECT_ABOVE = 1.0, 2.0
#: Metres: least standard deviation that is estimated.
_LEAST_SPREAD = 0.1
#: Buildings that a state may hold.
_CAPACITY = 5000
#: Rows of the recorded convergence.
_ROWS = 100
#: Metres: side of the squares of a city, what their chains see around them (half the diagonal of the largest building),
#: and the smallest side.
_SQUARE, _MARGIN, _LEAST_SQUARE = 256.0, 86.0, 32.0


@dataclass(frozen=True, kw_only=True)
class MPPPrinted(Detector):
    """Rectangles by the simulation printed in 2013: one Gaussian per class, acceptance by a constant ratio."""

    name: ClassVar[str] = "mpp-printed"
    paper = "Yu, Li, Guan & Wang 2013, Remote Sensing Letters 4(11), doi:10.1080/2150704X.2013.846487"
    requires: ClassVar[tuple[str, ...]] = ("points",)
    stochastic: ClassVar[bool] = True
    place_streams: ClassVar[bool] = True
    halo: ClassVar[float] = _SQUARE + _MARGIN

    heights: str = parameter(
        "elevation",
        choices=("elevation", "above-ground"),
        doc="what the Gaussians describe: elevations as printed, or heights above ground",
        source="Yu et al. 2013, section 2.1",
    )
    cell: float | None = parameter(
        None,
        unit="m",
        minimum=0.1,
        maximum=5,
        doc="cell by which points are counted; by default from the point density",
        source="roofbench",
    )
    ground_mean: float | None = parameter(
        None, unit="m", doc="mu of the ground; none: estimated from points below 1 m above ground", source=_EQ1
    )
    ground_spread: float | None = parameter(
        None, unit="m", minimum=0.01, doc="sigma of the ground; none: estimated like its mean", source=_EQ1
    )
    tree_mean: float | None = parameter(
        None, unit="m", doc="mu of trees; none: estimated from high points of multiple returns", source=_EQ1
    )
    tree_spread: float | None = parameter(
        None, unit="m", minimum=0.01, doc="sigma of trees; none: estimated like their mean", source=_EQ1
    )
    length_mean: float = parameter(15.0, unit="m", minimum=0, doc="mean of the prior of the length", source=_EQ5)
    length_spread: float = parameter(
        6.0, unit="m", minimum=0.01, doc="standard deviation of the prior of the length", source=_EQ5
    )
    width_mean: float = parameter(10.0, unit="m", minimum=0, doc="mean of the prior of the width", source=_EQ5)
    width_spread: float = parameter(
        4.0, unit="m", minimum=0.01, doc="standard deviation of the prior of the width", source=_EQ5
    )
    nu_mean: float | None = parameter(
        None, unit="m", doc="mean of the prior of nu; none: estimated from high points of single returns", source=_EQ5
    )
    nu_spread: float | None = parameter(
        None,
        unit="m",
        minimum=0.01,
        doc="standard deviation of the prior of nu; none: estimated like its mean",
        source=_EQ5,
    )
    tau_mean: float = parameter(0.5, unit="m", minimum=0, doc="mean of the prior of tau", source=_EQ5)
    tau_spread: float = parameter(
        0.25, unit="m", minimum=0.01, doc="standard deviation of the prior of tau", source=_EQ5
    )
    buildings: float = parameter(
        1.0,
        minimum=1e-3,
        doc="lambda, mean of the Poisson distribution of the number of buildings",
        source="Yu et al. 2013, section 2.3; no value printed",
    )
    birth_share: float | None = parameter(
        None,
        minimum=0.01,
        maximum=0.99,
        doc="b_k, share of births among births and deaths; none: 1/(1 + lambda), which makes equation 12 equation 13",
        source="Yu et al. 2013, section 2.4 (4)",
    )
    match: float = parameter(
        2.0,
        minimum=0.1,
        doc="points within this many tau of nu match the prior model of equation 6",
        source="Yu et al. 2013, equation 6; not defined in print",
    )
    update: str = parameter(
        "printed",
        choices=("printed", "union"),
        doc="likelihoods of equation 6: of both windows by themselves, or over their union as in equations 8 to 11",
        source="Yu et al. 2013, equation 6",
    )
    least_height: float | None = parameter(
        None,
        unit="m",
        doc="least nu above the mean of the ground; none: no limit, as printed",
        source="roofbench, a reading of the prior of nu",
    )
    prior_limit: float | None = parameter(
        None,
        minimum=0.1,
        doc="marks further than this many standard deviations from their prior's mean are rejected; none: as printed",
        source="roofbench, a reading of the Gaussian priors of equation 5",
    )
    overlap_share: float = parameter(
        1.0,
        minimum=0,
        maximum=1,
        doc="share of its area that a building may have in common with another; 1: overlap is free, as printed",
        source="roofbench, a reading of the partition of D in section 2.1",
    )
    length_step: float = parameter(
        1.0, unit="m", minimum=1e-3, doc="standard deviation of proposals of the length", source=_EPSILON
    )
    width_step: float = parameter(
        1.0, unit="m", minimum=1e-3, doc="standard deviation of proposals of the width", source=_EPSILON
    )
    angle_step: float = parameter(
        6.0, unit="deg", minimum=1e-3, doc="standard deviation of proposals of the angle", source=_EPSILON
    )
    nu_step: float = parameter(
        0.5, unit="m", minimum=1e-3, doc="standard deviation of proposals of nu", source=_EPSILON
    )
    tau_step: float = parameter(
        0.1, unit="m", minimum=1e-3, doc="standard deviation of proposals of tau", source=_EPSILON
    )
    least_side: float = parameter(2.0, unit="m", minimum=0.5, doc="shortest side of a building", source="roofbench")
    largest_side: float = parameter(120.0, unit="m", minimum=5, doc="longest side of a building", source="roofbench")
    false_alarm_ratio: float = parameter(
        0.5, minimum=1e-6, maximum=1, doc="p_f", source="Yu et al. 2013, equation 7; no value printed"
    )
    iterations: int = parameter(30000, minimum=1, doc="T_m", source="Yu et al. 2013, section 2.4 (1); no value printed")
    square: float = parameter(
        0.0,
        unit="m",
        minimum=0,
        maximum=_SQUARE,
        doc="side of the squares of a fixed grid with a chain each; 0: one chain over all, as printed; cities take 256",
        source="roofbench",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_sides(self.name, self.least_side, self.largest_side)
        if 0 < self.square < _LEAST_SQUARE:
            raise ParameterError(f"{self.name}: square={self.square:g} must be 0 or at least {_LEAST_SQUARE:g} m")

    def detect(self, scene: Scene, rng: np.random.Generator) -> Footprints:
        """Return rectangles with the attributes nu and tau (metres), and the record of the run."""
        seed = int(rng.integers(2**63))
        seen = scene.for_detection()
        seen.require(self.requires)
        return self._chain(seen, [seed]) if self.square == 0 else self._squares(seen, seed)

    def _squares(self, seen: Scene, seed: int) -> Footprints:
        """Return the buildings of every square that meets the core, found by a chain in it and a margin around it."""
        parts, seconds = [], {"preparation": 0.0, "sampling": 0.0}
        for square in tiles_over(seen.core, self.square):
            part = seen.window(square.core, _MARGIN)
            found = self._chain(part, [seed, square.column % 2**32, square.row % 2**32])
            if len(found):
                parts.append(found.take(square.owns(found.centres, seen.extent)))
                for name in seconds:
                    seconds[name] += found.metadata["seconds"][name]
        if not parts:
            return Footprints.empty(crs=seen.crs, source=self.name)
        record = {"seed": seed, "squares": len(parts), "seconds": seconds}
        return replace(stacked(parts), ids=np.arange(sum(map(len, parts))), metadata=record)

    def _chain(self, seen: Scene, entropy: Sequence[int]) -> Footprints:
        """Return the buildings of one chain over all that is seen."""
        points = seen.points
        assert points is not None
        if not has_points(points.z):
            return Footprints.empty(crs=seen.crs, source=self.name)
        began = time.perf_counter()
        grid = Grid.covering(seen.extent, self.cell or cell_size(points.x, points.y, seen.extent))
        index, inside = grid.cells(points.x, points.y)
        above = seen.heights.above(points)
        inside &= np.isfinite(above)
        if np.count_nonzero(inside) < FEWEST_POINTS:
            return Footprints.empty(crs=seen.crs, source=self.name)
        points, index = points.take(inside), index[inside]
        known = above[inside].astype(np.float64)
        z = points.z if self.heights == "elevation" else known
        base = float(np.median(z))
        gaussians = {
            name: tuple(
                estimate if set_value is None else set_value
                for estimate, set_value in zip(
                    pair, (getattr(self, f"{name}_mean"), getattr(self, f"{name}_spread")), strict=True
                )
            )
            for name, pair in class_gaussians(points, z, known).items()
        }
        ready = time.perf_counter()
        best, trace = run_printed(
            sorted_points(index, z - base, grid.shape),
            self._model(gaussians, base, grid.gsd),
            self._schedule(grid.gsd, gaussians["ground"][0] - base),
            stream(entropy),
        )
        record: dict[str, Any] = {
            "seed": entropy[0],
            "cell": grid.gsd,
            "gaussians": {name: list(pair) for name, pair in gaussians.items()},
            "energy": float(trace[:, PrintedTrace.ENERGY].min()),
            "trace": _trace_record(trace),
            "seconds": {"preparation": ready - began, "sampling": time.perf_counter() - ready},
        }
        return Footprints.of(
            shapely.polygons(to_world(best[:, : ANGLE + 1], grid)),
            crs=seen.crs,
            attributes={"nu": best[:, NU] + base, "tau": best[:, TAU]},
            metadata=record,
            source=self.name,
        )

    def measured(self, scene: Scene) -> Mapping[str, float]:
        """Return what the tiles of a city share: the cell size and the squares, unless they are given."""
        points = scene.points
        if points is None or not len(points):
            return {}
        found = {} if self.square else {"square": _SQUARE}
        if self.cell is None:
            found["cell"] = cell_size(points.x, points.y, scene.extent)
        return found

    def steps(self, scene: Scene, rng: np.random.Generator) -> Iterator[Step]:
        """Yield the convergence, where there is one chain, and the rectangles of the same run."""
        found = self.detect(scene, rng)
        if "trace" in found.metadata:
            yield convergence_step(found.metadata["trace"])
        if found.metadata:
            layer = OutlineLayer(found.polygons, "building", Role.RESULT)
            panel = MapPanel(extent=scene.extent, layers=(layer,))
            yield Step("buildings", "Buildings of the state with the highest posterior.", (panel,))

    def _model(self, gaussians: dict[str, tuple[float, ...]], base: float, cell: float) -> PrintedModel:
        """Return the constants of the model, elevations from `base`, sides in cells."""
        classes = np.array([gaussians["ground"], gaussians["tree"]]) - [base, 0.0]
        nu = (gaussians["nu"][0] - base, gaussians["nu"][1])
        sides = np.array([[self.length_mean, self.length_spread], [self.width_mean, self.width_spread]]) / cell
        prior = np.array([*sides, nu, (self.tau_mean, self.tau_spread)])
        share = self._birth_share
        return PrintedModel(
            classes, prior, self.match, math.log(self.buildings * share / (1.0 - share)), self.update == "union"
        )

    @property
    def _birth_share(self) -> float:
        return 1.0 / (1.0 + self.buildings) if self.birth_share is None else self.birth_share

    def _schedule(self, cell: float, ground: float) -> PrintedSchedule:
        return PrintedSchedule(
            np.array(
                [
                    self.length_step / cell,
                    self.width_step / cell,
                    math.radians(self.angle_step),
                    self.nu_step,
                    self.tau_step,
                ]
            ),
            np.array([self.least_side, self.largest_side]) / cell,
            self.iterations,
            self.false_alarm_ratio,
            self._birth_share,
            -math.inf if self.least_height is None else ground + self.least_height,
            math.inf if self.prior_limit is None else self.prior_limit,
            self.overlap_share,
            self.buildings,
            _CAPACITY,
            max(self.iterations // _ROWS, 1),
        )


def class_gaussians(points: PointCloud, z: _Floats, above: _Floats) -> dict[str, tuple[float, float]]:
    """Estimate mean and standard deviation of the elevations of ground, trees and roofs ("nu").

    Ground are the points less than 1 m above the bare earth. Of the points more than 2 m above it those of pulses with
    several returns are trees, the others roofs; where pulses are not numbered or all are alike, both are all of them.

    Parameters
    ----------
    points : PointCloud
    z, above : ndarray, shape (n,)
        What the Gaussians describe, and heights above ground, metres.
    """
    high = above > _OBJECT_ABOVE
    several = np.zeros(len(z), dtype=np.bool_) if points.number_of_returns is None else points.number_of_returns > 1
    chosen = {"ground": above < _GROUND_BELOW, "tree": high & several, "nu": high & ~several}
    if not high.any():
        high = np.ones(len(z), dtype=np.bool_)
    return {name: _normal(z[mask] if mask.any() else z[high]) for name, mask in chosen.items()}


def _normal(values: _Floats) -> tuple[float, float]:
    """Return mean and standard deviation, the latter at least 10 cm."""
    return float(values.mean()), max(float(values.std()), _LEAST_SPREAD)


def _trace_record(trace: _Floats) -> dict[str, Any]:
    """Return a trace as JSON holds it."""
    columns = trace.T.tolist()
    return {
        "proposals": columns[PrintedTrace.ITERATIONS],
        "energy": columns[PrintedTrace.ENERGY],
        "buildings": columns[PrintedTrace.BUILDINGS],
        "tried": {one.name.lower(): columns[PrintedTrace.TRIED + one] for one in Operation},
        "accepted": {one.name.lower(): columns[PrintedTrace.ACCEPTED + one] for one in Operation},
    }
