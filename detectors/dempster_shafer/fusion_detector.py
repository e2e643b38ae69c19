"""Building detection by the fusion of cues with the theory of Dempster and Shafer.

1. Cue maps on a grid (`cue_maps`): height above ground, pulse difference, vegetation index, and strength and
   directedness of the surface's texture.
2. Each cue gives a probability to a set of classes, by a cubic step, and the rest to the other classes: height to
   building or tree; pulse difference to tree; vegetation to tree or grass; strength to tree; directedness to tree, only
   where the surface is rough.
3. Dempster's rule combines them for each cell; a cell gets the class with the largest support.
4. Building cells are opened; connected components below a minimum area are dropped.
5. The same is decided again for each component, from its mean cues and its shares of smooth and of rough, undirected
   cells.
6. The outlines of the accepted components are traced and get straight walls.

Sources: Rottensteiner, Trinder, Clode & Kubik (2005), Information Fusion 6; the same (2007), Building detection by
fusion of airborne laser scanner data and multi-spectral images, ISPRS J. Photogrammetry and Remote Sensing 62. The
bounds of the steps are our reading: they depend on sensor and season.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.errors import ParameterError
from ...core.parameters import parameter
from ...scenes.geodata.density import point_spacing
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.outlines import coverage_of_mask, trace
from ...scenes.geodata.raster import Grid
from ...scenes.scene import Scene
from ..base import Detector
from ..shared.cue_information import ANCHOR, CueInformation, informative_cues
from ..shared.known_returns import known_returns
from ..shared.morphology import opened, without_holes
from ..shared.pixel_cues import greenness
from ..shared.regularise import regularise
from ..steps import Step
from .cue_maps import CueMaps, cue_maps
from .fusion_steps import fusion_steps
from .fusion_trace import FusionTrace
from .masses import (
    ALL,
    BUILDING,
    GRASS,
    TREE,
    Evidence,
    combined,
    evidence_for,
    step_probability,
    strongest_class,
    support,
)

__all__ = ["DempsterShafer"]

_Floats = NDArray[np.float32]
_Mask = NDArray[np.bool_]

#: The classes that each cue speaks for.
_SPEAKS_FOR = {
    "height": BUILDING | TREE,
    "pulse difference": TREE,
    "vegetation": TREE | GRASS,
    "strength": TREE,
    "directedness": TREE,
    "smooth share": ALL & ~TREE,
    "undirected share": TREE,
}
_SOURCE = "Rottensteiner 2005"
#: Names of the pulse difference with return numbers and without any.
_DIFFERENCE, _RANGE = "pulse difference", "range of heights"


@dataclass(frozen=True, kw_only=True)
class DempsterShafer(Detector):
    """Fusion of height, pulse, colour and texture cues by Dempster's rule, cell by cell and region by region."""

    name = "dempster-shafer"
    paper = "Rottensteiner, Trinder, Clode & Kubik 2005, Information Fusion 6"
    requires = ("points",)

    cell: float | None = parameter(
        None, unit="m", minimum=0.2, maximum=5, doc="cell size; none: 1.4 times the point spacing, 0.5 to 2 m"
    )
    low_height: float = parameter(
        1.5,
        unit="m",
        minimum=0,
        maximum=20,
        doc="height up to which a cell is neither building nor tree",
        source="reading",
    )
    high_height: float = parameter(
        3.0, unit="m", minimum=0, maximum=50, doc="height from which a cell is a building or tree", source="reading"
    )
    low_difference: float = parameter(
        1.5, unit="m", minimum=0, maximum=20, doc="pulse difference up to which a cell is not a tree", source="reading"
    )
    high_difference: float = parameter(
        3.0, unit="m", minimum=0, maximum=50, doc="pulse difference from which a cell is a tree", source="reading"
    )
    low_ndvi: float = parameter(
        0.1, minimum=-1, maximum=1, doc="(NIR - R) / (NIR + R) up to which a cell is not vegetation", source="reading"
    )
    high_ndvi: float = parameter(
        0.4, minimum=-1, maximum=1, doc="(NIR - R) / (NIR + R) from which a cell is vegetation", source="reading"
    )
    low_green: float = parameter(
        0.0, minimum=-1, maximum=1, doc="the same by (G - R) / (G + R), without a NIR band", source="reading"
    )
    high_green: float = parameter(
        0.15, minimum=-1, maximum=1, doc="the same by (G - R) / (G + R), without a NIR band", source="reading"
    )
    low_strength: float = parameter(
        0.5, unit="1/m", minimum=0, doc="texture strength up to which a surface is smooth", source="reading"
    )
    high_strength: float = parameter(
        2.0, unit="1/m", minimum=0, doc="texture strength from which a surface is that of a tree", source="reading"
    )
    low_directedness: float = parameter(
        0.3, minimum=0, maximum=1, doc="directedness up to which a rough surface is not a tree", source="reading"
    )
    high_directedness: float = parameter(
        0.9, minimum=0, maximum=1, doc="directedness from which a rough surface is a tree", source="reading"
    )
    low_share: float = parameter(
        0.2, minimum=0, maximum=1, doc="share of cells up to which a region is not smooth or rough", source="reading"
    )
    high_share: float = parameter(
        0.8, minimum=0, maximum=1, doc="share of cells from which a region is smooth or rough", source="reading"
    )
    least_probability: float = parameter(
        0.05, minimum=0.001, maximum=0.4, doc="probability below a step; above it is the complement", source=_SOURCE
    )
    window: float = parameter(
        1.0, unit="m", minimum=0.1, maximum=20, doc="sigma of the average of the texture", source="reading"
    )
    darkest: float = parameter(
        0.1, minimum=0, maximum=1, doc="brightness (0..1) below which the colours of a pixel are ignored: shadow"
    )
    opening: float = parameter(
        1.0, unit="m", minimum=0, maximum=10, doc="radius of the opening that removes thin bridges", source="reading"
    )
    smallest_area: float = parameter(10.0, unit="m2", minimum=0, doc="least area of a region", source="reading")
    second_pass: bool = parameter(True, doc="decide again for each region", source=_SOURCE)

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("height", "difference", "ndvi", "green", "strength", "directedness", "share"):
            if not getattr(self, f"low_{name}") < getattr(self, f"high_{name}"):
                raise ParameterError(f"{self.name}: low_{name} must be smaller than high_{name}")

    def detect(self, scene: Scene, rng: np.random.Generator) -> Footprints:
        """Return the buildings of a scene; attributes `height` (mean above ground, m) and `support` (0..1)."""
        return self.trace(scene).footprints

    def steps(self, scene: Scene, rng: np.random.Generator) -> Iterator[Step]:
        """Return cue maps, probabilities, classes, support, conflict, regions and outlines."""
        return fusion_steps(self.trace(scene))

    def measured(self, scene: Scene) -> Mapping[str, float]:
        """Return the cell size that is measured where none is set."""
        return {} if self.cell is not None else {"cell": _default_cell(scene)}

    def trace(self, scene: Scene) -> FusionTrace:
        """Detect, and return every intermediate result."""
        scene.require(self.requires)
        scene = scene.for_detection()
        assert scene.points is not None
        known = known_returns(scene.points.distinct(), scene.extent)
        points = known.points
        grid = Grid.covering(scene.extent, self.cell or _default_cell(scene))
        index = None if scene.image is None else greenness(scene.image, grid, darkest=self.darkest)
        near_infrared = scene.image is not None and "nir" in scene.image.bands
        heights = scene.heights.above(points)
        cues = cue_maps(points, heights, grid, window=self.window, vegetation=index)
        probabilities = self._probabilities(cues, near_infrared)
        information = self._information(probabilities, cues.numbered).with_notes(known.notes)
        if _DIFFERENCE in information.silent:
            # Numbers that do not describe the pulses, such as those of last returns alone: the heights may.
            unnumbered = replace(points, return_number=None, number_of_returns=None)
            cues = cue_maps(unnumbered, heights, grid, window=self.window, vegetation=index)
            probabilities = self._probabilities(cues, near_infrared)
            information = self._information(probabilities, numbered=False).with_notes(information.notes)
        if information.silent:
            cues = _without(cues, information.silent)
            probabilities = self._probabilities(cues, near_infrared)
        evidence, conflict = combined(_evidence(probabilities), grid.shape)
        classes = strongest_class(evidence)
        # A cell to which no evidence at all speaks is soil.
        initial = classes == 0
        cleaned = opened(without_holes(initial, 4.0 / grid.gsd**2), self.opening / grid.gsd)
        labels, count = _components(cleaned, self.smallest_area / grid.gsd**2)
        regions = labels > 0
        heard = np.ones(count, dtype=np.bool_)
        region_support = np.ones(count, dtype=np.float32)
        if count:
            decided, _ = combined(_evidence(self._of_regions(cues, labels, count, near_infrared)), (count,))
            region_support = support(decided, BUILDING)
            if self.second_pass:
                heard = strongest_class(decided) == 0
        accepted = regions & np.concatenate([[False], heard])[labels]
        traced = trace(coverage_of_mask(accepted), grid)
        return FusionTrace(
            cues=cues,
            probabilities=probabilities,
            classes=classes,
            building_support=support(evidence, BUILDING),
            conflict=conflict,
            initial=initial,
            opened=regions,
            accepted=accepted,
            traced=traced,
            rejected=trace(coverage_of_mask(regions & ~accepted), grid),
            footprints=replace(
                self._footprints(traced, labels, cues, region_support, scene.crs),
                metadata={"cues": ["height", *information.used], "notes": list(information.notes)},
            ),
        )

    def _information(self, probabilities: dict[str, _Floats], numbered: bool) -> CueInformation:
        """Return which cues separate roofs from trees among the high cells; the strength of texture is the anchor."""
        difference = _DIFFERENCE if numbered else _RANGE
        names = {"strength": ANCHOR, "pulse difference": difference, "vegetation": "vegetation"}
        # Steps are wide: which side of the middle a probability is on separates more than the probability itself.
        ratings = {
            name: np.sign(probabilities[cue] - np.float32(0.5)) for cue, name in names.items() if cue in probabilities
        }
        # Texture is a poor expert here: walls are as rough as crowns, and where trees are few it would refute colours.
        high = probabilities["height"] > 0.5
        return informative_cues(ratings, high, independent=("vegetation",))

    def _step(self, values: NDArray[np.floating] | None, name: str) -> _Floats | None:
        """Return the probability of a cue by the bounds of that name."""
        if values is None:
            return None
        low, high = getattr(self, f"low_{name}"), getattr(self, f"high_{name}")
        return step_probability(values, low, high, least=self.least_probability, most=1 - self.least_probability)

    def _probabilities(self, cues: CueMaps, near_infrared: bool) -> dict[str, _Floats]:
        """Return the probability by each cue per cell, for the classes that it speaks for."""
        directedness = self._step(cues.directedness, "directedness")
        assert directedness is not None
        rough = cues.strength > self.low_strength
        found = {
            "height": self._step(cues.height, "height"),
            "pulse difference": self._step(cues.pulse_difference, "difference"),
            "vegetation": self._step(cues.vegetation, "ndvi" if near_infrared else "green"),
            "strength": self._step(cues.strength, "strength"),
            "directedness": np.where(rough, directedness, np.float32(np.nan)),
        }
        return {name: value for name, value in found.items() if value is not None}

    def _of_regions(
        self, cues: CueMaps, labels: NDArray[np.int32], count: int, near_infrared: bool
    ) -> dict[str, _Floats]:
        """Return the probability by each cue per region: from means, and from shares of smooth and of rough cells."""
        inner = _inner(labels, count, self.window / cues.grid.gsd)
        smooth = cues.strength <= self.low_strength
        middle = (self.low_directedness + self.high_directedness) / 2
        undirected = ~smooth & (cues.directedness > middle)
        difference, vegetation = cues.pulse_difference, cues.vegetation
        found = {
            "height": self._step(_means(labels, count, cues.height), "height"),
            "pulse difference": None
            if difference is None
            else self._step(_means(labels, count, difference), "difference"),
            "vegetation": None
            if vegetation is None
            else self._step(_means(labels, count, vegetation), "ndvi" if near_infrared else "green"),
            "smooth share": self._step(_means(inner, count, smooth), "share"),
            "undirected share": self._step(_means(inner, count, undirected), "share"),
        }
        return {name: value for name, value in found.items() if value is not None}

    def _footprints(
        self,
        traced: NDArray[np.object_],
        labels: NDArray[np.int32],
        cues: CueMaps,
        region_support: _Floats,
        crs: str | None,
    ) -> Footprints:
        polygons = regularise(traced, max(cues.grid.gsd, 0.5))
        inside = shapely.point_on_surface(traced)
        region, _ = cues.grid.cells(shapely.get_x(inside), shapely.get_y(inside))
        number = labels.ravel()[region] - 1
        heights = _means(labels, len(region_support), cues.height)
        known = number >= 0
        keep = known & (shapely.area(polygons) > 0)
        number = number[keep]
        return Footprints.of(
            polygons[keep],
            crs=crs,
            attributes={"height": heights[number], "support": region_support[number]},
            source=self.name,
        )


def _evidence(probabilities: Mapping[str, _Floats]) -> list[Evidence]:
    return [evidence_for(_SPEAKS_FOR[name], value) for name, value in probabilities.items()]


def _default_cell(scene: Scene) -> float:
    """Return 1.4 times the point spacing in metres, in steps of 0.05 m, 0.5 to 2 m."""
    points = scene.points
    spacing = None if points is None else point_spacing(points.x, points.y, scene.extent, square=2.0)
    return 1.0 if spacing is None else min(max(round(1.4 * spacing / 0.05) * 0.05, 0.5), 2.0)


def _components(mask: _Mask, least: float) -> tuple[NDArray[np.int32], int]:
    """Return connected components of at least so many cells, numbered from 1, and their number."""
    import cv2

    _, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)
    large = np.bincount(labels.ravel()) >= least
    large[0] = False
    numbers = np.where(large, np.cumsum(large), 0).astype(np.int32)
    return numbers.take(labels), int(large.sum())


def _without(cues: CueMaps, silent: Collection[str]) -> CueMaps:
    """Return cue maps without those of silent cues."""
    return replace(
        cues,
        pulse_difference=None if {_DIFFERENCE, _RANGE} & set(silent) else cues.pulse_difference,
        vegetation=None if "vegetation" in silent else cues.vegetation,
    )


def _inner(labels: NDArray[np.int32], count: int, margin: float) -> NDArray[np.int32]:
    """Return the labels without cells near the edge of their region, where the surface is rough on every building.

    A region that is too narrow for that keeps all its cells.
    """
    import cv2

    reach = max(1, round(margin))
    window = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    solid = cv2.erode((labels > 0).astype(np.uint8), window) > 0
    left = np.bincount(labels[solid], minlength=count + 1) > 0
    return np.where(solid | ~left[labels], labels, 0)


def _means(labels: NDArray[np.int32], count: int, values: NDArray[np.generic]) -> NDArray[np.float64]:
    """Return the mean over the known cells of each region; NaN where none is known."""
    numbers = np.asarray(values, dtype=np.float64)
    known = np.isfinite(numbers) & (labels > 0)
    size = np.bincount(labels[known], minlength=count + 1)[1:]
    total = np.bincount(labels[known], weights=numbers[known], minlength=count + 1)[1:]
    return np.where(size > 0, total / np.maximum(size, 1), np.nan)
