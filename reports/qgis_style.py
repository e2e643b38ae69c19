"""Styles for QGIS: features coloured by a column, and labelled by another one on large scales.

A GeoPackage carries the style of each layer (`scenes.geodata.layer_styles`), so that a layer added to a map of QGIS
shows the colours of the maps and reports of roofbench at once.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple
from xml.etree import ElementTree

from ..evaluators.verdict_table import VerdictKind
from .pair_text import FATE_WORDS
from .verdict_style import FATE_LOOKS, ROLE_STYLE

__all__ = ["Category", "pair_styles", "qgis_style", "verdict_styles"]

#: Labels are shown on scales of 1 : _LABELS_FROM and larger.
_LABELS_FROM = 1500


class Category(NamedTuple):
    """A value of the column that is coloured: its text in the legend, colour, opacity of the fill, and hatching."""

    value: str
    label: str
    colour: str
    opacity: float
    hatched: bool = False


def verdict_styles(kinds: Sequence[VerdictKind]) -> dict[str, str]:
    """Return the styles of the layers ``detections`` and ``references``: coloured by verdict, labelled by reason."""
    return {f"{side}s": _of_verdicts(kinds, side) for side in ("detection", "reference")}


def pair_styles(kinds: Sequence[VerdictKind]) -> dict[str, str]:
    """Return the styles of the layers of two detections: references by their fate, detections by their verdict."""
    fates = [
        Category(fate, FATE_WORDS[fate], look.colour, look.opacity, look.hatch is not None)
        for fate, look in FATE_LOOKS.items()
    ]
    detections = _of_verdicts(kinds, "detection")
    references = qgis_style("fate", fates, label="reason_b")
    return {"references": references, "detections_a": detections, "detections_b": detections}


def _of_verdicts(kinds: Sequence[VerdictKind], side: str) -> str:
    return qgis_style("verdict", (_category(kind) for kind in kinds if kind.side == side), label="reason")


def _category(kind: VerdictKind) -> Category:
    style = ROLE_STYLE[kind.role]
    return Category(kind.key, kind.legend, style.colour, style.on_map, style.hatch is not None)


def qgis_style(column: str, categories: Iterable[Category], *, label: str) -> str:
    """Return a style in the format of QGIS (QML).

    Parameters
    ----------
    column : str
        Whose value decides the colour.
    categories : iterable of Category
        In the order of the legend.
    label : str
        Column that labels the features on scales of 1 : 1500 and larger.
    """
    chosen = list(categories)
    root = ElementTree.Element("qgis", version="3.22.0", styleCategories="Symbology|Labeling", labelsEnabled="1")
    renderer = ElementTree.SubElement(
        root, "renderer-v2", type="categorizedSymbol", attr=column, forceraster="0", symbollevels="0", enableorderby="0"
    )
    listed = ElementTree.SubElement(renderer, "categories")
    symbols = ElementTree.SubElement(renderer, "symbols")
    for number, category in enumerate(chosen):
        ElementTree.SubElement(
            listed, "category", symbol=str(number), value=category.value, label=category.label, render="true"
        )
        _add_symbol(symbols, str(number), category)
    _add_labels(root, label)
    return "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n" + ElementTree.tostring(root, "unicode")


def _add_symbol(symbols: ElementTree.Element, name: str, category: Category) -> None:
    symbol = ElementTree.SubElement(symbols, "symbol", type="fill", name=name, alpha="1", clip_to_extent="1")
    layer = ElementTree.SubElement(symbol, "layer", {"class": "SimpleFill", "enabled": "1", "locked": "0", "pass": "0"})
    solid = _rgba(category.colour, 1.0)
    fill = "no" if category.opacity == 0 else "b_diagonal" if category.hatched else "solid"
    options = {
        "color": solid if category.hatched else _rgba(category.colour, category.opacity),
        "style": fill,
        "outline_color": solid,
        "outline_style": "solid",
        "outline_width": "0.3",
        "outline_width_unit": "MM",
        "joinstyle": "miter",
    }
    _add_options(layer, options)


def _add_options(element: ElementTree.Element, options: dict[str, str]) -> None:
    """Write options twice: in the form of QGIS 3.20 and later, and in that of older versions."""
    written = ElementTree.SubElement(element, "Option", type="Map")
    for name, value in options.items():
        ElementTree.SubElement(written, "Option", name=name, value=value, type="QString")
    for name, value in options.items():
        ElementTree.SubElement(element, "prop", k=name, v=value)


def _add_labels(root: ElementTree.Element, column: str) -> None:
    labels = ElementTree.SubElement(ElementTree.SubElement(root, "labeling", type="simple"), "settings")
    style = ElementTree.SubElement(
        labels,
        "text-style",
        fieldName=column,
        isExpression="0",
        fontSize="8",
        fontSizeUnit="Point",
        textColor="0,0,0,255",
        textOpacity="1",
    )
    ElementTree.SubElement(
        style,
        "text-buffer",
        bufferDraw="1",
        bufferSize="0.8",
        bufferSizeUnits="MM",
        bufferColor="255,255,255,255",
        bufferOpacity="1",
    )
    ElementTree.SubElement(labels, "text-format", autoWrapLength="28", useMaxLineLengthForAutoWrap="1")
    ElementTree.SubElement(labels, "placement", placement="1", centroidInside="1", centroidWhole="1")
    # "scaleMax" is the smallest scale on which labels are shown.
    ElementTree.SubElement(
        labels, "rendering", drawLabels="1", scaleVisibility="1", scaleMin="0", scaleMax=str(_LABELS_FROM), obstacle="0"
    )


def _rgba(colour: str, opacity: float) -> str:
    red, green, blue = (int(colour[place : place + 2], 16) for place in (1, 3, 5))
    return f"{red},{green},{blue},{round(255 * opacity)}"
