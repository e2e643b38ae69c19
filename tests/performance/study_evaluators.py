"""Every evaluation system on the same pairs: where they disagree.

``python tests/performance/study_evaluators.py [FIGURE]`` prints the tables of docs/results/evaluators.md and draws the
pairs into FIGURE, such as docs/images/evaluators-pairs.png.
"""

import sys
from pathlib import Path

import numpy as np
import shapely

import roofbench as rb
from roofbench.evaluators.registry import EVALUATORS
from roofbench.reports.figures import save_plot
from roofbench.reports.format import number_text, unit_text
from roofbench.reports.inline_svg import INK, new_figure

SHIFT = 0.05


def house(x, width=10.0, y=0.0, depth=10.0):
    return shapely.box(x, y, x + width, y + depth)


L_SHAPE = house(0, 20) | house(0, 10, depth=20)
SLIVER = "sliver of 2 %"

#: Detections and references of each case.
CASES = {
    "identity": ([house(0)], [house(0)]),
    "shift by 1 m": ([house(1)], [house(0)]),
    "shift by 3 m": ([house(3)], [house(0)]),
    "shift by 4 m": ([house(4)], [house(0)]),
    SLIVER: ([house(9.8)], [house(0)]),
    "split in two": ([house(0, 5), house(5, 5)], [house(0)]),
    "two houses in one": ([house(0, 20)], [house(0), house(10)]),
    "row of five as one": ([house(0, 50)], [house(10 * k) for k in range(5)]),
    "row of five, shifted by 4 m": ([house(10 * k + 4) for k in range(5)], [house(10 * k) for k in range(5)]),
    "row of five, one missed": ([house(10 * k) for k in (0, 1, 3, 4)], [house(10 * k) for k in range(5)]),
    "found twice": ([house(0), house(0.5)], [house(0)]),
    "rectangle for an L": ([house(0, 20, depth=20)], [L_SHAPE]),
    "one wing of an L": ([house(0, 20)], [L_SHAPE]),
    "L in two rectangles": ([house(0, 20), house(0, 10, 10)], [L_SHAPE]),
    "missed and false": ([house(15)], [house(0)]),
}

#: Index of each system that is printed below a drawing.
_PRINTED = {"threshold-free": "object.quality", "iou": "iou.f1", "rutzinger": "object.quality"}


def sets_of(case):
    return tuple(rb.Footprints.of(polygons) for polygons in CASES[case])


def shown(evaluation, key):
    unit = evaluation.evaluator.index(key).unit
    text = number_text(evaluation.values[key], unit)
    return f"{text} {unit_text(unit)}".strip() if text else "–"


def row(*cells):
    print("| " + " | ".join(cells) + " |")


def ranking_table():
    """Print the ranking index of every system in each case."""
    systems = [rb.make_evaluator(name) for name in EVALUATORS.names()]
    keys = [system.ranking_index().key for system in systems]
    row("case", *(f"{one.name} {one.index(key).symbol}" for one, key in zip(systems, keys, strict=True)))
    row("---", *["--:"] * len(systems))
    for case in CASES:
        found = [rb.evaluate(*sets_of(case), evaluator=system) for system in systems]
        row(case, *(shown(one, key) for one, key in zip(found, keys, strict=True)))


def sliver_table():
    """Print for each system how an overlap of 2 % counts."""
    row("system", "verdict of the detection", "verdict of the reference", "counts as", "what else says so")
    row(*["---"] * 5)
    details = {
        "threshold-free": ("pixel.quality", "geometric.rmse"),
        "iou": ("iou.f1", "ap.ap"),
        "boundary": ("boundary.iou", "boundary.polis"),
    }
    for name in EVALUATORS.names():
        found = rb.evaluate(*sets_of(SLIVER), evaluator=name)
        verdicts = found.verdicts
        words = []
        for side, table, _ in verdicts.sides:
            kinds = {kind.key: kind for kind in verdicts.kinds_of(side)}
            words.append(kinds[table.verdicts[0]])
        right = all(kind.counts_as in ("correct", "duplicate") for kind in words)
        keys = details.get(name, (found.evaluator.ranking_index().key,))
        others = ", ".join(f"{found.evaluator.index(key).symbol} {shown(found, key)}" for key in keys)
        row(
            f"`{name}`",
            words[0].label,
            words[1].label.removeprefix("reference: "),
            "true positive" if right else "error",
            others,
        )


def thresholds():
    """Yield a name, an evaluator for a threshold, its threshold, and the side whose objects it decides."""
    for threshold in (0.5, 0.75):
        yield f"`iou`, IoU {threshold:g}", lambda t: rb.make_evaluator("iou", {"threshold": t}), threshold, (0, 1)
    for side, name in ((1, "references"), (0, "detections")):
        yield (
            f"`rutzinger`, {name} covered 50 %",
            lambda t: rb.make_evaluator("rutzinger", {"threshold": t}),
            0.5,
            (side,),
        )


def decided(sets, evaluator, threshold, sides, area=None):
    """Return the share of counted objects whose fate changes when the threshold moves by `SHIFT` up or down."""
    fates = []
    for moved in (threshold - SHIFT, threshold, threshold + SHIFT):
        verdicts = rb.evaluate(*sets, evaluator=evaluator(moved), area=area).verdicts
        neutral = {kind.key for kind in verdicts.kinds if kind.counts_as == "neutral"}
        tables = [table.verdicts for _, table, _ in verdicts.sides]
        fates.append(np.concatenate([tables[side] for side in sides]))
    counted = ~np.isin(fates[1], list(neutral))
    return float(((fates[0] != fates[1]) | (fates[2] != fates[1]))[counted].mean())


def shifted_houses(spread, count=2000):
    """Return houses of 12 m x 9 m, detected at their true size with normally distributed shifts."""
    rng = np.random.default_rng(0)
    x = 40.0 * np.arange(count)
    dx, dy = rng.normal(0, spread, (2, count))
    boxes = shapely.box(x + dx, dy, x + dx + 12, dy + 9), shapely.box(x, 0, x + 12, 9)
    return tuple(map(rb.Footprints.of, boxes))


def delft():
    """Return the references of the shipped scene, their blocks without inner walls, and what `ndsm` detects."""
    scene = rb.open_scene("delft")
    joined = shapely.union_all(shapely.buffer(scene.reference.polygons, 0.3, join_style="mitre"))
    blocks = shapely.get_parts(shapely.buffer(joined, -0.3, join_style="mitre"))
    return scene, rb.Footprints.of(blocks, crs=scene.crs), rb.detect(scene, "ndsm")


def flips_table(scene, detected):
    """Print for each object threshold the share of objects that a shift of it by 0.05 flips."""
    spreads = (0.5, 1.0, 1.5, 2.0)
    row("threshold", *(f"shifts of {spread:g} m" for spread in spreads), "Delft, `ndsm`")
    row("---", *["--:"] * 5)
    cases = [*((shifted_houses(spread), None) for spread in spreads), ((detected, scene.reference), scene.area)]
    for name, evaluator, threshold, sides in thresholds():
        row(name, *(f"{100 * decided(sets, evaluator, threshold, sides, area):.1f} %" for sets, area in cases))
    free = [rb.evaluate(*sets, area=area) for sets, area in cases]
    print()
    row("same sets", *(f"shifts of {spread:g} m" for spread in spreads), "Delft, `ndsm`")
    row("---", *["--:"] * 5)
    row("`iou` F1", *(shown(rb.evaluate(*sets, evaluator="iou", area=area), "iou.f1") for sets, area in cases))
    for key in ("object.quality", "pixel.quality", "geometric.rmse"):
        row(f"`threshold-free` {free[0].evaluator.index(key).symbol}", *(shown(one, key) for one in free))


def delft_table(scene, *detections):
    """Print the main indices of every system for sets of detections of Delft."""
    keys = {
        "threshold-free": ("object.completeness", "object.correctness", "object.quality", "pixel.quality"),
        "iou": ("iou.precision", "iou.recall", "iou.f1", "ap.ap", "panoptic.quality"),
        "rutzinger": ("object.completeness", "object.correctness", "object.quality", "object.merges", "area.quality"),
        "boundary": ("boundary.polis", "boundary.iou", "corner.completeness", "regularity.turning_distance"),
    }
    row("system", *(f"{name} ({len(found)})" for name, found in detections))
    row("---", *["---"] * len(detections))
    for name in EVALUATORS.names():
        cells = []
        for _, found in detections:
            result = rb.evaluate(found, scene.reference, evaluator=name, area=scene.area)
            known = {index.key for index in result.evaluator.indices}
            chosen = [key for key in keys.get(name, ()) if key in known]
            chosen = chosen or [index.key for index in result.evaluator.indices if index.main][:4]
            cells.append(", ".join(f"{result.evaluator.index(key).symbol} {shown(result, key)}" for key in chosen))
        row(f"`{name}`", *cells)


def draw(path):
    """Draw the pairs, with three of the systems' values below each."""
    figure = new_figure(11.0, 9.6)
    panels = figure.subplots(4, 4).ravel()
    for panel in panels[len(CASES) :]:
        panel.axis("off")
    for panel, case in zip(panels, CASES, strict=False):
        detected, reference = CASES[case]
        for polygon in reference:
            panel.fill(*polygon.exterior.xy, facecolor="#c9d3e0", edgecolor="#7d8ba0", linewidth=1.2, zorder=1)
        for polygon in detected:
            panel.fill(
                *polygon.exterior.xy,
                facecolor="none",
                edgecolor="#D55E00",
                linewidth=2.0,
                hatch="//",
                alpha=0.9,
                zorder=2,
            )
        xmin, ymin, xmax, ymax = shapely.total_bounds(np.array([*detected, *reference]))
        size = max(xmax - xmin, ymax - ymin) * 1.16
        panel.set_xlim((xmin + xmax - size) / 2, (xmin + xmax + size) / 2)
        panel.set_ylim((ymin + ymax - size) / 2, (ymin + ymax + size) / 2)
        panel.set_aspect("equal")
        panel.set_xticks([])
        panel.set_yticks([])
        panel.set_title(case, fontsize=10.5, color=INK)
        texts = []
        for name, index in _PRINTED.items():
            found = rb.evaluate(*sets_of(case), evaluator=name)
            texts.append(f"{name} {found.evaluator.index(index).symbol} {shown(found, index)}")
        panel.set_xlabel("\n".join(texts), fontsize=8.5, color=INK)
    key = panels[len(CASES)]
    key.fill([0, 1, 1, 0], [2, 2, 3, 3], facecolor="#c9d3e0", edgecolor="#7d8ba0")
    key.fill([0, 1, 1, 0], [0, 0, 1, 1], facecolor="none", edgecolor="#D55E00", linewidth=2.0, hatch="//")
    key.text(1.3, 2.5, "reference", va="center", fontsize=10, color=INK)
    key.text(1.3, 0.5, "detection", va="center", fontsize=10, color=INK)
    key.text(0, -1.2, "houses are 10 m wide", va="center", fontsize=9, color=INK)
    key.set_xlim(-0.5, 5)
    key.set_ylim(-2, 4)
    save_plot(figure, path, dpi=110, overwrite=True)


def main():
    ranking_table()
    print()
    sliver_table()
    print()
    scene, blocks, found = delft()
    flips_table(scene, found)
    print()
    delft_table(scene, ("blocks", blocks), ("`ndsm`", found))
    if len(sys.argv) > 1:
        draw(Path(sys.argv[1]))


if __name__ == "__main__":
    main()
