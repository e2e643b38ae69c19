"""Conditions: beside which values of other parameters a parameter counts.

A *condition* is a rule for one value, in words and as a function. The *use* of a parameter maps other parameters to the
values or conditions beside which it counts; one that is met is enough. Several uses must all be met.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

__all__ = ["ABOVE_ZERO", "AT_MOST_ONE", "GIVEN", "Condition", "Uses", "counts_beside", "uses_in_words"]


@dataclass(frozen=True)
class Condition:
    """A rule for the value of a parameter.

    Attributes
    ----------
    words : str
        Follows the name of the parameter: ``"above 0"``.
    holds : callable
    """

    words: str
    holds: Callable[[Any], bool]


#: Conditions of several detectors.
GIVEN = Condition("other than none", lambda value: value is not None)
ABOVE_ZERO = Condition("above 0", lambda value: value > 0)
AT_MOST_ONE = Condition("of at most 1", lambda value: value <= 1)

_Use = Mapping[str, tuple[Any, ...]]
Uses = _Use | tuple[_Use, ...]


def counts_beside(uses: Uses, value_of: Callable[[str], Any]) -> bool:
    """Return whether a parameter of such uses counts beside the values of the others.

    >>> counts_beside({"voting": (True,), "edges": (GIVEN,)}, {"voting": False, "edges": 0.5}.__getitem__)
    True
    """
    return all(
        any(_is_met(one, value_of(other)) for other, found in use.items() for one in found) for use in _each(uses)
    )


def uses_in_words(uses: Uses, text_of: Callable[[Any], str]) -> str:
    """Return the uses of a parameter for a message.

    >>> uses_in_words(({"texture": ("tests",)}, {"peaks": ("maxima",), "edges": (GIVEN,)}), str)
    'texture=tests, and with peaks=maxima or edges other than none'
    """
    return ", and with ".join(
        " or ".join(
            f"{other} {one.words}" if isinstance(one, Condition) else f"{other}={text_of(one)}"
            for other, found in use.items()
            for one in found
        )
        for use in _each(uses)
    )


def _each(uses: Uses) -> Iterator[_Use]:
    yield from (uses,) if isinstance(uses, Mapping) else uses


def _is_met(one: Any, value: Any) -> bool:
    return one.holds(value) if isinstance(one, Condition) else bool(one == value)
