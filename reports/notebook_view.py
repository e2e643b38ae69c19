"""What notebooks show of objects: maps and tables in HTML that is escaped, self-contained and small.

Each function is named by the class that it shows (`core.display`).
"""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

import numpy as np
import shapely

from ..benchmark.execution.scene_picture import scene_picture
from ..core.parameter_rules import Parameter, parameter_text
from ..core.parameters import Parameterised
from ..core.wording import counted
from ..detectors.base import Detector
from ..evaluators.base import Evaluation
from ..evaluators.comparison import Evaluations
from ..evaluators.uncertainty.paired import PairedComparison
from ..evaluators.verdict_table import Verdicts
from ..scenes.geodata.crs import crs_label
from ..scenes.geodata.footprints import Footprints
from ..scenes.scene import Scene
from .evaluation_text import described, evaluation_table
from .overlay_json import data_uri
from .pair_text import differences_table, fates_table, objects_line
from .svg_map import MapLayer, crowded_window, svg_map
from .tables import Column, Table
from .verdict_style import ROLE_STYLE, filled_kinds

__all__ = [
    "evaluation_view",
    "evaluations_view",
    "footprints_view",
    "pair_view",
    "parameters_view",
    "scene_view",
    "verdicts_view",
]

_BLUE, _ORANGE, _DARK = "#0072B2", "#D55E00", "#111"
#: Longer side of a scene's picture, pixels, and of a scene that is drawn whole, metres.
_PICTURE, _LARGE = 420, 1500.0


def footprints_view(footprints: Footprints) -> str:
    """Return the outlines on a map, and the facts of the set."""
    facts = [
        ("footprints", f"{len(footprints):,}"),
        ("buildings", f"{len(np.unique(footprints.building_codes)):,}" if footprints.building_ids is not None else ""),
        ("area", f"{footprints.areas.sum():,.0f} m²" if len(footprints) else ""),
        ("CRS", crs_label(footprints.crs)),
        ("columns", ", ".join(footprints.attributes)),
        ("source", footprints.source),
        ("repaired or left out", str(len(footprints.repairs)) if footprints.repairs else ""),
    ]
    notes = [*map(str, footprints.repairs[:5]), *map(str, footprints.metadata.get("notes", ()))]
    layers = [MapLayer(footprints.polygons, _BLUE, _BLUE, 0.35)]
    return _beside(_map(layers, counted(len(footprints), "footprint")), [_facts(facts), _notes(notes)])


def verdicts_view(verdicts: Verdicts) -> str:
    """Return the map of the verdicts, and how many objects have which."""
    return _beside(_verdict_map(verdicts), [_kinds(verdicts)])


def evaluation_view(evaluation: Evaluation) -> str:
    """Return the map of the verdicts with its key, the main indices, and the notes."""
    main = (index for index in evaluation.evaluator.indices if index.main)
    parts = [f"<b>{html.escape(described(evaluation))}</b>", evaluation_table(evaluation, main).to_html()]
    parts.append(_notes(evaluation.notes))
    verdicts = evaluation.verdicts
    if verdicts is None:
        return _beside("", parts)
    return _beside(_verdict_map(verdicts) + _kinds(verdicts), parts)


def evaluations_view(evaluations: Evaluations) -> str:
    """Return the main indices of several evaluators below each other."""
    rows: list[list[str]] = []
    for name, evaluation in evaluations.items():
        main = (index for index in evaluation.evaluator.indices if index.main)
        for place, row in enumerate(evaluation_table(evaluation, main).rows):
            rows.append(["" if place else name, *map(str, row)])
    columns = (Column("evaluator", "left"), Column("index", "left"), Column("symbol", "left"), Column("value"))
    notes = dict.fromkeys(note for evaluation in evaluations.values() for note in evaluation.notes)
    return Table.of(columns, rows).to_html() + _notes(list(notes))


def pair_view(found: PairedComparison) -> str:
    """Return what only A or only B finds, and the difference of every main index."""
    parts = [f"<b>{html.escape(described(found.first))}</b>"]
    if found.objects:
        parts += [fates_table(found).to_html(), f"<p>{html.escape(objects_line(found))}</p>"]
    main = [difference for difference in found.differences if difference.index.main]
    return "".join([*parts, differences_table(found, main).to_html()])


def parameters_view(plugin: Parameterised) -> str:
    """Return the parameters of a detector or evaluator: value, default, unit and meaning; changed values are bold."""
    name = str(getattr(plugin, "name", type(plugin).__name__))
    inputs = f", needs {', '.join(plugin.requires)}" if isinstance(plugin, Detector) else ""
    head = f"<p><b>{html.escape(name)}</b>{html.escape(inputs)}<br>{html.escape(_first_line(plugin))}</p>"
    values = {**plugin.values(), **plugin.execution_values()}
    rules = [*plugin.parameters().values(), *plugin.execution_options().values()]
    if not rules:
        return head
    defaults = {**{rule.name: rule.default for rule in rules}, **plugin.defaults()}
    rows = "".join(_parameter_row(rule, values[rule.name], defaults[rule.name]) for rule in rules)
    titles = "".join(
        f'<th style="text-align:left">{title}</th>' for title in ("parameter", "value", "default", "range", "meaning")
    )
    return f"{head}<table><thead><tr>{titles}</tr></thead><tbody>{rows}</tbody></table>"


def scene_view(scene: Scene) -> str:
    """Return a picture of the scene with its reference, and its facts; of a large scene, of its middle."""
    xmin, ymin, xmax, ymax = scene.extent
    place, part = scene, ""
    if max(xmax - xmin, ymax - ymin) > _LARGE:
        x, y, half = (xmin + xmax) / 2, (ymin + ymax) / 2, _LARGE / 6
        place = scene.window((x - half, y - half, x + half, y + half), 0.0)
        part = f"the middle {2 * half:.0f} m of it are shown"
    picture = scene_picture(place)
    layers = [] if place.reference is None else [MapLayer(place.reference.polygons, "none", _ORANGE)]
    if place.area is not None:
        layers.append(MapLayer(np.array([place.area], dtype=object), "none", _DARK, dashed=True))
    address = "" if picture is None else data_uri(picture.at_most(_PICTURE))
    drawn = svg_map(layers, place.extent, description=f"scene {scene.name}", picture=address, margin=False)
    shows = [] if picture is None else [picture.shows]
    shows += ["reference in orange"] if place.reference is not None else []
    shows += ["evaluation area dashed"] if place.area is not None else []
    facts = [
        ("scene", scene.name),
        ("extent", f"{xmax - xmin:,.0f} x {ymax - ymin:,.0f} m"),
        ("CRS", crs_label(scene.crs)),
        ("contents", ", ".join(scene.contents)),
        ("points", "" if place.points is None or part else f"{len(place.points):,}"),
        ("reference", "" if place.reference is None or part else counted(len(place.reference), "footprint")),
        ("source", str(scene.facts.get("source", ""))),
        ("licence", str(scene.facts.get("licence", ""))),
        ("picture", "; ".join(filter(None, [*shows, part]))),
    ]
    return _beside(drawn, [_facts(facts)])


def _beside(left: str, right: Iterable[str]) -> str:
    """Return a picture with text beside it, or below it where there is no room."""
    column = f'<div style="flex:1 1 20em">{"".join(right)}</div>'
    figure = f'<div style="flex:0 1 auto">{left}</div>' if left else ""
    return f'<div style="display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start">{figure}{column}</div>'


def _facts(pairs: Iterable[tuple[str, str]]) -> str:
    left = 'style="text-align:left"'
    rows = "".join(
        f"<tr><th {left}>{html.escape(name)}</th><td {left}>{html.escape(value)}</td></tr>"
        for name, value in pairs
        if value
    )
    return f"<table><tbody>{rows}</tbody></table>"


def _notes(notes: Sequence[str]) -> str:
    if not notes:
        return ""
    return f'<ul style="font-size:90%">{"".join(f"<li>{html.escape(note)}</li>" for note in notes)}</ul>'


def _map(layers: Sequence[MapLayer], description: str) -> str:
    every = np.concatenate([layer.polygons for layer in layers])
    if not len(every):
        return ""
    window = crowded_window(every)
    note = "" if window is None else f"<div>the most crowded part of {len(every):,} outlines</div>"
    xmin, ymin, xmax, ymax = window or map(float, shapely.total_bounds(every))
    return svg_map(layers, (xmin, ymin, xmax, ymax), description=description) + note


def _verdict_map(verdicts: Verdicts) -> str:
    layers = []
    for side in ("reference", "detection"):
        for kind in filled_kinds(verdicts, side):
            style = ROLE_STYLE[kind.role]
            chosen = verdicts.footprints(kind.side).polygons[verdicts.mask(kind)]
            layers.append(MapLayer(chosen, style.colour, style.colour, style.on_map))
    for kind in verdicts.kinds:
        if kind.role == "outline":
            chosen = verdicts.footprints(kind.side).polygons[verdicts.mask(kind)]
            layers.append(MapLayer(chosen, "none", ROLE_STYLE[kind.role].colour))
    return _map(layers, "map of the verdicts") if layers else ""


def _kinds(verdicts: Verdicts) -> str:
    """Return the key of the map: colour, meaning and number of each verdict that an object has."""
    rows = []
    for kind in verdicts.kinds:
        count = verdicts.table(kind.side).count(kind.key)
        if count:
            style = ROLE_STYLE[kind.role]
            fill = "transparent" if kind.role == "outline" else style.colour
            look = f"display:inline-block;width:1em;height:.8em;background:{fill};border:1px solid {style.colour}"
            rows.append(
                f'<tr><td><span style="{look}"></span></td><td style="text-align:left">{html.escape(kind.legend)}</td>'
                f'<td style="text-align:left">{kind.side}s</td><td>{count:,}</td></tr>'
            )
    return f"<table><tbody>{''.join(rows)}</tbody></table>"


def _first_line(plugin: Parameterised) -> str:
    return " ".join(plugin.description().partition("\n\n")[0].split())


def _parameter_row(rule: Parameter, value: object, default: object) -> str:
    shown, usual = (
        "none" if one is None else f"{parameter_text(one)} {rule.unit}".rstrip() for one in (value, default)
    )
    cells = [
        html.escape(rule.name),
        f"<b>{html.escape(shown)}</b>" if value != default else html.escape(shown),
        html.escape(usual),
        html.escape(rule.range_text),
        html.escape(rule.doc),
    ]
    return "".join(["<tr>", *(f'<td style="text-align:left">{cell}</td>' for cell in cells), "</tr>"])
