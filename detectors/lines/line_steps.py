"""The steps of a line detector as data, after figures 2 to 6 of the papers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import NDArray

from ..steps import (
    Axis,
    Bars,
    Category,
    ChartPanel,
    ClassRaster,
    ColourRaster,
    Layer,
    LineLayer,
    MapPanel,
    MarkerLayer,
    OutlineLayer,
    Role,
    Scale,
    Step,
    TextLayer,
    ValueRaster,
)
from .boxes import Boxes, box_centres, box_corners, lengths, widths
from .orientation import Oriented
from .texture import BIN_COUNT, Texture
from .trace import Outcome, Trace

__all__ = ["line_steps"]

_ROLES = {
    Outcome.RECTANGLE: Role.RESULT,
    Outcome.INSIDE: Role.REPEATED,
    Outcome.NARROW: Role.SMALL,
    Outcome.VEGETATION: Role.VEGETATION,
    Outcome.UNADJUSTED: Role.CANDIDATE,
    Outcome.OUTVOTED: Role.REMOVED,
    Outcome.BORDER: Role.BORDER,
    Outcome.NO_SIDE: Role.INPUT,
}
_DROPPED = (Outcome.VEGETATION, Outcome.UNADJUSTED, Outcome.OUTVOTED, Outcome.NARROW)
#: What the numbers on the candidates mean.
_NUMBERS = {Texture: "digits: the tests passed", Oriented: "numbers: the score, above 0 for buildings"}
#: Histograms shown of each kind of candidates, kept and dropped, the largest ones.
_SHOWN = 6


def line_steps(trace: Trace) -> Iterator[Step]:
    """Yield the steps of a detection."""
    yield _masks(trace)
    yield _map(
        trace,
        "lines",
        "Lines around the black shapes, by what became of them; dropped lines have a circle at their centre.",
        _orthoimage(trace, faint=True),
        *_fitted_lines(trace),
    )
    extended = np.isin(trace.outcomes, (Outcome.RECTANGLE, Outcome.INSIDE, Outcome.NARROW, Outcome.OUTVOTED))
    gained = float((lengths(trace.lines[extended]) - lengths(trace.fitted[extended])).sum()) * trace.grid.gsd
    yield _map(
        trace,
        "extended-lines",
        "Lines as fitted, and after adjustment and extension.",
        _mask(trace, trace.masks.primary, Role.FAINT),
        LineLayer(_lines(trace, trace.lines[extended]), f"adjusted and extended, {gained:.0f} m gained", Role.RESULT),
        LineLayer(_lines(trace, trace.fitted[extended]), "as fitted", Role.CANDIDATE),
    )
    inside = trace.candidate_of < 0
    yield _map(
        trace,
        "initial-rectangles",
        "Initial rectangles on the primary mask.",
        _mask(trace, trace.masks.primary, Role.FAINT),
        OutlineLayer(_rectangles(trace, trace.initial[~inside]), "initial rectangle", Role.RESULT),
        OutlineLayer(_rectangles(trace, trace.initial[inside]), "inside a final rectangle, dropped", Role.REMOVED),
    )
    if trace.votes is not None:
        yield _map(
            trace,
            "votes",
            "Mean vote of each extended line; lines at or below the majority are dropped.",
            _orthoimage(trace, faint=True),
            *_voted_lines(trace, trace.votes),
        )
    yield _final(trace)
    if isinstance(trace.texture, Texture):
        yield _histograms(trace, trace.texture)


def _map(trace: Trace, name: str, caption: str, *layers: Layer) -> Step:
    return Step(name, caption, (MapPanel(extent=trace.grid.extent, layers=layers),))


def _places(trace: Trace, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the map coordinates of pixel coordinates, both of shape (..., 2)."""
    return np.stack(trace.grid.to_world(pixels[..., 1], pixels[..., 0]), axis=-1)


def _lines(trace: Trace, lines: Boxes) -> NDArray[np.float64]:
    return _places(trace, box_corners(lines)[:, :2])


def _rectangles(trace: Trace, boxes: Boxes) -> NDArray[np.object_]:
    rectangles: NDArray[np.object_] = shapely.polygons(_places(trace, box_corners(boxes)))
    return rectangles


def _orthoimage(trace: Trace, *, faint: bool = False) -> ColourRaster:
    colours = np.stack([trace.image.band(name) for name in ("red", "green", "blue")], axis=-1)
    return ColourRaster(colours, trace.grid.extent, faint=faint)


def _mask(trace: Trace, mask: NDArray[np.uint8], role: Role) -> ClassRaster:
    return ClassRaster(mask, trace.grid.extent, (Category("", Role.BACKGROUND), Category("black in the mask", role)))


def _masks(trace: Trace) -> Step:
    index = Scale(label="vegetation index (0 to 255)", low=0, high=128)
    vegetation = ValueRaster(np.diff(trace.vegetation, axis=1), trace.grid.extent, index)
    panels: dict[str, Layer] = {
        "orthoimage": _orthoimage(trace),
        "vegetation index": vegetation,
        "primary mask: no ground": _mask(trace, trace.masks.primary, Role.SOLID),
        "secondary mask: something high": _mask(trace, trace.masks.secondary, Role.SOLID),
    }
    return Step(
        "masks",
        "Orthoimage, vegetation index, primary mask (black: no ground) and secondary mask (black: something high).",
        tuple(MapPanel(extent=trace.grid.extent, layers=(layer,), title=title) for title, layer in panels.items()),
        columns=2,
    )


def _fitted_lines(trace: Trace) -> Iterator[Layer]:
    for outcome, role in _ROLES.items():
        chosen = trace.outcomes == outcome
        if chosen.any():
            yield LineLayer(_lines(trace, trace.fitted[chosen]), outcome.label, role, marked=outcome in _DROPPED)
    if trace.smooth_green.any():
        places = _places(trace, box_centres(trace.fitted[trace.smooth_green]))
        yield MarkerLayer(places, "kept by its low entropy", Role.ADDED, "diamond")


def _voted_lines(trace: Trace, votes: NDArray[np.float64]) -> Iterator[Layer]:
    voted = ~np.isnan(votes[:, 0])
    yield LineLayer(
        _lines(trace, trace.lines[voted]),
        "line",
        Role.RESULT,
        values=votes[voted].mean(axis=1),
        scale=Scale(label="mean vote", low=0, high=1, kind="diverging"),
    )
    outvoted = trace.outcomes == Outcome.OUTVOTED
    yield MarkerLayer(_places(trace, box_centres(trace.lines[outvoted])), Outcome.OUTVOTED.label, Role.REMOVED)


def _final(trace: Trace) -> Step:
    repeated, refused = trace.duplicates, ~trace.kept & ~trace.duplicates
    layers: list[Layer] = [
        _orthoimage(trace),
        OutlineLayer(_rectangles(trace, trace.candidates[repeated]), "covered by larger rectangles", Role.REPEATED),
    ]
    caption = "Final rectangles, and candidates that larger ones cover"
    if trace.texture is not None:
        caption += " or that lack the texture of a building; " + _NUMBERS[type(trace.texture)]
        refused_rectangles = _rectangles(trace, trace.candidates[refused])
        layers.append(OutlineLayer(refused_rectangles, "no texture of a building", Role.REMOVED))
    layers.append(OutlineLayer(_rectangles(trace, trace.final), "building", Role.RESULT))
    if trace.texture is not None:
        # Away from the centre, which the rectangles of one house share.
        pixels = 0.7 * box_centres(trace.candidates) + 0.3 * box_corners(trace.candidates)[:, 0]
        texts = tuple(_numbers(trace.texture))
        layers.append(TextLayer(_places(trace, pixels), texts))
    return _map(trace, "final-rectangles", f"{caption}.", *layers)


def _numbers(texture: Texture | Oriented) -> Iterator[str]:
    if isinstance(texture, Oriented):
        yield from (f"{score:.1f}" for score in texture.score)
    else:
        yield from ("".join(str(k + 1) for k in np.flatnonzero(passed)) for passed in texture.passed)


def _histograms(trace: Trace, texture: Texture) -> Step:
    areas = lengths(trace.candidates) * widths(trace.candidates) * trace.grid.gsd**2
    by_area = np.argsort(-areas, kind="stable")
    passing = trace.kept | trace.duplicates
    chosen = [*by_area[passing[by_area]][:_SHOWN], *by_area[~passing[by_area]][:_SHOWN]]
    degrees = -90.0 + 5.0 * np.arange(BIN_COUNT)
    panels = []
    for candidate in chosen:
        histogram = texture.collective[candidate]
        tests = ", ".join(f"T{number + 1}" for number in np.flatnonzero(texture.passed[candidate]))
        role = Role.RESULT if passing[candidate] else Role.REMOVED
        panels.append(
            ChartPanel(
                x=Axis(label="direction of edges", ticks={-90: "±90°", -45: "-45°", 0: "0°", 45: "45°"}),
                y=Axis(label="length of edges", unit="m"),
                series=(Bars(degrees, histogram, 4.4, role, mean=float(histogram.mean())),),
                title=f"{areas[candidate]:.0f} m²: {tests or 'no test passed'}",
            )
        )
    return Step(
        "histograms",
        "Edge orientation histograms of the largest candidates, kept and dropped, with the tests that each passes; "
        "dashed: mean of the bins.",
        tuple(panels),
        columns=4,
    )
