"""The detector ``mpp``: a marked point process of rectangles on a point cloud.

Yu, Li, Guan & Wang (2013), "A marked point process for automated building detection from lidar point-clouds", Remote
Sensing Letters 4(11), 1127-1136. ``mode="paper"`` is the printed algorithm; ``mode="reversible"`` a valid sampler of a
repaired model with roofs, texture and party walls (docs/mpp.md says what was changed and why).
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any, ClassVar

import numpy as np
import shapely
from numpy.typing import NDArray

from ...scenes.errors import ParameterError
from ...scenes.footprints import Footprints
from ...scenes.ground import fill_unknown, ground_surface
from ...scenes.parameters import parameter
from ...scenes.points import PointCloud
from ...scenes.raster import Elevation, Grid
from ...scenes.scene import Scene
from ..base import Detector, Step
from .annealing import Annealed, Schedule, anneal
from .background import Background, estimate_background, score_cells, textures
from .candidates import propose_boxes
from .cells import HIGH, Cells, cell_size, make_cells
from .energy import Model, ground_variance, own_energy
from .figures import draw_convergence, draw_evidence, draw_heights, draw_rectangles
from .moves import MOVES
from .polish import polish
from .printed import run_printed
from .random_stream import stream
from .rectangles import to_world
from .roofs import KINDS, fit_roof
from .superstructures import lower_superstructures
from .tables import LONGEST, Tables, make_tables
from .tiles import Tile, tiles_of, work_off
from .walls import close_walls

__all__ = ["MPP", "Prepared"]

_Rectangles = NDArray[np.float64]

#: Fewer points than this are no scene.
_FEW = 20


@dataclass(frozen=True, eq=False)
class Prepared:
    """What the sampler reads, and what the figures show of it.

    Attributes
    ----------
    cells : Cells
    background : Background
    score : ndarray of float32, shape (rows, columns)
    tables : Tables
    model : Model
    boxes : ndarray, shape (n, 5)
        Best first.
    weights : ndarray, shape (n,)
    """

    cells: Cells
    background: Background
    score: NDArray[np.float32]
    tables: Tables
    model: Model
    boxes: _Rectangles
    weights: NDArray[np.float64]


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
        "rectangles", choices=("rectangles", "blocks"), doc="one footprint a rectangle, or one a block of touching ones"
    )
    roofs: str = parameter("all", choices=("all", "flat"), doc="plane, gable and hip roofs besides flat ones, or not")
    roof_step: float = parameter(1.0, unit="m", minimum=0.1, doc="step between neighbouring cells that parts two roofs")
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
    low_price: float = parameter(3.0, minimum=0, doc="nats per m2 of low ground under a roof", swept=(2, 3, 4))
    void_price: float = parameter(0.1, minimum=0, doc="nats per m2 without points under a roof", swept=(0.05, 0.1, 0.3))
    data_births: float = parameter(
        0.9, minimum=0, maximum=0.99, doc="share of births proposed by the data; 0: uniform", swept=(0, 0.5, 0.9)
    )
    start: str = parameter("greedy", choices=("greedy", "empty"), doc="first state of the chain")
    effort: float = parameter(0.25, minimum=0, doc="factor of the number of proposals", swept=(0, 0.25, 1, 4))
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
    workers: int = parameter(1, minimum=1, doc="threads; they change the time, never the result")

    def detect(self, scene: Scene, rng: np.random.Generator) -> Footprints:
        """Return rectangles with the attributes height, tau, slope (m, m, m/m), roof and energy, and the run record."""
        return self._run(scene, rng)[0]

    def steps(self, scene: Scene, rng: np.random.Generator) -> Iterator[Step]:
        """Yield heights, evidence, boxes, convergence and result of the same run."""
        found, prepared, rectangles = self._run(scene, rng)
        if prepared is None:
            return
        cells, boxes = prepared.cells, prepared.boxes
        yield Step("01-heights", "Heights above ground of high cells.", partial(draw_heights, cells))
        yield Step(
            "02-evidence",
            "What each cell adds to a rectangle: blue speaks for a roof, red against it.",
            partial(draw_evidence, cells, prepared.score),
        )
        yield Step(
            "03-boxes",
            f"{len(boxes)} boxes that the data suggest as births.",
            partial(draw_rectangles, cells, boxes, colour="darkorange"),
        )
        trace = found.metadata["trace"]
        yield Step(
            "04-convergence",
            "Energy, temperature, number of buildings and acceptance of each move over the chain.",
            partial(draw_convergence, trace),
        )
        yield Step(
            "05-buildings", f"{len(rectangles)} buildings after polishing.", partial(draw_rectangles, cells, rectangles)
        )

    def _run(self, scene: Scene, rng: np.random.Generator) -> tuple[Footprints, Prepared | None, _Rectangles]:
        seed = int(rng.integers(2**63))
        seen = scene.for_detection()
        seen.require(self.requires)
        began = time.perf_counter()
        points = seen.points
        assert points is not None
        if np.count_nonzero(np.isfinite(points.z)) < _FEW:
            return Footprints.empty(crs=scene.crs, source=self.name), None, np.empty((0, 5))
        with ThreadPoolExecutor(self.workers) as pool:
            prepared = self._prepare(points, seen, pool)
            ready = time.perf_counter()
            results: list[Annealed] = []
            if self.mode == "paper":
                rectangles, trace = self._printed(prepared, points, seed)
            else:
                rectangles, results = self._sample(prepared, seed, pool)
                trace = _joined_trace(results)
        record: dict[str, Any] = {
            "mode": self.mode,
            "seed": seed,
            "cell": prepared.cells.grid.gsd,
            "background": {key: value for key, value in asdict(prepared.background).items() if key != "evidence"},
            "boxes": len(prepared.boxes),
            "energy": {
                "start": sum(result.start for result in results),
                "chain": sum(result.chain for result in results),
                "final": sum(result.final for result in results),
            },
            "trace": trace,
            "seconds": {"preparation": ready - began, "sampling": time.perf_counter() - ready},
        }
        return self._footprints(prepared, rectangles, scene.crs, record), prepared, rectangles

    def _prepare(self, points: PointCloud, scene: Scene, pool: ThreadPoolExecutor) -> Prepared:
        """Turn the cloud into cells, classes, tables and boxes."""
        if scene.dem is not None:
            ground = Elevation(fill_unknown(scene.dem.values), scene.dem.grid)
        else:
            ground = ground_surface(points, scene.extent)
        cell = self.cell or cell_size(points.x, points.y, scene.extent)
        if math.sqrt(2) * self.largest_side > LONGEST * cell:
            raise ParameterError(
                f"mpp: largest_side of {self.largest_side:g} m is too long for cells of {cell:g} m; a rectangle must "
                f"not reach over more than {LONGEST} cells: lower it to {math.floor(LONGEST * cell / math.sqrt(2))}, "
                f"or raise cell"
            )
        grid = Grid.covering(scene.extent, cell)
        low = 0.8 * self.least_height
        cells = make_cells(points, ground, grid, low=low, workers=pool, bands=self.workers)
        background, bins = estimate_background(cells)
        score, fitted = self._score(cells, bins, background)
        if self.carried_share <= 1:
            height, state = lower_superstructures(
                cells.height,
                cells.state,
                fitted,
                step=self.roof_step,
                share=self.carried_share,
                most=int(self.furniture / cell**2),
            )
            cells = replace(cells, height=height, state=state)
            score, fitted = self._score(cells, textures(cells.height, cells.state, cells.openness), background)
        tables = make_tables(cells.height, fitted, score)
        model = Model(
            weight=cell * cell,
            price=self.price,
            overlap=self.overlap * cell * cell,
            roof_price=self.roof_price if self.roofs == "all" else math.inf,
            least_tau=self.least_tau,
            least_height=self.least_height,
            cell=cell,
            void_price=self.void_price,
            least_side=self.least_side / cell,
            largest_side=self.largest_side / cell,
            fit_weight=self.fit_weight,
            ground_error=self.ground_error,
        )
        boxes, weights = np.empty((0, 5)), np.empty(0)
        if self.data_births > 0 or self.start == "greedy":
            boxes = propose_boxes(cells.height, fitted, steps=(0.4, 1.0, 1000.0), least_cells=math.ceil(6 / cell**2))
            energies = np.array([own_energy(tables.small, tables.large, box, model) for box in boxes])
            order = np.argsort(energies, kind="stable")
            boxes, weights = boxes[order], np.sqrt(np.maximum(-energies[order], 1.0))
        return Prepared(cells, background, score, tables, model, boxes, weights)

    def _score(
        self, cells: Cells, bins: NDArray[np.int16], background: Background
    ) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        return score_cells(
            cells,
            bins,
            background,
            fit_weight=self.fit_weight,
            texture_weight=self.texture_weight,
            texture_limit=self.texture_limit,
            low_price=self.low_price,
            void_price=self.void_price,
        )

    def _sample(self, prepared: Prepared, seed: int, pool: ThreadPoolExecutor) -> tuple[_Rectangles, list[Annealed]]:
        """Anneal every tile, then polish the seams."""
        grid, model, tables = prepared.cells.grid, prepared.model, prepared.tables
        cell = grid.gsd
        size = max(self.tile, 2.0 * self.largest_side)
        reach = math.sqrt(2.0) * model.largest_side
        results: dict[tuple[int, int], Annealed] = {}

        def annealed(tile: Tile, own: _Rectangles, fixed: _Rectangles) -> _Rectangles:
            inside = tile.owns(prepared.boxes)
            x0, y0, x1, y1 = tile.window
            area = (x1 - x0) * (y1 - y0) * cell * cell
            proposals = max(int(self.effort * (0.2 * area + 60 * np.count_nonzero(inside))), 1)
            result = anneal(
                tables,
                model,
                tile.window,
                prepared.boxes[inside],
                prepared.weights[inside],
                own,
                fixed,
                stream([seed, tile.column % 2**32, tile.row % 2**32]),
                Schedule(
                    proposals=proposals,
                    hot=self.hot,
                    cold=self.cold,
                    intensity=self.intensity * 1e-6 * cell * cell,
                    jump_share=self.jump_share,
                    split_share=self.split_share,
                    data_share=self.data_births,
                    merge_reach=20.0 / cell,
                    greedy=self.start == "greedy",
                ),
            )
            results[tile.column, tile.row] = result
            return result.rectangles

        def mended(tile: Tile, own: _Rectangles, fixed: _Rectangles) -> _Rectangles:
            boxes = prepared.boxes[tile.owns(prepared.boxes)]
            window = np.array(tile.window)
            best, _ = polish(tables.small, tables.large, model, window, own, fixed, boxes, len(own) + 64, 4)
            return best  # type: ignore[no-any-return]

        tiles = tiles_of(grid, size)
        rectangles = work_off(tiles, np.empty((0, 5)), annealed, reach=reach, workers=pool)
        if len(tiles) > 1:
            rectangles = work_off(tiles_of(grid, size, shifted=True), rectangles, mended, reach=reach, workers=pool)
        rectangles = np.ascontiguousarray(rectangles[np.lexsort(rectangles.T)])
        close_walls(tables.small, tables.large, model, rectangles, 0.25 * self.price)
        return rectangles, [results[key] for key in sorted(results)]

    def _printed(self, prepared: Prepared, points: PointCloud, seed: int) -> tuple[_Rectangles, dict[str, Any]]:
        """Run the printed algorithm on elevations; the Gaussians of ground and trees come from low and rough cells."""
        cells = prepared.cells
        grid, cell = cells.grid, cells.grid.gsd
        index, inside = grid.cells(points.x, points.y)
        inside &= np.isfinite(points.z)
        index, z = index[inside], points.z[inside]
        base = float(np.median(z)) if len(z) else 0.0
        z = z - base
        sums = [np.bincount(index, weights=z**k, minlength=grid.rows * grid.columns) for k in range(3)]
        table = np.stack(sums, axis=-1).reshape(*grid.shape, 3)
        high = (cells.state == HIGH).ravel()[index]
        rough = (prepared.score < 0).ravel()[index] & high
        roof = high & ~rough
        classes = np.array([_normal(z[~high]), _normal(z[rough] if rough.any() else z)])
        height = _normal(z[roof] if roof.any() else z)
        prior = np.array([(15 / cell, 6 / cell), (10 / cell, 4 / cell), height, (0.5, 0.25)])
        steps = np.array([1.0 / cell, 1.0 / cell, 0.1, 0.5, 0.1])
        sides = np.array([self.least_side / cell, self.largest_side / cell])
        found, trace = run_printed(
            table,
            classes,
            prior,
            steps,
            sides,
            stream([seed]),
            self.iterations,
            self.false_alarm_ratio,
            5000,
            max(self.iterations // 100, 1),
        )
        rectangles = np.ascontiguousarray(found[:, :5])
        columns = ("proposals", "temperature", "energy", "buildings")
        return rectangles, {name: trace[:, k].tolist() for k, name in enumerate(columns)}

    def _footprints(
        self, prepared: Prepared, rectangles: _Rectangles, crs: str | None, record: dict[str, Any]
    ) -> Footprints:
        tables, model = prepared.tables, prepared.model
        fits = np.zeros((len(rectangles), 5))
        energies = np.zeros(len(rectangles))
        for i, rectangle in enumerate(rectangles):
            price = model.roof_price / (model.weight * model.fit_weight) if model.fit_weight > 0 else math.inf
            fit_roof(
                tables.small,
                tables.large,
                rectangle,
                price,
                model.least_tau,
                ground_variance(rectangle, model),
                model.least_height,
                model.cell,
                fits[i],
            )
            energies[i] = own_energy(tables.small, tables.large, rectangle, model)
        if self.outline == "blocks":
            return _blocks(to_world(rectangles, prepared.cells.grid), 0.5 * prepared.cells.grid.gsd, crs, record)
        return Footprints.from_rectangles(
            to_world(rectangles, prepared.cells.grid),
            crs=crs,
            attributes={
                "height": fits[:, 1],
                "tau": fits[:, 2],
                "slope": fits[:, 4],
                "roof": np.array([KINDS[int(kind)] for kind in fits[:, 3]], dtype=str),
                "energy": energies,
            },
            metadata=record,
            source=self.name,
        )


def _blocks(corners: NDArray[np.float64], gap: float, crs: str | None, record: dict[str, Any]) -> Footprints:
    """Return the union of rectangles that touch, or stand less than `gap` metres apart."""
    rectangles = Footprints.from_rectangles(corners)
    wide = shapely.buffer(rectangles.polygons, gap / 2, join_style="mitre")
    union = shapely.buffer(shapely.union_all(wide), -gap / 2, join_style="mitre")
    return Footprints.of(shapely.get_parts(union), crs=crs, metadata=record, source=MPP.name)


def _normal(values: NDArray[np.float64]) -> tuple[float, float]:
    """Return mean and standard deviation, the latter at least 10 cm."""
    return float(values.mean()), max(float(values.std()), 0.1)


def _joined_trace(results: list[Annealed]) -> dict[str, Any]:
    """Add up the traces of all tiles row by row: each ran the same schedule on its own number of proposals."""
    rows = min((len(result.trace) for result in results), default=0)
    if rows == 0:
        return {}
    total = np.sum([result.trace[:rows] for result in results], axis=0)
    return {
        "proposals": total[:, 0].tolist(),
        "temperature": results[0].trace[:rows, 1].tolist(),
        "energy": total[:, 2].tolist(),
        "buildings": total[:, 3].tolist(),
        "tried": {move: total[:, 4 + k].tolist() for k, move in enumerate(MOVES)},
        "accepted": {move: total[:, 12 + k].tolist() for k, move in enumerate(MOVES)},
    }
