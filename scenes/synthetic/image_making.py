"""How an orthoimage came about besides the photograph: from colours of points, and what was done to it afterwards.

A laser point takes the colour of the orthoimage where it lies. As the image leans, a point on a roof may have the
colour of a wall or of the ground beside it. Real clouds are coloured in this way, and images are made of them again.
"""

from __future__ import annotations

import dataclasses
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from ..geodata.coloured_points import image_from_points
from ..geodata.points import PointCloud
from ..geodata.raster import Image
from .recipe import SceneParameters

__all__ = ["coloured_points", "processed", "rastered"]

#: Pixel of an image made of points, point spacings: half of its cells have no point.
_PIXEL = 0.7
#: Pixel of a resampled image, and standard deviation of a blurred one, metres.
_COARSE, _BLUR = 0.5, 0.3
#: Quality of a compressed image.
_QUALITY = 20
#: Standard deviation of the unsharp mask in pixels, and its amount.
_UNSHARP, _AMOUNT = 1.5, 1.5


def coloured_points(points: PointCloud, image: Image) -> PointCloud:
    """Return the points with the colour of the pixel that each lies in; those beside the image take the nearest."""
    column, row = ((points.x - image.grid.west) / image.grid.gsd, (image.grid.north - points.y) / image.grid.gsd)
    rows = np.clip(row.astype(np.intp), 0, image.grid.rows - 1)
    columns = np.clip(column.astype(np.intp), 0, image.grid.columns - 1)
    colour = image.values[:, rows, columns].T.astype(np.uint16) * 257
    return dataclasses.replace(points, colour=np.ascontiguousarray(colour))


def rastered(points: PointCloud, extent: tuple[float, float, float, float], recipe: SceneParameters) -> Image | None:
    """Return the image made of coloured points; None when the recipe has no bands."""
    if points.colour is None:
        return None
    fill: Literal["interpolated", "nearest"] = "nearest" if recipe.image_from == "nearest" else "interpolated"
    return image_from_points(points, extent, gsd=_PIXEL * recipe.point_spacing, fill=fill)


def processed(image: Image, processing: str) -> Image:
    """Return the image after one kind of processing (see `SceneParameters.image_processing`)."""
    if processing == "none":
        return image
    values = image.values.astype(np.uint8)
    if processing == "compressed":
        return dataclasses.replace(image, values=_compressed(values))
    changed = np.stack([_PROCESSED[processing](band, image.grid.gsd) for band in values])
    return dataclasses.replace(image, values=changed)


def _resampled(band: NDArray[np.uint8], gsd: float) -> NDArray[np.uint8]:
    rows, columns = (max(1, round(size * gsd / _COARSE)) for size in band.shape)
    coarse = cv2.resize(band, (columns, rows), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.resize(coarse, band.shape[::-1], interpolation=cv2.INTER_LINEAR))


def _sharpened(band: NDArray[np.uint8], gsd: float) -> NDArray[np.uint8]:
    values = band.astype(np.float32)
    smooth = cv2.GaussianBlur(values, (0, 0), _UNSHARP)
    return np.asarray(np.clip(np.rint(values + _AMOUNT * (values - smooth)), 0, 255), dtype=np.uint8)


def _blurred(band: NDArray[np.uint8], gsd: float) -> NDArray[np.uint8]:
    return np.asarray(cv2.GaussianBlur(band, (0, 0), _BLUR / gsd))


_PROCESSED = {"resampled": _resampled, "sharpened": _sharpened, "blurred": _blurred}


def _compressed(values: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the bands after JPEG compression: red, green and blue together, as subsampling of colours needs them."""
    parts = [np.ascontiguousarray(np.moveaxis(values[2::-1], 0, -1)), *values[3:]]
    colour, *others = (
        np.asarray(cv2.imdecode(code, cv2.IMREAD_UNCHANGED), dtype=np.uint8)
        for _, code in (cv2.imencode(".jpg", part, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY]) for part in parts)
    )
    return np.stack([*np.moveaxis(colour[..., ::-1], -1, 0), *others])
