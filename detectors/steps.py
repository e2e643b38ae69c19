"""Steps: the intermediate results of a detection, as data that others draw.

Nouns
-----
step
    One intermediate result with a name and a caption, shown in one or more panels.
panel
    A map (`MapPanel`) or a chart (`ChartPanel`).
layer
    What a map is made of, the first at the bottom: a raster, outlines, lines, markers or texts.
extent
    ``(xmin, ymin, xmax, ymax)``, metres.
role
    What the objects of a layer are to the detector (`Role`). A drawing chooses one colour per role, the same for all
    detectors. The groups of one panel have different roles.

Coordinates are map coordinates in metres, x east and y north. Rasters have the axis order (row, column), row 0
northernmost, and fill their extent. Nothing here knows how it is drawn.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..core.errors import InputError

__all__ = [
    "Axis",
    "Bars",
    "Category",
    "ChartPanel",
    "ClassRaster",
    "ColourRaster",
    "Curve",
    "Extent",
    "Layer",
    "LineLayer",
    "MapPanel",
    "MarkerLayer",
    "OutlineLayer",
    "Panel",
    "ReliefRaster",
    "Role",
    "Scale",
    "Step",
    "TextLayer",
    "ValueRaster",
]

#: ``(xmin, ymin, xmax, ymax)``, metres.
Extent = tuple[float, float, float, float]


class Role(StrEnum):
    """What the objects of a layer, or the cells of a class, are to the detector."""

    RESULT = "result"
    """kept by this step"""
    INPUT = "input"
    """as they were before this step"""
    ADDED = "added"
    """added by this step"""
    REMOVED = "removed"
    """dropped by a test of this step"""
    REPEATED = "repeated"
    """covered by other results already"""
    CANDIDATE = "candidate"
    """not decided, or without support"""
    SMALL = "small"
    """below a minimum size"""
    VEGETATION = "vegetation"
    """looks like vegetation"""
    BORDER = "border"
    """at the border of the data"""
    SOLID = "solid"
    """cells of a mask"""
    FAINT = "faint"
    """cells of a mask below other layers"""
    BACKGROUND = "background"
    """cells outside a mask"""


@dataclass(frozen=True, kw_only=True)
class Scale:
    """How numbers map to colours.

    Attributes
    ----------
    label, unit : str
        Quantity and its unit, ``""`` for none.
    low, high : float
        Values of the first and the last colour; what lies beyond takes the same colour.
    kind : str
        ``"sequential"``; ``"diverging"`` around the middle of low and high; ``"grey"``, dark to light, below other
        layers.
    ends : tuple of str
        Names of low, middle and high where words say more than numbers; empty otherwise.
    """

    label: str
    low: float
    high: float
    unit: str = ""
    kind: Literal["sequential", "diverging", "grey"] = "sequential"
    ends: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class ValueRaster:
    """Numbers on a grid.

    Attributes
    ----------
    values : ndarray, shape (rows, columns)
        NaN where there is none.
    extent : tuple of float
    scale : Scale
    missing : str
        What cells without a value are, for the legend; ``""`` leaves them out of it.
    """

    values: NDArray[np.floating]
    extent: Extent
    scale: Scale
    missing: str = ""


@dataclass(frozen=True)
class Category:
    """A class of cells: its name in the legend, ``""`` for none, and its role."""

    label: str
    role: Role


@dataclass(frozen=True, eq=False)
class ClassRaster:
    """Classes on a grid.

    Attributes
    ----------
    values : ndarray of integers or bool, shape (rows, columns)
        Index of each cell's category.
    extent : tuple of float
    categories : tuple of Category
    """

    values: NDArray[np.integer] | NDArray[np.bool_]
    extent: Extent
    categories: tuple[Category, ...]


@dataclass(frozen=True, eq=False)
class ColourRaster:
    """An orthoimage.

    Attributes
    ----------
    values : ndarray, shape (rows, columns, 3)
        Red, green and blue, 0..1.
    extent : tuple of float
    faint : bool
        Whether it is only the background of other layers: light and grey.
    """

    values: NDArray[np.floating]
    extent: Extent
    faint: bool = False


@dataclass(frozen=True, eq=False)
class ReliefRaster:
    """Heights that are shown as shaded relief, the background of other layers.

    Attributes
    ----------
    values : ndarray, shape (rows, columns)
        Metres; NaN is level ground.
    extent : tuple of float
    """

    values: NDArray[np.floating]
    extent: Extent


@dataclass(frozen=True, eq=False)
class OutlineLayer:
    """Outlines of polygons, holes included.

    Attributes
    ----------
    polygons : ndarray of Polygon or MultiPolygon, shape (n,)
    label : str
        For the legend, to which the number of polygons is added.
    role : Role
    """

    polygons: NDArray[np.object_]
    label: str
    role: Role


@dataclass(frozen=True, eq=False)
class LineLayer:
    """Straight lines.

    Attributes
    ----------
    lines : ndarray, shape (n, 2, 2)
        Start and end of each, x and y.
    label : str
        For the legend, to which the number of lines is added.
    role : Role
    marked : bool
        Whether a circle marks the middle of each, so that short ones are seen.
    values : ndarray, shape (n,), optional
        Number that colours each line by `scale`, instead of the role.
    scale : Scale, optional
    """

    lines: NDArray[np.float64]
    label: str
    role: Role
    marked: bool = False
    values: NDArray[np.float64] | None = None
    scale: Scale | None = None


@dataclass(frozen=True, eq=False)
class MarkerLayer:
    """Places.

    Attributes
    ----------
    places : ndarray, shape (n, 2)
        x and y.
    label : str
        For the legend, to which the number of places is added.
    role : Role
    symbol : str
    """

    places: NDArray[np.float64]
    label: str
    role: Role
    symbol: Literal["circle", "diamond"] = "circle"


@dataclass(frozen=True, eq=False)
class TextLayer:
    """Short texts.

    Attributes
    ----------
    places : ndarray, shape (n, 2)
        x and y of the middle of each text.
    texts : tuple of str
    """

    places: NDArray[np.float64]
    texts: tuple[str, ...]


Layer = ValueRaster | ClassRaster | ColourRaster | ReliefRaster | OutlineLayer | LineLayer | MarkerLayer | TextLayer


@dataclass(frozen=True, kw_only=True)
class MapPanel:
    """A map.

    Attributes
    ----------
    extent : tuple of float
        What is shown.
    layers : tuple of Layer
        The first at the bottom.
    title : str
        For steps of several panels.
    """

    extent: Extent
    layers: tuple[Layer, ...]
    title: str = ""


@dataclass(frozen=True, kw_only=True)
class Axis:
    """An axis of a chart.

    Attributes
    ----------
    label, unit : str
        Quantity and its unit: ``""`` for none, ``"%"`` for fractions to show in percent, ``"°"`` for degrees.
    logarithmic : bool
    ticks : dict of float to str
        Values to label and their labels; empty for a choice by the drawing.
    """

    label: str
    unit: str = ""
    logarithmic: bool = False
    ticks: dict[float, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve of a chart; NaN interrupts it. The label is for the legend, ``""`` for none."""

    x: NDArray[np.floating]
    y: NDArray[np.floating]
    label: str = ""


@dataclass(frozen=True, eq=False)
class Bars:
    """Bars of a chart.

    Attributes
    ----------
    x, y : ndarray, shape (n,)
        Middle and height of each bar.
    width : float
    role : Role
    mean : float, optional
        Level that a dashed line marks.
    """

    x: NDArray[np.floating]
    y: NDArray[np.floating]
    width: float
    role: Role
    mean: float | None = None


@dataclass(frozen=True, kw_only=True)
class ChartPanel:
    """A chart of curves or bars."""

    x: Axis
    y: Axis
    series: tuple[Curve | Bars, ...]
    title: str = ""


Panel = MapPanel | ChartPanel


@dataclass(frozen=True)
class Step:
    """One intermediate result that a person can look at.

    Attributes
    ----------
    name : str
        Short, fit for a file name: ``"extended-lines"``. Whoever writes the steps numbers them.
    caption : str
        One sentence that says what is seen. It does not name colours: the legend shows them.
    panels : tuple of Panel
        Row by row; none where there is nothing to show.
    columns : int
        Panels side by side.

    Raises
    ------
    InputError
        A name with other characters than letters, digits, ``-`` and ``_``.
    """

    name: str
    caption: str
    panels: tuple[Panel, ...]
    columns: int = 1

    def __post_init__(self) -> None:
        if not re.fullmatch(r"[\w-]+", self.name):
            raise InputError(f"the step name {self.name!r} is not fit for a file name: use letters, digits, - and _")
