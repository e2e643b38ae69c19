"""Colours of roles and scales.

The colours of roles are those of Okabe & Ito (2008), which people with any colour vision can separate. Sequential maps
(viridis) grow lighter throughout; diverging ones run from red over light yellow to blue, never from red to green.
"""

from __future__ import annotations

from ...detectors.steps import Role, Scale

__all__ = ["MISSING", "ROLE_COLOURS", "colour_map"]

#: Cells without a value.
MISSING = "#d9d9d9"

ROLE_COLOURS = {
    Role.RESULT: "#0072b2",
    Role.INPUT: "#000000",
    Role.ADDED: "#f0e442",
    Role.REMOVED: "#d55e00",
    Role.REPEATED: "#56b4e9",
    Role.CANDIDATE: "#e69f00",
    Role.SMALL: "#cc79a7",
    Role.VEGETATION: "#009e73",
    Role.BORDER: "#777777",
    Role.SOLID: "#333333",
    Role.FAINT: "#bfbfbf",
    Role.BACKGROUND: "#ffffff",
}

_COLOUR_MAPS = {"sequential": "viridis", "diverging": "RdYlBu", "grey": "gray"}


def colour_map(scale: Scale) -> str:
    """Return the name of the matplotlib colour map of a scale."""
    return _COLOUR_MAPS[scale.kind]
