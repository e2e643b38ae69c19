"""What the energy of ``mpp`` is worth as a measure of a map, and what its chain adds to the search.

Run by hand, figures go to docs/images:

- ``python tests/performance/study_energy.py chain --seeds 901-912 --folders delft,ign``: the search against the sampler
  with the same start and the same local search, paired by scene and seed, and the chain's acceptance by kind of move;
- ``study_energy.py states --folders delft,ign``: energy and quality of many states of each scene, their rank
  correlation, and the picture;
- ``study_energy.py changes --seeds 701-702``: single changes of the result of the search (a rectangle removed, added,
  moved, split, merged), whether the energy and the quality agree about each, and the weights of the energy that a
  logistic fit (contrastive: changed against unchanged) chooses, scene by scene left out.

Q_l is object quality, Q_lp pixel quality (threshold-free evaluator, exact areas), in percent, at level ``part``, which
is what the references of the presets are. Means have their standard error over runs.
"""

from __future__ import annotations

import argparse
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np
import shapely
from scipy import optimize, stats

import roofbench as rb
from roofbench.core.errors import RoofbenchError
from roofbench.detectors.mpp.annealing import schedule_of
from roofbench.detectors.mpp.births import make_births
from roofbench.detectors.mpp.cells import HIGH, LOW
from roofbench.detectors.mpp.energy import ground_variance, overlaps, rectangle_energies
from roofbench.detectors.mpp.local_search import room_of
from roofbench.detectors.mpp.moves import Move
from roofbench.detectors.mpp.outcome import as_footprints, fit_roofs
from roofbench.detectors.mpp.preparation import prepare
from roofbench.detectors.mpp.random_stream import stream
from roofbench.detectors.mpp.rectangle_sums import scan
from roofbench.detectors.mpp.rectangles import to_world
from roofbench.detectors.mpp.reshaping import cut, hull, move_edge
from roofbench.detectors.mpp.roofs import fit_roof
from roofbench.detectors.mpp.sampler import Trace, run_chain
from roofbench.detectors.mpp.squares import process_squares, rounds_of
from roofbench.detectors.mpp.tables import make_tables
from roofbench.detectors.mpp.threads import ONE_THREAD
from roofbench.detectors.mpp.whole_scene import find_rectangles, total_energy
from roofbench.detectors.mpp.windows import Window

IMAGES = Path(__file__).resolve().parents[2] / "docs" / "images"
PRESETS = (
    "fairfield", "fairfield-1", "fairfield-2", "fairfield-3", "moonee-ponds", "knox", "toronto-a", "toronto-b",
    "vaihingen-a", "vaihingen-b",
)  # fmt: skip
EFFORTS = (0.25, 1.0)
#: Of `states`: scenes, efforts of the sampler, temperatures of the chains whose last state counts, seeds.
PICTURED = ("fairfield-1", "moonee-ponds", "knox", "vaihingen-a")
TEMPERATURES = (1.0, 3.0, 10.0, 30.0)
STATE_EFFORTS, STATE_SEEDS = (0.25, 1.0), 3
#: Of `changes`: presets, changes of each kind, least change of quality that counts (in objects).
FITTED = ("fairfield-1", "knox", "moonee-ponds", "toronto-a", "toronto-b", "vaihingen-a")
EACH, LEAST = 60, 0.02
KINDS = ("removed", "added", "edge moved", "shifted", "turned", "split", "merged")
WEIGHTS = ("price", "fit_weight", "texture_weight", "low_price", "void_price", "overlap")
#: Strength with which the fit holds the logarithms of the weights at their defaults.
HELD = 0.02


def scenes_of(presets, seeds, folders):
    """Yield name, seed and scene; seeds for which the generator refuses a preset are left out."""
    for seed in seeds:
        for preset in presets:
            try:
                scene = rb.make_scene(preset, seed=seed)
                scene.points  # noqa: B018
            except RoofbenchError as error:
                print(f"{preset}, seed {seed} is left out: {error}")
                continue
            yield preset, seed, scene
    for folder in folders:
        scene = rb.open_scene(folder)
        for seed in seeds:
            yield Path(folder).name, seed, scene


class Search:
    """The search of one scene, prepared once."""

    def __init__(self, scene, change=""):
        self.scene, self.detector = scene, rb.make_detector(f"mpp[{change}]" if change else "mpp")
        seen = scene.for_detection()
        self.prepared = prepare(self.detector, seen.points, seen, ONE_THREAD)

    def rectangles(self, seed=0, **changes):
        found, results = find_rectangles(self.detector.replaced(changes), self.prepared, seed, ONE_THREAD)
        return found, results

    def energy(self, rectangles):
        energies = rectangle_energies(self.prepared.tables, rectangles, self.prepared.model)
        return total_energy(self.prepared, rectangles, energies)

    def quality(self, rectangles, level="part"):
        """Return object and pixel quality of the footprints that a state gives, percent."""
        kept = rectangles[self.detector._evident(self.prepared, rectangles)]
        energies = rectangle_energies(self.prepared.tables, kept, self.prepared.model)
        fits = fit_roofs(self.prepared, kept)
        found = as_footprints(
            self.prepared, kept, fits, energies, level=level, crs=self.scene.crs, record={}, source="mpp"
        )
        return quality_of(found, self.scene)

    def sampled(self, first, temperature, seed):
        """Return the last state of chains of constant temperature that start from a state."""
        prepared = self.prepared
        detector = self.detector.replaced({"optimiser": "rjmcmc", "effort": 1.0})
        squares = rounds_of(prepared.grid, prepared.core, detector.largest_side).chains

        def job(square, own, fixed):
            window = Window(prepared.tables, prepared.model, square.edges, fixed)
            boxes = prepared.boxes.take(square.owns(prepared.boxes.rectangles))
            births = make_births(window, boxes.rectangles, np.sqrt(np.maximum(-boxes.energies, 1.0)), 0.9)
            schedule = schedule_of(detector, window, boxes)._replace(hot=temperature, cold=temperature)
            state = stream([seed, *square.place])
            return run_chain(window, births, own, schedule, room_of(boxes, own), state)[1]

        return process_squares(squares, first, job, largest=prepared.model.largest_side, groups=1)


def quality_of(found, scene):
    values = rb.evaluate(found, scene.reference, area=scene.area).values
    return [100 * (values[key] or 0) for key in ("object.quality", "pixel.quality")]


def chain(options):
    """Print the differences between the sampler and the search, and the acceptance by move."""
    differences, tried, accepted = defaultdict(list), Counter(), Counter()
    for name, seed, scene in scenes_of(options.presets, options.seeds, options.folders):
        search = Search(scene, options.change)
        base, _ = search.rectangles()
        before = np.array(search.quality(base, options.level))
        row = [search.energy(base), *before]
        for effort in EFFORTS:
            found, results = search.rectangles(seed, optimiser="rjmcmc", effort=effort)
            row += [search.energy(found) - row[0], *(np.array(search.quality(found, options.level)) - before)]
            if effort == EFFORTS[0]:
                for move in Move:
                    tried[move] += sum(result.trace[:, Trace.TRIED + move].sum() for result in results)
                    accepted[move] += sum(result.trace[:, Trace.ACCEPTED + move].sum() for result in results)
        differences[name].append(row)
        print(f"{name}, seed {seed}: " + ", ".join(f"{value:.2f}" for value in row), flush=True)
    print("\n| scene | runs | search: Q_l | Q_lp |", end="")
    print("".join(f" effort {effort:g}: energy | Q_l | Q_lp |" for effort in EFFORTS))
    print("|---" + "|--:" * (3 + 3 * len(EFFORTS)) + "|")
    for name, rows in differences.items():
        print(table_row(name, np.array(rows)))
    presets = [np.array(rows) for name, rows in differences.items() if name in options.presets]
    if presets:
        print(table_row("all presets", np.concatenate(presets)))
    print("\n| move | tried | accepted | share |\n|---|--:|--:|--:|")
    for move in Move:
        share = accepted[move] / max(tried[move], 1)
        print(f"| {move.name.lower()} | {tried[move]:,.0f} | {accepted[move]:,.0f} | {share:.2%} |")


def table_row(name, rows):
    """Return means, and of differences of quality the standard error over runs as well."""
    mean, error = rows.mean(axis=0), rows.std(axis=0, ddof=1) / np.sqrt(len(rows)) if len(rows) > 1 else rows[0] * 0
    cells = [f"{mean[1]:.1f}", f"{mean[2]:.1f}"]
    for first in range(3, rows.shape[1], 3):
        cells.append(f"{mean[first]:+,.0f}")
        cells += [f"{mean[k]:+.2f} ± {error[k]:.2f}" for k in (first + 1, first + 2)]
    return f"| {name} | {len(rows)} | " + " | ".join(cells) + " |"


def states(options):
    """Print and draw energy against quality over many states of each scene."""
    found = {}
    print("\n| scene | states | energy and Q_l | and Q_lp | after a local search | energy and Q_l | and Q_lp |")
    print("|---|--:|--:|--:|--:|--:|--:|")
    for name, seed, scene in scenes_of(options.presets, options.seeds[:1], ()):
        found[name] = states_of(Search(scene), seed)
        print(correlation_row(name, found[name]), flush=True)
    for folder in options.folders:
        found[Path(folder).name] = states_of(Search(rb.open_scene(folder)), 1)
        print(correlation_row(Path(folder).name, found[Path(folder).name]), flush=True)
    draw(found)


def states_of(search, seed):
    """Return group (0 the search, 1 ends of local searches, 2 others), energy, object and pixel quality of states."""
    first, _ = search.rectangles()
    rows = [(0, first)]
    for step in range(STATE_SEEDS):
        stream_seed = 1000 * seed + step
        for effort in STATE_EFFORTS:
            rows.append((1, search.rectangles(stream_seed, optimiser="rjmcmc", effort=effort)[0]))
        rows.append((1, search.rectangles(stream_seed, optimiser="rjmcmc", start="empty", effort=0.5)[0]))
        rows.append((2, search.rectangles(stream_seed, optimiser="rjmcmc", start="empty", sweeps=0, effort=1)[0]))
        rows += [(2, search.sampled(first, temperature, stream_seed)) for temperature in TEMPERATURES]
    return np.array([(group, search.energy(state), *search.quality(state)) for group, state in rows])


def correlation_row(name, rows):
    cells = [name]
    for chosen in (np.ones(len(rows), dtype=bool), rows[:, 0] < 2):
        cells.append(str(int(chosen.sum())))
        for column in (2, 3):
            values = rows[chosen][:, column]
            same = np.ptp(values) < 1e-9
            cells.append("all equal" if same else f"{stats.spearmanr(rows[chosen][:, 1], values).statistic:+.2f}")
    return "| " + " | ".join(cells) + " |"


def draw(found):
    from matplotlib.figure import Figure

    columns = (len(found) + 1) // 2
    figure = Figure(figsize=(3.2 * columns, 6), layout="constrained")
    panels = figure.subplots(2, columns, squeeze=False).ravel()
    groups = ((2, "o", "C7", "chain at a temperature, or alone"), (1, "o", "C0", "sampler and local search"),
              (0, "*", "C3", "search (default)"))  # fmt: skip
    for panel, (name, rows) in zip(panels, found.items(), strict=False):
        above = rows[:, 1] - rows[:, 1].min()
        for group, marker, colour, label in groups:
            chosen = rows[:, 0] == group
            panel.plot(
                above[chosen] + 1,
                rows[chosen][:, 2],
                marker,
                color=colour,
                markersize=11 if group == 0 else 4,
                alpha=1 if group == 0 else 0.7,
                label=label,
            )
        panel.set_xscale("log")
        panel.set_ylim(-3, 103)
        panel.set_title(name, fontsize=10)
        panel.grid(alpha=0.3)
    for panel in panels[len(found) :]:
        panel.set_axis_off()
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3, fontsize=9)
    figure.supxlabel("energy above the lowest state of the scene, plus 1", fontsize=10)
    figure.supylabel("object quality, %", fontsize=10)
    figure.savefig(IMAGES / "mpp-energy-quality.png", dpi=100)


def changes(options):
    """Print how often energy and quality agree about a change, and the weights that a fit chooses."""
    made = []
    for name, seed, scene in scenes_of(options.presets, options.seeds, ()):
        made.append((name, Changes(scene, seed).rows()))
        print(f"{name}, seed {seed}: {len(made[-1][1])} changes", flush=True)
    rows = np.concatenate([found for _, found in made])
    default = np.array([rb.make_detector("mpp").values()[name] for name in WEIGHTS])
    chosen, temperature = fitted(rows, default)
    print("\n| | " + " | ".join(WEIGHTS) + " |\n|---" + "|--:" * len(WEIGHTS) + "|")
    for label, weights in (("default", default), (f"fit, temperature {temperature:.0f}", chosen)):
        print(f"| {label} | " + " | ".join(f"{weight:.3g}" for weight in weights) + " |")
    print("\n| change | made | raise quality | energy agrees | after the fit |\n|---|--:|--:|--:|--:|")
    for kind, label in enumerate((*KINDS, "all")):
        part = rows if label == "all" else rows[rows[:, 0] == kind]
        shares = (np.mean(part[:, -1] > LEAST), agreement(part, default), agreement(part, chosen))
        print(f"| {label} | {len(part)} | " + " | ".join(f"{share:.1%}" for share in shares) + " |")
    left = []
    for k, (_, found) in enumerate(made):
        others = np.concatenate([other for m, (_, other) in enumerate(made) if m != k])
        left.append((agreement(found, default), agreement(found, fitted(others, default)[0])))
    by_default, by_fit = np.mean(left, axis=0)
    print(f"\neach scene by weights fitted on the others: {by_default:.1%} by default, {by_fit:.1%} fitted")


def agreement(rows, weights):
    """Return the share of the changes that matter about which energy and quality agree."""
    matters = np.abs(rows[:, -1]) > LEAST
    return np.mean(np.sign(-rows[matters, 1:-1] @ weights) == np.sign(rows[matters, -1]))


def fitted(rows, default):
    """Return weights and temperature that make improving changes likely; each kind of change has the same weight."""
    rows = rows[np.abs(rows[:, -1]) > LEAST]
    share = np.minimum(np.abs(rows[:, -1]), 2)
    for kind in range(len(KINDS)):
        of_kind = rows[:, 0] == kind
        share[of_kind] /= max(share[of_kind].sum(), 1e-9) * len(KINDS)
    better = np.sign(rows[:, -1])

    def loss(logs):
        delta = rows[:, 1:-1] @ (default * np.exp(logs[:-1])) / np.exp(logs[-1])
        return share @ np.logaddexp(0, np.clip(better * delta, -50, 50)) + HELD * np.mean(logs[:-1] ** 2)

    best = optimize.minimize(loss, [0.0] * len(default) + [3.0], method="L-BFGS-B").x
    weights = default * np.exp(best[:-1])
    texture = WEIGHTS.index("texture_weight")
    return weights / weights[texture] * default[texture], np.exp(best[-1])


class Changes:
    """Single changes of what the search finds on one scene.

    A row holds the kind, the change of what each weight multiplies, and the change of object plus pixel quality of the
    rectangles as they are, in objects of the reference.
    """

    def __init__(self, scene, seed):
        self.search = search = Search(scene)
        self.scene, self.model, self.rng = scene, search.prepared.model, np.random.default_rng(seed)
        self.found, _ = search.rectangles()
        plain = Search(scene, "fit_weight=0").prepared.score
        prepared = search.prepared
        none, height = np.zeros(plain.shape, dtype=bool), prepared.height.astype(np.int32)
        unit = np.full(plain.shape, 1000, dtype=np.int16)
        high, low = prepared.state == HIGH, prepared.state == LOW
        parts = ((high, plain), (high, prepared.score), (low, unit), (~(high | low), unit))
        self.parts = [make_tables(height, none, np.where(mask, values, 0).astype(np.int16)) for mask, values in parts]
        self.own = [self.features(one) for one in self.found]
        self.before = self.quality(self.found)

    def features(self, rectangle):
        """Return what price, fit, texture, low and void cells multiply in the energy of a rectangle by itself."""
        prepared, model = self.search.prepared, self.model
        fit = fit_roof(prepared.tables, rectangle, model.roof_rules, ground_variance(rectangle, model)).likelihood
        texture, high, low, void = (scan(table, rectangle) for table in self.parts)
        crown = (high.score - texture.score) / model.fit_weight
        weight = model.weight
        return np.array([1, -weight * (fit + crown), -weight * texture.score, weight * low.score,
                         weight * (void.score + void.outside)])  # fmt: skip

    def quality(self, rectangles):
        polygons = shapely.polygons(to_world(rectangles, self.search.prepared.grid))
        found = rb.Footprints.of(polygons, crs=self.scene.crs)
        return 0.01 * len(self.scene.reference) * sum(quality_of(found, self.scene))

    def common(self, rectangle, skipped):
        kept = np.delete(self.found, skipped, axis=0)
        return overlaps(kept, len(kept), rectangle, -1, -1) * self.model.cell**2

    def row(self, kind, removed, added):
        added = np.array(added).reshape(-1, 5)
        delta = np.zeros(6)
        delta[:5] = sum((self.features(one) for one in added), np.zeros(5)) - sum(self.own[k] for k in removed)
        delta[5] = sum(self.common(one, removed) for one in added)
        delta[5] -= sum(self.common(self.found[k], [k]) for k in removed)
        if len(added) == 2:
            delta[5] += overlaps(added[:1], 1, added[1], -1, -1) * self.model.cell**2
        if len(removed) == 2:  # what the two share with each other was subtracted twice
            delta[5] += overlaps(self.found[removed[:1]], 1, self.found[removed[1]], -1, -1) * self.model.cell**2
        after = self.quality(np.concatenate([np.delete(self.found, removed, axis=0), added]))
        return (kind, *delta, after - self.before)

    def rows(self):
        return np.array([self.row(*change) for change in self.drawn() if self.holds(change[2])])

    def holds(self, added):
        return all(min(one[2:4]) >= self.model.least_side for one in added)

    def drawn(self):
        found, rng, least = self.found, self.rng, self.model.least_side
        boxes = self.search.prepared.boxes

        def some(share=1.0):
            return rng.permutation(len(found))[: int(EACH * share)]

        yield from ((0, [i], []) for i in some())
        free = [box for box, energy in zip(boxes.rectangles, boxes.energies, strict=True) if energy < 150
                and overlaps(found, len(found), box, -1, -1) < 0.3 * box[2] * box[3]]  # fmt: skip
        yield from ((1, [], [free[k]]) for k in rng.permutation(len(free))[:EACH])
        for i in some(2):
            moved = np.empty(5)
            move_edge(found[i], int(rng.integers(4)), rng.choice([-4, -2, -1, 1, 2, 4]) * rng.uniform(0.5, 1.5), moved)
            yield 2, [i], [moved]
        for i in some():
            yield 3, [i], [found[i] + np.array([*rng.normal(0, 2, 2), 0, 0, 0])]
        for i in some(0.5):
            yield 4, [i], [found[i] + np.array([0, 0, 0, 0, rng.normal(0, 0.08)])]
        for i in some():
            axis = int(rng.integers(2))
            half = 0.5 * found[i][2 + axis]
            if half > least + 0.5:
                first, second, wall = np.empty(5), np.empty(5), rng.uniform(least - half, half - least)
                cut(found[i], axis, -half, wall, first)
                cut(found[i], axis, wall, half, second)
                yield 5, [i], [first, second]
        for i in some(2):
            apart = np.hypot(*(found[:, :2] - found[i, :2]).T)
            j = int(np.argsort(apart)[1]) if len(found) > 1 else i
            if j != i and apart[j] < 0.75 * (found[i][2:4].max() + found[j][2:4].max()):
                merged = np.empty(5)
                hull(found[i], found[j], merged)
                yield 6, [i, j], [merged]


def numbers(text):
    first, _, last = text.partition("-")
    return tuple(range(int(first), int(last or first) + 1))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", choices=("chain", "states", "changes"))
    parser.add_argument("--presets", help="by commas; - for none")
    parser.add_argument("--seeds", type=numbers, default=(901,), help="such as 901-912")
    parser.add_argument("--folders", default="", help="scene folders with a reference, by commas")
    parser.add_argument("--change", default="", help="parameters of mpp for all runs of chain")
    parser.add_argument("--level", default="part", help="level of chain")
    options = parser.parse_args()
    default = {"chain": PRESETS, "states": PICTURED, "changes": FITTED}[options.study]
    options.presets = default if options.presets is None else [p for p in options.presets.split(",") if p != "-"]
    options.folders = [folder for folder in options.folders.split(",") if folder]
    {"chain": chain, "states": states, "changes": changes}[options.study](options)


if __name__ == "__main__":
    main()
