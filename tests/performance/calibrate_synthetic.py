"""Compare synthetic scenes with the two real ones, by the same measurements on both.

Run by hand: ``python tests/performance/calibrate_synthetic.py [PICTURE.png]`` prints the table of
docs/results/synthetic.md and draws its picture.
The real scenes are looked for beside the repository (``../shared/scenes``) or in ROOFBENCH_SHARED.
"""

import os
import sys
from dataclasses import dataclass
from pathlib import Path

import laspy
import numpy as np
import shapely
from scipy import ndimage
from scipy.spatial import cKDTree

import roofbench as rb
from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.geodata.raster import Grid

SHARED = Path(os.environ.get("ROOFBENCH_SHARED", Path(rb.__file__).parent / ".." / "shared" / "scenes"))
CELL = 0.5


@dataclass
class Sample:
    """One scene as the measurements need it: heights above ground, roofs and crowns by mask, first returns."""

    name: str
    cloud: PointCloud
    height: np.ndarray
    roof: np.ndarray
    crown: np.ndarray
    outlines: np.ndarray
    pulse: np.ndarray  # number of the pulse of each return
    colours: np.ndarray | None  # (n, 3), 0..1


def ground_height(cloud):
    """Height above the mean of ground points in 1 m cells, holes filled from the nearest cell."""
    ground = cloud.classification == 2
    west, south = cloud.x.min(), cloud.y.min()
    column, row = ((cloud.x - west) // 1).astype(int), ((cloud.y - south) // 1).astype(int)
    shape = row.max() + 1, column.max() + 1
    flat = row * shape[1] + column
    count = np.bincount(flat[ground], minlength=shape[0] * shape[1])
    total = np.bincount(flat[ground], cloud.z[ground], minlength=shape[0] * shape[1])
    level = np.where(count > 0, total / np.maximum(count, 1), np.nan).reshape(shape)
    near = ndimage.distance_transform_edt(np.isnan(level), return_distances=False, return_indices=True)
    return cloud.z - level[tuple(near)].ravel()[flat]


def sample(name, cloud, outlines, pulse, colours=None):
    height = ground_height(cloud)
    tree = shapely.STRtree(outlines)
    points = shapely.points(cloud.x, cloud.y)
    on_roof = np.zeros(len(cloud), bool)
    on_roof[np.unique(tree.query(points, predicate="within")[0])] = True
    roof = on_roof & (height > 2) & (cloud.classification == 6)
    beside = ~np.isin(np.arange(len(cloud)), tree.query(points, predicate="dwithin", distance=1.0)[0])
    crown = beside & (height > 2) & ~np.isin(cloud.classification, (2, 6, 9, 26))
    return Sample(name, cloud, height, roof, crown, outlines, pulse, colours)


def read(files, outline_file, name):
    clouds = [laspy.read(file) for file in files]

    def column(attribute):
        return np.concatenate([np.asarray(getattr(cloud, attribute)) for cloud in clouds])

    cloud = PointCloud(
        *(column(axis) for axis in "xyz"),
        return_number=column("return_number"),
        number_of_returns=column("number_of_returns"),
        classification=column("classification"),
    )
    pulse = np.unique(column("gps_time"), return_inverse=True)[1]
    colours = None
    if "red" in clouds[0].point_format.dimension_names:
        colours = np.stack([column(band) for band in ("red", "green", "blue")], -1) / 65535
        colours = colours / (1 if colours.max() > 0.1 else 255 / 65535)
    return sample(name, cloud, rb.read_footprints(outline_file).polygons, pulse, colours)


def synthetic(name, preset, **parameters):
    # The density and the precision of today's scanners, which the real scenes were measured with.
    scanner = {"point_spacing": 0.32, "vertical_noise": 0.015, "horizontal_noise": 0.04, "digitised": "ground"}
    scene = rb.make_scene(preset, seed=3, pulse="all", width=150, height=150, gsd=0.25, **scanner, **parameters)
    cloud, image = scene.points, scene.image
    cells, _ = image.grid.cells(cloud.x, cloud.y)
    colours = image.values[:3].reshape(3, -1).T[cells] / 255
    # The returns of a pulse follow each other.
    return sample(name, cloud, scene.reference.polygons, np.cumsum(cloud.return_number == 1), colours)


def quantiles(values):
    return " ".join(f"{value:.1f}" for value in np.quantile(values, (0.1, 0.5, 0.9))) if len(values) else "-"


def multiple(part, select):
    first = select & (part.cloud.return_number == 1)
    return float((part.cloud.number_of_returns[first] > 1).mean())


def through(part):
    """Share of the pulses that first meet a crown and last meet the ground."""
    last = part.cloud.return_number == part.cloud.number_of_returns
    level = np.full(part.pulse.max() + 1, np.nan)
    level[part.pulse[last]] = part.height[last]
    ends = level[part.pulse[part.crown & (part.cloud.return_number == 1)]]
    return float((ends[np.isfinite(ends)] < 0.7).mean())


def roughness(part, select, most=6000):
    """Residual of a plane through the neighbours within 1 m, standard deviation, of first returns."""
    first = np.flatnonzero(select & (part.cloud.return_number == 1))
    places = np.stack([part.cloud.x, part.cloud.y, part.cloud.z], -1)[first]
    tree = cKDTree(places[:, :2])
    chosen = np.random.default_rng(0).choice(len(first), min(most, len(first)), replace=False)
    residuals = []
    for neighbours in tree.query_ball_point(places[chosen, :2], 1.0):
        if len(neighbours) >= 6:
            local = places[neighbours] - places[neighbours].mean(axis=0)
            design = np.column_stack([local[:, :2], np.ones(len(local))])
            plane = np.linalg.lstsq(design, local[:, 2], rcond=None)[0]
            residuals.append(np.sqrt(np.mean((local[:, 2] - design @ plane) ** 2)))
    return np.array(residuals)


def green_red(part, select):
    if part.colours is None:
        return np.empty(0)
    chosen = select & (part.cloud.return_number == 1)
    red, green = part.colours[chosen, 0], part.colours[chosen, 1]
    return (green - red) / np.maximum(green + red, 1e-6)


def brightness(part, select):
    return part.colours[select].mean(axis=1) if part.colours is not None else np.empty(0)


def density(part):
    """First returns per m2 of 2 m cells that hold points; and how much that varies."""
    first = part.cloud.return_number == 1
    x, y = part.cloud.x[first], part.cloud.y[first]
    counts = np.histogram2d(x, y, bins=[np.arange(x.min(), x.max() - 2, 2), np.arange(y.min(), y.max() - 2, 2)])[0]
    counts = ndimage.median_filter(counts, 1)
    filled = counts[counts > 0] / 4
    return filled


def outline_distance(part):
    """Distance of the height mask's edge from the reference outline, signed outwards, metres."""
    cloud = part.cloud
    extent = cloud.x.min(), cloud.y.min(), cloud.x.max(), cloud.y.max()
    grid = Grid.covering(extent, CELL)
    cells, _ = grid.cells(cloud.x, cloud.y)
    top = np.full(grid.rows * grid.columns, -1.0)
    np.maximum.at(top, cells, part.height)
    top = top.reshape(grid.shape)
    empty = top == -1
    top = top[tuple(ndimage.distance_transform_edt(empty, return_distances=False, return_indices=True))]
    mask = top > 2
    edge = mask & ~ndimage.binary_erosion(mask)
    rows, columns = np.nonzero(edge)
    x, y = grid.to_world(rows + 0.5, columns + 0.5)
    union = shapely.union_all(part.outlines)
    line = shapely.boundary(union)
    points = shapely.points(x, y)
    distance = shapely.distance(points, line)
    signed = np.where(shapely.contains_xy(union, x, y), -distance, distance)
    crowns = cKDTree(np.stack([cloud.x[part.crown], cloud.y[part.crown]], -1))
    free = crowns.query(np.stack([x, y], -1))[0] > 2.5
    return signed[free & (np.abs(signed) < 1.5)]


def crown_shape(part):
    """Perimeter of crowns relative to circles of their area, on the same mask."""
    cloud = part.cloud
    grid = Grid.covering((cloud.x.min(), cloud.y.min(), cloud.x.max(), cloud.y.max()), CELL)
    cells, _ = grid.cells(cloud.x[part.crown], cloud.y[part.crown])
    mask = np.zeros(grid.rows * grid.columns, bool)
    mask[cells] = True
    labels, count = ndimage.label(ndimage.binary_closing(mask.reshape(grid.shape)))
    ratios = []
    for number in range(1, count + 1):
        crown = labels == number
        area = crown.sum()
        if area * CELL**2 >= 8:
            sides = sum(int((crown & ~np.roll(crown, shift, axis)).sum()) for shift in (-1, 1) for axis in (0, 1))
            ratios.append(sides / (np.sqrt(4 * np.pi * area) * 4 / np.pi))
    return np.array(ratios)


def table(samples):
    rows = {
        "roof height above ground, m (10 50 90 %)": lambda s: quantiles(s.height[s.roof]),
        "crown height above ground, m": lambda s: quantiles(s.height[s.crown]),
        "pulses with several returns, roofs": lambda s: f"{multiple(s, s.roof):.0%}",
        "pulses with several returns, crowns": lambda s: f"{multiple(s, s.crown):.0%}",
        "crown pulses that reach the ground": lambda s: f"{through(s):.0%}",
        "roughness of roofs, m": lambda s: " ".join(
            f"{v:.2f}" for v in np.quantile(roughness(s, s.roof), (0.1, 0.5, 0.9))
        ),
        "roughness of crowns, m": lambda s: " ".join(
            f"{v:.2f}" for v in np.quantile(roughness(s, s.crown), (0.1, 0.5, 0.9))
        ),
        "(G-R)/(G+R) of roofs": lambda s: (
            " ".join(f"{v:.2f}" for v in np.quantile(green_red(s, s.roof), (0.1, 0.5, 0.9)))
            if s.colours is not None
            else "-"
        ),
        "(G-R)/(G+R) of crowns": lambda s: (
            " ".join(f"{v:.2f}" for v in np.quantile(green_red(s, s.crown), (0.1, 0.5, 0.9)))
            if s.colours is not None
            else "-"
        ),
        "brightness of roofs, tenths": lambda s: quantiles(brightness(s, s.roof) * 10),
        "brightness of crowns, tenths": lambda s: quantiles(brightness(s, s.crown) * 10),
        "first returns per m2": lambda s: quantiles(density(s)),
        "their variation": lambda s: f"{density(s).std() / density(s).mean():.2f}",
        "mask edge from outline, m": lambda s: " ".join(
            f"{v:.2f}" for v in np.quantile(outline_distance(s), (0.1, 0.5, 0.9))
        ),
        "crown perimeter / circle": lambda s: quantiles(crown_shape(s)),
    }
    lines = ["| | " + " | ".join(s.name for s in samples) + " |", "|---" * (len(samples) + 1) + "|"]
    for title, measure in rows.items():
        lines.append(f"| {title} | " + " | ".join(measure(s) for s in samples) + " |")
    return "\n".join(lines)


def picture(samples, path):
    """Draw the distributions of real (filled) and synthetic (lines) scenes."""
    from matplotlib.figure import Figure

    panels = (
        ("height above ground of crowns, m", lambda s: s.height[s.crown], (2, 16)),
        ("height above ground of roofs, m", lambda s: s.height[s.roof], (2, 14)),
        ("roughness of crowns, m", lambda s: roughness(s, s.crown), (0, 2.5)),
        ("roughness of roofs, m", lambda s: roughness(s, s.roof), (0, 0.4)),
        ("(G-R)/(G+R) of crowns", lambda s: green_red(s, s.crown), (-0.3, 0.4)),
        ("(G-R)/(G+R) of roofs", lambda s: green_red(s, s.roof), (-0.3, 0.4)),
        ("mask edge from outline, m", outline_distance, (-1.5, 1.5)),
        ("first returns per m2 over their mean", lambda s: density(s) / density(s).mean(), (0, 2.5)),
    )
    figure = Figure(figsize=(13, 5.6), layout="constrained")
    axes = figure.subplots(2, 4).ravel()
    styles = (
        {"histtype": "stepfilled", "color": "#9ecae1", "alpha": 0.75},
        {"histtype": "stepfilled", "color": "#fdae6b", "alpha": 0.65},
        {"histtype": "step", "color": "#54278f", "linewidth": 1.6},
        {"histtype": "step", "color": "#006d2c", "linewidth": 1.6},
    )
    for axis, (title, measure, span) in zip(axes, panels, strict=True):
        for part, style in zip(samples, styles, strict=True):
            values = measure(part)
            if len(values):
                axis.hist(np.clip(values, *span), bins=36, range=span, density=True, label=part.name, **style)
        axis.set_title(title, fontsize=10)
        axis.set_yticks([])
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    figure.savefig(path, dpi=90)


def main():
    delft, ign = SHARED / "delft-ahn3", SHARED / "ign-870200-colour"
    samples = [
        read(sorted(delft.glob("*.laz")), delft / "bgt_pand_footprints.gpkg", "Delft"),
        read(sorted(ign.glob("*.laz")), ign / "reference_from_class.gpkg", "IGN"),
        synthetic("synthetic village", "vaihingen-a-small", buildings=16),
        synthetic("synthetic suburb", "moonee-ponds-small", buildings=20),
    ]
    print(table(samples))
    if len(sys.argv) > 1:
        picture(samples, sys.argv[1])


if __name__ == "__main__":
    sys.exit(main())
