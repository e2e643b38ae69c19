"""Every evaluation system on the same pairs: where they disagree.

``python tests/performance/study_evaluators.py`` prints the tables of docs/results/evaluators.md.
"""

import numpy as np
import shapely

import roofbench as rb
from roofbench.evaluators.registry import EVALUATORS
from roofbench.reports.format import number_text, unit_text


def house(x, width=10.0, y=0.0, depth=10.0):
    return shapely.box(x, y, x + width, y + depth)


L_SHAPE = house(0, 20) | house(0, 10, depth=20)

#: Detections and references of each case.
CASES = {
    "identity": ([house(0)], [house(0)]),
    "shift by 1 m": ([house(1)], [house(0)]),
    "shift by 3 m": ([house(3)], [house(0)]),
    "shift by 4 m": ([house(4)], [house(0)]),
    "sliver of 2 %": ([house(9.8)], [house(0)]),
    "split in two": ([house(0, 5), house(5, 5)], [house(0)]),
    "two houses in one": ([house(0, 20)], [house(0), house(10)]),
    "row of five as one": ([house(0, 50)], [house(10 * k) for k in range(5)]),
    "row of five, shifted by 4 m": ([house(10 * k + 4) for k in range(5)], [house(10 * k) for k in range(5)]),
    "found twice": ([house(0), house(0.5)], [house(0)]),
    "rectangle for an L": ([house(0, 20, depth=20)], [L_SHAPE]),
    "one wing of an L": ([house(0, 20)], [L_SHAPE]),
    "missed and false": ([house(50)], [house(0)]),
}


def table(names, keys):
    heads = [
        "case",
        *(f"{name} {rb.make_evaluator(name).index(key).symbol}" for name, key in zip(names, keys, strict=True)),
    ]
    print("| " + " | ".join(heads) + " |\n|" + "---|" * len(heads))
    for case, (detected, reference) in CASES.items():
        row = [case]
        for name, key in zip(names, keys, strict=True):
            found = rb.evaluate(rb.Footprints.of(detected), rb.Footprints.of(reference), evaluator=name)
            unit = found.evaluator.index(key).unit
            text = number_text(found.values[key], unit)
            row.append(f"{text} {unit_text(unit)}".strip() if text else "–")
        print("| " + " | ".join(row) + " |")


def flipped(seed=0, count=2000):
    """Return per shift the share of objects whose verdict a threshold of IoU that moves by 0.05 changes."""
    rng = np.random.default_rng(seed)
    x = 40.0 * np.arange(count)
    reference = rb.Footprints.of(shapely.box(x, 0, x + 12, 9))
    for spread in (0.5, 1.0, 1.5, 2.0):
        dx, dy = rng.normal(0, spread, (2, count))
        detected = rb.Footprints.of(shapely.box(x + dx, dy, x + dx + 12, dy + 9))
        values = rb.evaluate(detected, reference, evaluator="iou").values
        free = rb.evaluate(detected, reference)
        print(
            f"| {spread:g} m | {100 * values['iou.f1']:.1f} % | {100 * values['iou.flipped']:.1f} % | "
            f"{100 * free.object.quality:.1f} % | {free.geometric.rmse:.2f} m |"
        )


if __name__ == "__main__":
    ranked = EVALUATORS.names()
    table(ranked, [rb.make_evaluator(name).ranking_index().key for name in ranked])
    print()
    print("| spread of the shift | iou F1 | objects that the threshold decides | threshold-free Q_l | RMSE |")
    print("|---|---|---|---|---|")
    flipped()
