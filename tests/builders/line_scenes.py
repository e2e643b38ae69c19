"""Small scenes made by hand for the line detectors: flat roofs and trees as points, colours and a level DEM."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely

from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.geodata.raster import Elevation, Grid, Image
from roofbench.scenes.scene import Scene

RED_ROOF = (170, 75, 60)
GREEN_ROOF = (70, 120, 65)
GROUND = (125, 118, 110)
LEAVES = (60, 115, 50)


def rectangle(x: float, y: float, length: float, width: float, degrees: float = 0.0) -> shapely.Polygon:
    box = shapely.box(-length / 2, -width / 2, length / 2, width / 2)
    turned = shapely.affinity.rotate(box, degrees, origin=(0, 0))
    return shapely.affinity.translate(turned, x, y)


def corners_off(found: shapely.Polygon, truth: shapely.Polygon) -> float:
    """Root mean square distance of the corners of two rectangles, as the evaluation measures it."""
    distances = shapely.distance(shapely.points(truth.exterior.coords[:4]), shapely.MultiPoint(found.exterior.coords))
    return float(np.sqrt(np.mean(distances**2)))


@dataclass
class SceneBuilder:
    """Ground at 10 m with houses and trees; points in a jittered grid, last pulses."""

    side: float = 60.0
    gsd: float = 0.15
    spacing: float = 0.5
    west: float = 1000.0
    south: float = 2000.0
    seed: int = 0
    houses: list[tuple[shapely.Polygon, tuple[int, int, int], float]] = field(default_factory=list)
    trees: list[tuple[shapely.Polygon, tuple[int, int, int], float]] = field(default_factory=list)

    def house(self, outline: shapely.Polygon, colour=RED_ROOF, height: float = 4.0) -> SceneBuilder:
        self.houses.append((outline, colour, height))
        return self

    def tree(self, x: float, y: float, radius: float, colour=LEAVES, height: float = 6.0) -> SceneBuilder:
        self.trees.append((shapely.Point(x, y).buffer(radius), colour, height))
        return self

    def build(self, bands=("red", "green", "blue")) -> Scene:
        rng = np.random.default_rng(self.seed)
        n = round(self.side / self.spacing)
        row, column = np.mgrid[0:n, 0:n].reshape(2, -1)
        x = (column + rng.uniform(0.3, 0.7, n * n)) * self.spacing
        y = (row + rng.uniform(0.3, 0.7, n * n)) * self.spacing
        z = 10 + rng.normal(0, 0.03, n * n)
        cells = round(self.side / self.gsd)
        grid = Grid(self.west, self.south + self.side, self.gsd, cells, cells)
        image = np.empty((3, cells, cells))
        image[:] = np.array(GROUND)[:, None, None]
        image += rng.normal(0, 3, image.shape)
        centre = (np.arange(cells) + 0.5) * self.gsd
        px, py = np.meshgrid(centre, self.side - centre)
        for outline, colour, height in self.houses:
            z[shapely.contains_xy(outline, x, y)] = 10 + height
            on = shapely.contains_xy(outline, px, py)
            image[:, on] = np.array(colour)[:, None] + rng.normal(0, 3, (3, on.sum()))
        for outline, colour, height in self.trees:
            on = shapely.contains_xy(outline, x, y)
            z[on] = 10 + rng.uniform(0.6 * height, height, on.sum())
            on = shapely.contains_xy(outline, px, py)
            image[:, on] = np.array(colour)[:, None] * rng.uniform(0.3, 1.7, on.sum())
        values = np.clip(np.round(image), 0, 255).astype(np.uint8)
        dem = Grid(self.west, self.south + self.side, 1.0, round(self.side), round(self.side))
        return Scene(
            "hand-made",
            (self.west, self.south, self.west + self.side, self.south + self.side),
            crs="EPSG:28356",
            points=PointCloud(x + self.west, y + self.south, z),
            image=Image(values, bands, grid),
            dem=Elevation(np.full(dem.shape, 10, np.float32), dem),
        )

    def truth(self) -> list[shapely.Polygon]:
        return [shapely.affinity.translate(outline, self.west, self.south) for outline, _, _ in self.houses]
