"""The detector process: detects on measurements that it receives as data, and holds nothing that leads to the truth.

It receives a detector by name and parameters, the arrays of a scene and the state of a random stream, and returns
geometries and attributes. It never held the reference, the recipe or the seed of the scene, the suite or the path of
the store: whatever a detector looks at (the frames of its callers, all objects of the interpreter, the facts of its
process) does not have them. The process that started it (`detector_process`) opens the scene and evaluates.
"""

from __future__ import annotations

import dataclasses
import os
import tempfile
import traceback
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.errors import InputError, MissingInputError
from ...core.memory import reset_highest_memory
from ...core.plain_values import plain_value
from ...detectors.base import Declaration, Detector
from ...detectors.registry import make_detector
from ...scenes.geodata.footprints import Footprints
from ...scenes.scene import NEUTRAL_NAME, Scene
from ..identity.spool import measured_layers
from .messages import listen, receive_parts, send_parts
from .run_time import Stopwatch, reason_of

__all__ = ["detect_on", "serve_detectors"]


def detect_on(detector: Detector, visible: Scene, stream: np.random.Generator) -> tuple[Footprints, dict[str, Any]]:
    """Return what a detector finds on a scene for detection, and the facts of the whole set that go with it.

    The facts are its metadata, and as ``notes`` what was estimated because the scene does not hold it.

    Raises
    ------
    InputError
        The detector returned no `Footprints`.
    """
    found = detector.detect(visible, stream)
    if not isinstance(found, Footprints):
        raise InputError(
            f"{detector.name} returned {type(found).__name__}, not Footprints: build them by Footprints.of"
        )
    notes = [*found.metadata.get("notes", ()), *visible.notes]
    return found, {**found.metadata, **({"notes": notes} if notes else {})}


def serve_detectors() -> None:
    """Answer requests from standard input until it closes: the main function of a detector process."""
    inward, outward = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # output of a detector must not mix with the messages
    tempfile.tempdir = str(Path.cwd())  # removed with the working folder when this process is killed
    requests = listen(inward, receive_parts)
    detectors: dict[str, Detector] = {}
    layers: tuple[Mapping[str, Any], list[NDArray[Any]]] = {}, []
    while True:
        header, arrays = requests.get()
        reset_highest_memory()  # a limit applies to this run, not to earlier ones
        watch = Stopwatch.start()
        parts: list[NDArray[Any]] = []
        try:
            if header["key"] not in detectors:
                detectors.clear()
                detectors[header["key"]] = make_detector(header["use"], header["parameters"])
            detector = detectors[header["key"]]
            if header["view"] is None:
                answer: dict[str, Any] = {"status": "ok", "declaration": Declaration.of(detector)}
            else:
                if header["layers"] is not None:
                    layers = header["layers"], arrays
                scene = _scene(*layers, header["view"])
                watch = Stopwatch.start()
                found, facts = detect_on(detector, scene, _stream(header["stream"]))
                cost = watch.read()
                answer, parts = _found(found, facts)
                answer["cost"] = cost
        except Exception as error:
            answer = {
                "status": "skipped" if isinstance(error, MissingInputError) else "failed",
                "reason": reason_of(error),
                "traceback": traceback.format_exc(),
                "cost": watch.read(),
            }
        send_parts(outward, answer, parts)


def _scene(held: Mapping[str, Any], arrays: Sequence[NDArray[Any]], view: Mapping[str, Any]) -> Scene:
    """Return the scene of a request; `view` is the part of it that is wanted, and what was measured for it."""
    layers = measured_layers(held, dict(zip(held["names"], arrays, strict=True)))
    scene = Scene(NEUTRAL_NAME, held["extent"], crs=held["crs"], **layers).for_detection()
    scene.ground_cell, scene.core, scene.whole = view["ground_cell"], tuple(view["core"]), view["whole"]
    return scene


def _stream(given: Mapping[str, Any]) -> np.random.Generator:
    """Return the random stream of a request: its state, and the entropy from which it spawns others."""
    bits = np.random.PCG64(np.random.SeedSequence(given["entropy"]))
    bits.state = given["state"]
    return np.random.Generator(bits)


def _found(found: Footprints, facts: Mapping[str, Any]) -> tuple[dict[str, Any], list[NDArray[Any]]]:
    """Return footprints as a header that JSON holds and arrays; they are checked where they arrive."""
    blobs = [blob or b"" for blob in shapely.to_wkb(np.asarray(found.polygons, dtype=object)).tolist()]
    lengths = np.array([len(blob) for blob in blobs], dtype=np.int64)
    parts: list[NDArray[Any]] = [found.ids, lengths, np.frombuffer(b"".join(blobs), dtype=np.uint8)]
    header = {
        "status": "ok",
        "crs": found.crs,
        "building_ids": None if found.building_ids is None else _column(found.building_ids, parts),
        "attributes": {name: _column(column, parts) for name, column in found.attributes.items()},
        "facts": dict(facts),
        "repairs": [dataclasses.asdict(repair) for repair in found.repairs],
    }
    return header, parts


def _column(column: Any, parts: list[NDArray[Any]]) -> int | list[Any]:
    """Add a column of numbers to the arrays and return its place there; return any other as a list."""
    if isinstance(column, np.ndarray) and column.dtype.kind in "iufb" and not isinstance(column, np.ma.MaskedArray):
        parts.append(column)
        return len(parts) - 1
    return [plain_value(value) for value in column]
