"""The detectors by name: built in, installed (entry points ``roofbench.detectors``) or from a file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..core.registry import Registry, parse_selection
from .base import Detector

__all__ = ["DETECTORS", "make_detector"]

DETECTORS = Registry(
    "detector",
    "roofbench.detectors",
    Detector,
    {
        "command": "detectors.external.command_detector:Command",
        "dempster-shafer": "detectors.dempster_shafer.fusion_detector:DempsterShafer",
        "improved": "detectors.lines.improved:Improved",
        "ndsm": "detectors.ndsm.ndsm_detector:NDSM",
        "original": "detectors.lines.original:Original",
        "precomputed": "detectors.external.precomputed:Precomputed",
        "mpp": "detectors.mpp.mpp_detector:MPP",
        "mpp-printed": "detectors.mpp.printed_detector:MPPPrinted",
    },
)


def make_detector(selection: str | Detector, parameters: Mapping[str, Any] | None = None, /, **values: Any) -> Detector:
    """Return a detector by name, by ``name[parameter=value]`` or by ``file.py:Class``, with parameters.

    Parameters
    ----------
    selection : str or Detector
        A detector passes through, with changed parameters where some are given.
    parameters : mapping, optional
        Parameters by name; texts are read as on the command line.
    **values
        Parameters by name as well: ``make_detector("ndsm", height=3)``.

    Raises
    ------
    UnknownNameError
        No such detector; the nearest name is given.
    ParameterError
        Unknown parameter or value outside its range.
    """
    chosen = {**(parameters or {}), **values}
    if isinstance(selection, Detector):
        return selection.replaced(chosen) if chosen else selection
    name, selected = parse_selection(selection)
    detector: Detector = DETECTORS.get(name).build({**selected, **chosen})
    return detector
