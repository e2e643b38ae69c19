"""Random streams of the generator: one per part of the scene, so that changing one parameter leaves the rest in place.

Nouns
-----
stream
    A numpy generator of one part (terrain, parcels, trees, ...), seeded by (seed, part) and by nothing else.
counter noise
    A random number that is a function of (key, counter): inside kernels, where it must not depend on the order of work.
tile
    A periodic square of fractal noise, zero mean and unit standard deviation, looked up instead of computed per pixel.

Only additions, multiplications and comparisons are used, which every processor rounds alike.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.kernels import kernel

__all__ = ["PARTS", "Draws", "counter_key", "fractal_field", "fractal_tile", "gauss", "stream", "uniform"]

#: Numbers of the parts; a number never changes; new parts are added at the end.
PARTS = {
    name: number
    for number, name in enumerate(
        (
            *("terrain", "streets", "zones", "sites", "buildings", "roofs", "colours", "green-roofs", "trees"),
            *("crowns", "clutter", "lidar", "texture", "image", "dem", "reference", "ground"),
            *("rows", "gap-trees", "party-walls", "long-rows"),
        )
    )
}


def _sequence(seed: int, part: str) -> np.random.SeedSequence:
    return np.random.SeedSequence((seed, PARTS[part]))


def stream(seed: int, part: str) -> np.random.Generator:
    """Return the random stream of one part of the scene."""
    return np.random.Generator(np.random.PCG64(_sequence(seed, part)))


class Draws:
    """Random numbers of one parcel, taken one after the other."""

    def __init__(self, row: NDArray[np.float64]) -> None:
        self._numbers: Iterator[float] = iter(row.tolist())

    def unit(self) -> float:
        """Return the next number in [0, 1)."""
        return next(self._numbers)

    def between(self, low: float, high: float) -> float:
        """Return a number between two bounds."""
        return low + (high - low) * self.unit()

    def chance(self, share: float) -> bool:
        """Return whether an event of this probability happens."""
        return self.unit() < share

    def normal(self) -> float:
        """Return a nearly normal number: the sum of four uniforms, at most 3.46."""
        return (self.unit() + self.unit() + self.unit() + self.unit() - 2) * 1.7320508


def counter_key(seed: int, part: str) -> np.uint64:
    """Return the key of one part's counter noise."""
    key: np.uint64 = _sequence(seed, part).generate_state(2, np.uint64)[1]
    return key


@kernel
def _mix(key: np.uint64, counter: int) -> Any:
    """Scramble (key, counter) to 64 random bits (the finaliser of the SplitMix64 generator)."""
    bits = np.uint64(key) + np.uint64(counter) * np.uint64(0x9E3779B97F4A7C15)
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return bits ^ (bits >> np.uint64(31))


@kernel
def uniform(key: np.uint64, counter: int) -> Any:
    """Counter noise, uniform in [0, 1)."""
    return (_mix(key, counter) >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@kernel
def gauss(key: np.uint64, counter: int) -> Any:
    """Counter noise with zero mean and unit variance: the sum of four uniforms, nearly normal, at most 3.46."""
    bits = _mix(key, counter)
    mask = np.uint64(0xFFFF)
    total = (
        (bits & mask) + ((bits >> np.uint64(16)) & mask) + ((bits >> np.uint64(32)) & mask) + (bits >> np.uint64(48))
    )
    return (total * (1.0 / 65536.0) - 2.0 + 2.0 / 65536.0) * 1.7320508075688772


def fractal_field(
    rng: np.random.Generator, shape: tuple[int, int], cell: float, wavelengths: tuple[float, ...], falloff: float = 0.5
) -> NDArray[np.float64]:
    """Return smooth noise on a raster: lattice noise of several wavelengths, each weaker by `falloff`.

    Parameters
    ----------
    rng : numpy Generator
    shape : tuple of int
        Rows and columns.
    cell : float
        Cell size, metres.
    wavelengths : tuple of float
        Lattice spacings, metres, the strongest first.
    falloff : float
        Amplitude of a wavelength relative to the one before.

    Returns
    -------
    ndarray, shape `shape`
        Between about -1 and 1, not normalised.
    """
    field = np.zeros(shape)
    amplitude = 1.0
    for wavelength in wavelengths:
        rows = np.arange(shape[0]) * (cell / wavelength)
        columns = np.arange(shape[1]) * (cell / wavelength)
        offset = rng.random(2)
        lattice = rng.random((math.ceil(rows[-1]) + 3, math.ceil(columns[-1]) + 3)) * 2 - 1
        row0, down = _lattice_position(rows + offset[0])
        column0, right = _lattice_position(columns + offset[1])
        upper, lower = lattice[row0], lattice[row0 + 1]
        across = upper + (lower - upper) * down[:, None]
        field += amplitude * (across[:, column0] * (1 - right) + across[:, column0 + 1] * right)
        amplitude *= falloff
    return field


def _lattice_position(position: NDArray[np.float64]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return the lattice line before each position and the smooth (quintic) weight of the next one."""
    line = position.astype(np.intp)
    t = position - line
    return line, t * t * t * (t * (t * 6 - 15) + 10)


def fractal_tile(rng: np.random.Generator, size: int, coarsest: int, falloff: float) -> NDArray[np.float32]:
    """Return a periodic tile of fractal noise, shape (size, size), zero mean, unit standard deviation.

    Parameters
    ----------
    rng : numpy Generator
    size, coarsest : int
        Side of the tile and of its coarsest lattice cell, cells, powers of two; the finest lattice is the cell itself.
    falloff : float
        Amplitude of a lattice relative to the one twice as coarse.
    """
    field = np.zeros((size, size))
    amplitude, step = 1.0, coarsest
    while step >= 1:
        lattice = rng.random((size // step, size // step)) * 2 - 1
        line, weight = _lattice_position(np.arange(size) / step)
        following = (line + 1) % (size // step)
        across = lattice[line] * (1 - weight[:, None]) + lattice[following] * weight[:, None]
        field += amplitude * (across[:, line] * (1 - weight) + across[:, following] * weight)
        amplitude *= falloff
        step //= 2
    field -= field.mean()
    tile: NDArray[np.float32] = (field / field.std()).astype(np.float32)
    return tile
