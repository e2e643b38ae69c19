"""The report as one HTML file: no network, a strict content security policy, all data escaped.

The page is a jinja2 template with autoescape; tables and charts are inserted as they are, maps are drawn by a script
of our own from JSON in the page. Only that script may run: the policy names its hash.
"""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from itertools import groupby
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup, escape

from ..benchmark.analysis.published import Comparison, checks
from ..benchmark.analysis.report_contents import fill_report
from ..benchmark.analysis.report_data import Report
from ..benchmark.analysis.results import Cell, Entry, Leaderboard
from ..benchmark.plan import KeyedEvaluator
from ..benchmark.store.records import RunRow
from ..benchmark.store.writer import Store
from ..core.output import whole_file
from ..core.package import VERSION
from ..core.wording import counted
from ..evaluators.base import Index
from .charts import cost_figure, size_figure
from .curve_charts import curves_figure
from .format import interval_text, listed, number_text, shortened, unit_text, value_text
from .gate_text import gate_summary
from .inline_svg import to_inline_svg
from .leaderboard_text import leaderboard_caption
from .overlay_json import report_json
from .sensitivity import sensitivity_figure
from .sweep_text import break_down_text

__all__ = ["html_report", "is_report", "write_report", "write_run_report"]

_MOST_MATRIX_ROWS = 300
#: Panels in one sensitivity figure.
_MOST_AXES = 12
_GENERATOR = b'<meta name="generator" content="roofbench">'
_SYMBOL = re.compile(r"\b([A-Z])_([a-z]{1,2})\b")


def is_report(path: Path) -> bool:
    """Return whether a file is a report of roofbench, which a new one may replace."""
    try:
        with path.open("rb") as file:
            return _GENERATOR in file.read(4096)
    except OSError:
        return False


def html_report(report: Report, *, level: float = 0.8) -> str:
    """Return the page.

    Parameters
    ----------
    report : Report
    level : float
        Quality that the break-down points of the sensitivity plots are about.
    """
    templates = resources.files(__package__) / "templates"
    css, script, page = (
        (templates / name).read_text("utf-8") for name in ("report.css", "report.js", "report.html.j2")
    )
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    # Browsers convert line ends to \n, and so does reading as text: the hash is of the script as the browser reads it.
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return environment.from_string(page).render(
        report=report,
        css=Markup(css),  # noqa: S704 - our own file
        script=Markup(script),  # noqa: S704 - our own file
        script_hash=f"sha256-{digest}",
        data=jinja2.utils.htmlsafe_json_dumps(report_json(report), separators=(",", ":"), allow_nan=False),
        version=VERSION,
        level=level,
        cell_text=number_text,
        gate_summary=gate_summary,
        percent_text=_percent_text,
        subscripted=_subscripted,
        lead=_lead(report),
        tiles=_tiles(report),
        boards=[
            *(_board(part, title=part.title) for part in report.parts),
            *(_board(board, title="All scenes" if report.parts else "") for board in report.boards),
        ],
        scene_groups=_scene_groups(report),
        matrix=_matrix(report),
        charts=_charts(report, level),
        break_downs=[break_down_text(line.break_down) for line in report.sensitivities if line.break_down],
        published=_published(report),
        unsuccessful=report.boards[0].unsuccessful if report.boards else (),
        contents=_contents(report),
    )


@dataclass(frozen=True)
class _Head:
    """A column of a leaderboard: plain text, or an index with its unit and its name in words."""

    text: str = ""
    css: str = ""
    index: Index | None = None
    unit: str = ""
    words: str = ""
    meaning: str = ""
    first: str = "ascending"
    sorted: str = ""


def _contents(report: Report) -> list[tuple[str, str]]:
    there = [
        ("leaderboard", "Leaderboard", True),
        ("scenes", "Scenes", report.scenes),
        ("worst", "Worst objects", report.errors),
        ("by-scene", "Every scene", report.matrix),
        ("size", "Building size", report.sizes),
        ("curves", "Curves", report.curves),
        ("sensitivity", "Sensitivity", report.sensitivities),
        ("cost", "Time and memory", report.costs),
        ("gate", "Gate", report.gate),
        ("published", "Published", report.comparison),
        ("unsuccessful", "Failures", report.boards and report.boards[0].unsuccessful),
        ("provenance", "Provenance", True),
    ]
    return [(place, text) for place, text, shown in there if shown]


def _lead(report: Report) -> str:
    """Return the result in one or two sentences."""
    if not report.boards:
        return "Nothing was measured."
    board = next((board for board in (*report.parts, report.boards[0]) if _ranked(board)), report.boards[0])
    ranked = _ranked(board)
    if not ranked:
        several = f"{len(_pooled(board))} detectors, none of which has a result on every scene: nothing is ranked."
        return several if len(_pooled(board)) > 1 else "The detector has no result on every scene: it is not ranked."
    best, index = ranked[0], board.rank_by
    cell = best.cells[index.key]
    where = "" if board is report.boards[0] else f"{board.title}: "
    text = f"{where}{_short(best.label)} leads with {value_text(cell.value, index.unit, undefined='no')} {index.title}"
    if cell.low is not None:
        text += f" (95 % interval {interval_text(cell.low, cell.high, index.unit)})"
    text += f" over {counted(len(board.scenes), 'scene')} and {best.reference:,} reference footprints"
    same = [_short(entry.label) for entry in ranked[1:] if set(entry.group) & set(best.group)]
    if same:
        return f"{text}; the lead over {listed(same)} is not significant with {counted(len(board.scenes), 'scene')}."
    too_few = ""
    if len(ranked) > 1 and not best.group:
        too_few = " There are too few scenes to test whether the lead is significant."
    rest = [
        f"{_short(entry.label)} {value_text(entry.cells[index.key].value, index.unit, undefined='no')}"
        for entry in ranked[1:4]
    ]
    return f"{text}{', before ' + listed(rest) if rest else ''}.{too_few}"


def _tiles(report: Report) -> list[dict[str, Any]]:
    if not report.boards:
        return []
    board = report.boards[0]
    entries = _pooled(board)
    failed = sum(entry.failed for entry in entries)
    skipped = sum(entry.skipped for entry in entries)
    runs = sum(entry.runs for entry in entries)
    shown = [
        (f"{len(entries)}", "detector" if len(entries) == 1 else "detectors"),
        (f"{len(board.scenes):,}", "scene" if len(board.scenes) == 1 else "scenes"),
        (f"{max((entry.reference for entry in entries), default=0):,}", "reference footprints"),
        (f"{runs:,}", "runs"),
    ]
    tiles = [{"value": value, "text": text, "bad": False} for value, text in shown]
    tiles.append({"value": f"{failed:,}", "text": f"failed, {skipped:,} skipped", "bad": failed > 0})
    if report.gate is not None:
        passed = report.gate.exit_code == 0
        tiles.append({"value": "passed" if passed else "not passed", "text": "gate", "bad": not passed})
    return tiles


def _pooled(board: Leaderboard) -> list[Entry]:
    return [entry for entry in board.entries if entry.pooling == "pooled"]


def _ranked(board: Leaderboard) -> list[Entry]:
    return [entry for entry in _pooled(board) if entry.rank is not None]


def _board(board: Leaderboard, *, title: str = "") -> dict[str, Any]:
    """Return a leaderboard in the form of the template."""
    grouped = any(entry.group for entry in board.entries)
    # The summary stands first, so that a phone shows the score; the other indices are shown on request.
    indices = (*board.summary, *(index for index in board.indices if index not in board.summary))
    shown = len(board.summary)
    groups = [("", shown, "group")]
    groups += [(name, len(list(found)), "group more") for name, found in groupby(map(_group_of, indices[shown:]))]
    starts = {0}
    for _, count, _ in groups:
        starts.add(max(starts) + count)
    heads = [_Head("rank", "rank", sorted="ascending"), _Head("detector", "name")]
    heads += [_Head("group", "left")] if grouped else []
    css = []
    for place, index in enumerate(indices):
        words = ["start"] * (place in starts) + ["main"] * (index == board.rank_by) + ["more"] * (place >= shown)
        css.append(" ".join(words))
        heads.append(
            _Head(
                css=css[-1],
                index=index,
                unit=_unit(index),
                words=index.title,
                meaning=f"{index.title}: {index.meaning} ({index.source}); better {index.better}",
                first="descending" if index.better == "higher" else "ascending",
            )
        )
    heads += [
        _Head("scenes", "start"),
        _Head("objects", first="descending"),
        _Head("CPU s", meaning="median processor time of a run, seconds"),
        _Head("MB", meaning="highest resident memory of all runs"),
    ]
    best = {(index.key, pooling): _best(board, index, pooling) for index in indices for pooling in _POOLINGS}
    rows = [
        {
            "entry": entry,
            "cells": [
                {
                    "index": index,
                    "cell": entry.cells[index.key],
                    "css": f"{css[place]} best".strip()
                    if _same(entry.cells[index.key], best[index.key, entry.pooling])
                    else css[place],
                }
                for place, index in enumerate(indices)
            ],
        }
        for entry in board.entries
    ]
    return {
        "evaluator": f"{title}: {board.evaluator}" if title else board.evaluator,
        "leading": 2 + grouped,
        "hidden": len(indices) - shown,
        "grouped": grouped,
        "groups": groups,
        "heads": heads,
        "rows": rows,
        "scenes": len(board.scenes),
        "caption": leaderboard_caption(board),
        "notes": board.notes,
    }


_POOLINGS = ("pooled", "mean")


def _best(board: Leaderboard, index: Index, pooling: str) -> float | None:
    """Return the best value of an index among ranked entries; None for fewer than two values or without a direction."""
    values = [
        value
        for entry in board.entries
        if entry.pooling == pooling and entry.rank is not None and (value := entry.cells[index.key].value) is not None
    ]
    if index.better == "neither" or len(values) < 2:
        return None
    return max(values) if index.better == "higher" else min(values)


def _same(cell: Cell, best: float | None) -> bool:
    return best is not None and cell.value == best


def _group_of(index: Index) -> str:
    return index.group or index.key.partition(".")[0]


def _unit(index: Index) -> str:
    """Return the unit with the space before it."""
    sign = unit_text(index.unit)
    return f" {sign}" if sign else ""


def _percent_text(value: float | None, index: Index) -> str:
    """Return our value in the units of the papers' tables: percent, also for ratios, and metres."""
    if value is None or index.unit not in ("fraction", "ratio"):
        return value_text(value, index.unit)
    return number_text(value, "fraction")


def _subscripted(text: str) -> Markup:
    """Return escaped text with symbols such as ``Q_l`` as HTML subscripts."""
    return Markup(_SYMBOL.sub(r"\1<sub>\2</sub>", str(escape(text))))  # noqa: S704 - escaped here


def _short(label: str) -> str:
    return shortened(label, 60)


def _scene_groups(report: Report) -> list[tuple[str, list[tuple[int, str]]]]:
    groups: dict[str, list[tuple[int, str]]] = {}
    for place, view in enumerate(report.scenes):
        groups.setdefault(_short(view.group), []).append((place, _short(view.name)))
    return list(groups.items())


def _matrix(report: Report) -> dict[str, Any] | None:
    if not report.matrix or not report.boards:
        return None
    index = report.boards[0].rank_by
    labels = [entry.label for entry in _pooled(report.boards[0])]
    drawn = {view.name: place for place, view in enumerate(report.scenes)}
    scenes = list(report.matrix)[:_MOST_MATRIX_ROWS]
    return {
        "index": index,
        "unit": _unit(index),
        "bars": index.unit == "fraction",
        "labels": labels,
        "rows": [
            {
                "scene": scene,
                "place": drawn.get(scene),
                "cells": [report.matrix[scene].get(label) for label in labels],
            }
            for scene in scenes
        ],
        "left_out": len(report.matrix) - len(scenes),
    }


def _published(report: Report) -> dict[str, Any] | None:
    comparison: Comparison | None = report.comparison
    if comparison is None:
        return None
    return {
        "indices": comparison.indices,
        "rows": comparison.rows,
        "checks": [(source, list(found)) for source, found in groupby(checks(), key=lambda check: check.source)],
    }


def _charts(report: Report, level: float) -> dict[str, Any]:
    charts: dict[str, Any] = {"size": None, "cost": None, "gate": None, "sensitivity": []}
    charts["curves"] = [
        (found.evaluator, _svg(curves_figure(found), f"curves{place}", f"Curves by {found.evaluator}"))
        for place, found in enumerate(report.curves)
    ]
    if report.sizes:
        charts["size"] = _svg(size_figure(report.sizes), "size", "Completeness and correctness by footprint area")
    if report.costs:
        charts["cost"] = _svg(cost_figure(report.costs), "cost", "Time and memory against the size of the scene")
    if report.gate is not None:
        from .gate_figure import gate_figure

        charts["gate"] = _svg(gate_figure(report.gate), "gate", "Paired differences of every index")
    lines = report.sensitivities
    for kind, name in ((True, "of the scenes"), (False, "of the detectors")):
        names = list(dict.fromkeys(line.axis for line in lines if line.axis.startswith("scene.") == kind))
        for start in range(0, len(names), _MOST_AXES):
            some = [line for line in lines if line.axis in names[start : start + _MOST_AXES]]
            figure = sensitivity_figure(some, level=level)
            charts["sensitivity"].append(
                _svg(figure, f"sensitivity{int(kind)}{start}", f"Quality along parameters {name}")
            )
    return charts


def _svg(figure: Any, name: str, description: str) -> Markup:
    return Markup(to_inline_svg(figure, name=name, description=description))  # noqa: S704 - escaped by matplotlib


def write_report(filled: Report, path: Path, *, level: float = 0.8, overwrite: bool) -> int:
    """Write a report, completely or not at all; return its size in bytes."""
    content = html_report(filled, level=level).encode("utf-8", "xmlcharrefreplace")
    with whole_file(path, overwrite=overwrite) as scratch:
        scratch.write_bytes(content)
    return len(content)


def write_run_report(
    path: Path,
    store: Store,
    rows: Sequence[RunRow],
    *,
    suite: str,
    evaluated: Sequence[tuple[KeyedEvaluator, Leaderboard]],
) -> bool:
    """Write the report of a run over an older report; a file of that name that is none stays, and False is returned."""
    if path.exists() and not is_report(path):
        return False
    write_report(fill_report(store, rows, title=f"Suite {suite}", evaluated=list(evaluated)), path, overwrite=True)
    return True
