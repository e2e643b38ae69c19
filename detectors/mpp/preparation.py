"""From the cloud to what the search reads: cells, classes, tables and boxes.

The tables and their inputs set the peak memory, 40 bytes per cell; arrays are released as soon as they are no longer
needed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...core.errors import ParameterError
from ...scenes.geodata.points import PointCloud
from ...scenes.geodata.raster import Grid, Image
from ...scenes.scene import Scene
from ..shared.cue_information import IMAGE, PENETRATION, CueInformation
from ..shared.known_returns import known_returns
from .arrays import Heights, Integers, Mask, Rectangles, Scores, States
from .background import Background, estimate_background, tally_textures
from .candidates import Boxes, propose_boxes
from .cells import Cells, cell_size, make_cells
from .energy import Model, rectangle_energies
from .image_cue import add_image, image_silence, rate_image, tally_image
from .memory import release_memory
from .parameters import MPPParameters
from .patches import Division
from .return_numbers import MULTIPLE, cues_of
from .scores import Weights, fitted_cells, score_cells
from .squares import side_of
from .superstructures import lower_superstructures
from .tables import LONGEST, TALLEST, Tables, make_tables
from .textures import textures
from .threads import Threads

__all__ = ["Prepared", "prepare", "survey_textures", "weights_of"]

#: Square metres: largest rough place that counts as a structure of the roof around it, smallest box that is proposed.
_LARGEST_STRUCTURE, _SMALLEST_BOX = 40.0, 6.0
#: Sides of a square that a patch may be long before it is divided: less than the halo has.
_LONGEST_PATCH = 1.5
#: Metres: steps between neighbouring cells that the patches of boxes may hold; a low one separates houses of different
#: height, one that is never reached keeps a block together.
_BOX_STEPS = (0.4, 1.0, 1000.0)
#: Share of the least height of a roof below which a point is low: eaves and the annexes beside a roof are lower than
#: its mean, and the ground may be some decimetres too high.
_LOW_SHARE = 0.8
#: Names of the textures of a whole scene, counted with and without the number of returns.
_MULTIPLE_TALLY, _SINGLE_TALLY = "textures", "textures_of_single_returns"
#: Name of the tally of the image of a whole scene.
_IMAGE_TALLY = "image"


@dataclass(frozen=True, eq=False)
class Prepared:
    """What the search reads, and what the figures show of it.

    Attributes
    ----------
    grid : Grid
        Of the cells.
    height : ndarray of uint16, shape (rows, columns)
        Centimetres above ground of high cells, at most `tables.TALLEST`.
    state : ndarray of uint8, shape (rows, columns)
        See `cells`.
    score : ndarray of int16, shape (rows, columns)
        Thousandths of a nat.
    openness : ndarray of uint8, shape (rows, columns)
        See `cells`.
    structures : ndarray of uint8, shape (rows, columns)
        Centimetres, at most 255, by which cells were lowered to the roof below them.
    background : Background
    tables : Tables
        `tables.NO_TABLES` after use.
    model : Model
    boxes : Boxes
    cues : CueInformation
        Which cues the evidence is made of.
    core : tuple of float
        Part of the scene whose buildings are wanted (`Scene.core`), metres.
    image_of : callable
        Returns the image of the scene, read only where it is needed.
    """

    grid: Grid
    height: NDArray[np.uint16]
    state: States
    score: Scores
    openness: States
    structures: NDArray[np.uint8]
    background: Background
    tables: Tables
    model: Model
    boxes: Boxes
    cues: CueInformation
    core: tuple[float, float, float, float]
    image_of: Callable[[], Image | None]


def prepare(parameters: MPPParameters, points: PointCloud, scene: Scene, threads: Threads) -> Prepared:
    """Turn the cloud into cells, classes, tables and boxes."""
    cell = parameters.cell or cell_size(points.x, points.y, scene.extent, threads=threads)
    if math.sqrt(2) * parameters.largest_side > LONGEST * cell:
        raise ParameterError(
            f"mpp: largest_side of {parameters.largest_side:g} m is too long for cells of {cell:g} m; a rectangle must "
            f"not reach over more than {LONGEST} cells: lower it to {math.floor(LONGEST * cell / math.sqrt(2))}, "
            f"or raise cell"
        )
    background, height, state, score, openness, fitted, structures, cues = _classes(
        parameters, points, scene, cell, threads
    )
    least = math.ceil(_SMALLEST_BOX / cell**2)
    division = _division(parameters, Grid.covering(scene.extent, cell))
    boxes = propose_boxes(height, fitted, steps=_BOX_STEPS, least_cells=least, division=division, threads=threads)
    kept = _shortened(height, threads)
    del height
    release_memory(kept.size)
    tables = make_tables(kept, fitted, score, threads=threads)
    model, grid = _model(parameters, cell), Grid.covering(scene.extent, cell)
    rated = _rated(boxes, tables, model, threads)
    return Prepared(
        grid,
        kept,
        state,
        score,
        openness,
        structures,
        background,
        tables,
        model,
        rated,
        cues,
        scene.core,
        lambda: scene.image,
    )


def _division(parameters: MPPParameters, grid: Grid) -> Division:
    """Return the squares at whose borders long patches are divided."""
    side = round(side_of(parameters.largest_side) / grid.gsd)
    return Division(-round(grid.north / grid.gsd), round(grid.west / grid.gsd), side, round(_LONGEST_PATCH * side))


def _rated(rectangles: Rectangles, tables: Tables, model: Model, threads: Threads) -> Boxes:
    """Return boxes, those of the lowest energy first."""
    parts = threads.bands(
        lambda first, last: rectangle_energies(tables, rectangles[first:last], model), len(rectangles)
    )
    energies = np.concatenate([np.empty(0), *parts])
    order = np.argsort(energies, kind="stable")
    return Boxes(rectangles[order], energies[order])


def _shortened(height: Heights, threads: Threads) -> NDArray[np.uint16]:
    """Return heights in two bytes each; they are only read from here on."""
    short = np.empty(height.shape, dtype=np.uint16)

    def work(first: int, last: int) -> None:
        np.minimum(height[first:last], TALLEST, out=short[first:last], casting="unsafe")

    threads.bands(work, len(height))
    return short


def _lowered_by(before: Heights, after: Heights, threads: Threads) -> NDArray[np.uint8]:
    """Return by how many centimetres, at most 255, cells were lowered."""
    lowered = np.empty(before.shape, dtype=np.uint8)

    def work(first: int, last: int) -> None:
        fall = before[first:last] - after[first:last]
        np.clip(fall, 0, 255, out=lowered[first:last], casting="unsafe")

    threads.bands(work, len(lowered))
    return lowered


class _Classes(NamedTuple):
    """Classes of a scene, and what they make of its cells; attributes as in `Prepared`."""

    background: Background
    height: Heights
    state: States
    score: Scores
    openness: States
    fitted: Mask
    structures: NDArray[np.uint8]
    cues: CueInformation


def _classes(parameters: MPPParameters, points: PointCloud, scene: Scene, cell: float, threads: Threads) -> _Classes:
    """Return the classes of the scene, and of each cell height, state, score, openness, if it is fitted, structures."""
    low = _LOW_SHARE * parameters.least_height
    grid, ground = Grid.covering(scene.extent, cell), scene.heights.ground
    cells = make_cells(points, ground, grid, low=low, threads=threads)
    counted, bins = tally_textures(cells, threads=threads)
    tally = _of_whole(scene, _MULTIPLE_TALLY, counted)
    cues = cues_of(points, tally[:, 0])
    if MULTIPLE in cues.silent:
        cells = make_cells(replace(points, number_of_returns=None), ground, grid, low=low, threads=threads)
        counted, bins = tally_textures(cells, threads=threads)
        tally = _of_whole(scene, _SINGLE_TALLY, counted)
    background = estimate_background(tally, cell, openness=PENETRATION in cues.used)
    weights = weights_of(parameters)
    fitted = fitted_cells(cells, bins, background, weights, threads=threads)
    structures = np.zeros(cells.state.shape, dtype=np.uint8)
    if parameters.carried_share <= 1:
        height, state = lower_superstructures(
            cells.height,
            cells.state,
            fitted,
            step=parameters.roof_step,
            share=parameters.carried_share,
            most=int(_LARGEST_STRUCTURE / cell**2),
            division=_division(parameters, grid),
            threads=threads,
        )
        structures = _lowered_by(cells.height, height, threads)
        cells = replace(cells, height=height, state=state)
        bins = textures(cells.height, cells.state, cells.openness, threads=threads)
        fitted = fitted_cells(cells, bins, background, weights, threads=threads)
    score = score_cells(cells, bins, background, weights, threads=threads)
    if MULTIPLE not in cues.used and parameters.texture_weight > 0:
        score, cues = _with_image(scene, cells, score, cues, parameters.texture_weight)
    return _Classes(background, cells.height, cells.state, score, cells.openness, fitted, structures, cues)


def _with_image(
    scene: Scene, cells: Cells, score: Scores, cues: CueInformation, weight: float
) -> tuple[Scores, CueInformation]:
    """Return scores with the image as a further cue, where it has colours and separates roofs from trees."""
    ratings = rate_image(scene.image, cells.grid)
    if ratings is None:
        return score, cues
    reason = image_silence(_of_whole(scene, _IMAGE_TALLY, tally_image(ratings, cells.state, score)))
    if reason is not None:
        return score, replace(cues, silent={**cues.silent, IMAGE: reason})
    return add_image(score, cells.state, ratings, weight), replace(cues, used=(*cues.used, IMAGE))


def _of_whole(scene: Scene, name: str, counted: Integers) -> Integers:
    """Return what was counted on the whole scene of which this is a window, else what was counted here."""
    return np.array(scene.whole[name], dtype=np.int64) if name in scene.whole else counted


def survey_textures(parameters: MPPParameters, scene: Scene) -> dict[str, Any]:
    """Return the textures in the core of a scene, counted with and without the number of returns, and of the image."""
    assert scene.points is not None
    points = known_returns(scene.points, scene.extent).points
    cell = parameters.cell or cell_size(points.x, points.y, scene.extent)
    grid, ground = Grid.covering(scene.extent, cell), scene.heights.ground
    found: dict[str, Any] = {}
    for name, cloud in ((_MULTIPLE_TALLY, points), (_SINGLE_TALLY, replace(points, number_of_returns=None))):
        cells = make_cells(cloud, ground, grid, low=_LOW_SHARE * parameters.least_height)
        tally, bins = tally_textures(cells, scene.core)
        found[name] = tally.tolist()
    ratings = rate_image(scene.image, grid)
    if ratings is not None:
        score = score_cells(cells, bins, estimate_background(tally, cell), weights_of(parameters))
        part = grid.part(scene.core) or (slice(0), slice(0))
        found[_IMAGE_TALLY] = tally_image(ratings[part], cells.state[part], score[part]).tolist()
    return found


def weights_of(parameters: MPPParameters) -> Weights:
    """Return how observations count."""
    return Weights(
        fit=parameters.fit_weight,
        texture=parameters.texture_weight,
        limit=parameters.texture_limit,
        low=parameters.low_price,
        void=parameters.void_price,
    )


def _model(parameters: MPPParameters, cell: float) -> Model:
    """Return the constants of the energy in units of cells."""
    return Model(
        weight=cell * cell,
        price=parameters.price,
        overlap=parameters.overlap * cell * cell,
        roof_price=parameters.roof_price if parameters.roofs == "all" else math.inf,
        least_tau=parameters.least_tau,
        least_height=parameters.least_height,
        cell=cell,
        void_price=parameters.void_price,
        least_side=parameters.least_side / cell,
        largest_side=parameters.largest_side / cell,
        fit_weight=parameters.fit_weight,
        ground_error=parameters.ground_error,
    )
