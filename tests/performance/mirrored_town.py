"""A town of any size: a scene mirrored to many copies, every second one turned over, as a folder of tiles."""

import numpy as np

from roofbench.scenes.geodata.las_files import write_points
from roofbench.scenes.geodata.points import PointCloud
from roofbench.scenes.geodata.raster import Elevation, Grid, Image
from roofbench.scenes.geodata.raster_files import write_elevation, write_image
from roofbench.scenes.importing.tile_index import index_folder

__all__ = ["mirror"]

#: Standard deviations of what is added to x, y and z of the points of a copy, metres.
NOISE = np.array([0.1, 0.1, 0.01])


def mirror(scene, folder, columns, rows):
    """Write columns x rows copies of a scene, mirrored at their common borders, as a folder of tiles."""
    xmin, ymin, xmax, ymax = scene.extent
    width, height = xmax - xmin, ymax - ymin
    points = scene.points
    inside = (points.x >= xmin) & (points.x < xmax) & (points.y >= ymin) & (points.y < ymax)
    points = points.take(inside)
    for layer in ("points", "dem", "ortho"):
        (folder / layer).mkdir(parents=True, exist_ok=True)
    for column in range(columns):
        for row in range(rows):
            west, south = xmin + column * width, ymin + row * height
            x, y = points.x - xmin, points.y - ymin
            x, y = (width - x if column % 2 else x), (height - y if row % 2 else y)
            # Exact symmetry leaves ties that rounding decides, also in masks of image cells; no real town has any.
            noise = np.random.default_rng((column, row)).normal(0, 1, (3, len(x))) * NOISE[:, None]
            x, y = np.clip(x + noise[0], 0, width - 0.001), np.clip(y + noise[1], 0.001, height)
            copy = {name: getattr(points, name) for name in PointCloud.__dataclass_fields__}
            cloud = PointCloud(**{**copy, "x": west + x, "y": south + y, "z": points.z + noise[2]})
            write_points(cloud, folder / "points" / f"{column}_{row}.laz", crs=scene.crs)
            for layer, raster in (("dem", scene.dem), ("ortho", scene.image)):
                if raster is None:
                    continue
                part = raster.window(scene.extent)
                step = (slice(None, None, -1 if row % 2 else 1), slice(None, None, -1 if column % 2 else 1))
                values = np.ascontiguousarray(part.values[..., step[0], step[1]])
                grid = Grid(west, south + height, part.grid.gsd, *part.grid.shape)
                name = folder / layer / f"{column}_{row}.tif"
                if layer == "dem":
                    write_elevation(Elevation(values, grid), name, crs=scene.crs)
                else:
                    write_image(Image(values, part.bands, grid), name, crs=scene.crs)
    return index_folder(folder).scene
