"""The steps of the plain baseline detector as data: heights, cues, likeness to trees, mask and outlines."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..steps import (
    Category,
    ClassRaster,
    Layer,
    MapPanel,
    OutlineLayer,
    Role,
    Scale,
    Step,
    ValueRaster,
)
from .ndsm_trace import NDSMTrace

__all__ = ["ndsm_steps"]

_LIKENESS = Scale(label="likeness to a tree", low=-1, high=1, kind="diverging", ends=("roof", "undecided", "tree"))
_NOT_HIGH = "not high, or not known"


def ndsm_steps(trace: NDSMTrace) -> Iterator[Step]:
    """Yield the steps of a detection."""
    known = trace.cues.height[np.isfinite(trace.cues.height)]
    top = max(1.0, float(np.percentile(known, 99))) if len(known) else 1.0
    extent = trace.cues.grid.extent
    heights = Scale(label="height above ground", unit="m", low=0, high=top)
    yield _map(
        trace,
        "heights",
        "Mean height above ground of the points that are higher than the threshold.",
        ValueRaster(trace.cues.height, extent, heights, missing="no high point"),
    )
    yield Step(
        "cues",
        "Each cue on high cells, from a roof over its threshold to a tree.",
        tuple(
            MapPanel(
                extent=extent,
                layers=(ValueRaster(np.where(trace.high, cue, np.nan), extent, _LIKENESS, missing=_NOT_HIGH),),
                title=name,
            )
            for name, cue in trace.cue_likeness.items()
        ),
        columns=2,
    )
    yield _map(
        trace,
        "likeness",
        "Mean of the cues over the neighbourhood; high cells on the roof side are roof.",
        ValueRaster(np.where(trace.high, trace.likeness, np.nan), extent, _LIKENESS, missing=_NOT_HIGH),
    )
    changes = np.zeros(trace.roof.shape, dtype=np.uint8)
    changes[trace.roof & trace.mask] = 1
    changes[trace.mask & ~trace.roof] = 2
    changes[trace.roof & ~trace.mask] = 3
    categories = (
        Category("", Role.BACKGROUND),
        Category("roof cell", Role.SOLID),
        Category("added: hole filled", Role.ADDED),
        Category("removed by the opening", Role.REMOVED),
    )
    yield _map(
        trace,
        "mask",
        "Roof cells after holes were filled and narrow parts removed.",
        ClassRaster(changes, extent, categories),
    )
    # Beyond the highest roofs, so that outlines stand out.
    grey = Scale(label="height above ground", unit="m", low=0, high=1.3 * top, kind="grey")
    yield _map(
        trace,
        "outlines",
        "Traced outlines and footprints with straight walls on heights above ground; traced outlines without a "
        "footprint were too small or too similar to a tree.",
        ValueRaster(trace.cues.height, extent, grey),
        OutlineLayer(trace.traced, "traced outline", Role.CANDIDATE),
        OutlineLayer(trace.footprints.polygons, "footprint", Role.RESULT),
    )


def _map(trace: NDSMTrace, name: str, caption: str, *layers: Layer) -> Step:
    return Step(name, caption, (MapPanel(extent=trace.cues.grid.extent, layers=layers),))
