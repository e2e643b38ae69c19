"""Numbers in sentences."""

from __future__ import annotations

__all__ = ["counted"]


def counted(number: int, one: str, many: str | None = None) -> str:
    """Return a number with the words that follow it, in the singular or the plural.

    Parameters
    ----------
    number : int
    one : str
        What follows the number 1: a noun, or a noun with its verb.
    many : str, optional
        What follows any other number; by default the singular with an ``s``.

    Examples
    --------
    >>> counted(1, "scene"), counted(1200, "scene")
    ('1 scene', '1,200 scenes')
    >>> counted(1, "run is missing", "runs are missing"), counted(0, "run is missing", "runs are missing")
    ('1 run is missing', '0 runs are missing')
    """
    return f"{number:,} {one}" if number == 1 else f"{number:,} {f'{one}s' if many is None else many}"
