"""What single cells of a store contain, decoded: a damaged cell ends in one sentence instead of a traceback.

SQLite notices damage to its own structure, not to the texts and geometries that it keeps.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from shapely.errors import ShapelyError

from ...core.errors import InputError, RoofbenchError

__all__ = ["decoding", "json_of"]


@contextmanager
def decoding(what: str) -> Iterator[None]:
    """Turn errors of decoding into one sentence.

    Parameters
    ----------
    what : str
        What is decoded and where it lies, such as ``"runs.sqlite: scene 3"``.

    Raises
    ------
    InputError
        What is stored is damaged.
    """
    try:
        yield
    except RoofbenchError:
        raise
    except (ValueError, TypeError, LookupError, struct.error, zlib.error, RecursionError, ShapelyError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(
            f"{what} is damaged ({reason}): copy the store again, or move it away and repeat its commands"
        ) from error


def json_of(text: Any, what: str) -> Any:
    """Return the object that a cell keeps as JSON; see `decoding`."""
    with decoding(what):
        return json.loads(text)
