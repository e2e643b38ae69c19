"""The file that a program wrote, read and checked as footprints."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import shapely

from ...core.errors import InputError, ProgramError
from ...scenes.geodata.crs import crs_label, same_crs
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.vector_files import read_footprints

__all__ = ["read_output"]


def read_output(file: Path, *, crs: str | None, program: str, log: str = "") -> Footprints:
    """Return the footprints in a file of a program, in the CRS of the scene.

    Invalid polygons are repaired and reported in `repairs`. A file without features is a valid result, no buildings,
    and the notes of the metadata say so.

    Parameters
    ----------
    file : Path
    crs : str, optional
        CRS of the scene; footprints that name none are taken to be in it.
    program : str
        Name for messages.
    log : str, optional
        What the program printed, kept in the metadata and in the error.

    Raises
    ------
    ProgramError
        No file, an empty or unreadable one, no polygons in it, polygons with heights (Z), or another CRS.
    """
    if not file.is_file():
        raise ProgramError(f"{program} wrote no footprints: it must write the file that it is given", log=log)
    if not file.stat().st_size:
        raise ProgramError(f"{program} wrote an empty file: without buildings it must have no features", log=log)
    try:
        found = read_footprints(file)
        three_dimensional = _is_three_dimensional(file)
    except InputError as error:
        problem = str(error).replace(str(file), file.name)
        raise ProgramError(f"{program} wrote what cannot be used: {problem}", log=log) from error
    if three_dimensional:
        raise ProgramError(
            f"{program} wrote polygons in three dimensions: it must write outlines without heights, as "
            "'ogr2ogr -dim XY' does",
            log=log,
        )
    if found.crs is not None and crs is not None and not same_crs(found.crs, crs):
        raise ProgramError(
            f"{program} wrote footprints in {crs_label(found.crs)}, but the scene is in {crs_label(crs)}: "
            "it must write them in the CRS of the scene",
            log=log,
        )
    notes = []
    if not len(found):
        notes.append(f"{program} wrote a file without footprints")
    metadata: dict[str, Any] = {**({"notes": notes} if notes else {}), **({"program_output": log} if log else {})}
    return dataclasses.replace(found, crs=crs or found.crs, metadata=metadata, source=program)


def _is_three_dimensional(file: Path) -> bool:
    """Return whether geometries of the first layer of a vector file have heights."""
    import pyogrio
    from pyogrio.errors import DataLayerError, DataSourceError

    try:
        kind = str(pyogrio.read_info(file)["geometry_type"])
        if "Unknown" not in kind:
            return "Z" in kind or "3D" in kind or "2.5D" in kind
        geometries = pyogrio.raw.read(file, columns=[])[2]
    except (DataLayerError, DataSourceError):
        return False
    return bool(shapely.has_z(shapely.from_wkb(geometries, on_invalid="ignore")).any())
