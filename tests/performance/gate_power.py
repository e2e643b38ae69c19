"""Simulate which drop the gate finds with how many scenes: ``python tests/performance/gate_power.py [PICTURE.png]``.

The code of the gate tests simulated pairs: five indices, of which one drops by so much, with paired differences that
scatter over scenes with a given standard deviation. Prints the share of ``worse`` verdicts and, as a check, the share
of false alarms when nothing drops.
"""

import sys

import numpy as np

from roofbench.benchmark.analysis.baseline import Measured
from roofbench.benchmark.analysis.gate import compare_detector, margins_of
from roofbench.benchmark.identity.recipes import PluginRecipe
from roofbench.evaluators.registry import make_evaluator

SCENES = (8, 10, 12, 16, 24, 30, 48)
DROPS = (0.0, 0.01, 0.015, 0.02, 0.03, 0.05)
SPREADS = (0.01, 0.02)
REPEATS = 200

INDICES = make_evaluator().gated_indices()
MARGINS = margins_of([], INDICES)


def found(rng, scenes, drop, spread):
    """Whether a drop of the first index is found, and whether any other index is called worse."""
    before, after = {}, {}
    for scene in range(scenes):
        old = {index.key: 0.8 for index in INDICES}
        new = {key: value + rng.normal(0, spread) for key, value in old.items()}
        new[INDICES[0].key] -= drop
        before[str(scene), 0], after[str(scene), 0] = old, new
    one, two = (Measured(PluginRecipe("d", {}), (0,), runs) for runs in (before, after))
    verdicts = [v.verdict == "worse" for v in compare_detector("d", one, two, indices=INDICES, margins=MARGINS)]
    return verdicts[0], any(verdicts[1:])


def simulate():
    rng = np.random.default_rng(1)
    power = np.zeros((len(SPREADS), len(DROPS), len(SCENES)))
    alarms = np.zeros_like(power)
    for place in np.ndindex(power.shape):
        spread, drop, scenes = SPREADS[place[0]], DROPS[place[1]], SCENES[place[2]]
        results = np.array([found(rng, scenes, drop, spread) for _ in range(REPEATS)])
        power[place], alarms[place] = results.mean(axis=0)
    return power, alarms


def draw(power, path):
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 3.6), layout="constrained")
    colours = ("#0072b2", "#56b4e9", "#009e73", "#e69f00", "#d55e00")
    for number, axes in enumerate(figure.subplots(1, len(SPREADS), sharey=True)):
        for drop, line, colour in zip(DROPS[1:], power[number][1:], colours, strict=True):
            axes.plot(SCENES, 100 * line, marker="o", markersize=3.5, color=colour, label=f"{100 * drop:g}")
        unit = "point" if SPREADS[number] == 0.01 else "points"
        axes.set_title(f"differences scatter by {100 * SPREADS[number]:g} {unit}", fontsize=10)
        axes.set_xlabel("scenes")
        axes.set_xticks([10, 16, 24, 30, 48])
        axes.grid(alpha=0.3)
        axes.set_ylim(-3, 103)
    figure.axes[0].set_ylabel("drops found, %")
    figure.axes[-1].legend(
        title="drop, points", fontsize=8, title_fontsize=8, loc="upper left", bbox_to_anchor=(1.02, 1)
    )
    figure.savefig(path, dpi=110)


def main():
    power, alarms = simulate()
    for spread, table, wrong in zip(SPREADS, power, alarms, strict=True):
        print(f"\nstandard deviation of the paired differences {100 * spread:g} points; found in % of {REPEATS}")
        print("| drop, points |" + "".join(f" {count} scenes |" for count in SCENES))
        print("|--:|" + "--:|" * len(SCENES))
        for drop, line in zip(DROPS, table, strict=True):
            print(f"| {100 * drop:g} |" + "".join(f" {100 * share:.0f} |" for share in line))
        print(f"false alarms on any of the four other indices: {100 * wrong.mean():.2f} %")
    if len(sys.argv) > 1:
        draw(power, sys.argv[1])


if __name__ == "__main__":
    main()
