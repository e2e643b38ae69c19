"""How verdicts are drawn: a colour for each role that an evaluator may give to a verdict kind.

Colours are those of Okabe & Ito, which people with any colour vision can distinguish; missing objects are hatched, too.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from ..evaluators.verdict_table import ColourRole, Side, VerdictKind, Verdicts

if TYPE_CHECKING:
    from ..evaluators.uncertainty.paired import Fate

__all__ = ["FATE_LOOKS", "ROLE_STYLE", "FateLook", "RoleStyle", "filled_kinds"]


class RoleStyle(NamedTuple):
    """Colour, matplotlib hatch, and opacity: alone on a white map, over a picture, and in the report's viewer."""

    colour: str
    hatch: str | None
    on_map: float
    on_picture: float
    in_viewer: float


ROLE_STYLE: Mapping[ColourRole, RoleStyle] = {
    "correct": RoleStyle("#009E73", None, 0.75, 0.5, 0.32),
    "partial": RoleStyle("#E69F00", None, 0.75, 0.5, 0.55),
    "excess": RoleStyle("#D55E00", None, 0.75, 0.5, 0.55),
    "missing": RoleStyle("#0072B2", "////", 0.35, 0.3, 0.9),
    "left out": RoleStyle("#BBBBBB", None, 0.35, 0.2, 0.2),
    "outline": RoleStyle("#000000", None, 0.0, 0.0, 0.0),
}


class FateLook(NamedTuple):
    """Colour, opacity and matplotlib hatch of what becomes of a reference in two detections."""

    colour: str
    opacity: float
    hatch: str | None = None


FATE_LOOKS: Mapping[Fate, FateLook] = {
    "both": FateLook("#009E73", 0.35),
    "only A": FateLook("#0072B2", 0.85),
    "only B": FateLook("#D55E00", 0.85),
    "neither": FateLook("#000000", 0.15, "////"),
    "left out": FateLook("#BBBBBB", 0.3),
}


def filled_kinds(verdicts: Verdicts, side: Side) -> list[VerdictKind]:
    """Return the kinds of a side that are filled, in drawing order: left-out objects below the others."""
    kinds = [kind for kind in verdicts.kinds_of(side) if kind.role != "outline"]
    return sorted(kinds, key=lambda kind: kind.counts_as != "neutral")
