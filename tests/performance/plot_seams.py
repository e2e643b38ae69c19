"""Draw how tiles become one result: ``python tests/performance/plot_seams.py docs/images/city-seams.png``.

The street of the tests (`builders.town.street`): a hall of 300 m, a row of houses over four tiles, a house on a seam.
Above what each tile of 64 m found and owns or keeps as spare, each tile in a colour; below the result. `ndsm` shows the
hall, `mpp` the single houses of the row.
"""

import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from builders.town import SOUTH, STREET, WEST, street

from roofbench.benchmark.execution.worker import detect
from roofbench.detectors.registry import make_detector
from roofbench.detectors.seams import join_tiles
from roofbench.detectors.tiling import CUT, SPARE, measure, owned, stream_of, tiles_over

TILE = 64.0


def parts_of(scene, detector):
    """Return what each tile found, and the result."""
    tiles = tiles_over(scene.extent, TILE)
    measured = measure(scene, detector, tiles)
    fixed, parts = detector.replaced(measured.parameters), {}
    for tile in tiles:
        window = scene.window(tile.core, detector.halo)
        window.ground_cell, window.whole = measured.ground_cell, measured.whole
        found = detect(window, fixed, stream=stream_of(0, tile, fixed))
        parts[tile] = owned(found, tile, window.extent, scene.extent)
    return parts, join_tiles(parts, crs=scene.crs)


def outline(axes, polygon, **style):
    """Draw the outer ring of a polygon."""
    x, y = polygon.exterior.xy
    axes.fill(np.array(x) - WEST, np.array(y) - SOUTH, **style)


def draw(axes, parts, result, truth, title):
    """Draw the parts on the first axes, the result and the truth on the second."""
    colours = plt.colormaps["tab10"]
    for number, found in enumerate(parts.values()):
        for polygon, cut, spare in zip(found.polygons, found.attributes[CUT], found.attributes[SPARE], strict=True):
            colour = colours(number % 10)
            style = {"hatch": "///"} if cut else {"linestyle": ":"} if spare else {}
            outline(axes[0], polygon, facecolor=(*colour[:3], 0.12 if spare else 0.35), edgecolor=colour, **style)
    for polygon in result.polygons:
        outline(axes[1], polygon, facecolor="0.75", edgecolor="black")
    for west, south, east, north in truth:
        axes[1].plot(
            np.array([west, east, east, west, west]) - WEST, np.array([south, south, north, north, south]) - SOUTH,
            color="tab:red", linewidth=0.6, linestyle="--",
        )  # fmt: skip
    axes[0].set_title(f"{title}: found by each tile (hatched: cut by its halo; dotted: in reserve)", fontsize=9)
    axes[1].set_title(f"result: {len(result)} footprints (red: reference)", fontsize=9)
    for one in axes:
        for x in np.arange(WEST // TILE * TILE, WEST + 401, TILE) - WEST:
            one.axvline(x, color="0.5", linewidth=0.5)
        for y in np.arange(SOUTH // TILE * TILE, SOUTH + 97, TILE) - SOUTH:
            one.axhline(y, color="0.5", linewidth=0.5)
        one.set(xlim=(0, 400), ylim=(0, 96), aspect="equal")
        one.tick_params(labelsize=7)


def main(path):
    figure, axes = plt.subplots(4, 1, figsize=(9, 11), layout="constrained")
    for pair, selection, without in (
        (axes[:2], "ndsm[cell=0.5]", ()),
        (axes[2:], "mpp[level=part,largest_side=60]", ("hall",)),
    ):
        parts, (result, seams) = parts_of(street(without=without), make_detector(selection))
        print(selection, seams)
        draw(pair, parts, result, [box for name, box in STREET.items() if name not in without], selection)
    axes[-1].set_xlabel("metres")
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main(sys.argv[1])
