"""Tiles against the whole: ``python tests/performance/study_tiling.py SCENE WORK [--copies 4] [--detectors ndsm mpp]``.

A scene folder is mirrored to N x N copies, every second one turned over so that neighbours meet in what both show, and
written as a folder of tiles (WORK/town, kept for the next call). A detector then runs on the whole in memory and tile
by tile, with the same measured values. Printed for each detector: the share of footprints of the whole that the tiles
have, too (to a thousandth of their area), those centred farther than one halo from every seam by themselves, the time
of both, and the peak memory of a worker. The others are listed with their distance from the nearest seam, and drawn in
WORK/DETECTOR-differences.png, those that lie together in one panel. ``--only-tiles`` leaves the whole out, for towns
that do not fit in memory: 12 x 13 copies of Delft (265 x 230 m) are 3 x 3 km and 130 million points.
"""

import argparse
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import shapely
from mirrored_town import mirror

from roofbench.benchmark.execution.city import City, detect_city
from roofbench.benchmark.execution.executors import Execution
from roofbench.benchmark.execution.worker import detect
from roofbench.benchmark.identity.recipes import SceneRecipe
from roofbench.core.memory import highest_memory
from roofbench.detectors.registry import make_detector
from roofbench.scenes.folder import open_scene
from roofbench.scenes.geodata.vector_files import read_footprints, write_footprints

#: Share of the area by which a footprint may differ from its match.
SAME = 1e-3
#: Metres within which footprints that differ are drawn in one panel, and the highest number of panels.
NEAR, PANELS = 5.0, 12


def apart(whole, tiled):
    """Return by how much each footprint of the whole differs from its nearest of the tiles, in shares of its area."""
    first, second = shapely.STRtree(tiled.polygons).query(whole.polygons, predicate="intersects")
    differ = shapely.area(shapely.symmetric_difference(whole.polygons[first], tiled.polygons[second]))
    least = np.full(len(whole), np.inf)
    np.minimum.at(least, first, differ / whole.areas[first])
    return least


def share(rows):
    """Return a share in words."""
    return f"{100 * rows.mean():.2f} %" if len(rows) else "none"


def from_seams(centres, side):
    """Return the distance of centres from the nearest line of the grid of tiles, metres."""
    return np.minimum(centres % side, side - centres % side).min(axis=1)


def groups_of(polygons):
    """Return the rows of polygons that lie together, the largest group first."""
    near = shapely.union_all(shapely.buffer(polygons, NEAR))
    rows = [np.flatnonzero(shapely.intersects(polygons, part)) for part in shapely.get_parts(near)]
    return sorted(rows, key=len, reverse=True)


def draw(whole, tiled, rows, side, path):
    """Draw the footprints of some rows of the whole (filled) and what the tiles have there (outlines)."""
    groups = groups_of(whole.polygons[rows])[:PANELS]
    columns = min(4, len(groups))
    lines = -(-len(groups) // columns)
    figure, axes = plt.subplots(lines, columns, figsize=(3 * columns, 3 * lines), squeeze=False, layout="constrained")
    for one, group in zip(axes.flat, groups, strict=False):
        west, south, east, north = shapely.total_bounds(whole.polygons[rows[group]])
        reach = max(east - west, north - south) / 2 + 10
        x, y = (west + east) / 2, (south + north) / 2
        panel = shapely.box(x - reach, y - reach, x + reach, y + reach)
        for footprints, style in ((whole, {"facecolor": "0.8"}), (tiled, {"facecolor": "none", "edgecolor": "C3"})):
            for polygon in footprints.polygons[shapely.intersects(footprints.polygons, panel)]:
                for part in shapely.get_parts(polygon):
                    one.fill(*np.array(part.exterior.xy), **style)
        for line in np.arange(np.floor((x - reach) / side) + 1, (x + reach) / side) * side:
            one.axvline(line, color="C0")
        for line in np.arange(np.floor((y - reach) / side) + 1, (y + reach) / side) * side:
            one.axhline(line, color="C0")
        one.set(xlim=(x - reach, x + reach), ylim=(y - reach, y + reach), aspect="equal", xticks=[], yticks=[])
        seam = from_seams(whole.centres[rows[group]], side).min()
        one.set_title(f"{x:.0f} {y:.0f}, {seam:.0f} m from a seam", fontsize=8)
    for one in axes.flat[len(groups) :]:
        one.remove()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("scene", type=Path)
    parser.add_argument("work", type=Path)
    parser.add_argument("--copies", type=int, nargs="+", default=[4])
    parser.add_argument("--detectors", nargs="+", default=["ndsm", "mpp"])
    parser.add_argument("--tile", type=float, default=512.0)
    parser.add_argument("--halo", type=float)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--only-tiles", action="store_true")
    options = parser.parse_args()
    town = options.work / "town"
    if not (town / "scene.toml").is_file():
        mirror(open_scene(options.scene), town, options.copies[0], options.copies[-1])
    recipe, scene = SceneRecipe.of_folder(town), open_scene(town)
    print(f"town of {scene.extent[2] - scene.extent[0]:.0f} x {scene.extent[3] - scene.extent[1]:.0f} m")
    for name in options.detectors:
        detector = make_detector(name)
        halo = detector.halo if options.halo is None else options.halo
        output = options.work / f"{detector.name}.gpkg"
        started = time.perf_counter()
        city = City(tile=options.tile, halo=options.halo)
        result = detect_city(recipe, detector, output, city, execution=Execution(jobs=options.jobs), overwrite=True)
        seconds = time.perf_counter() - started
        print(
            f"{name}: {result.tiles} tiles of {options.tile:g} m, halo {halo:g} m, {seconds:.0f} s with "
            f"{options.jobs} workers, {result.peak_memory / 1e6:.0f} MB each; {result.footprints} footprints, "
            f"{result.seams}, {result.measured.parameters}, failed {result.failed}",
            flush=True,
        )
        if options.only_tiles:
            continue
        scene = open_scene(town)
        scene.ground_cell, scene.whole = result.measured.ground_cell, result.measured.whole
        started = time.perf_counter()
        whole = detect(scene, detector.replaced(result.measured.parameters), stream=np.random.default_rng([0]))
        print(f"  the whole: {time.perf_counter() - started:.0f} s, {len(whole)} footprints", flush=True)
        write_footprints(whole, options.work / f"{detector.name}-whole.gpkg", overwrite=True)
        tiled = read_footprints(output)
        differ = apart(whole, tiled)
        same = differ < SAME
        far = from_seams(whole.centres, options.tile) > halo
        near = from_seams(whole.centres, options.tile) <= halo
        for label, rows in (("all", np.ones(len(whole), dtype=bool)), ("beyond a halo", far), ("within a halo", near)):
            print(f"  {label}: {same[rows].sum()} of {rows.sum()} identical ({share(same[rows])})", flush=True)
        others = np.flatnonzero(~same)
        for row in others:
            (x, y), seam = whole.centres[row], from_seams(whole.centres[[row]], options.tile)[0]
            print(
                f"  differs by {min(differ[row], 9.99):.2f} of {whole.areas[row]:.0f} m2 at {x:.0f} {y:.0f}, "
                f"{seam:.0f} m from a seam"
            )
        if len(others):
            draw(whole, tiled, others, options.tile, options.work / f"{detector.name}-differences.png")
    print(f"peak memory of this process {highest_memory() / 1e6:.0f} MB")


if __name__ == "__main__":
    main()
