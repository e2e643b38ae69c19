"""The file that a program wrote, read and checked as footprints."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import shapely

from ...core.errors import InputError, ProgramError
from ...scenes.geodata.crs import crs_label, same_crs
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.ogr_layers import quiet
from ...scenes.geodata.vector_files import read_footprints

__all__ = ["read_output"]


def read_output(file: Path, *, crs: str | None, program: str = "", log: str = "") -> Footprints:
    """Return the footprints in a file that a program wrote, in the CRS of the scene.

    Invalid polygons are repaired and reported in `repairs`. A file without features is a valid result, no buildings,
    and the notes of the metadata say so.

    Parameters
    ----------
    file : Path
    crs : str, optional
        CRS of the scene; footprints that name none are taken to be in it.
    program : str, optional
        Name for messages, where the file was written by a program that ran here.
    log : str, optional
        What the program printed, kept in the metadata and in the error.

    Raises
    ------
    ProgramError
        No file, an empty or unreadable one, no polygons in it, polygons with heights (Z), or another CRS.
    """
    wrote = f"{program} wrote" if program else f"{file.name} holds"
    if not file.is_file():
        instead = " but a folder or device" if file.exists() else ""
        raise ProgramError(f"{wrote} no footprints{instead}: it must write the file that it is given", log=log)
    if not file.stat().st_size:
        content = "an empty file" if program else "nothing"
        raise ProgramError(f"{wrote} {content}: a result without buildings is a file without features", log=log)
    try:
        found = read_footprints(file)
        three_dimensional = _is_three_dimensional(file)
    except InputError as error:
        problem = str(error).replace(str(file), file.name)
        what = f"{wrote} what cannot be used: " if program else ""
        raise ProgramError(f"{what}{problem}", log=log) from error
    if three_dimensional:
        raise ProgramError(
            f"{wrote} polygons in three dimensions: outlines must have no heights; 'ogr2ogr -dim XY' drops them",
            log=log,
        )
    if found.crs is not None and crs is not None and not same_crs(found.crs, crs):
        raise ProgramError(
            f"{wrote} polygons in {crs_label(found.crs)}, but the scene is in {crs_label(crs)}: "
            "they must be in the CRS of the scene",
            log=log,
        )
    notes = []
    if not len(found):
        notes.append(f"{wrote} {'a file without footprints' if program else 'no footprints'}")
    metadata: dict[str, Any] = {**({"notes": notes} if notes else {}), **({"program_output": log} if log else {})}
    return dataclasses.replace(found, crs=crs or found.crs, metadata=metadata, source=program or file.name)


def _is_three_dimensional(file: Path) -> bool:
    """Return whether geometries of the first layer of a vector file have heights, whatever its type says."""
    import pyogrio
    from pyogrio.errors import DataLayerError, DataSourceError

    try:
        with quiet():
            kind = str(pyogrio.read_info(file)["geometry_type"])
            geometries = pyogrio.raw.read(file, columns=[])[2]
    except (DataLayerError, DataSourceError):
        return False
    declared = any(mark in kind for mark in (" Z", "3D", "2.5D"))
    return declared or bool(shapely.has_z(shapely.from_wkb(geometries, on_invalid="ignore")).any())
