"""The data of a report, without any drawing.

Nouns
-----
overlay
    The verdicts of one run on one scene: what the detector found, what it missed, and why.
scene view
    A scene with its picture, its reference and the overlays of the detectors that ran on it.
error
    A wrong object, with its wrong area in m2.
size bin
    Objects of similar footprint area, with the number of correct ones.
cost
    Time and memory of a detector on one scene.

Coordinates are metres of the scene's CRS, x east and y north.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ...evaluators.base import Evaluation, Index
from ...evaluators.verdict_table import Side, Verdicts
from ...scenes.geodata.footprints import Footprints
from ..execution.scene_picture import ScenePicture
from .break_down import BreakDown
from .published import Comparison
from .results import GateResult, Leaderboard

__all__ = [
    "CostPoint",
    "Error",
    "Overlay",
    "PooledCurves",
    "Provenance",
    "Report",
    "SceneView",
    "Sensitivity",
    "SensitivityPoint",
    "SizeBin",
    "SizeCurve",
]


@dataclass(frozen=True, eq=False, kw_only=True)
class Overlay:
    """One run on one scene.

    Attributes
    ----------
    label : str
        Detector with changed parameters.
    run, seed : int
    verdicts : Verdicts
        With the footprints of both sides.
    """

    label: str
    run: int
    seed: int
    verdicts: Verdicts


@dataclass(frozen=True, eq=False, kw_only=True)
class SceneView:
    """A scene with everything that is drawn over it; `picture` is None where none was stored."""

    name: str
    group: str
    extent: tuple[float, float, float, float]
    picture: ScenePicture | None
    reference: Footprints
    area: Any
    overlays: tuple[Overlay, ...]


@dataclass(frozen=True, kw_only=True)
class Error:
    """A wrong object.

    Attributes
    ----------
    scene, overlay : int
        Places in the report's scenes and in that scene's overlays.
    side : {"detection", "reference"}
    position : int
        Row among the objects of its side.
    wrong : float
        Area that is wrong, m2: of an object that counts as an error its own; of a correct detection what only it or
        its partner covers.
    """

    scene: int
    overlay: int
    side: Side
    position: int
    wrong: float


@dataclass(frozen=True)
class SizeBin:
    """Objects with an area from `low` to `high` m2: `right` of `count` are correct."""

    low: float
    high: float
    count: int
    right: int


@dataclass(frozen=True, kw_only=True)
class SizeCurve:
    """One detector by size: references found (completeness) and correct detections (correctness)."""

    label: str
    found: tuple[SizeBin, ...]
    correct: tuple[SizeBin, ...]


@dataclass(frozen=True)
class SensitivityPoint:
    """Mean over scenes of an index at one value of an axis, with its 95 % bootstrap interval where there is one."""

    value: Any
    mean: float | None
    low: float | None
    high: float | None
    scenes: int


@dataclass(frozen=True, kw_only=True)
class Sensitivity:
    """One line of a sensitivity plot.

    Attributes
    ----------
    detector, axis : str
        The axis is a parameter of the detector, or ``scene.NAME`` of the generator.
    unit : str
        Of the axis; empty when not known.
    index : Index
    points : tuple of SensitivityPoint
        In the order of the axis.
    default : Any
        Default value of the detector; None for generator axes.
    left_out : tuple
        Values of the axis that are stored for other scenes only, and hence not on the line.
    scenes : int
        Scenes of each value; a point with fewer is undefined on some. 0: as many as the point with the most has.
    break_down : BreakDown, optional
        Where the index passes a level; None when it was not looked for.
    """

    detector: str
    axis: str
    unit: str
    index: Index
    points: tuple[SensitivityPoint, ...]
    default: Any = None
    left_out: tuple[Any, ...] = ()
    scenes: int = 0
    break_down: BreakDown | None = None


@dataclass(frozen=True, kw_only=True)
class CostPoint:
    """One detector on one scene: medians over its runs; `points` is the size of the cloud, `hectares` of the extent."""

    label: str
    scene: str
    points: int | None
    hectares: float
    cpu_seconds: float
    peak_memory: int
    runs: int


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """Where the values come from.

    Attributes
    ----------
    facts : tuple of (str, str)
        Name and value, in order: version, command, machine, packages, and so on.
    scenes : tuple of (str, str, str)
        Name, how it can be made again, and content hash.
    """

    facts: tuple[tuple[str, str], ...]
    scenes: tuple[tuple[str, str, str], ...]


@dataclass(frozen=True, eq=False, kw_only=True)
class PooledCurves:
    """Pooled evaluations of several detectors by an evaluator that declares curves.

    Attributes
    ----------
    evaluator : str
        Its name with changed parameters.
    scenes : tuple of str
        Those that the evaluations are over.
    pooled : mapping of str to Evaluation
        By detector.
    """

    evaluator: str
    scenes: tuple[str, ...]
    pooled: Mapping[str, Evaluation]


@dataclass(frozen=True, eq=False, kw_only=True)
class Report:
    """The contents of one report; empty parts are not shown.

    Attributes
    ----------
    title : str
    boards : tuple of Leaderboard
        One per evaluator, over all scenes; the first one's verdicts are drawn.
    parts : tuple of Leaderboard
        By the first evaluator: the suites of the store, and the scenes that all detectors ran on, where not every
        detector ran on every scene.
    matrix : mapping of str to mapping of str to float or None
        Scene to detector to the value of the first board's ranking index (mean over seeds).
    scenes : tuple of SceneView
        Scenes with maps.
    errors : tuple of Error
        The largest errors.
    sizes : tuple of SizeCurve
    curves : tuple of PooledCurves
    sensitivities : tuple of Sensitivity
    costs : tuple of CostPoint
    comparison : Comparison, optional
        Published values beside ours.
    gate : GateResult, optional
    provenance : Provenance
    sampling : tuple of str
        What was left out of the maps, one sentence each.
    """

    title: str
    boards: tuple[Leaderboard, ...]
    provenance: Provenance
    parts: tuple[Leaderboard, ...] = ()
    matrix: Mapping[str, Mapping[str, float | None]] = field(default_factory=dict)
    scenes: tuple[SceneView, ...] = ()
    errors: tuple[Error, ...] = ()
    sizes: tuple[SizeCurve, ...] = ()
    curves: tuple[PooledCurves, ...] = ()
    sensitivities: tuple[Sensitivity, ...] = ()
    costs: tuple[CostPoint, ...] = ()
    comparison: Comparison | None = None
    gate: GateResult | None = None
    sampling: tuple[str, ...] = ()
