"""The rasters that the steps of the line detectors use, all on the grid of the orthoimage."""

from __future__ import annotations

from dataclasses import dataclass

from ...scenes.geodata.raster import Image
from .colours import Colours
from .extension import Cover
from .masks import Masks

__all__ = ["Rasters"]


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
    """

    image: Image
    masks: Masks
    cover: Cover
    colours: Colours
    spacing: float

    @property
    def gsd(self) -> float:
        """Ground sampling distance, metres."""
        return self.image.grid.gsd
