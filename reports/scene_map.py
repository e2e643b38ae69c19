"""A scene as one picture: orthoimage, height above ground and reference, side by side.

Panels: the orthoimage (where there is none, the laser intensity, else the height); the height above ground, shaded; the
reference footprints and the evaluation area over the relief.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PathCollection
from matplotlib.colors import LightSource, Normalize, to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ..core.wording import counted
from ..scenes.geodata.crs import crs_label
from ..scenes.geodata.density import point_spacing
from ..scenes.geodata.raster import Elevation, Grid
from ..scenes.geodata.surfaces import highest_surface, mean_intensity
from ..scenes.scene import Scene
from .map_elements import add_scale_bar, polygon_paths

__all__ = ["scene_figure"]

#: Most cells along a side of a panel; more would not be seen.
_MOST_CELLS = 1500
_REFERENCE, _AREA = "#d7301f", "#08519c"
_WIDTH = 4.6  # of a panel, inches


def scene_figure(scene: Scene, *, dpi: int = 130) -> Figure:
    """Return a figure of up to three panels on one scale; what the scene lacks is left out."""
    surface = _surface(scene)
    panels: list[Any] = []
    if scene.image is not None:
        panels.append(lambda axes: _draw_image(axes, scene))
    elif scene.points is not None and (intensity := mean_intensity(scene.points, _grid(scene))) is not None:
        panels.append(lambda axes: _draw_intensity(axes, intensity))
    if surface is not None:
        panels.append(lambda axes: _draw_height(axes, scene, surface))
    if scene.reference is not None or not panels:
        panels.append(lambda axes: _draw_reference(axes, scene, surface))

    xmin, ymin, xmax, ymax = scene.extent
    size = _WIDTH * len(panels) + 0.2, _panel_height(scene) + 1.0
    figure = Figure(figsize=size, dpi=dpi, layout="constrained")
    figure.suptitle(_title(scene), fontsize=11)
    for number, draw in enumerate(panels, start=1):
        axes = figure.add_subplot(1, len(panels), number)
        draw(axes)
        axes.set_xlim(xmin, xmax)
        axes.set_ylim(ymin, ymax)
        axes.set_aspect("equal")
        axes.set_xticks([])
        axes.set_yticks([])
        add_scale_bar(axes)
    return figure


def _panel_height(scene: Scene) -> float:
    """Return the height of a panel, inches."""
    xmin, ymin, xmax, ymax = scene.extent
    return _WIDTH * float(np.clip((ymax - ymin) / (xmax - xmin), 0.3, 2.5))


def _title(scene: Scene) -> str:
    xmin, ymin, xmax, ymax = scene.extent
    parts = [scene.name, f"{xmax - xmin:g} x {ymax - ymin:g} m", crs_label(scene.crs)]
    if scene.points is not None:
        parts.append(f"{len(scene.points) / ((xmax - xmin) * (ymax - ymin)):.1f} points/m²")
    return "  ·  ".join(parts)


def _grid(scene: Scene) -> Grid:
    """Return the grid of the panels: half a metre, coarser for large or sparse scenes."""
    xmin, ymin, xmax, ymax = scene.extent
    cell = max(0.5, max(xmax - xmin, ymax - ymin) / _MOST_CELLS)
    if scene.points is not None:
        spacing = point_spacing(scene.points.x, scene.points.y, scene.extent) or 0.0
        cell = max(cell, float(np.ceil(10 * spacing) / 10))
    return Grid.covering(scene.extent, cell)


def _surface(scene: Scene) -> Elevation | None:
    return None if scene.points is None else highest_surface(scene.points, _grid(scene))


def _draw_image(axes: Axes, scene: Scene) -> None:
    image = scene.image
    assert image is not None
    step = max(1, max(image.grid.shape) // _MOST_CELLS)
    if image.is_colour:
        names: tuple[str, ...] = ("red", "green", "blue")
    else:
        names = ("grey",) if "grey" in image.bands else image.bands[:1]
    view = np.dstack([image.band(name)[::step, ::step] for name in names])
    low, high = np.percentile(view, (1, 99)) if image.values.dtype == np.uint16 else (0.0, 1.0)
    view = np.clip((view - low) / max(high - low, 1e-6), 0, 1)
    view = np.repeat(view, 3, axis=2) if view.shape[2] == 1 else view
    alpha = np.ones(view.shape[:2]) if image.valid is None else image.valid[::step, ::step].astype(float)
    axes.imshow(np.dstack([view, alpha]), extent=_bounds(image.grid), interpolation="antialiased")
    bands = ", ".join(image.bands)
    axes.set_title(f"Orthoimage, {image.grid.gsd:g} m ({bands})", fontsize=9)


def _draw_intensity(axes: Axes, intensity: Elevation) -> None:
    known = intensity.values[np.isfinite(intensity.values)]
    low, high = np.percentile(known, (2, 98)) if len(known) else (0, 1)
    axes.imshow(_filled(intensity.values), cmap="gray", vmin=low, vmax=high, extent=_bounds(intensity.grid))
    axes.set_title(f"Laser intensity, {intensity.grid.gsd:g} m (no orthoimage)", fontsize=9)


def _draw_height(axes: Axes, scene: Scene, surface: Elevation) -> None:
    height, label = _above_ground(scene, surface)
    known = height[np.isfinite(height)]
    low = 0.0 if scene.dem is not None else float(np.percentile(known, 1))
    high = max(low + 3.0, float(np.percentile(known, 99.5))) if len(known) else low + 3.0
    scale = Normalize(low, high, clip=True)
    colours = colormaps["viridis"](scale(_filled(height)))
    colours[..., :3] *= (0.45 + 0.55 * _shade(surface))[..., None]
    colours[np.isnan(_filled(height))] = (1, 1, 1, 1)
    axes.imshow(colours, extent=_bounds(surface.grid), interpolation="antialiased")
    axes.set_title(f"{label}, shaded, {surface.grid.gsd:g} m", fontsize=9)
    assert axes.figure is not None
    # Inset, so that the panels stay of one size, and of one height and distance in inches on each scene.
    inch = 1.0 / _panel_height(scene)
    strip = axes.inset_axes((0.0, -0.27 * inch, 1.0, 0.13 * inch))
    bar = axes.figure.colorbar(ScalarMappable(scale, "viridis"), cax=strip, orientation="horizontal")
    bar.ax.xaxis.set_major_formatter("{x:g} m")
    bar.ax.tick_params(labelsize=8)


def _draw_reference(axes: Axes, scene: Scene, surface: Elevation | None) -> None:
    if surface is not None:
        axes.imshow(0.3 + 0.7 * _shade(surface), cmap="gray", vmin=0, vmax=1, extent=_bounds(surface.grid))
    handles: list[Any] = []
    title = "No reference"
    if scene.reference is not None:
        fill = to_rgba(_REFERENCE, 0.3)
        shapes = list(polygon_paths(scene.reference.polygons))
        axes.add_collection(PathCollection(shapes, facecolor=fill, edgecolor=_REFERENCE, linewidth=0.7))
        buildings = len(np.unique(scene.reference.building_codes))
        title = f"Reference: {counted(len(scene.reference), 'footprint')}, {counted(buildings, 'building')}"
        handles.append(Patch(facecolor=fill, edgecolor=_REFERENCE, label="reference"))
    if scene.area is not None:
        border = list(polygon_paths([scene.area]))
        axes.add_collection(PathCollection(border, facecolor="none", edgecolor=_AREA, linewidth=1.4))
        handles.append(Line2D([], [], color=_AREA, lw=1.4, label="evaluation area"))
    axes.set_title(title, fontsize=9)
    if handles:
        axes.legend(
            handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.01), ncols=2, fontsize=8, frameon=False
        )


def _above_ground(scene: Scene, surface: Elevation) -> tuple[NDArray[np.float32], str]:
    if scene.dem is None:
        return surface.values, "Height (no DEM)"
    rows, columns = np.indices(surface.grid.shape)
    x, y = surface.grid.to_world(rows + 0.5, columns + 0.5)
    return (surface.values - scene.dem.sample(x, y)).astype(np.float32), "Height above ground"


def _filled(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the values with cells nearer than 3 cells to a known one filled from it."""
    from scipy import ndimage

    distance, nearest = ndimage.distance_transform_edt(np.isnan(values), return_indices=True)
    filled: NDArray[np.float32] = values[nearest[0], nearest[1]]
    return np.where(distance <= 3, filled, np.float32(np.nan))


def _shade(surface: Elevation) -> NDArray[np.float64]:
    """Return the relief lit from the north-west, 0 to 1."""
    values = _filled(surface.values)
    values = np.where(np.isnan(values), np.nanmin(values) if np.isfinite(values).any() else 0, values)
    size = surface.grid.gsd
    shade: NDArray[np.float64] = LightSource(315, 45).hillshade(values, dx=size, dy=size, vert_exag=0.5)
    return shade


def _bounds(grid: Grid) -> tuple[float, float, float, float]:
    xmin, ymin, xmax, ymax = grid.extent
    return xmin, xmax, ymin, ymax
