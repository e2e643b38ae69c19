"""The contents of a scene as text: a section for each part, a line for each fact."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..core.parameter_rules import parameter_text
from ..scenes import builtin
from ..scenes.synthetic import SceneParameters, preset_names
from ..scenes.synthetic.presets import preset
from .tables import Column, Table

__all__ = ["format_facts", "format_parameters", "format_presets"]

#: Unit of a fact, by the last word of its name.
_UNITS = {"density": "/m²", "gsd": "m", "height": "m", "width": "m", "area": "m²"}


def format_facts(facts: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the facts of a scene, as `scenes.checking` collects them, in aligned lines."""
    lines = []
    for part, values in facts.items():
        lines.append(part)
        width = max(map(len, values), default=0)
        lines += [f"  {key.replace('_', ' '):<{width}}  {_printed(key, value)}" for key, value in values.items()]
    return "".join(f"{line}\n" for line in lines)


def _printed(key: str, value: Any) -> str:
    """Return a fact with its unit."""
    unit = _UNITS.get(key.rpartition("_")[2], "")
    if isinstance(value, bool):
        return "yes" if value else "no"
    if key.endswith(("share", "coverage")):
        return f"{value:.1%}"
    if isinstance(value, dict):
        return ", ".join(f"{name}: {count}" for name, count in value.items())
    if isinstance(value, list):
        return (" to " if unit else ", ").join(_printed("", item) for item in value) + (f" {unit}" if unit else "")
    if isinstance(value, float):
        value = f"{value:.10g}" if value.is_integer() else f"{value:.2f}"
    return f"{value} {unit}".rstrip()


def format_parameters() -> str:
    """Return the parameters of the generator with default, unit, range and meaning."""
    rows = [
        (rule.name, parameter_text(rule.default), rule.unit, rule.range_text, rule.doc)
        for rule in SceneParameters.parameters().values()
    ]
    titles = ("parameter", "default", "unit", "range", "meaning")
    return Table.of((Column(title, "left") for title in titles), rows).to_text()


def format_presets() -> str:
    """Return the synthetic scenes with extent, reference, image and points."""
    side = f"{builtin.SIZE:g}"
    spacing = builtin.DENSITY**-0.5
    rows = [
        ("hamlet", f"{side} x {side} m", "about 30 rectangles", f"rgb {builtin.GSD:g} m", f"all {spacing:.1f} m"),
    ]
    for name in preset_names():
        recipe = preset(name)
        image = "none" if recipe.bands == "none" else f"{recipe.bands} {recipe.gsd:g} m"
        extent = f"{recipe.width:g} x {recipe.height:g} m"
        rows.append(
            (name, extent, f"{recipe.buildings} {recipe.counted}", image, f"{recipe.pulse} {recipe.point_spacing:g} m")
        )
    titles = ("preset", "extent", "reference", "image", "pulses, spacing")
    return Table.of((Column(title, "left") for title in titles), rows).to_text()
