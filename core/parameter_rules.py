"""Rules of one parameter: its type, range and meaning, how a value is read, checked and written."""

from __future__ import annotations

import math
import numbers
from dataclasses import dataclass
from typing import Any

from .errors import ParameterError

__all__ = ["Parameter", "parameter_text"]


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """What is known of one parameter.

    Attributes
    ----------
    name : str
        Field name.
    type : type
        float, int, bool or str (the part besides ``None`` of an optional one).
    optional : bool
        Whether ``None`` is a value.
    default : object
    unit : str
        ``"m"``, ``"px"``, ``"deg"``; empty for a pure number.
    minimum, maximum : float, optional
        Closed range of a number.
    choices : tuple
        The values of an enumeration; empty when any is allowed.
    doc, source : str
        Meaning in words, and where the value is printed.
    swept : tuple
        Values a paper (or we) sweep.
    """

    name: str
    type: type
    optional: bool
    default: Any
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[Any, ...] = ()
    doc: str = ""
    source: str = ""
    swept: tuple[Any, ...] = ()

    @property
    def is_reading(self) -> bool:
        """Whether its source leaves it open, so that it is our reading or comes from a program."""
        return bool({"reading", "program"} & {part.strip() for part in self.source.split(";")})

    @property
    def range_text(self) -> str:
        """The rule in words, for messages and documentation."""
        if self.choices:
            named = [str(choice) for choice in self.choices if choice != ""]
            return "one of " + ", ".join(named) + (", or empty" if "" in self.choices else "")
        unit = f" {self.unit}" if self.unit else ""
        if self.minimum is not None and self.maximum is not None:
            return f"from {self.minimum:g} to {self.maximum:g}{unit}"
        if self.minimum is not None:
            return f"at least {self.minimum:g}{unit}"
        if self.maximum is not None:
            return f"at most {self.maximum:g}{unit}"
        return {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}[self.type]

    def check(self, value: Any, owner: str) -> Any:
        """Return `value` as this parameter's type, or raise `ParameterError` naming rule and remedy."""
        if value is None and self.optional:
            return None
        wanted = ParameterError(f"{owner}: {self.name} must be {self.range_text}, not {value!r}")
        if self.type is bool:
            if not isinstance(value, bool):
                raise wanted
        elif self.type in (int, float):
            if isinstance(value, bool) or not isinstance(value, numbers.Real):
                raise wanted
            if not math.isfinite(value):
                raise ParameterError(f"{owner}: {self.name} must be a finite number {self.range_text}, not {value!r}")
            number = float(value)
            if self.type is int and not number.is_integer():
                raise wanted
            value = self.type(number)
            if self.minimum is not None and value < self.minimum:
                raise wanted
            if self.maximum is not None and value > self.maximum:
                raise wanted
        elif not isinstance(value, str):
            raise wanted
        if self.choices and value not in self.choices:
            raise wanted
        return value

    def parse(self, text: str, owner: str) -> Any:
        """Read a value from the command line, e.g. ``"400"`` or ``"true"``."""
        plain = text.strip().strip("\"'")
        if self.optional and plain.lower() in ("none", "null", ""):
            return None
        value: Any = plain
        if self.type is bool:
            value = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}.get(
                plain.lower(), plain
            )
        elif self.type in (int, float):
            try:
                value = float(plain)
            except ValueError:
                value = plain
        return self.check(value, owner)


def parameter_text(value: Any) -> str:
    """Return the value of a parameter as labels and tables write it.

    >>> parameter_text(0.25), parameter_text(3.0), parameter_text("exact")
    ('0.25', '3', 'exact')
    """
    return f"{value:g}" if isinstance(value, float) else str(value)
