"""The rasters that the steps of the line detectors use, all on the grid of the orthoimage."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from ...scenes.geodata.raster import Grid, Image
from .box_smoothness import Smoothness
from .colours import Colours
from .entropy_scale import EntropyScale
from .extension import Cover
from .masks import Masks

__all__ = ["Rasters", "refined"]


@dataclass(frozen=True, eq=False)
class Rasters:
    """The rasters of a scene.

    Attributes
    ----------
    image : Image
    masks : Masks
    cover : Cover
    colours : Colours
    spacing : float
        Point spacing, metres.
    entropy_limit : float
        Mean of the entropy raster above which a green area is a tree.
    scale : EntropyScale, optional
        Scale of the image's entropy; none where it is not used.
    own_pixel : float
        Pixel of the image as it was given, metres: that of `image` may be finer.
    smoothness : Smoothness, optional
        Of the laser points; none where it is not used.
    """

    image: Image
    masks: Masks
    cover: Cover
    colours: Colours
    spacing: float
    entropy_limit: float = 0.0
    scale: EntropyScale | None = None
    own_pixel: float = 0.0
    smoothness: Smoothness | None = None

    @property
    def gsd(self) -> float:
        """Ground sampling distance, metres."""
        return self.image.grid.gsd


def refined(image: Image, largest: float) -> Image:
    """Return an image whose pixels are at most `largest` metres wide, interpolated linearly; fine ones unchanged."""
    grid = image.grid
    parts = math.ceil(grid.gsd / largest - 1e-9)
    if parts <= 1 or not image.values.size:
        return image
    fine = Grid(grid.west, grid.north, grid.gsd / parts, grid.rows * parts, grid.columns * parts)
    size = (fine.columns, fine.rows)
    values = np.empty((len(image.values), *fine.shape), dtype=image.values.dtype)
    for band, finer in zip(image.values, values, strict=True):
        cv2.resize(band, size, dst=finer, interpolation=cv2.INTER_LINEAR)
    valid = None if image.valid is None else image.valid.repeat(parts, axis=0).repeat(parts, axis=1)
    return Image(values, image.bands, fine, valid)
