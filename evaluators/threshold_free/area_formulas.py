"""The seven area indices of T, F and M (Awrangjeb et al. 2010, 4.2.2), whichever way these areas are measured.

T, F and M are the areas of true positives, false positives and false negatives, m2. An index is None where it is 0/0.
"""

from __future__ import annotations

from typing import Protocol

from ..index import ratio

__all__ = [
    "ErrorAreas",
    "area_commission",
    "area_completeness",
    "area_correctness",
    "area_omission",
    "area_quality",
    "branching",
    "miss",
]


class ErrorAreas(Protocol):
    """T, F and M, m2."""

    @property
    def true_positive(self) -> float:
        """T."""

    @property
    def false_positive(self) -> float:
        """F."""

    @property
    def false_negative(self) -> float:
        """M."""


def area_completeness(areas: ErrorAreas) -> float | None:
    """Return T/(T+M)."""
    return ratio(areas.true_positive, areas.true_positive + areas.false_negative)


def area_correctness(areas: ErrorAreas) -> float | None:
    """Return T/(T+F)."""
    return ratio(areas.true_positive, areas.true_positive + areas.false_positive)


def area_quality(areas: ErrorAreas) -> float | None:
    """Return T/(T+F+M)."""
    return ratio(areas.true_positive, areas.true_positive + areas.false_positive + areas.false_negative)


def area_omission(areas: ErrorAreas) -> float | None:
    """Return M/(T+M)."""
    return ratio(areas.false_negative, areas.true_positive + areas.false_negative)


def area_commission(areas: ErrorAreas) -> float | None:
    """Return F/(T+F)."""
    return ratio(areas.false_positive, areas.true_positive + areas.false_positive)


def branching(areas: ErrorAreas) -> float | None:
    """Return F/T."""
    return ratio(areas.false_positive, areas.true_positive)


def miss(areas: ErrorAreas) -> float | None:
    """Return M/T."""
    return ratio(areas.false_negative, areas.true_positive)
