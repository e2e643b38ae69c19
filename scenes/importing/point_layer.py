"""The points of a scene: those of all files in its place, without noise and repeats."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...core.errors import InputError
from ..geodata.las_files import LasHeader, read_points
from ..geodata.points import PointCloud
from ..usable_points import is_land, is_noise
from .place import Place, extent_text, file_paths

__all__ = ["points_of"]


def points_of(place: Place, clouds: Sequence[LasHeader], progress: Callable[[int, int], None] | None) -> PointCloud:
    """Return the points of all files in the place, without noise and repeats."""
    cloud = read_points([header.path for header in clouds], window=place.extent, progress=progress)
    names = file_paths([header.path for header in clouds])
    if len(cloud) == 0:
        raise InputError(f"{names} has no points in {extent_text(place.extent)}: choose another extent=")
    _check_bounds(place, cloud, names)
    wild = ~is_land(cloud.z)
    if wild.any():
        value = float(cloud.z[wild][0])
        cloud = cloud.take(~wild)
        place.log.note(
            f"{np.count_nonzero(wild)} points at heights such as {value:g} m, where no land is, were left out"
        )
        if len(cloud) == 0:
            raise InputError(f"{names} holds no heights of land: the first is {value:g} m; are they scaled?")
    noise = is_noise(cloud)
    if noise.any():
        cloud = cloud.take(~noise)
        place.log.note(f"{np.count_nonzero(noise)} points of the classes noise (7 and 18) were left out")
        if len(cloud) == 0:
            raise InputError(f"{names} holds no points but noise (classes 7 and 18)")
    distinct = cloud.distinct()
    if len(distinct) < len(cloud):
        place.log.note(f"{len(cloud) - len(distinct)} points that were there twice were left out")
    return distinct


def _check_bounds(place: Place, cloud: PointCloud, names: str) -> None:
    """Refuse a header whose bounds are far wider than its points: grids of that size would fill the memory."""
    xmin, ymin, xmax, ymax = place.extent
    real = (cloud.x.min(), cloud.y.min(), cloud.x.max(), cloud.y.max())
    share = (real[2] - real[0]) * (real[3] - real[1]) / ((xmax - xmin) * (ymax - ymin))
    if (xmax - xmin) * (ymax - ymin) > 1e7 and share < 0.25:
        raise InputError(
            f"{names}: the header says {extent_text(place.extent)}, but the points lie in {extent_text(real)}: give "
            f"extent=({real[0]:.0f}, {real[1]:.0f}, {real[2]:.0f}, {real[3]:.0f})"
        )
    if share < 0.25 and xmax - xmin > 2 and ymax - ymin > 2:
        place.log.note(
            f"the points lie in {extent_text(real)}, a small part of the scene, {extent_text(place.extent)}: if the "
            "header is wrong, give the extent"
        )
