"""Rasters: orthoimages and elevation models on a north-up grid of square cells.

Nouns
-----
grid
    Upper left corner (`west`, `north`), cell size `gsd` (ground sampling distance, metres), `rows` and `columns`.
    Row 0 is the northernmost; the centre of cell (row, column) is at
    ``west + (column + 0.5) * gsd, north - (row + 0.5) * gsd``.
raster
    Values on a grid, axis order (band, row, column) for images and (row, column) for elevation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...core.errors import InputError

__all__ = ["Elevation", "Frame", "Grid", "Image"]

#: Rows of points put on a grid at a time.
_CHUNK = 1_000_000


class Frame(NamedTuple):
    """A grid as kernels take it: upper left corner and cell size in metres, rows and columns."""

    west: float
    north: float
    gsd: float
    rows: int
    columns: int


def _of_one_shape(x: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return two arrays broadcast to one shape; those that have one stay as they are, which compiled code needs."""
    first, second = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if first.shape != second.shape:
        first, second = (np.array(values) for values in np.broadcast_arrays(first, second))
    return first, second


@dataclass(frozen=True)
class Grid:
    """A north-up grid of square cells; all lengths in metres."""

    west: float
    north: float
    gsd: float
    rows: int
    columns: int

    @classmethod
    def covering(cls, extent: Sequence[float], gsd: float) -> Grid:
        """Return the smallest grid, anchored at multiples of `gsd`, that covers ``[xmin, ymin, xmax, ymax]``."""
        xmin, ymin, xmax, ymax = extent
        west, north = math.floor(xmin / gsd + 1e-9) * gsd, math.ceil(ymax / gsd - 1e-9) * gsd
        columns = max(1, math.ceil((xmax - west) / gsd - 1e-9))
        rows = max(1, math.ceil((north - ymin) / gsd - 1e-9))
        return cls(west, north, gsd, rows, columns)

    @property
    def frame(self) -> Frame:
        """The grid for kernels."""
        return Frame(self.west, self.north, self.gsd, self.rows, self.columns)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.rows, self.columns

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """``(xmin, ymin, xmax, ymax)`` of the outer cell edges."""
        south, east = self.north - self.rows * self.gsd, self.west + self.columns * self.gsd
        return self.west, south, east, self.north

    def part(self, extent: Sequence[float]) -> tuple[slice, slice] | None:
        """Return the rows and columns of the cells that ``[xmin, ymin, xmax, ymax]`` meets; None when it meets none.

        >>> Grid(0, 10, 0.5, 20, 20).part((1.2, 7, 2, 20))
        (slice(0, 6, None), slice(2, 4, None))
        """
        xmin, ymin, xmax, ymax = extent
        top = max(math.floor((self.north - ymax) / self.gsd + 1e-9), 0)
        bottom = min(math.ceil((self.north - ymin) / self.gsd - 1e-9), self.rows)
        left = max(math.floor((xmin - self.west) / self.gsd + 1e-9), 0)
        right = min(math.ceil((xmax - self.west) / self.gsd - 1e-9), self.columns)
        return (slice(top, bottom), slice(left, right)) if top < bottom and left < right else None

    def cut(self, rows: slice, columns: slice) -> Grid:
        """Return the grid of some of its cells."""
        west, north = self.west + columns.start * self.gsd, self.north - rows.start * self.gsd
        return Grid(west, north, self.gsd, rows.stop - rows.start, columns.stop - columns.start)

    @property
    def transform(self) -> tuple[float, float, float, float, float, float]:
        """Affine coefficients ``(a, b, c, d, e, f)`` as rasterio writes them."""
        return self.gsd, 0.0, self.west, 0.0, -self.gsd, self.north

    def to_pixel(self, x: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return fractional (row, column); the centre of the first cell is (0.5, 0.5), so ``floor`` gives its index."""
        row = (self.north - np.asarray(y, dtype=np.float64)) / self.gsd
        column = (np.asarray(x, dtype=np.float64) - self.west) / self.gsd
        return row, column

    def to_world(self, row: ArrayLike, column: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return (x, y) of fractional (row, column), the inverse of `to_pixel`."""
        x = self.west + np.asarray(column, dtype=np.float64) * self.gsd
        y = self.north - np.asarray(row, dtype=np.float64) * self.gsd
        return x, y

    def cells(self, x: ArrayLike, y: ArrayLike) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """Return the flat cell index of each point and whether it lies on the grid (index 0 where it does not)."""
        # numba takes a while to load, and evaluating footprints needs no cells.
        from .sampling import cells_at

        x, y = _of_one_shape(x, y)
        # Cells are counted from the origin of the CRS, and only the shift of the grid against it, to a micrometre, is
        # that of the grid: a point on the border of two cells is in the same one on the grid of every window.
        first, last = math.floor(self.west / self.gsd + 1e-6), math.ceil(self.north / self.gsd - 1e-6)
        shift = round(self.west - first * self.gsd, 6), round(last * self.gsd - self.north, 6)
        flat, inside = cells_at(x.ravel(), y.ravel(), (first, last), shift, self.gsd, (self.rows, self.columns))
        return flat.reshape(x.shape), inside.reshape(x.shape)


@dataclass(frozen=True, eq=False)
class Image:
    """An orthoimage.

    Attributes
    ----------
    values : ndarray, shape (bands, rows, columns)
        uint8 or uint16.
    bands : tuple of str
        ``red``, ``green``, ``blue``, ``nir`` or ``grey``, in the order of `values`.
    grid : Grid
    valid : ndarray of bool, shape (rows, columns), optional
        False where the image has no data; None when it has data everywhere.
    """

    values: NDArray[np.uint8] | NDArray[np.uint16]
    bands: tuple[str, ...]
    grid: Grid
    valid: NDArray[np.bool_] | None = None

    def __post_init__(self) -> None:
        if self.values.shape != (len(self.bands), *self.grid.shape):
            raise InputError(
                f"image values have shape {self.values.shape}, but {len(self.bands)} bands on a grid of "
                f"{self.grid.rows} x {self.grid.columns} need {(len(self.bands), *self.grid.shape)}"
            )

    def band(self, name: str) -> NDArray[np.float32]:
        """Return one band scaled to 0..1, shape (rows, columns)."""
        if name not in self.bands:
            raise InputError(f"the image has no band {name!r}; it has {', '.join(self.bands)}")
        values = self.values[self.bands.index(name)]
        scaled: NDArray[np.float32] = values.astype(np.float32) / np.float32(np.iinfo(values.dtype).max)
        return scaled

    def window(self, extent: Sequence[float]) -> Image | None:
        """Return the cells that an extent meets, not copied; None when it meets none."""
        part = self.grid.part(extent)
        if part is None:
            return None
        valid = None if self.valid is None else self.valid[part]
        return Image(self.values[:, *part], self.bands, self.grid.cut(*part), valid)

    def in_colour(self) -> Image:
        """Return the image itself where it has colours, else one that has them as far as its bands allow.

        Of colour infrared without blue, green stands for blue as well; red, green and blue of an image of one band,
        grey or near infrared, are that band.
        """
        if self.is_colour:
            return self
        if not self.has_brightness:
            raise InputError(f"the image has neither colours nor a band 'grey'; it has {', '.join(self.bands)}")
        index = self.bands.index
        if {"red", "green"} <= set(self.bands):
            chosen = [index("red"), index("green"), index("green")]
        else:
            chosen = [index("grey") if "grey" in self.bands else index("nir")] * 3
        if "nir" in self.bands and len(self.bands) > 1:
            chosen.append(index("nir"))
        return Image(self.values[chosen], ("red", "green", "blue", "nir")[: len(chosen)], self.grid, self.valid)

    @property
    def has_brightness(self) -> bool:
        """Whether there are colours, with or without blue, or one band of grey or near infrared."""
        return {"red", "green"} <= set(self.bands) or "grey" in self.bands or self.bands == ("nir",)

    @property
    def shows_vegetation(self) -> bool:
        """Whether there is an index of vegetation: red with green or near infrared, or grey with near infrared."""
        bands = set(self.bands)
        return {"red", "green"} <= bands or ("nir" in bands and bool(bands & {"red", "grey"}))

    @property
    def is_colour(self) -> bool:
        """Whether red, green and blue are all there."""
        return {"red", "green", "blue"} <= set(self.bands)


@dataclass(frozen=True, eq=False)
class Elevation:
    """An elevation model (DEM: bare earth; DSM: highest surface; nDSM: height above ground).

    Attributes
    ----------
    values : ndarray of float32, shape (rows, columns)
        Metres; NaN where not known.
    grid : Grid
    """

    values: NDArray[np.float32]
    grid: Grid

    def window(self, extent: Sequence[float]) -> Elevation | None:
        """Return the cells that an extent meets, not copied; None when it meets none."""
        part = self.grid.part(extent)
        return None if part is None else Elevation(self.values[part], self.grid.cut(*part))

    def sample(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
        """Return bilinear elevation at points, shape of `x`; clamped at the border, NaN beside unknown cells."""
        # numba takes a while to load, and evaluating footprints does not sample.
        from .sampling import bilinear

        x, y = _of_one_shape(x, y)
        grid = self.grid
        sampled: NDArray[np.float64] = bilinear(self.values, grid.west, grid.north, grid.gsd, x.ravel(), y.ravel())
        return sampled.reshape(x.shape)
