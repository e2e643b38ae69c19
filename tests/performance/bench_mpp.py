"""Speed and memory of the marked point process: stages, threads, bytes a cell.

Run by hand: ``python tests/performance/bench_mpp.py [stages] [threads] [span] [memory]`` (all without names),
``--scenes toronto-a,vaihingen-a --repeats 5``; ``--level`` sets the level, ``--change optimiser=rjmcmc`` the sampler.

From arrays in memory to rectangles, after the kernels are compiled. CPU seconds of one thread where threads are not the
subject, the median and the least of the repeats. Threads: wall seconds of one and of two threads in turn, side by side,
so that what else the machine does hits both; the median ratio and that of the least times. Memory: the highest resident
set during a detection less the resident set before it, which holds the scene, divided by the number of cells, in a
process of its own. `+2x2` behind a name makes a mosaic of four copies.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

import numpy as np

import roofbench as rb

STAGES = {
    "cell size": ("preparation", "cell_size"),
    "points to cells": ("preparation", "make_cells"),
    "classes by EM, textures": ("preparation", "tally_textures"),
    "textures again": ("preparation", "textures"),
    "scores": ("preparation", "score_cells"),
    "superstructures": ("preparation", "lower_superstructures"),
    "tables": ("preparation", "make_tables"),
    "boxes": ("preparation", "propose_boxes"),
    "energies of boxes": ("preparation", "_rated"),
    "local search": ("whole_scene", "search"),
    "chains": ("annealing", "run_chain"),
    "walls": ("whole_scene", "close_walls"),
    "footprints": ("mpp_detector", "as_footprints"),
}
LEVEL, CHANGE = "building", ""


def scene_of(name):
    """Return a preset without its reference and image, in memory, and its reference."""
    name, _, tiles = name.partition("+")
    scene = rb.make_scene(name, seed=1)
    points, dem = scene.points, scene.dem
    if tiles != "2x2":
        return rb.Scene(name, scene.extent, crs=scene.crs, points=points, dem=dem), scene.reference
    grid = dem.grid
    wide, high = grid.columns * grid.gsd, grid.rows * grid.gsd
    shifts = [(i * wide, j * high) for i in (0, 1) for j in (0, 1)]
    cloud = rb.PointCloud(
        np.concatenate([points.x + dx for dx, _ in shifts]),
        np.concatenate([points.y + dy for _, dy in shifts]),
        np.concatenate([points.z] * 4),
        return_number=np.concatenate([points.return_number] * 4),
        number_of_returns=np.concatenate([points.number_of_returns] * 4),
    )
    place = rb.Grid(grid.west, grid.north + high, grid.gsd, 2 * grid.rows, 2 * grid.columns)
    west, south, _, _ = scene.extent
    extent = (west, south, west + 2 * wide, south + 2 * high)
    return rb.Scene(
        name, extent, crs=scene.crs, points=cloud, dem=rb.Elevation(np.tile(dem.values, (2, 2)), place)
    ), None


def detect(scene, seed=0, **parameters):
    named = ",".join(f"{name}={value}" for name, value in {"level": LEVEL, **parameters}.items())
    return rb.make_detector(f"mpp[{named}{CHANGE}]").detect(scene, np.random.default_rng(seed))


def module(name):
    import importlib

    return importlib.import_module(f"roofbench.detectors.mpp.{name}")


def stages(scenes, repeats):
    seconds = defaultdict(float)

    def timed(function, stage):
        def call(*args, **named):
            began = time.process_time()
            result = function(*args, **named)
            seconds[stage] += time.process_time() - began
            return result

        return call

    held = {stage: getattr(module(room), name) for stage, (room, name) in STAGES.items()}
    for stage, (room, name) in STAGES.items():
        setattr(module(room), name, timed(held[stage], stage))
    for scene, _ in scenes:
        runs, parts = [], []
        for _ in range(repeats):
            seconds.clear()
            began = time.process_time()
            found = detect(scene)
            runs.append(time.process_time() - began)
            parts.append(dict(seconds))
        size, cell = len(scene.points), found.metadata["cell"]
        print(f"\n{scene.name}: {size:,} points, cells of {cell:g} m, {len(found)} footprints")
        print(f"  all stages {statistics.median(runs):8.3f} s  (least {min(runs):.3f} s)")
        for stage in STAGES:
            if any(stage in part for part in parts):
                print(f"  {stage:24s}{1e3 * statistics.median(part.get(stage, 0) for part in parts):7.1f} ms")
    for stage, (room, name) in STAGES.items():
        setattr(module(room), name, held[stage])


def threads(scenes, repeats):
    print("\nwall seconds of 1 and 2 threads in turn, and their ratio: median, best pair, least times; CPU seconds")
    for scene, _ in scenes:
        walls = {1: [], 2: []}
        spent = {1: [], 2: []}
        for count in (1, 2):
            detect(scene, threads=count)
        for _ in range(repeats):
            for count in (1, 2):
                began, cpu = time.perf_counter(), time.process_time()
                detect(scene, threads=count)
                walls[count].append(time.perf_counter() - began)
                spent[count].append(time.process_time() - cpu)
        ratios = [one / two for one, two in zip(walls[1], walls[2], strict=True)]
        print(
            f"  {scene.name:18s} {len(scene.points):10,d} points  least {min(walls[1]):.3f}, {min(walls[2]):.3f} s  "
            f"ratio {statistics.median(ratios):.2f}, {max(ratios):.2f}, {min(walls[1]) / min(walls[2]):.2f}  CPU "
            f"{min(spent[1]):.3f}, {min(spent[2]):.3f} s",
            flush=True,
        )


def span(scenes, repeats):
    """Two free cores, on a machine that has none: jobs are done one by one and laid out on two cores on paper."""
    from roofbench.detectors.mpp.threads import Threads

    print("\nCPU seconds of all, and of the longer of two cores when each job goes to the core that is free first")
    saved, held = [0.0], Threads.map

    def laid_out(threads, function, jobs):
        results, cores, total = [], [0.0] * threads.count, 0.0
        for job in jobs:
            began = time.process_time()
            results.append(function(job))
            spent = time.process_time() - began
            cores[cores.index(min(cores))] += spent
            total += spent
        saved[0] += total - max(cores)
        return results

    for scene, _ in scenes:
        rows = []
        Threads.map = laid_out
        for _ in range(repeats):
            saved[0], began = 0.0, time.process_time()
            detect(scene, threads=2)
            whole = time.process_time() - began
            rows.append((whole, whole - saved[0]))
        Threads.map = held
        whole, longer = min(rows)
        print(f"  {scene.name:18s} {whole:.3f}, {longer:.3f} s: {whole / longer:.2f} times as fast", flush=True)


def resident(key):
    """Return VmRSS or VmHWM of this process, bytes."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(key):
            return int(line.split()[1]) * 1024
    raise LookupError(key)


def memory(folder):
    """Measure one scene that lies in a folder as arrays; nothing else has been in this process."""
    with np.load(Path(folder) / "scene.npz") as held:
        arrays = dict(held)
    names = ("x", "y", "z", "return_number", "number_of_returns")
    points = rb.PointCloud(*(arrays[name] for name in names[:3]), **{name: arrays[name] for name in names[3:]})
    place = arrays["place"]
    dem = rb.Elevation(arrays["dem"], rb.Grid(*place[:3], int(place[3]), int(place[4])))
    west, south, east, north = extent = tuple(arrays["extent"].tolist())
    inside = (points.x < west + 60) & (points.y < south + 60)
    corner = (west, south, west + 60, south + 60)
    for ground in (dem, None):
        detect(rb.Scene("corner", corner, crs="EPSG:25832", points=points.take(inside), dem=ground))
    for ground in (dem, None):
        scene = rb.Scene("whole", extent, crs="EPSG:25832", points=points, dem=ground)
        before = resident("VmRSS")
        Path("/proc/self/clear_refs").write_text("5")
        cell = detect(scene).metadata["cell"]
        used = resident("VmHWM") - before
        cells = (east - west) * (north - south) / cell**2
        kind = "without a DEM" if ground is None else "with a DEM"
        print(
            f"    {kind:14s}{cells:11,.0f} cells, {len(points):,} points: "
            f"{used / 1e6:5.0f} MB = {used / cells:.1f} bytes a cell",
            flush=True,
        )


def save(scene, folder):
    points, dem = scene.points, scene.dem
    grid = dem.grid
    names = ("x", "y", "z", "return_number", "number_of_returns")
    place = np.array([grid.west, grid.north, grid.gsd, grid.rows, grid.columns])
    arrays = {name: getattr(points, name) for name in names}
    np.savez(Path(folder) / "scene.npz", dem=dem.values, place=place, extent=np.array(scene.extent), **arrays)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", help="stages, threads, span, memory")
    parser.add_argument("--scenes", default="toronto-a,vaihingen-a")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--level", default="building", help="part, building or block")
    parser.add_argument("--change", default="", help="further parameters of mpp")
    options = parser.parse_args()
    global LEVEL, CHANGE
    LEVEL, CHANGE = options.level, f",{options.change}" if options.change else ""
    parts = options.parts or ["stages", "threads", "span", "memory"]
    if parts == ["memory-of"]:
        memory(options.scenes)
        return
    detect(scene_of("fairfield-small")[0])
    scenes = [scene_of(name) for name in options.scenes.split(",")]
    if "stages" in parts:
        stages(scenes, options.repeats)
    if "threads" in parts:
        threads(scenes, options.repeats)
    if "span" in parts:
        span(scenes, options.repeats)
    if "memory" in parts:
        print("\nhighest resident set of a detection beyond the scene")
        for scene, _ in scenes:
            print(f"  {scene.name}", flush=True)
            with tempfile.TemporaryDirectory() as folder:
                save(scene, folder)
                subprocess.run(
                    [sys.executable, __file__, "memory-of", "--scenes", folder, "--level", LEVEL], check=True
                )


if __name__ == "__main__":
    main()
