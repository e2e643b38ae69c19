"""A scene as one small picture, the background for the verdicts in a report.

A *picture* is the orthoimage, or where there is none the height above ground, shaded, as WebP. It covers the extent of
the scene exactly, row 0 in the north. Workers make it while the scene is open, so that a report neither generates nor
reads it again; matplotlib is not needed.
"""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Bitmap

from ...scenes.geodata.density import point_spacing
from ...scenes.geodata.raster import Grid, Image
from ...scenes.geodata.surfaces import highest_surface
from ...scenes.scene import Scene

__all__ = ["ScenePicture", "scene_picture"]

#: Maximum number of pixels along the longer side, and the smallest pixel in metres: a shed is visible, the file small.
_MOST_PIXELS = 1600
_FINEST = 0.2
_QUALITY = 82
#: Height above ground (m) to colour: ground, hedges, houses, halls, towers; light to dark, so that it works in grey.
_HEIGHTS = (0.0, 2.0, 5.0, 10.0, 20.0, 60.0)
_TINTS = ((236, 233, 226), (206, 213, 190), (140, 178, 170), (79, 134, 155), (58, 84, 128), (52, 36, 88))


@dataclass(frozen=True)
class ScenePicture:
    """A picture that covers the extent of a scene.

    Attributes
    ----------
    content : bytes
        WebP file.
    width, height : int
        Pixels.
    shows : str
        What the picture shows, as a caption.
    """

    content: bytes
    width: int
    height: int
    shows: str

    @classmethod
    def read(cls, content: bytes, shows: str = "") -> ScenePicture:
        """Return a picture of its file."""
        with Bitmap.open(io.BytesIO(content)) as bitmap:
            return cls(content, bitmap.width, bitmap.height, shows or str(bitmap.getexif().get(_DESCRIPTION, "")))

    def at_most(self, pixels: int, *, quality: int = 70) -> ScenePicture:
        """Return the picture with at most `pixels` along its longer side."""
        with Bitmap.open(io.BytesIO(self.content)) as bitmap:
            bitmap.thumbnail((pixels, pixels), Bitmap.Resampling.LANCZOS)
            return _encoded(bitmap, self.shows, quality)

    def cut(self, box: tuple[float, float, float, float], size: int) -> ScenePicture:
        """Return a square part of ``size`` pixels; the box ``(left, upper, right, lower)`` is in pixels."""
        with Bitmap.open(io.BytesIO(self.content)) as bitmap:
            part = bitmap.convert("RGB").transform(
                (size, size), Bitmap.Transform.EXTENT, box, Bitmap.Resampling.BICUBIC, fillcolor=(128, 128, 128)
            )
            return _encoded(part, self.shows, 75)


#: EXIF tag "ImageDescription".
_DESCRIPTION = 270


def scene_picture(scene: Scene) -> ScenePicture | None:
    """Return the picture of a scene; None when it has neither image nor points."""
    xmin, ymin, xmax, ymax = scene.extent
    pixel = max(_FINEST, max(xmax - xmin, ymax - ymin) / _MOST_PIXELS)
    size = max(1, round((xmax - xmin) / pixel)), max(1, round((ymax - ymin) / pixel))
    image = scene.image
    if image is not None:
        bitmap = _fitted(Bitmap.fromarray(_visible(image)), image.grid, scene.extent, size)
        return _encoded(bitmap, f"orthoimage, {image.grid.gsd:g} m ({', '.join(image.bands)})", _QUALITY)
    if scene.points is None or not len(scene.points):
        return None
    spacing = point_spacing(scene.points.x, scene.points.y, scene.extent) or 0.0
    grid = Grid.covering(scene.extent, max(pixel, float(np.ceil(10 * spacing) / 10)))
    surface = highest_surface(scene.points, grid).values
    if np.isnan(surface).all():
        return None
    height, ground = _height(scene, surface, grid)
    bitmap = _fitted(Bitmap.fromarray(_tinted(height, grid.gsd)), grid, scene.extent, size)
    shown = "height above ground" if ground else "height above the lowest point"
    return _encoded(bitmap, f"{shown}, shaded, {grid.gsd:g} m (no orthoimage)", _QUALITY)


def _encoded(bitmap: Bitmap.Image, shows: str, quality: int) -> ScenePicture:
    file = io.BytesIO()
    exif = Bitmap.Exif()
    exif[_DESCRIPTION] = shows.encode("ascii", "replace").decode()
    bitmap.convert("RGB").save(file, "WEBP", quality=quality, method=2, exif=exif)
    return ScenePicture(file.getvalue(), bitmap.width, bitmap.height, shows)


def _visible(image: Image) -> NDArray[np.uint8]:
    """Return red, green and blue as bytes; without them the first band as grey. No data is grey."""
    if image.is_colour:
        names: tuple[str, ...] = ("red", "green", "blue")
    else:
        names = ("grey",) if "grey" in image.bands else image.bands[:1]
    chosen = image.values[[image.bands.index(name) for name in names]]
    if chosen.dtype != np.uint8:
        low, high = np.percentile(chosen[:, ::4, ::4], (1, 99))
        chosen = np.clip((chosen.astype(np.float32) - low) * (255 / max(high - low, 1)), 0, 255).astype(np.uint8)
    view = np.ascontiguousarray(np.moveaxis(np.broadcast_to(chosen, (3, *image.grid.shape)), 0, -1))
    if image.valid is not None:
        view[~image.valid] = 128
    return view


def _fitted(
    bitmap: Bitmap.Image, grid: Grid, extent: tuple[float, float, float, float], size: tuple[int, int]
) -> Bitmap.Image:
    """Return the part of a picture on a grid that an extent covers, at a size in pixels."""
    upper, left = grid.to_pixel(extent[0], extent[3])
    lower, right = grid.to_pixel(extent[2], extent[1])
    # First reduced by averaging whole blocks: a transform alone would skip pixels (aliasing).
    step = max(1, int(min((right - left) / size[0], (lower - upper) / size[1])))
    reduced = bitmap.reduce(step) if step > 1 else bitmap
    box = (float(left) / step, float(upper) / step, float(right) / step, float(lower) / step)
    return reduced.transform(size, Bitmap.Transform.EXTENT, box, Bitmap.Resampling.BICUBIC, fillcolor=(128, 128, 128))


def _height(scene: Scene, surface: NDArray[np.float32], grid: Grid) -> tuple[NDArray[np.float32], bool]:
    """Return the highest point per cell, gaps filled from the nearest, and whether it is above ground."""
    from scipy import ndimage

    nearest = ndimage.distance_transform_edt(np.isnan(surface), return_distances=False, return_indices=True)
    filled: NDArray[np.float32] = surface[nearest[0], nearest[1]]
    if scene.dem is None:
        return filled - np.float32(np.nanpercentile(filled, 1)), False
    rows, columns = np.indices(grid.shape)
    ground = scene.dem.sample(*grid.to_world(rows + 0.5, columns + 0.5))
    return np.nan_to_num(filled - ground).astype(np.float32), True


def _tinted(height: NDArray[np.float32], cell: float) -> NDArray[np.uint8]:
    """Return heights as colours, lit from the north-west at 45 degrees."""
    tints = np.array(_TINTS, dtype=np.float64)
    colour = np.stack([np.interp(height, _HEIGHTS, tints[:, band]) for band in range(3)], axis=-1)
    if min(height.shape) > 1:
        south, east = np.gradient(np.clip(height, -2, 80), cell)
        # Half the relief, so that the faces of low roofs and of towers are both visible.
        south, east = 0.5 * south, 0.5 * east
        light = (1 + (east + south) / np.sqrt(2)) / np.sqrt(2 * (1 + east**2 + south**2))
        colour *= (0.5 + 0.5 * np.clip(light / np.sqrt(0.5), 0, 1.25))[..., None]
    return np.clip(colour, 0, 255).astype(np.uint8)
