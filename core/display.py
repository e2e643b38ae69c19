"""Objects that show themselves in notebooks.

An object says which function draws it, by name, as a registry does: pictures and tables belong to a higher room, which
is imported when a notebook asks and not before.
"""

from __future__ import annotations

import importlib
from typing import ClassVar

from .package import NAME

__all__ = ["Displayed"]


class Displayed:
    """Mixin of objects with a view for notebooks.

    Attributes
    ----------
    shown_by : str
        ``"module:function"`` in the package; the function takes the object and returns HTML.
    """

    shown_by: ClassVar[str]

    def _repr_html_(self) -> str:
        """Return the HTML that a notebook shows."""
        module, _, function = self.shown_by.partition(":")
        text: str = getattr(importlib.import_module(f"{NAME}.{module}"), function)(self)
        return text
