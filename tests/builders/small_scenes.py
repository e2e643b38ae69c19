"""Small scenes made in memory, for tests of files."""

import numpy as np
import shapely

import roofbench as rb

CRS = "EPSG:25832"
WEST, SOUTH = 500_000.0, 5_700_000.0


def cloud(count=4000, *, size=40.0, colour=False, seed=0, west=WEST, south=SOUTH, slope=0.0):
    """Ground at 100 m (class 2, sloping to the east) and a roof at 108 m (class 6) on [10, 20] x [10, 25]."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0, size, count), rng.uniform(0, size, count)
    roof = (x > 10) & (x < 20) & (y > 10) & (y < 25)
    z = np.where(roof, 108.0, 100.0 + slope * x) + rng.normal(0, 0.02, count)
    return rb.PointCloud(
        x=np.round(west + x, 3),
        y=np.round(south + y, 3),
        z=np.round(z, 3),
        return_number=np.ones(count, np.uint8),
        number_of_returns=rng.integers(1, 3, count).astype(np.uint8),
        intensity=rng.integers(1, 60_000, count).astype(np.uint16),
        classification=np.where(roof, 6, 2).astype(np.uint8),
        colour=rng.integers(0, 65_535, (count, 3)).astype(np.uint16) if colour else None,
    )


def image(*, bands=("red", "green", "blue"), gsd=0.5, size=40.0, west=WEST, south=SOUTH, seed=0, dtype=np.uint8):
    grid = rb.Grid.covering((west, south, west + size, south + size), gsd)
    values = np.random.default_rng(seed).integers(1, 255, (len(bands), *grid.shape)).astype(dtype)
    return rb.Image(values, bands, grid)


def scene(**changes):
    grid = rb.Grid.covering((WEST, SOUTH, WEST + 40, SOUTH + 40), 1.0)
    dem = np.full(grid.shape, 100.0, np.float32)
    dem[0, 0] = np.nan
    parts = {
        "crs": CRS,
        "points": cloud(),
        "image": image(),
        "dem": rb.Elevation(dem, grid),
        "reference": rb.Footprints.of(
            [
                shapely.box(WEST + 10, SOUTH + 10, WEST + 20, SOUTH + 25),
                shapely.box(WEST + 18, SOUTH, WEST + 25, SOUTH + 12),
            ],
            building_ids=["a", "a"],
            crs=CRS,
        ),
        "area": shapely.box(WEST + 1, SOUTH + 1, WEST + 39, SOUTH + 39),
        "facts": {"source": "made for a test", "licence": "CC0-1.0", "derived": {"dem": "by hand"}, "seed": 3},
    }
    parts.update(changes)
    return rb.Scene("small", (WEST, SOUTH, WEST + 40, SOUTH + 40), **parts)
