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


def make_detector(selection: str | Detector, parameters: Mapping[str, Any] | None = None) -> Detector:
    """Return a detector by name, by ``name[parameter=value]`` or by ``file.py:Class``; an instance passes through.

    Raises
    ------
    UnknownNameError
        No such detector; the nearest name is given.
    ParameterError
        Unknown parameter or value outside its range.
    """
    if isinstance(selection, Detector):
        return selection
    name, values = parse_selection(selection)
    detector: Detector = DETECTORS.get(name).build({**values, **(parameters or {})})
    return detector
