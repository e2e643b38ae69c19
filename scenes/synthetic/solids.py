"""Solids: everything with straight edges, as convex bodies that rays and rasters can be intersected with.

Nouns
-----
solid
    An upright prism over a rectangle, or over a parallelogram whose ends are oblique, closed by up to four roof planes:
    a convex body of eight half-spaces ``normal . (x, y, z) <= offset``. Faces 0-3 are the walls (ends of the length,
    then sides), 4-7 the roof.
roof kind
    flat; shed (one plane, rising across the width); gable (ridge along the length); hip (four planes).
body kind
    What a solid is: building, roof structure, car, hedge, fence, carport.

Angles are radians from east towards north; lengths metres; colours red, green, blue, near infrared in 0..1.
"""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["Body", "Roof", "Solid", "Solids", "Texture"]


class Body(enum.IntEnum):
    """What a solid is."""

    BUILDING = 0
    ROOF_STRUCTURE = 1
    CAR = 2
    HEDGE = 3
    FENCE = 4
    CARPORT = 5


class Roof(enum.IntEnum):
    """Shape of a solid's top."""

    FLAT = 0
    SHED = 1
    GABLE = 2
    HIP = 3


class Texture(enum.IntEnum):
    """Look of a solid's top from above."""

    PLAIN = 0
    TILES = 1
    CORRUGATED = 2
    GRAVEL = 3
    PLANTED = 4


@dataclass
class Solid:
    """One solid during the construction of a scene.

    Attributes
    ----------
    x, y, angle, length, width : float
        Rectangle, local world coordinates; the ridge runs along the length.
    eave : float
        Height of the walls above `base`.
    base : float
        Elevation of the floor; set when the ground is known.
    slant : float
        Tangent of the angle by which both ends of the length are oblique: the length begins and ends so much later a
        metre across. The length itself and the area are the same.
    roof : Roof
    pitch : float
        Tangent of the roof's angle.
    owner : int
        Building number, -1 for none.
    body : Body
    colour, wall : tuple of float
        Of the top and of the sides.
    texture : Texture
    """

    x: float
    y: float
    angle: float
    length: float
    width: float
    eave: float = 0.0
    roof: Roof = Roof.FLAT
    pitch: float = 0.0
    owner: int = -1
    body: Body = Body.BUILDING
    colour: tuple[float, float, float, float] = (0.5, 0.5, 0.5, 0.5)
    wall: tuple[float, float, float, float] = (0.6, 0.58, 0.54, 0.5)
    texture: Texture = Texture.PLAIN
    base: float = 0.0
    slant: float = 0.0

    @property
    def ridge(self) -> float:
        """Greatest height above `base`."""
        if self.roof == Roof.SHED:
            return self.eave + self.pitch * self.width
        if self.roof in (Roof.GABLE, Roof.HIP):
            return self.eave + self.pitch * min(self.width, self.length if self.roof == Roof.HIP else self.width) / 2
        return self.eave

    def turned(self) -> Solid:
        """Return a solid over the same rectangle whose ridge runs across it."""
        return replace(self, angle=self.angle + math.pi / 2, length=self.width, width=self.length)

    def corners(self, grow: float = 0.0) -> NDArray[np.float64]:
        """Return the rectangle's corners, counter-clockwise, shape (4, 2), grown by `grow` metres each side."""
        cosine, sine = math.cos(self.angle), math.sin(self.angle)
        a, b = self.length / 2 + grow, self.width / 2 + grow
        shift = self.slant * b
        offsets = np.array([(-a - shift, -b), (a - shift, -b), (a + shift, b), (-a + shift, b)])
        corners: NDArray[np.float64] = offsets @ np.array([(cosine, sine), (-sine, cosine)]) + (self.x, self.y)
        return corners

    def half_spaces(self) -> NDArray[np.float64]:
        """Return normals and offsets, shape (8, 4); unused planes are zero with an offset of 1."""
        cosine, sine = math.cos(self.angle), math.sin(self.angle)
        planes = np.zeros((8, 4))
        planes[:, 3] = 1.0
        along, across = (cosine, sine), (-sine, cosine)
        for face, (axis, sign, half) in enumerate(
            ((along, 1, self.length), (along, -1, self.length), (across, 1, self.width), (across, -1, self.width))
        ):
            normal = (sign * axis[0], sign * axis[1])
            if self.slant and face < 2:
                # Not of unit length, which no one needs of a wall.
                normal = (normal[0] - sign * self.slant * across[0], normal[1] - sign * self.slant * across[1])
            planes[face] = (*normal, 0.0, normal[0] * self.x + normal[1] * self.y + half / 2)
        slopes: list[tuple[tuple[float, float], float, float]] = []  # axis, signed pitch, half extent
        if self.roof == Roof.FLAT:
            slopes = [(across, 0.0, 0.0)]
        elif self.roof == Roof.SHED:
            slopes = [(across, -self.pitch, self.width / 2)]
        else:
            slopes = [(across, self.pitch, self.width / 2), (across, -self.pitch, self.width / 2)]
            if self.roof == Roof.HIP:
                slopes += [(along, self.pitch, self.length / 2), (along, -self.pitch, self.length / 2)]
        for face, (axis, pitch, half) in enumerate(slopes, start=4):
            # z + pitch * t <= base + eave + |pitch| * half, with t the coordinate along the axis.
            scale = 1 / math.sqrt(1 + pitch * pitch)
            normal3 = np.array((pitch * axis[0], pitch * axis[1], 1.0)) * scale
            top = (self.base + self.eave + abs(pitch) * half) * scale
            planes[face] = (*normal3, top + normal3[0] * self.x + normal3[1] * self.y)
        return planes


@dataclass(frozen=True)
class Solids:
    """All solids of a scene as arrays, one row each.

    Attributes
    ----------
    rectangle : ndarray of float64, shape (n, 5)
        x, y, angle, length, width.
    slant : ndarray of float64, shape (n,)
    planes : ndarray of float64, shape (n, 8, 4)
        Half-spaces, see the module.
    base, eave, ridge : ndarray of float64, shape (n,)
        Elevations (not heights), metres.
    body, roof, texture : ndarray of uint8, shape (n,)
    owner : ndarray of int32, shape (n,)
    colour, wall : ndarray of float32, shape (n, 4)
    """

    rectangle: NDArray[np.float64]
    slant: NDArray[np.float64]
    planes: NDArray[np.float64]
    base: NDArray[np.float64]
    eave: NDArray[np.float64]
    ridge: NDArray[np.float64]
    body: NDArray[np.uint8]
    roof: NDArray[np.uint8]
    texture: NDArray[np.uint8]
    owner: NDArray[np.int32]
    colour: NDArray[np.float32]
    wall: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.base)

    @classmethod
    def of(cls, items: list[Solid]) -> Solids:
        """Collect solids whose base is set."""

        def column(name: str, dtype: type, width: int | None = None) -> NDArray[Any]:
            shape = (-1,) if width is None else (-1, width)
            return np.array([getattr(item, name) for item in items], dtype=dtype).reshape(shape)

        base = column("base", np.float64)
        return cls(
            rectangle=np.array(
                [(item.x, item.y, item.angle, item.length, item.width) for item in items], dtype=np.float64
            ).reshape(-1, 5),
            slant=column("slant", np.float64),
            planes=np.array([item.half_spaces() for item in items], dtype=np.float64).reshape(-1, 8, 4),
            base=base,
            eave=base + column("eave", np.float64),
            ridge=base + column("ridge", np.float64),
            body=column("body", np.uint8),
            roof=column("roof", np.uint8),
            texture=column("texture", np.uint8),
            owner=column("owner", np.int32),
            colour=column("colour", np.float32, 4),
            wall=column("wall", np.float32, 4),
        )

    @property
    def heights(self) -> NDArray[np.float64]:
        """Greatest height above the floor, metres, shape (n,)."""
        return self.ridge - self.base

    @property
    def areas(self) -> NDArray[np.float64]:
        """Ground area, m2, shape (n,)."""
        return self.rectangle[:, 3] * self.rectangle[:, 4]
