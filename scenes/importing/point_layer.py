"""The points of a scene: those of all files in its place, without noise and repeats."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ...core.errors import InputError
from ...core.wording import counted
from ..geodata.las_files import LasHeader, read_points
from ..geodata.points import PointCloud
from ..usable_points import is_land, is_noise
from .place import Place, extent_text, file_paths

__all__ = ["points_of"]


def points_of(place: Place, clouds: Sequence[LasHeader], progress: Callable[[int, int], None] | None) -> PointCloud:
    """Return the points of all files in the place, without noise and repeats."""
    cloud = read_points([header.path for header in clouds], window=place.extent, progress=progress, note=place.log.note)
    names = file_paths([header.path for header in clouds])
    if len(cloud) == 0:
        raise InputError(f"{names} has no points in {extent_text(place.extent)}: choose another extent=")
    _check_bounds(place, cloud, names)
    wild = ~is_land(cloud.z)
    if wild.any():
        value = float(cloud.z[wild][0])
        cloud = cloud.take(~wild)
        dropped = counted(int(wild.sum()), "point was", "points were")
        place.log.note(f"{dropped} left out: heights such as {value:g} m are beyond those of land")
        if len(cloud) == 0:
            raise InputError(
                f"{names} contains no plausible heights: the first is {value:g} m; check the unit and the scale"
            )
    noise = is_noise(cloud)
    if noise.any():
        cloud = cloud.take(~noise)
        dropped = counted(int(noise.sum()), "point was", "points were")
        place.log.note(f"{dropped} left out: class 7 or 18 (noise)")
        if len(cloud) == 0:
            raise InputError(f"{names} contains only noise (classes 7 and 18)")
    distinct = cloud.distinct()
    if len(distinct) < len(cloud):
        repeated = counted(len(cloud) - len(distinct), "duplicate point was", "duplicate points were")
        place.log.note(f"{repeated} left out")
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
