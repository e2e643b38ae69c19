"""The plain baseline: high, large objects that do not look like trees are buildings.

1. Points are gathered on a grid as fine as their spacing allows; heights are those of the scene (`Scene.heights`).
2. A cell is *high* where at least half of its points are above the height threshold.
3. Each available cue (multiple returns, roughness, penetration, image vegetation) rates a cell from -1 (roof) to +1
   (tree). The mean is averaged over the neighbourhood; high cells with a negative mean are *roof*.
4. Small holes are filled, and an opening with a disc removes narrow parts.
5. The outline is traced to a fraction of a cell. Small or tree-like footprints are dropped; the others get straight
   walls along their main directions, or are replaced by their minimum-area rectangle.

The detector has no training and no random numbers: the same points give the same footprints.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.conditions import GIVEN, Uses
from ...core.parameters import parameter
from ...scenes.geodata.density import point_spacing
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.outlines import coverage_of_mask, minimum_rectangles, trace
from ...scenes.geodata.points import PointCloud
from ...scenes.geodata.raster import Grid
from ...scenes.ground.heights import Heights, heights_of
from ...scenes.scene import Scene
from ..base import Detector
from ..shared.cue_information import ANCHOR, IMAGE, PENETRATION, CueInformation, informative_cues, silent_on_rasters
from ..shared.cues import CellCues, cell_cues, rated
from ..shared.known_returns import known_returns
from ..shared.morphology import opened, without_holes
from ..shared.pixel_cues import DARKEST, LEAST_GREEN_RED, LEAST_NDVI, greenness
from ..shared.regularise import regularise
from ..steps import Step
from .ndsm_steps import ndsm_steps
from .ndsm_trace import NDSMTrace

__all__ = ["NDSM"]

_Floats = NDArray[np.float32]
_Mask = NDArray[np.bool_]

#: Weight of the cue from the image against 1 for each cue from the points: roofs may be green, trees in autumn are not,
#: and roofs are displaced in the image.
_IMAGE_WEIGHT = 0.5
#: Noise of heights, metres, that the threshold of roughness allows for; image matching may have more.
_LASER_NOISE = 0.12
#: The thresholds of the cues, each of which may be none.
_ANY_CUE = dict.fromkeys(("multiple_share", "roughness", "penetration", "ndvi", "green_red"), (GIVEN,))


@dataclass(frozen=True, kw_only=True)
class NDSM(Detector):
    """Height above ground with vegetation cues, opening and traced outlines: the plain baseline."""

    name = "ndsm"
    requires = ("points",)
    halo = 64.0
    used_with: ClassVar[Mapping[str, Uses]] = {
        "window": {"roughness": (GIVEN,)},
        "darkest": {"ndvi": (GIVEN,), "green_red": (GIVEN,)},
        "smoothing": _ANY_CUE,
        "most_tree_like": _ANY_CUE,
        "tolerance": {"outline": ("polygon",)},
    }

    height: float = parameter(
        2.5,
        unit="m",
        minimum=0.5,
        maximum=20,
        doc="least height above ground of a high point",
        source="Awrangjeb 2010, section 3.2",
        swept=(1.5, 2.0, 2.5, 3.0),
    )
    cell: float | None = parameter(
        None, unit="m", minimum=0.1, maximum=5, doc="cell size; none: 1.4 times the point spacing, 0.25 to 2 m"
    )
    dem: bool = parameter(True, doc="take the ground from the DEM where it is known; false: always from the points")
    multiple_share: float | None = parameter(
        0.5, minimum=0, maximum=1, doc="share of multiple returns above which a cell looks like a tree; none: unused"
    )
    roughness: float | None = parameter(
        0.25,
        unit="m",
        minimum=0.01,
        maximum=5,
        doc="deviation from a local plane above which a cell looks like a tree; none: unused",
    )
    window: float = parameter(
        1.5,
        unit="m",
        minimum=0.2,
        maximum=20,
        doc="width of the windows in which planes are fitted, at least two cells",
    )
    penetration: float | None = parameter(
        0.35,
        minimum=0,
        maximum=1,
        doc="share of points below the height above which a high cell looks like a tree; none: unused",
    )
    ndvi: float | None = parameter(
        LEAST_NDVI, minimum=-1, maximum=1, doc="(NIR - R) / (NIR + R) of vegetation, with a NIR band; none: unused"
    )
    green_red: float | None = parameter(
        LEAST_GREEN_RED, minimum=-1, maximum=1, doc="(G - R) / (G + R) of vegetation, without a NIR band; none: unused"
    )
    darkest: float = parameter(
        DARKEST, minimum=0, maximum=1, doc="brightness (0..1) below which the colours of a pixel are ignored: shadow"
    )
    smoothing: float = parameter(
        0.75, unit="m", minimum=0, maximum=5, doc="sigma of the Gaussian that averages the likeness to a tree"
    )
    opening: float = parameter(
        1.0, unit="m", minimum=0, maximum=10, doc="radius of the opening that removes narrow parts"
    )
    largest_hole: float = parameter(4.0, unit="m2", minimum=0, doc="largest hole that is filled")
    most_tree_like: float = parameter(
        -0.4, minimum=-1, maximum=1, doc="mean likeness to a tree above which a footprint is dropped"
    )
    smallest_area: float = parameter(8.0, unit="m2", minimum=0, doc="least area of a footprint")
    outline: Literal["polygon", "rectangle"] = parameter(
        "polygon",
        choices=("polygon", "rectangle"),
        doc="traced polygon with straight walls, or rectangle of least area around it",
    )
    tolerance: float | None = parameter(
        None,
        unit="m",
        minimum=0,
        maximum=5,
        doc="largest distance of traced points from a wall; none: one cell, at least 0.5 m",
    )

    def detect(self, scene: Scene, rng: np.random.Generator) -> Footprints:
        """Return the buildings of a scene; attributes `height` (mean above ground, m) and `tree_likeness` (-1..1)."""
        return self.trace(scene).footprints

    def steps(self, scene: Scene, rng: np.random.Generator) -> Iterator[Step]:
        """Return heights, cues, likeness to trees, mask and outlines."""
        return ndsm_steps(self.trace(scene))

    def trace(self, scene: Scene) -> NDSMTrace:
        """Detect, and return every intermediate result."""
        scene.require(self.requires)
        scene = scene.for_detection()
        assert scene.points is not None
        # Duplicate points would count as evidence for a plane.
        known = known_returns(scene.points.distinct(), scene.extent)
        points = known.points
        heights = self._ground(scene).above(points)
        grid = Grid.covering(scene.extent, self.cell or default_cell(points, heights, scene.extent))
        cues = cell_cues(points, heights, grid, threshold=self.height, window=self.window)
        high = np.nan_to_num(cues.high_share) >= 0.5
        ratings = self._cue_likeness(cues, self._vegetation(scene, grid))
        information = informative_cues(ratings, high, known_silent=self._known_silent(points, grid))
        cue_likeness = {name: ratings[name] for name in information.used}
        likeness = _averaged(_mean_of(cue_likeness, grid.shape), high, self.smoothing / grid.gsd)
        roof = high & ((likeness < 0) | np.isnan(likeness))
        mask = self._clean(roof, grid.gsd)
        traced = trace(coverage_of_mask(mask, np.where(likeness > 0, np.float32(0), cues.high_share)), grid)
        return NDSMTrace(
            cues=cues,
            high=high,
            cue_likeness=cue_likeness,
            likeness=likeness,
            roof=roof,
            mask=mask,
            traced=traced,
            footprints=self._footprints(traced, mask, cues, likeness, scene.crs, information.with_notes(known.notes)),
        )

    def measured(self, scene: Scene) -> Mapping[str, float]:
        """Return the cell size in steps of 1/32 m, unless it is given.

        Computers hold multiples of such a cell exactly, so that a point on the border of two cells falls into the same
        one in every window; with cells of 0.35 m it does not.
        """
        if self.cell is not None or scene.points is None or not len(scene.points):
            return {}
        points = scene.points.distinct()
        return {"cell": round(32 * default_cell(points, self._ground(scene).above(points), scene.extent)) / 32}

    def _ground(self, scene: Scene) -> Heights:
        return scene.heights if self.dem else heights_of(scene.points, None, scene.extent, cell=scene.ground_cell)

    def _vegetation(self, scene: Scene, grid: Grid) -> tuple[_Floats, float] | None:
        """Return the vegetation index of the image per cell and its threshold."""
        image = scene.image
        if image is None:
            return None
        threshold = self.ndvi if "nir" in image.bands else self.green_red
        index = None if threshold is None else greenness(image, grid, darkest=self.darkest)
        return None if index is None or threshold is None else (index, threshold)

    def _known_silent(self, points: PointCloud, grid: Grid) -> dict[str, str]:
        """Return why a cue cannot carry information: penetration of a raster fine enough for roughness to do alone."""
        fine = 2 * grid.gsd <= self.window and self.roughness is not None
        return silent_on_rasters(points.x, points.y) if fine and self.penetration is not None else {}

    def _cue_likeness(self, cues: CellCues, vegetation: tuple[_Floats, float] | None) -> dict[str, _Floats]:
        """Return the rating of each cell by each cue: -1 roof, 0 at its threshold, +1 tree, NaN unknown."""
        index, least_index = vegetation or (None, None)
        rules = {
            "multiple returns": (cues.multiple_share, self.multiple_share, 0.25),
            ANCHOR: (cues.roughness, self._roughest_roof(cues.noise), 0.2),
            PENETRATION: (cues.penetration, self.penetration, 0.15),
            IMAGE: (index, least_index, 0.05),
        }
        return {
            name: rated(value, threshold, width)
            for name, (value, threshold, width) in rules.items()
            if value is not None and threshold is not None
        }

    def _roughest_roof(self, noise: float) -> float | None:
        """Return the threshold of roughness, raised by what the noise of the cloud exceeds that of laser scanners."""
        return None if self.roughness is None else self.roughness + max(noise - _LASER_NOISE, 0.0)

    def _clean(self, roof: _Mask, cell: float) -> _Mask:
        """Fill small holes and open."""
        return opened(without_holes(roof, self.largest_hole / cell**2), self.opening / cell)

    def _footprints(
        self,
        traced: NDArray[np.object_],
        mask: _Mask,
        cues: CellCues,
        likeness: _Floats,
        crs: str | None,
        information: CueInformation,
    ) -> Footprints:
        height, looks = _means_inside(traced, mask, cues.grid, cues.height, likeness)
        if self.outline == "rectangle":
            polygons = minimum_rectangles(traced)
        else:
            tolerance = max(cues.grid.gsd, 0.5) if self.tolerance is None else self.tolerance
            polygons = regularise(traced, tolerance)
        # Without any cue the mean is NaN and the footprint is kept.
        keep = ~(looks > self.most_tree_like) & (shapely.area(polygons) >= self.smallest_area)
        attributes = {"height": height[keep], "tree_likeness": looks[keep]}
        record = {"cues": list(information.used), "notes": list(information.notes)}
        return Footprints.of(polygons[keep], crs=crs, attributes=attributes, metadata=record, source=self.name)


def default_cell(points: PointCloud, heights: NDArray[np.float32], extent: tuple[float, float, float, float]) -> float:
    """Return 1.4 times the point spacing in metres, in steps of 0.05 m, 0.25 to 2 m.

    The spacing is that of the covered part of the extent (2 m cells that hold points).
    """
    used = np.isfinite(heights)
    spacing = point_spacing(points.x[used], points.y[used], extent, square=2.0)
    if spacing is None:
        return 1.0
    return min(max(round(1.4 * spacing / 0.05) * 0.05, 0.25), 2.0)


def _mean_of(cue_likeness: dict[str, _Floats], shape: tuple[int, int]) -> _Floats:
    """Return the weighted mean of the cues; NaN where all are unknown."""
    total, weights = np.zeros(shape, dtype=np.float32), np.zeros(shape, dtype=np.float32)
    for name, cue in cue_likeness.items():
        weight = np.float32(_IMAGE_WEIGHT if name == IMAGE else 1)
        known = np.isfinite(cue)
        total += np.where(known, weight * cue, 0)
        weights += weight * known
    return np.where(weights > 0, total / np.where(weights > 0, weights, 1), np.float32(np.nan))


def _averaged(likeness: _Floats, high: _Mask, sigma: float) -> _Floats:
    """Return the Gaussian mean over high cells, unchanged in others; `sigma` in cells."""
    import cv2

    known = high & np.isfinite(likeness)
    if sigma <= 0 or not known.any():
        return likeness
    total = cv2.GaussianBlur(np.where(known, likeness, np.float32(0)), (0, 0), sigma)
    weight = cv2.GaussianBlur(known.astype(np.float32), (0, 0), sigma)
    return np.where(known, total / np.where(known, weight, 1), likeness)


def _means_inside(
    polygons: NDArray[np.object_], mask: _Mask, grid: Grid, *rasters: _Floats
) -> list[NDArray[np.float64]]:
    """Return per raster the mean of its known cells inside each polygon traced around a mask; NaN where none is known.

    A traced polygon contains whole components of its mask, and no other cell centre.
    """
    if len(polygons) == 0:
        return [np.empty(0) for _ in rasters]
    cells, component = np.flatnonzero(mask), _components(mask)
    # One cell stands for each component.
    row, column = np.divmod(cells[np.unique(component, return_index=True)[1]], grid.columns)
    inside, polygon = shapely.STRtree(polygons).query(shapely.points(*grid.to_world(row + 0.5, column + 0.5)), "within")
    owner_of = np.full(len(row) + 1, len(polygons))
    owner_of[inside + 1] = polygon
    owner = owner_of[component]
    means = []
    for raster in rasters:
        values = raster.ravel()[cells]
        known = np.isfinite(values)
        count = np.bincount(owner[known], minlength=len(polygons) + 1)[:-1]
        total = np.bincount(owner[known], weights=values[known], minlength=len(polygons) + 1)[:-1]
        means.append(np.where(count > 0, total / np.maximum(count, 1), np.nan))
    return means


def _components(mask: _Mask) -> NDArray[np.int32]:
    """Return the number, from 1, of the connected component of each cell of a mask, in the order of the cells."""
    import cv2

    labels: NDArray[np.int32] = cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)[1][mask]
    return labels
