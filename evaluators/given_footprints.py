"""What people hand over for comparison, as footprints: frames of geopandas, files, lists, scenes."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from shapely import Geometry

from ..core.errors import InputError
from ..core.registry import nearest_hint
from ..scenes.geodata.crs import require_metric
from ..scenes.geodata.footprints import Footprints
from ..scenes.geodata.raster import Grid
from ..scenes.geodata.vector_columns import labels_of

if TYPE_CHECKING:
    import geopandas as gpd

    from ..scenes.scene import Scene

__all__ = ["Given", "GivenFootprints", "GivenReference", "given_footprints", "given_sets"]

#: What is taken as a set of footprints.
GivenFootprints: TypeAlias = "Footprints | gpd.GeoDataFrame | gpd.GeoSeries | str | os.PathLike[str] | Iterable[Any]"
#: What is taken as a reference: a scene brings its evaluation area and pixel grid.
GivenReference: TypeAlias = "GivenFootprints | Scene"


class Given(NamedTuple):
    """A reference, the polygon inside which it is complete, and the pixel grid."""

    footprints: Footprints
    area: Geometry | None
    grid: Grid | None


def given_sets(
    detected: Sequence[Any],
    reference: Any,
    area: Geometry | None = None,
    grid: Grid | None = None,
    *,
    building_id: str | None = None,
    roles: Sequence[str] = ("detected",),
) -> tuple[list[Footprints], Given]:
    """Return detected sets and their reference as footprints.

    Bare sequences of polygons, which cannot name a CRS, are taken in the CRS that the others have.

    Parameters
    ----------
    detected : sequence
        Each as of `given_footprints`.
    reference
        The same, or a `Scene`, which gives its area and grid as well, unless others are given.
    area, grid, building_id
        As of `evaluate`.
    roles : sequence of str
        Names of the detected sets, for messages.
    """
    found = [given_footprints(value, role=role) for value, role in zip(detected, roles, strict=True)]
    truth = _given_reference(reference, area, grid, building_id=building_id)
    known = next((one.crs for one in (truth.footprints, *found) if one.crs is not None), None)
    found = [_located(one, value, known) for one, value in zip(found, detected, strict=True)]
    return found, truth._replace(footprints=_located(truth.footprints, reference, known))


def _located(footprints: Footprints, value: Any, crs: str | None) -> Footprints:
    bare = not isinstance(value, Footprints | str | os.PathLike) and not hasattr(value, "crs")
    return replace(footprints, crs=crs) if bare and footprints.crs is None else footprints


def given_footprints(value: Any, *, role: str, building_id: str | None = None) -> Footprints:
    """Return footprints of whatever holds polygons; a CRS is kept.

    Parameters
    ----------
    value : Footprints, GeoDataFrame, GeoSeries, path, or iterable of polygons
    role : str
        ``"detected"`` or ``"reference"``, for messages.
    building_id : str, optional
        Column whose equal values mark the parts of one building.

    Raises
    ------
    InputError
        Anything else, or a column that is not there.
    """
    if isinstance(value, Footprints):
        return value if building_id is None else _with_buildings(value, building_id)
    if isinstance(value, str | os.PathLike):
        from ..scenes.geodata.vector_files import read_footprints

        return read_footprints(value, building_id=building_id)
    if hasattr(value, "geometry") and hasattr(value, "crs"):
        found = Footprints.from_geopandas(value, building_id=building_id, source=role)
        remedy = "reproject the frame, for instance with frame.to_crs(frame.estimate_utm_crs())"
        if len(found):
            require_metric(found.crs, role, heights=False, remedy=remedy)
        return found
    if isinstance(value, Iterable) and not isinstance(value, Geometry | bytes | dict):
        found = Footprints.of(value, source=role)
        return found if building_id is None else _with_buildings(found, building_id)
    raise InputError(
        f"{role} is {type(value).__name__}, not footprints: give Footprints, a GeoDataFrame, a GeoSeries, the path of "
        "a vector file, or a list of polygons"
    )


def _given_reference(value: Any, area: Geometry | None, grid: Grid | None, *, building_id: str | None) -> Given:
    if isinstance(value, str | os.PathLike):
        from ..scenes.shipped import shipped_or_given

        folder = shipped_or_given(value)
        if (folder / "scene.toml").is_file():
            from ..scenes.folder import open_scene

            value = open_scene(folder)
    if not isinstance(value, Footprints) and hasattr(value, "evaluation_grid"):
        if value.reference is None:
            raise InputError(f"the scene {value.name!r} has no reference footprints: give others as reference")
        return Given(value.reference, area or value.area, grid or value.evaluation_grid)
    return Given(given_footprints(value, role="reference", building_id=building_id), area, grid)


def _with_buildings(footprints: Footprints, column: str) -> Footprints:
    if column not in footprints.attributes:
        known = footprints.attributes
        raise InputError(
            f"{footprints.source}: no column {column!r}{nearest_hint(column, known)}; "
            f"it has {', '.join(known) or 'none'}"
        )
    return replace(footprints, building_ids=labels_of(footprints.attributes[column]))
