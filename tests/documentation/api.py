"""The page of the Python API: signature and docstring of every public name and of the methods of its classes."""

from __future__ import annotations

import inspect
import re

import roofbench
from roofbench.core.package import HOMES

__all__ = ["page"]

_SECTION = re.compile(r"^([A-Z][\w ]+)\n-{3,}$", re.MULTILINE)


def _text(documented: object) -> str:
    """Return a docstring as Markdown: section titles bold, examples and parameter lists as they stand."""
    doc = inspect.getdoc(documented) or ""
    parts = _SECTION.split(doc)
    text = _prose(parts[0])
    for title, body in zip(parts[1::2], parts[2::2], strict=True):
        text += f"\n\n**{title}**\n\n```text\n{body.strip()}\n```"
    return text.strip()


def _prose(text: str) -> str:
    return re.sub(r"``([^`]+)``", r"`\1`", text).strip()


def _signature(name: str, documented: object) -> str:
    try:
        signature = str(inspect.signature(documented))  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return name
    signature = re.sub(r"<[^>]*>", "...", signature.replace("'", ""))
    return f"{name}{signature}"


def _methods(owner: type) -> list[tuple[str, object]]:
    found = []
    for name, value in vars(owner).items():
        if name.startswith("_"):
            continue
        if isinstance(value, classmethod | staticmethod):
            value = value.__func__
        if inspect.isfunction(value) and inspect.getdoc(value):
            found.append((name, value))
    return found


def page() -> str:
    """Return the page in Markdown."""
    parts = [
        "# Python API",
        "<!-- Written by python -m tests.documentation.reference from the docstrings. -->",
        "`import roofbench as rb` gives these names; everything else is internal and may change. Lengths are in "
        "metres, areas in square metres, coordinates in the order x (east), y (north).",
    ]
    for name in sorted(HOMES, key=str.lower):
        value = getattr(roofbench, name)
        parts += [f"## {name}", f"```py\n{_signature(f'rb.{name}', value)}\n```", _text(value)]
        if inspect.isclass(value):
            for method, function in _methods(value):
                parts += [f"### {name}.{method}", f"```text\n{_signature(method, function)}\n```", _text(function)]
    return "\n\n".join(part for part in parts if part) + "\n"
