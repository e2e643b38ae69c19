"""Real crowns between real houses: the tables of docs/results/real-scenes.md on crowns that fill gaps.

Run by hand: ``python tests/performance/study_crowns.py table --folders kentucky-s,ign-s,st-barth-s -d mpp``; ``choose``
prints the values of the threshold of openness, ``pictures`` draws docs/images/crowns.png of the first two folders.
Folders are scenes with a reference, as `roofbench scenes import` writes them. ``--without`` is the threshold that
switches the rule off.

Scenes are put together of pieces of one real scene, so that returns of roofs and crowns are measured ones: the points
of single houses of 50 to 450 m2, two side by side on flat ground at a given distance, and the points of single trees in
the gap between them and elsewhere, ground under the crowns included. Trees in gaps keep their height or are scaled to
a share of the lower ridge. Ground elsewhere is flat, with the scene's density. Pieces are chosen and turned at random.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from itertools import islice, product

import numpy as np
import shapely
from scipy import ndimage
from study_real import IMAGES, blind, remembered, scored, set_to

import roofbench as rb
from roofbench.detectors.mpp import block_cells

#: Metres: distances of the two houses, field of a pair, cell in which trees are connected, and coordinates of a scene.
GAPS, FIELD, CELL, PLACE = (2.5, 4.5), 60.0, 0.5, np.array([500_000.0, 5_000_000.0])
#: Height of the crowns in gaps: as measured, or so many times the lower ridge.
TOPS = (None, 1.0, 0.8)
PAIRS, COLUMNS, FREE_TREES = 12, 4, 25
VALUES = (99.0, 0.5, 0.65, 0.75, 0.85, 1.0)


@dataclass(frozen=True)
class Piece:
    """Points of a house or tree around its centre; `outline` is that of a house, `radius` that of a tree."""

    index: np.ndarray
    xy: np.ndarray
    height: np.ndarray
    outline: shapely.Polygon | None = None
    radius: float = 0.0


@dataclass(frozen=True)
class Source:
    """A real scene and its pieces; `density` in points per m2."""

    scene: rb.Scene
    houses: list[Piece]
    trees: list[Piece]
    density: float


def source_of(folder):
    scene = blind(rb.open_scene(folder))
    points = scene.points
    height = points.z - scene.heights.ground.sample(points.x, points.y)
    references = shapely.get_parts(scene.reference.polygons)
    tree = shapely.STRtree(references)
    near = np.zeros(len(points), dtype=bool)
    near[tree.query(shapely.points(points.x, points.y), predicate="dwithin", distance=1.2)[0]] = True
    row, column = (((values - values.min()) / CELL).astype(int) for values in (points.y, points.x))
    return Source(
        scene,
        list(single_houses(points, height, references)),
        list(single_trees(points, height, near, row, column)),
        density_of(row, column),
    )


def single_houses(points, height, references):
    for k, outline in enumerate(references):
        apart = all(other.distance(outline) >= 1.5 for j, other in enumerate(references) if j != k)
        if not (apart and 50 < outline.area < 450):
            continue
        index = np.flatnonzero(shapely.contains_xy(outline.buffer(0.6), points.x, points.y))
        middle = np.median(height[index])
        # No tree above the roof.
        if middle < 2.5 or np.mean(height[index] > middle + 5) > 0.03:
            continue
        frame = shapely.minimum_rotated_rectangle(outline)
        corner = shapely.get_coordinates(frame)
        sides = np.diff(corner[:3], axis=0)
        long = sides[np.argmax(np.hypot(*sides.T))]
        centre = shapely.get_coordinates(frame.centroid)[0]
        turn = turned(-np.arctan2(long[1], long[0]))
        flat = shapely.Polygon((shapely.get_coordinates(outline.exterior) - centre) @ turn)
        xy = (np.stack([points.x[index], points.y[index]], axis=1) - centre) @ turn
        yield Piece(index, xy, height[index], flat)


def single_trees(points, height, near, row, column):
    leaves = (height > 2.5) & (height < 30) & ~near
    mask = np.zeros((row.max() + 1, column.max() + 1), dtype=bool)
    mask[row[leaves], column[leaves]] = True
    labels, count = ndimage.label(ndimage.binary_closing(mask, iterations=2))
    area, own = np.bincount(labels.ravel()) * CELL**2, labels[row, column]
    for k in range(1, count + 1):
        index = np.flatnonzero((own == k) & (height > -0.5))
        if not 8 < area[k] < 90 or len(index) < 25 or np.quantile(height[index], 0.95) < 3.5:
            continue
        xy = np.stack([points.x[index], points.y[index]], axis=1)
        yield Piece(index, xy - xy.mean(axis=0), height[index], None, float(np.sqrt(area[k] / np.pi)))


def density_of(row, column):
    filled = np.zeros((row.max() + 1, column.max() + 1), dtype=bool)
    filled[row, column] = True
    covered = ndimage.binary_closing(filled, iterations=2).sum() * CELL**2
    # The last fifth are further returns of pulses that met a crown.
    return 0.8 * len(row) / covered


def turned(angle):
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, sin], [-sin, cos]])


class Field:
    """Pieces that were put down."""

    def __init__(self, source):
        self.source, self.index, self.xy, self.z = source, [], [], []
        self.houses, self.crowns = [], []

    def put(self, index, xy, z):
        self.index.append(index)
        self.xy.append(xy)
        self.z.append(z)

    def scene(self, rng, name):
        size = np.array([COLUMNS, -(-PAIRS // COLUMNS)]) * FIELD
        ground = rng.uniform([0, 0], size, (int(self.source.density * size.prod()), 2))
        hidden = shapely.union_all([*shapely.buffer(self.houses, 0.5), *self.crowns])
        ground = ground[~shapely.contains_xy(hidden, ground)]
        index, xy = np.concatenate(self.index), np.concatenate([*self.xy, ground])
        points = self.source.scene.points
        returns = {}
        for field in ("return_number", "number_of_returns"):
            values = getattr(points, field)
            if values is not None:
                returns[field] = np.concatenate([values[index], np.ones(len(ground), np.uint8)])
        z = np.concatenate([*self.z, rng.normal(0, 0.04, len(ground))]) + 100
        cloud = rb.PointCloud(*(xy + PLACE).T.copy(), z, **returns)
        outlines = shapely.transform(np.array(self.houses, dtype=object), lambda values: values + PLACE)
        reference = rb.Footprints.of(outlines, crs="EPSG:25832")
        return rb.Scene(name, (*PLACE, *(PLACE + size)), crs="EPSG:25832", points=cloud, reference=reference)


def scene_of(source, gap, top, seed):
    """Pairs of houses at a distance of `gap` metres, with crowns between them."""
    rng, field = np.random.default_rng(seed), Field(source)
    for k in range(PAIRS):
        place = (np.array(divmod(k, COLUMNS))[::-1] + 0.5) * FIELD
        turn = turned(-rng.uniform(-0.5, 0.5))
        pair = [beside(source, rng, side, gap) for side in (-1, 1)]
        pair[1] = moved(pair[1], pair[0], gap)
        for piece, xy, outline in pair:
            field.put(piece.index, xy @ turn + place, piece.height)
            field.houses.append(shapely.Polygon(shapely.get_coordinates(outline.exterior) @ turn + place))
        fill_gap(field, rng, pair, gap, top, lambda xy, turn=turn, place=place: xy @ turn + place)
    free_trees(field, rng)
    return field.scene(rng, f"{source.scene.name}-{gap:g}-{top}-{seed}")


def beside(source, rng, side, gap):
    """A house, turned by a multiple of 90 degrees, on one side of the gap."""
    piece = source.houses[rng.integers(len(source.houses))]
    turn = turned(rng.integers(4) * np.pi / 2)
    outline = shapely.Polygon(shapely.get_coordinates(piece.outline.exterior) @ turn)
    west, _, east, _ = outline.bounds
    shift = (-east - gap / 2, 0) if side < 0 else (-west + gap / 2, 0)
    return piece, piece.xy @ turn + shift, shapely.affinity.translate(outline, *shift)


def moved(second, first, gap):
    """The second house moved until the outlines are `gap` metres apart."""
    piece, xy, outline = second
    for _ in range(20):
        rest = gap - outline.distance(first[2])
        xy, outline = xy + np.array([rest, 0]), shapely.affinity.translate(outline, rest, 0)
    return piece, xy, outline


def fill_gap(field, rng, pair, gap, top, to_field):
    first, second = (outline for _, _, outline in pair)
    ridge = min(np.quantile(piece.height, 0.95) for piece, _, _ in pair)
    middle = (first.bounds[2] + second.bounds[0]) / 2
    y, end = (choose(outline.bounds[k] for outline in (first, second)) for k, choose in ((1, max), (3, min)))
    y += 1
    roofs, taken = shapely.buffer([first, second], 0.3), []
    while y < end - 0.5:
        tree = field.source.trees[rng.integers(len(field.source.trees))]
        centre = np.array([middle, y + 0.6 * tree.radius])
        xy = tree.xy @ turned(rng.uniform(0, 2 * np.pi)) + centre
        scale = 1.0 if top is None else top * ridge / np.quantile(tree.height[tree.height > 1], 0.97)
        free = ~(shapely.contains_xy(roofs[0], xy) | shapely.contains_xy(roofs[1], xy))
        for other, radius in taken:
            free &= np.hypot(*(xy - other).T) >= radius
        field.put(tree.index[free], to_field(xy[free]), np.where(tree.height < 0.4, 1, scale)[free] * tree.height[free])
        field.crowns.append(shapely.Point(to_field(centre)).buffer(0.9 * tree.radius))
        taken.append((centre, tree.radius))
        y += 1.4 * tree.radius


def free_trees(field, rng):
    size = np.array([COLUMNS, -(-PAIRS // COLUMNS)]) * FIELD
    for _ in range(3 * FREE_TREES):
        tree = field.source.trees[rng.integers(len(field.source.trees))]
        centre = rng.uniform(5, size - 5)
        point = shapely.Point(centre)
        if shapely.distance(point, field.houses).min() < tree.radius + 5:
            continue
        if shapely.distance(point, field.crowns).min() < tree.radius:
            continue
        field.put(tree.index, tree.xy + centre, tree.height)
        field.crowns.append(point.buffer(0.9 * tree.radius))


def scenes_of(options):
    """Return the scenes of each place and distance."""
    found = {}
    for folder in options.folders:
        source = source_of(folder)
        print(f"<!-- {source.scene.name}: {len(source.houses)} houses, {len(source.trees)} trees -->")
        for gap, top, seed in product(GAPS, TOPS, range(1, options.seeds + 1)):
            found.setdefault((source.scene.name, gap), []).append(scene_of(source, gap, top, seed))
    return found


def qualities(scenes, detector):
    """Return the means of object and pixel quality and of the points lost where references are merged."""
    outcomes = [scored(rb.detect(scene, detector), scene) for scene in scenes]
    return np.mean([(one.object, one.pixel, one.causes[1]) for one in outcomes], axis=0)


def table(options):
    print("\n| place | gap, m | detector | without: Q_l / Q_lp, merged | with |\n|---|--:|---|--:|--:|")
    for (name, gap), scenes in scenes_of(options).items():
        for detector in options.detectors:
            cells = []
            for value in (options.without, block_cells._AS_OPEN):
                with set_to(block_cells, "_AS_OPEN", value):
                    cells.append("{:.1f} / {:.1f}, {:.1f}".format(*qualities(scenes, detector)))
            print(f"| {name} | {gap:g} | `{detector}` | {' | '.join(cells)} |", flush=True)


def choose_value(options):
    """Print the qualities of each value, and the value that is best without each place."""
    found = scenes_of(options)
    places = list(dict.fromkeys(name for name, _ in found))
    sums = {}
    with remembered():
        for value in VALUES:
            with set_to(block_cells, "_AS_OPEN", value):
                for (name, gap), scenes in found.items():
                    object_quality, pixel, _ = qualities(scenes, options.detectors[0])
                    sums[value, name] = sums.get((value, name), 0) + object_quality + pixel
                    print(f"| {value:g} | {name} | {gap:g} | {object_quality:.1f} / {pixel:.1f} |", flush=True)
    for left_out in places:
        best = max(VALUES, key=lambda value: sum(sums[value, name] for name in places if name != left_out))
        print(f"without {left_out}: {best:g}")


def pictures(options):
    """Draw pairs of houses of two places with the footprints without and with the rule, over the heights."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    figure = Figure(figsize=(13, 4.0), layout="constrained")
    panels = iter(figure.subplots(1, 4).ravel())
    for folder in options.folders[:2]:
        source = source_of(folder)
        for pair, scene, found in islice(parted(source, options), 2):
            panel = next(panels)
            draw_pair(panel, scene, pair, found)
            panel.set_title(f"pieces of {source.scene.name}", fontsize=9)
    lines = [Line2D([], [], color=colour, linewidth=2) for colour in ("C2", "C3", "C0")]
    figure.legend(
        lines, ("reference", "without the rule", "with it"), loc="outside lower center", ncols=3, frameon=False
    )
    figure.savefig(IMAGES / "crowns.png", dpi=80)


def parted(source, options):
    """Yield the pairs that the rule takes apart."""
    for seed in range(1, 10):
        scene = scene_of(source, GAPS[0], 1.0, seed)
        found = []
        for value in (options.without, block_cells._AS_OPEN):
            with set_to(block_cells, "_AS_OPEN", value):
                found.append(rb.detect(scene, options.detectors[0]))
        for pair in scene.reference.polygons.reshape(-1, 2):
            if joined(found[0], pair) and not joined(found[1], pair):
                yield pair, scene, found


def joined(found, pair):
    """Whether one footprint covers much of both houses."""
    common = shapely.area(shapely.intersection(found.polygons[:, None], pair)) / shapely.area(pair)
    return bool((common > 0.4).all(axis=1).any())


def draw_pair(panel, scene, pair, found):
    x, y = shapely.get_coordinates(shapely.union_all(pair).envelope.centroid)[0]
    west, south, east, north = x - 20, y - 20, x + 20, y + 20
    points = scene.points
    near = (points.x > west) & (points.x < east) & (points.y > south) & (points.y < north)
    panel.scatter(
        points.x[near] - west, points.y[near] - south, c=points.z[near] - 100, s=2, cmap="Greys", vmin=0, vmax=9
    )
    for outlines, colour, width in (
        (pair, "C2", 2.5),
        (found[0].polygons, "C3", 2.0),
        (found[1].polygons, "C0", 1.5),
    ):
        for polygon in shapely.get_parts(outlines):
            if polygon.intersects(shapely.box(west, south, east, north)):
                x, y = polygon.exterior.xy
                panel.plot(np.array(x) - west, np.array(y) - south, color=colour, linewidth=width)
    panel.set(xlim=(0, east - west), ylim=(0, north - south), xlabel="m", aspect="equal")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", choices=("table", "choose", "pictures"))
    parser.add_argument("--folders", required=True, type=lambda text: text.split(","), help="scene folders, by commas")
    parser.add_argument("-d", dest="detectors", action="append", help="detector [mpp]")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--without", type=float, default=99.0, help="threshold that switches the rule off [99]")
    options = parser.parse_args()
    options.detectors = options.detectors or ["mpp"]
    {"table": table, "choose": choose_value, "pictures": pictures}[options.study](options)


if __name__ == "__main__":
    main()
