"""Members of GeoJSON that OGR passes over: what is no feature in a collection, and lines that it cannot read.

The file is searched for signs of such a member, and only with one it is read a second time.
"""

from __future__ import annotations

import json
import mmap
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ...core.errors import InputError
from ...core.wording import counted
from .degrees import JSON_ENDINGS

__all__ = ["LARGEST_JSON", "JsonMembers", "json_members", "refuse_other_members"]

#: Bytes: larger JSON is not read a second time.
LARGEST_JSON = 128 * 1024**2
#: End of an object, then the start of the next one.
_NEXT = re.compile(rb"\}[\s,\x1e]*\{")
#: A first member, or one after an object, that is no object; names of members are followed by a colon.
_OTHER = re.compile(
    rb'"features"\s*:\s*\[\s*[^\s{\]]|\}\s*,\s*(?:[^\s{"\]},]|"(?:[^"\\]|\\.)*"\s*[^\s:])',
)
_GEOMETRIES = {"Point", "LineString", "Polygon", "MultiPoint", "MultiLineString", "MultiPolygon", "GeometryCollection"}
#: What is around a text in a sequence of JSON texts (RFC 8142).
_AROUND = "\x1e \t\r"


def refuse_other_members(file: Path, count: int) -> None:
    """Raise `InputError` when a file has members that are no features, which would be left out.

    Parameters
    ----------
    file : Path
        Files of other formats than GeoJSON, and those above 128 MB, are not looked at.
    count : int
        Number of features that were read.
    """
    if file.suffix.lower() not in JSON_ENDINGS or not 0 < file.stat().st_size <= LARGEST_JSON:
        return
    with file.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as content:
        plain = 1 + sum(1 for _ in _NEXT.finditer(content)) == max(count, 1)
        if content.find(b'"FeatureCollection"') >= 0:
            plain = plain and not _OTHER.search(content)
        else:
            content.seek(0)
            lines = sum(1 for line in iter(content.readline, b"") if line.strip(_AROUND.encode() + b"\n"))
            plain = plain and lines == count
    if plain:
        return
    found = json_members(file)
    if found.by_lines and len(found.members) == count and None not in found.members:
        return
    known = _GEOMETRIES | {"Feature"} if found.by_lines else {"Feature"}
    other = [n for n, one in enumerate(found.members) if not (isinstance(one, dict) and one.get("type") in known)]
    place = "line" if found.by_lines else "member"
    if other:
        many = counted(len(other), f"{place} is not a feature", f"{place}s are not features")
        raise InputError(
            f"{file}: {many} (the first is {place} {other[0] + found.by_lines}): write each as a Feature, "
            f"{'one in each line, ' if found.by_lines else ''}or delete it"
        )
    if found.by_lines:
        raise InputError(
            f"{file}: {count} of its {counted(len(found.members), 'line')} can be read: write one feature in each "
            "line, or all of them as one FeatureCollection"
        )


class JsonMembers(NamedTuple):
    """Values in a GeoJSON file.

    Attributes
    ----------
    members : sequence
        Members of its collection, or values of its lines that are not empty; None for a line that is not JSON.
    by_lines : bool
    """

    members: Sequence[Any]
    by_lines: bool


def json_members(file: Path) -> JsonMembers:
    """Return the members of a collection, or of a file with a value in each line; none of another object."""
    text = file.read_bytes().decode("utf-8-sig", errors="replace")
    try:
        whole = json.loads(text)
    except (ValueError, RecursionError):
        lines = (line.strip(_AROUND) for line in text.split("\n"))
        return JsonMembers([_value(line) for line in lines if line], True)
    found = whole.get("features") if isinstance(whole, dict) and whole.get("type") == "FeatureCollection" else None
    return JsonMembers(found if isinstance(found, list) else [], False)


def _value(line: str) -> Any:
    try:
        return json.loads(line)
    except (ValueError, RecursionError):
        return None
