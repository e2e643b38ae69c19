"""The steps of `dempster-shafer` as data: cue maps, probabilities, classes, support, conflict, regions and outlines."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..steps import Category, ClassRaster, Layer, MapPanel, OutlineLayer, Role, Scale, Step, ValueRaster
from .fusion_trace import FusionTrace

__all__ = ["fusion_steps"]

_PROBABILITY = Scale(label="probability", low=0, high=1)


def fusion_steps(trace: FusionTrace) -> Iterator[Step]:
    """Yield the steps of a detection."""
    cues, extent = trace.cues, trace.cues.grid.extent
    top = max(3.0, float(np.percentile(cues.height, 99)))
    shown = {
        "height above ground": (cues.height, Scale(label="height above ground", unit="m", low=0, high=top)),
        "pulse difference": (cues.pulse_difference, Scale(label="pulse difference", unit="m", low=0, high=6)),
        "vegetation": (cues.vegetation, Scale(label="vegetation index", low=-0.2, high=0.6)),
        "texture strength": (cues.strength, Scale(label="texture strength", unit="1/m", low=0, high=3)),
        "texture directedness": (cues.directedness, Scale(label="directedness", low=0, high=1)),
    }
    yield Step(
        "cues",
        "The cue maps: large pulse differences, vegetation and rough surfaces without a direction are those of trees.",
        tuple(
            MapPanel(extent=extent, layers=(ValueRaster(values, extent, scale, missing="not known"),), title=title)
            for title, (values, scale) in shown.items()
            if values is not None
        ),
        columns=2,
    )
    meaning = {"height": "building or tree", "vegetation": "tree or grass"}
    yield Step(
        "probabilities",
        "The probability that each cue gives to its classes; the rest goes to the other classes.",
        tuple(
            MapPanel(
                extent=extent,
                layers=(ValueRaster(values, extent, _PROBABILITY, missing="says nothing"),),
                title=f"{name}: {meaning.get(name, 'tree')}",
            )
            for name, values in trace.probabilities.items()
        ),
        columns=2,
    )
    categories = (
        Category("building", Role.SOLID),
        Category("tree", Role.VEGETATION),
        Category("grass", Role.FAINT),
        Category("soil", Role.BACKGROUND),
    )
    yield _map(
        trace,
        "classes",
        "The class with the largest support in each cell.",
        ClassRaster(trace.classes, extent, categories),
    )
    yield Step(
        "support",
        "Support of the class building after the combination, and the conflict between the cues.",
        (
            MapPanel(
                extent=extent,
                layers=(ValueRaster(trace.building_support, extent, Scale(label="support", low=0, high=1)),),
                title="support of building",
            ),
            MapPanel(
                extent=extent,
                layers=(ValueRaster(trace.conflict, extent, Scale(label="conflict", low=0, high=1)),),
                title="conflict",
            ),
        ),
        columns=2,
    )
    changes = np.zeros(trace.initial.shape, dtype=np.uint8)
    changes[trace.initial & ~trace.opened] = 1
    changes[trace.opened & ~trace.accepted] = 2
    changes[trace.accepted] = 3
    regions = (
        Category("", Role.BACKGROUND),
        Category("removed: opening or minimum area", Role.SMALL),
        Category("region rejected by the second pass", Role.REMOVED),
        Category("accepted region", Role.SOLID),
    )
    yield _map(trace, "regions", "Building cells by what became of them.", ClassRaster(changes, extent, regions))
    grey = Scale(label="height above ground", unit="m", low=0, high=1.3 * top, kind="grey")
    yield _map(
        trace,
        "outlines",
        "Traced outlines, footprints with straight walls, and refused regions on heights above ground.",
        ValueRaster(cues.height, extent, grey),
        OutlineLayer(trace.rejected, "refused region", Role.REMOVED),
        OutlineLayer(trace.traced, "traced outline", Role.CANDIDATE),
        OutlineLayer(trace.footprints.polygons, "footprint", Role.RESULT),
    )


def _map(trace: FusionTrace, name: str, caption: str, *layers: Layer) -> Step:
    return Step(name, caption, (MapPanel(extent=trace.cues.grid.extent, layers=layers),))
