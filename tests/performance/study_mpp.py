"""How the result of the marked point process moves: the tables and figures of docs/results/mpp.md.

Run by hand: ``python tests/performance/study_mpp.py ablation --folders delft,ign`` and the same with ``readings``,
``sensitivity``, ``points``, ``ground``, ``detectors``, ``shapes`` or ``pictures``; figures go to
docs/images.

Small presets of one or two scene seeds and the real scenes in folders. Q_l is object quality
of the buildings, Q_lp pixel quality, both in percent by the threshold-free evaluator (nearest matching, exact areas);
of a real scene the second number is agreement: the area that all footprints have in common with all of the reference,
as a share of the area of both together, within the evaluation area. The detector never sees classes, and sees no image.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import shapely

import roofbench as rb
from roofbench.core.errors import RoofbenchError

IMAGES = Path(__file__).resolve().parents[2] / "docs" / "images"
#: The references of the presets are parts of buildings, one rectangle each.
LEVEL = "part"
#: Presets with an image, and the detectors that are compared there.
IMAGED = ("fairfield-1", "fairfield-2", "fairfield-3", "knox", "moonee-ponds")
RIVALS = (f"mpp[level={LEVEL}]", "ndsm", "original", "improved")
PRESETS = ("vaihingen-a-small", "toronto-a-small", "knox-small")
ABLATIONS = {
    "as it is": "",
    "the printed algorithm": "mpp-printed",
    "the sampler as well": "optimiser=rjmcmc",
    "the sampler, empty start": "optimiser=rjmcmc,start=empty",
    "the sampler, empty start, no local search": "optimiser=rjmcmc,start=empty,sweeps=0",
    "the same, 16 times the proposals": "optimiser=rjmcmc,start=empty,sweeps=0,effort=4",
    "flat roofs alone": "roofs=flat",
    "no texture": "texture_weight=0",
    "no superstructures": "carried_share=1.1",
    "ground without error": "ground_error=0",
    "overlap is free": "overlap=0",
    "no test of slender parts": "slender=1000,part_share=0",
    "no test of the mean evidence": "least_evidence=0",
    "buildings": "level=building",
    "blocks": "level=block",
}
#: Readings of the print, as docs/results/mpp.md names them.
_FAR = "heights=above-ground,update=union,least_height=2.5,overlap_share=0.1,prior_limit=3"
READINGS = {
    "as printed, 30,000 iterations": "iterations=30000",
    "as printed, 1,000,000 iterations": "iterations=1000000",
    "H": "heights=above-ground",
    "U": "update=union",
    "O": "overlap_share=0.1",
    "P": "prior_limit=3",
    "N": "least_height=2.5",
    "H, U, N": "heights=above-ground,update=union,least_height=2.5",
    "H, U, N, O": "heights=above-ground,update=union,least_height=2.5,overlap_share=0.1",
    "H, U, N, P": "heights=above-ground,update=union,least_height=2.5,prior_limit=3",
    "H, U, N, O, P": _FAR,
    "the same without H": f"{_FAR},heights=elevation",
    "the same without U": f"{_FAR},update=printed",
    "the same, lambda 100 and as many births as deaths": f"{_FAR},buildings=100,birth_share=0.5",
    "the same, tau 0.3 ± 0.1 m": f"{_FAR},tau_mean=0.3,tau_spread=0.1",
    "the same, p_f = 1": f"{_FAR},false_alarm_ratio=1",
    "the same, p_f = 0.01": f"{_FAR},false_alarm_ratio=0.01",
    "the same, exp(n/N) counts within one tau": f"{_FAR},match=1",
    "H, U, N, O, P, T": f"{_FAR},tree_spread=10",
    "the same, length 30 ± 20, width 15 ± 10 m": (
        f"{_FAR},tree_spread=10,length_mean=30,length_spread=20,width_mean=15,width_spread=10"
    ),
}
FACTORS = (0.5, 2.0)
#: Seeds of random thinnings.
DRAWS = (5, 6, 7)
NUMBERS = (
    "price", "fit_weight", "least_tau", "low_price", "void_price", "texture_weight", "texture_limit", "least_height",
    "least_side", "roof_price", "roof_step", "overlap", "ground_error", "slender",
    "part_share", "least_evidence",
)  # fmt: skip
OTHERS = {
    "carried_share": (0.5, 0.8),
    "cell": (0.5, 1.0),
    "largest_side": (60.0, 150.0),
}


class Case:
    """Scenes that share a column of a table."""

    def __init__(self, name, scenes, *, real=False):
        self.name, self.scenes, self.real = name, scenes, real

    def quality(self, change="", points=None, *, dem=True):
        """Return mean object and pixel quality over scenes, percent; `points` maps a cloud to another."""
        rows = []
        for scene in self.scenes:
            cloud = scene.points.unclassified() if points is None else points(scene.points.unclassified())
            seen = rb.Scene(scene.name, scene.extent, crs=scene.crs, points=cloud, dem=scene.dem if dem else None)
            rows.append(indices(scene, seen, change, real=self.real))
        return np.nanmean(np.array(rows, dtype=float), axis=0)


def indices(scene, seen, change, *, real):
    detector = rb.make_detector(change if change == "mpp-printed" else f"mpp[level={LEVEL},{change}]")
    found = detector.detect(seen, np.random.default_rng(0))
    result = rb.evaluate(found, scene.reference, area=scene.area)
    by_object, pixel = result.object.quality, result.pixel.quality
    if real:
        pixel = agreement(found, scene)
    return 100 * (by_object or 0), 100 * (pixel or 0)


def agreement(found, scene):
    """Return the area in common of both unions over that of both together, whichever house is which."""
    detected, reference = (shapely.union_all(footprints.polygons) for footprints in (found, scene.reference))
    if scene.area is not None:
        detected, reference = shapely.intersection([detected, reference], scene.area)
    return detected.intersection(reference).area / detected.union(reference).area


@cache
def scene_of(name, seed):
    return rb.make_scene(name, seed=seed)


def cases(folders, presets=PRESETS, seeds=(1, 2)):
    made = [Case(name, [scene_of(name, seed) for seed in seeds]) for name in presets]
    return made + [Case(Path(folder).name, [rb.open_scene(folder)], real=True) for folder in folders]


def head(chosen, first):
    print(
        f"\n| {first} | "
        + " | ".join(f"{case.name} Q_l | {'agreement' if case.real else 'Q_lp'}" for case in chosen)
        + " |"
    )
    print("|---" + "|--:" * (2 * len(chosen)) + "|")


def line(label, values, base=None):
    pairs = np.ravel(values) if base is None else np.ravel(values) - np.ravel(base)
    text = (f"{value:.1f}" if base is None else f"{value:+.1f}" for value in pairs)
    print(f"| {label.strip()} | " + " | ".join(text) + " |", flush=True)


def ablation(folders):
    chosen = cases(folders)
    head(chosen, "change")
    base = None
    for label, change in ABLATIONS.items():
        values = [case.quality(change) for case in chosen]
        line(label, values, base)
        base = values if base is None else base


def sensitivity(folders):
    """Print the mean change of quality with each parameter; draw its range over the values, a bar a scene."""
    chosen = cases(folders, seeds=(1,))
    defaults = rb.make_detector("mpp").values()
    base = np.array([case.quality() for case in chosen])
    sweeps = {name: tuple(round(defaults[name] * factor, 6) for factor in FACTORS) for name in NUMBERS} | OTHERS
    rows = {}
    for name, values in sweeps.items():
        found = np.array([[case.quality(f"{name}={value}") for case in chosen] for value in values])
        rows[name] = found - base
        default = "automatic" if defaults[name] is None else f"{defaults[name]:g}"
        mean = rows[name].mean(axis=1)
        cells = (f"{value:g}: {change[0]:+.1f}, {change[1]:+.1f}" for value, change in zip(values, mean, strict=True))
        print(f"| `{name}` | {default} | " + " | ".join(cells) + " |", flush=True)
    draw_sensitivity(rows, [case.name for case in chosen])


def draw_sensitivity(rows, names):
    from matplotlib.figure import Figure

    order = sorted(rows, key=lambda name: np.ptp(rows[name][:, :, 0], axis=0).mean())
    figure = Figure(figsize=(10, 7), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for panel, column, title in zip(panels, (0, 1), ("object quality", "pixel quality"), strict=True):
        for k, scene in enumerate(names):
            offset = 0.8 * ((k + 0.5) / len(names) - 0.5)
            for place, name in enumerate(order):
                change = rows[name][:, k, column]
                ends = min(change.min(), 0), max(change.max(), 0)
                panel.plot(ends, [place - offset] * 2, color=f"C{k}", linewidth=2.5, solid_capstyle="butt",
                           label=scene if place == 0 else None)  # fmt: skip
        panel.axvline(0, color="black", linewidth=0.8)
        panel.set_xlabel(f"change of {title}, percent points")
        panel.grid(axis="x", alpha=0.3)
        for place in range(1, len(order), 2):
            panel.axhspan(place - 0.5, place + 0.5, color="0.95", zorder=0)
    panels[0].set_yticks(range(len(order)), order)
    panels[0].set_ylim(-0.5, len(order) - 0.5)
    panels[0].legend(fontsize=8, loc="lower left")
    save(figure, "mpp-sensitivity.png")


def readings(_folders):
    """Print what each reading of the print reaches on two small presets."""
    scenes = [scene_of(name, 1) for name in ("toronto-a-small", "vaihingen-a-small")]
    print("\n| reading |" + "".join(f" {scene.name} C_m | C_r | Q_l | Q_lp |" for scene in scenes))
    print("|---" + "|--:" * 4 * len(scenes) + "|")
    for label, change in READINGS.items():
        values = []
        for scene in scenes:
            # A later value of a parameter replaces an earlier one.
            given = dict(part.split("=") for part in f"iterations=200000,{change}".split(","))
            detector = rb.make_detector(f"mpp-printed[{','.join(map('='.join, given.items()))}]")
            result = rb.evaluate(detector.detect(scene.for_detection(), np.random.default_rng(0)), scene.reference)
            values += [result.object.completeness, result.object.correctness, result.object.quality]
            values.append(result.pixel.quality)
        print(f"| {label} | " + " | ".join(f"{100 * (value or 0):.1f}" for value in values) + " |", flush=True)


def thinned(density, draw):
    def thin(cloud):
        places = np.floor(np.column_stack([cloud.x, cloud.y]) / 2)
        covered = 4.0 * len(np.unique(places, axis=0))
        keep = np.random.default_rng(draw).random(len(cloud)) < density * covered / len(cloud)
        return cloud.take(keep)

    return thin


def without_return_numbers(cloud):
    return replace(cloud, return_number=None, number_of_returns=None)


def first(cloud):
    return cloud.take(cloud.return_number == 1)


def last(cloud):
    return cloud.take(cloud.return_number == cloud.number_of_returns)


def points(folders):
    """Print quality by density and kind of returns; what is thinned at random is the mean of some draws."""
    chosen = cases(folders, presets=())
    whole = {"all returns": None, "first returns": first, "last returns": last}
    whole["return numbers unknown"] = without_return_numbers
    head(chosen, "points (no DEM)")
    for label, change in whole.items():
        line(label, [case.quality(points=change, dem=False) for case in chosen])
    random = {f"{density} points per m2": (density, lambda cloud: cloud) for density in (15, 8, 3, 1.5)}
    for label, returns in (("first", first), ("last", last)):
        change = partial(lambda returns, cloud: without_return_numbers(returns(cloud)), returns)
        random[f"{label} returns, numbers unknown, 3 per m2"] = (3, change)
    for label, (density, change) in random.items():
        thin = [partial(lambda thin, change, cloud: thin(change(cloud)), thinned(density, k), change) for k in DRAWS]
        values = [[case.quality(points=one, dem=False) for case in chosen] for one in thin]
        line(label, np.mean(values, axis=0))


def ground(folders):
    chosen = cases(folders, presets=("toronto-a", "vaihingen-a", "knox", "moonee-ponds"), seeds=(1,))
    head(chosen, "ground")
    line("DEM of the scene", [case.quality() for case in chosen])
    line("own ground surface", [case.quality(dem=False) for case in chosen])


def detectors(_folders, presets=IMAGED, scene_seeds=(1, 2, 3), names=RIVALS):
    """Print means over scene seeds, and the lead of the first detector over the others, paired by scene.

    Seeds for which the generator refuses a preset are left out.
    """
    print(
        "\n| preset | scenes | detector | C_m % | C_r % | Q_l % | M_d % | Q_lp % |\n|---|--:|---|--:|--:|--:|--:|--:|"
    )
    for preset in presets:
        rows = {name: [] for name in names}
        for seed in scene_seeds:
            scene = rb.make_scene(preset, seed=seed)
            try:
                scene.points  # noqa: B018
            except RoofbenchError as error:
                print(f"  seed {seed} is left out: {error}")
                continue
            for name in names:
                rows[name].append(shares_of(name, scene))
            print(f"  seed {seed}, Q_l: " + ", ".join(f"{name} {rows[name][-1][2]:.1f}" for name in names), flush=True)
        for name in names:
            means = " | ".join(f"{value:.1f}" for value in np.mean(rows[name], axis=0))
            print(f"| {preset} | {len(rows[name])} | {name} | {means} |", flush=True)
        for name in names[1:]:
            lead = np.array(rows[names[0]]) - np.array(rows[name])
            mean, error = lead.mean(axis=0), lead.std(axis=0, ddof=1) / np.sqrt(len(lead))
            print(f"  lead over {name}: Q_l {mean[2]:+.1f} ± {error[2]:.1f}, Q_lp {mean[4]:+.1f} ± {error[4]:.1f}")


def shares_of(name, scene):
    found = rb.make_detector(name).detect(scene.for_detection(), np.random.default_rng(0))
    result = rb.evaluate(found, scene.reference)
    shares = result.object.completeness, result.object.correctness, result.object.quality
    return [100 * (share or 0) for share in (*shares, result.object.multiple_detection_rate, result.pixel.quality)]


def best_rectangle(polygon):
    """Return the rectangle with the largest intersection over union with a polygon, by descent, and that share."""
    outline = np.array(shapely.minimum_rotated_rectangle(polygon).exterior.coords)[:4]
    along, across = outline[1] - outline[0], outline[3] - outline[0]
    middle = outline.mean(axis=0)
    now = np.array([*middle, np.hypot(*along), np.hypot(*across), np.arctan2(along[1], along[0])])

    def made(values):
        x, y, a, b, angle = values
        box = shapely.affinity.rotate(shapely.box(-a / 2, -b / 2, a / 2, b / 2), angle, use_radians=True, origin=(0, 0))
        return shapely.affinity.translate(box, x, y)

    def share(values):
        box = made(values)
        common = box.intersection(polygon).area
        return common / (box.area + polygon.area - common)

    best, step = share(now), 2.0
    while step > 0.05:
        moved = False
        u, v = np.array([np.cos(now[4]), np.sin(now[4])]), np.array([-np.sin(now[4]), np.cos(now[4])])
        moves = [np.array([*(0.5 * s * step * u), t * step, 0, 0]) for s in (-1, 1) for t in (-1, 1)]
        moves += [np.array([*(0.5 * s * step * v), 0, t * step, 0]) for s in (-1, 1) for t in (-1, 1)]
        moves += [np.array([0, 0, 0, 0, s * step / max(now[2], now[3])]) for s in (-1, 1)]
        for change in moves:
            if (now + change)[2:4].min() > 0.5 and share(now + change) > best + 1e-6:
                now, best, moved = now + change, share(now + change), True
        if not moved:
            step /= 2
    return made(now), best


def shapes(folders):
    """What rectangles could reach at best: one for each reference footprint, as if the detector were perfect."""
    print(
        "\n| scene | footprints | area / bounding rectangle: median | best IoU: median | below 0.8 | below 0.6 |",
        end="",
    )
    print(" Q_l % at best | Q_lp % at best |\n|---|--:|--:|--:|--:|--:|--:|--:|")
    for folder in folders:
        scene = rb.open_scene(folder)
        polygons = scene.reference.polygons
        filled = shapely.area(polygons) / shapely.area(shapely.minimum_rotated_rectangle(polygons))
        boxes, shares = zip(*(best_rectangle(polygon) for polygon in polygons), strict=True)
        shares = np.array(shares)
        result = rb.evaluate(rb.Footprints.of(boxes, crs=scene.crs), scene.reference, area=scene.area)
        print(
            f"| {Path(folder).name} | {len(polygons)} | {np.median(filled):.2f} | {np.median(shares):.2f} | "
            f"{(shares < 0.8).mean():.0%} | {(shares < 0.6).mean():.0%} | {100 * result.object.quality:.1f} | "
            f"{100 * result.pixel.quality:.1f} |",
            flush=True,
        )


def pictures(folders):
    """Draw the evidence, the convergence and the result of one run."""
    from roofbench.reports.steps.step_figure import step_figure

    scene = rb.open_scene(folders[0])
    for step in rb.make_detector("mpp[optimiser=rjmcmc]").steps(scene, np.random.default_rng(0)):
        if step.name in ("evidence", "convergence", "buildings"):
            save(step_figure(step), f"mpp-{step.name}.png")


def save(figure, name):
    """Save a picture of less than 300 kB: with 256 colours, rare ones kept, then smaller."""
    from PIL import Image as Picture

    for dpi in (110, 100, 90, 75):
        figure.savefig(IMAGES / name, dpi=dpi, bbox_inches="tight")
        with Picture.open(IMAGES / name) as picture:
            few = picture.convert("RGB").quantize(256, method=Picture.Quantize.MAXCOVERAGE, dither=Picture.Dither.NONE)
            few.save(IMAGES / name, optimize=True)
        if (IMAGES / name).stat().st_size < 290_000:
            return


STUDIES = {
    "ablation": ablation,
    "readings": readings,
    "sensitivity": sensitivity,
    "points": points,
    "ground": ground,
    "detectors": detectors,
    "shapes": shapes,
    "pictures": pictures,
}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", choices=tuple(STUDIES))
    parser.add_argument("--folders", default="", help="scene folders with a reference, by commas")
    parser.add_argument("--presets", default=",".join(IMAGED), help="of detectors, by commas")
    parser.add_argument("--seeds", default="1-3", help="of detectors: first and last seed")
    parser.add_argument("-d", "--detector", action="append", help="of detectors; repeat for more")
    options = parser.parse_args()
    folders = [folder for folder in options.folders.split(",") if folder]
    if options.study == "detectors":
        first, last = map(int, options.seeds.split("-"))
        detectors(folders, options.presets.split(","), range(first, last + 1), options.detector or RIVALS)
    else:
        STUDIES[options.study](folders)


if __name__ == "__main__":
    main()
