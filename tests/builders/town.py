"""A small town in a folder: level ground, flat roofs, and no DEM error, for tests of tiles."""

import numpy as np
import shapely

import roofbench as rb
from roofbench.scenes.folder import save_scene

WEST, SOUTH, SIDE = 1000.0, 2000.0, 192.0

#: With tiles of 64 m (multiples of 64: x 960, 1024, 1088, 1152): a house on a seam, one on a corner of four tiles, a
#: hall over three tiles and a row of houses over four.
HOUSES = {
    "on a seam": (1082.0, 2030.0, 1096.0, 2040.0),
    "on a corner": (1018.0, 2042.0, 1032.0, 2056.0),
    "hall": (1010.0, 2075.0, 1120.0, 2095.0),
    "inside": (1040.0, 2140.0, 1052.0, 2152.0),
    **{f"row {n}": (1004.0 + 15 * n, 2108.0, 1016.0 + 15 * n, 2117.0) for n in range(12)},
    "at the border": (1180.0, 2180.0, 1192.0, 2192.0),
}


def town(*, spacing=0.5, houses=None):
    """The scene; points in a jittered grid, ground at 10 m, roofs 6 m above it."""
    rng = np.random.default_rng(3)
    n = round(SIDE / spacing)
    row, column = np.mgrid[0:n, 0:n].reshape(2, -1)
    x = WEST + (column + rng.uniform(0.3, 0.7, n * n)) * spacing
    y = SOUTH + (row + rng.uniform(0.3, 0.7, n * n)) * spacing
    z = 10 + rng.normal(0, 0.02, n * n)
    for west, south, east, north in (HOUSES if houses is None else houses).values():
        z[(x > west) & (x < east) & (y > south) & (y < north)] += 6
    grid = rb.Grid.covering((WEST, SOUTH, WEST + SIDE, SOUTH + SIDE), 2.0)
    return rb.Scene(
        "town",
        (WEST, SOUTH, WEST + SIDE, SOUTH + SIDE),
        crs="EPSG:25832",
        points=rb.PointCloud(x=np.round(x, 3), y=np.round(y, 3), z=np.round(z, 3)),
        dem=rb.Elevation(np.full(grid.shape, 10.0, np.float32), grid),
    )


def town_folder(folder, **changes):
    save_scene(town(**changes), folder)
    return folder


def same_footprints(one, two, *, least=1e-6):
    """Return which footprints of `one` are in `two`, to a share of their area."""
    first, second = shapely.STRtree(two.polygons).query(one.polygons, predicate="intersects")
    apart = shapely.area(shapely.symmetric_difference(one.polygons[first], two.polygons[second]))
    found = np.full(len(one), np.inf)
    np.minimum.at(found, first, apart / one.areas[first])
    return found < least


#: With tiles of 64 m: a hall of 300 m over six of them, a row of houses wall to wall over four, a house on a seam.
STREET = {
    "hall": (1020.0, 2050.0, 1320.0, 2085.0),
    **{f"house {n}": (1040.0 + 12 * n, 2018.0, 1052.0 + 12 * n, 2028.0 + n % 2) for n in range(16)},
    "on a seam": (1275.0, 2014.0, 1289.0, 2024.0),
}


def street(*, spacing=0.5, without=()):
    """A scene of 400 x 96 m with the buildings of `STREET`; houses of the row have steps of 1.5 m between them."""
    rng = np.random.default_rng(5)
    rows, columns = round(96 / spacing), round(400 / spacing)
    row, column = np.mgrid[0:rows, 0:columns].reshape(2, -1)
    x = WEST + (column + rng.uniform(0.3, 0.7, row.size)) * spacing
    y = SOUTH + (row + rng.uniform(0.3, 0.7, row.size)) * spacing
    z = 10 + rng.normal(0, 0.02, row.size)
    for number, (name, (west, south, east, north)) in enumerate(STREET.items()):
        if name in without:
            continue
        z[(x > west) & (x < east) & (y > south) & (y < north)] += 6 + 1.5 * (number % 2)
    extent = (WEST, SOUTH, WEST + 400, SOUTH + 96)
    grid = rb.Grid.covering(extent, 2.0)
    points = rb.PointCloud(x=np.round(x, 3), y=np.round(y, 3), z=np.round(z, 3))
    dem = rb.Elevation(np.full(grid.shape, 10.0, np.float32), grid)
    return rb.Scene("street", extent, crs="EPSG:25832", points=points, dem=dem)
