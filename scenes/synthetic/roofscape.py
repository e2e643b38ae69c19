"""Roof structures: chimneys, dormers, solar panels, skylights, plant rooms, air conditioners.

They make roofs rough for the laser and add lines to the image; the reference ignores them.
"""

from __future__ import annotations

import math
from typing import Protocol

from .layout import HALLS, TOWERS
from .palettes import BRICK, shaded
from .solids import Body, Roof, Solid, Texture

__all__ = ["furnish"]

_PANEL = (0.13, 0.15, 0.23, 0.15)
_STEEL = (0.70, 0.71, 0.72, 0.66)
_GLASS = (0.62, 0.70, 0.74, 0.55)


class Numbers(Protocol):
    """A source of uniform draws (see `buildings.Draws`)."""

    def unit(self) -> float:
        """Return the next number in [0, 1)."""
        ...

    def between(self, low: float, high: float) -> float:
        """Return a number between two bounds."""
        ...

    def chance(self, share: float) -> bool:
        """Return whether an event of this probability happens."""
        ...


def _on(host: Solid, along: float, across: float, length: float, width: float, lift: float, **more: object) -> Solid:
    """Return a solid on a host's roof; `along`, `across` from its centre; `lift` above the roof there, metres."""
    cosine, sine = math.cos(host.angle), math.sin(host.angle)
    values: dict[str, object] = {"colour": _STEEL, "wall": _STEEL, "body": Body.ROOF_STRUCTURE, **more}
    return Solid(
        host.x + cosine * along - sine * across,
        host.y + sine * along + cosine * across,
        host.angle,
        length,
        width,
        roof_height(host, along, across) + lift,
        **values,  # type: ignore[arg-type]
    )


def roof_height(host: Solid, along: float, across: float) -> float:
    """Return the height of a roof above the floor at a place given along and across its rectangle."""
    if host.roof == Roof.FLAT:
        return host.eave
    if host.roof == Roof.SHED:
        return host.eave + host.pitch * (host.width / 2 + across)
    inwards = host.width / 2 - abs(across)
    if host.roof == Roof.HIP:
        inwards = min(inwards, host.length / 2 - abs(along))
    return host.eave + host.pitch * inwards


def furnish(group: list[Solid], zone: int, draws: Numbers, *, chimney: bool = True) -> list[Solid]:
    """Return the structures on the roofs of a building: dormers, plant, and on pitched roofs of houses a chimney."""
    host = group[0]
    if zone == TOWERS:
        return [item for part in group for item in _plant(part, draws)]
    if zone == HALLS:
        return _ridge_vents(host, draws)
    return _domestic(host, draws, chimney)


def _domestic(host: Solid, draws: Numbers, with_chimney: bool) -> list[Solid]:
    items = []
    chimney, panels, dormer, cooler = draws.unit(), draws.unit(), draws.unit(), draws.unit()
    along, across = draws.between(-0.3, 0.3) * host.length, draws.between(0.05, 0.2) * host.width
    if host.roof in (Roof.GABLE, Roof.HIP):
        if with_chimney and chimney < 0.6:
            items.append(_on(host, along, across, 0.7, 0.55, 0.9, colour=BRICK, wall=BRICK))
        side = 1.0 if draws.chance(0.5) else -1.0
        if panels < 0.22:
            items += _panels(host, side, draws)
        elif dormer < 0.3 and host.pitch > 0.55:
            # A dormer is a small gable across the roof; its ridge meets the main roof further up.
            items.append(
                Solid(
                    *_offset(host, -along, side * host.width * 0.27),
                    host.angle + math.pi / 2,
                    host.width * 0.34,
                    2.2,
                    roof_height(host, -along, side * host.width * 0.34) + 0.7,
                    roof=Roof.GABLE,
                    pitch=0.5,
                    body=Body.ROOF_STRUCTURE,
                    colour=host.colour,
                    wall=host.wall,
                    texture=host.texture,
                )
            )
        if cooler < 0.18:
            items.append(_on(host, along * 0.5 + 1.5, -across, 1.1, 1.1, 0.6))
    elif chimney < 0.5:
        items.append(_on(host, along, across, 1.2, 1.0, 0.7))
    return items


def _panels(host: Solid, side: float, draws: Numbers) -> list[Solid]:
    """Solar panels, some centimetres over one face: thin solids with the roof's own pitch."""
    length = min(host.length * 0.4, draws.between(3.2, 7.0))
    width = min(host.width * 0.3, 3.4)
    across = side * host.width * 0.25
    rise = roof_height(host, 0, across + side * width / 2)
    # A shed's low side is at negative v; turn it so that it faces the eave.
    return [
        Solid(
            *_offset(host, draws.between(-0.15, 0.15) * host.length, across),
            host.angle + (math.pi if side > 0 else 0.0),
            length,
            width,
            rise + 0.12,
            roof=Roof.SHED,
            pitch=host.pitch,
            body=Body.ROOF_STRUCTURE,
            colour=_PANEL,
            wall=_PANEL,
        )
    ]


def _offset(host: Solid, along: float, across: float) -> tuple[float, float]:
    cosine, sine = math.cos(host.angle), math.sin(host.angle)
    return host.x + cosine * along - sine * across, host.y + sine * along + cosine * across


def _ridge_vents(host: Solid, draws: Numbers) -> list[Solid]:
    """Skylight strips and ventilators of a hall."""
    items = []
    if draws.chance(0.55):
        for place in (-0.3, -0.1, 0.1, 0.3):
            items.append(_on(host, place * host.length, 0.25 * host.width, 1.1, host.width * 0.3, 0.03, colour=_GLASS))
    for _ in range(3):
        along, across = draws.between(-0.42, 0.42) * host.length, draws.between(-0.4, 0.4) * host.width
        if draws.chance(0.6):
            items.append(
                _on(host, along, across, draws.between(1.0, 2.6), draws.between(1.0, 2.2), draws.between(0.5, 1.3))
            )
    return items


def _plant(host: Solid, draws: Numbers) -> list[Solid]:
    """Plant room and machines on a downtown roof."""
    items = []
    dark = shaded(host.colour, 0.75)
    along, across = draws.between(-0.15, 0.15) * host.length, draws.between(-0.15, 0.15) * host.width
    if host.length > 14 and host.width > 10:
        share = draws.between(0.25, 0.45)
        items.append(
            _on(
                host,
                along,
                across,
                host.length * share,
                host.width * share,
                draws.between(2.2, 5.0),
                colour=dark,
                wall=host.wall,
                texture=Texture.GRAVEL,
            )
        )
    for _ in range(4):
        along, across = draws.between(-0.42, 0.42) * host.length, draws.between(-0.4, 0.4) * host.width
        size = draws.between(1.2, 3.6), draws.between(1.0, 2.4)
        if draws.chance(0.55):
            items.append(_on(host, along, across, *size, draws.between(0.8, 2.2)))
    return items
