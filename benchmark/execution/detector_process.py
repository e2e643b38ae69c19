"""The detector processes as the process that opens scenes and evaluates sees them; see `detection`.

Detectors of roofbench share one process. A plugin runs in another one, which has run no other plugin, so that no plugin
can change what another detector finds.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections.abc import Mapping
from contextlib import suppress
from typing import IO, Any

import numpy as np
import shapely
from numpy.typing import NDArray

from ...core.errors import MissingInputError
from ...core.processes import death_reason, end_tree, start_python
from ...detectors.base import Declaration
from ...detectors.registry import DETECTORS
from ...scenes.geodata.footprints import Footprints
from ...scenes.geodata.polygon_repair import Repair
from ...scenes.scene import Scene
from ..identity.recipes import PluginRecipe
from ..identity.spool import measured_arrays
from ..store.outcomes import Cost
from .fork_server import ForkedProcess, ForkServer
from .messages import receive_parts, send_parts

__all__ = ["DetectionFailedError", "DetectorProcess", "DetectorProcesses"]

_START = f"from {__package__}.detection import serve_detectors; serve_detectors()"
_PATIENCE = 5.0  # seconds for a process that closed its streams to end


class DetectionFailedError(Exception):
    """A detector failed in its process, or the process ended."""

    def __init__(self, reason: str, trace: str, cost: Cost, *, process_ended: bool) -> None:
        super().__init__(reason)
        self.trace, self.cost, self.process_ended = trace, cost, process_ended


class _StartedProcess:
    """A detector process that is a new interpreter; see `ForkedProcess`, which it can replace."""

    def __init__(self, folder: str, errors: int | None) -> None:
        path = os.pathsep.join(entry for entry in sys.path if entry)
        self._process = start_python(_START, path=path, folder=folder, errors=errors)
        self.pid, self.stdin, self.stdout = self._process.pid, self._process.stdin, self._process.stdout

    def ended(self) -> tuple[int | None, int]:
        """Return the exit code of a process that closed its streams and its highest memory; None while it runs."""
        deadline = time.monotonic() + _PATIENCE
        while time.monotonic() < deadline:
            if not hasattr(os, "wait4"):
                return self._process.poll(), 0
            number, status, usage = os.wait4(self.pid, os.WNOHANG)
            if number:
                self._process.returncode = os.waitstatus_to_exitcode(status)
                return self._process.returncode, usage.ru_maxrss * 1024
            time.sleep(0.01)
        return None, 0

    def end(self) -> None:
        """Kill it with the programs that it runs, and wait for it."""
        end_tree(self.pid)
        with suppress(OSError):
            self._process.kill()
        self._process.wait()


class DetectorProcess:
    """One detector process, started by the first request, and anew after it ended.

    Parameters
    ----------
    server : ForkServer, optional
        What forks it; by default it is a new interpreter.
    errors : int, optional
        Descriptor of its standard error, by default that of this process.
    place : str, optional
        Folder for its working folder, by default that of temporary files.
    """

    def __init__(self, server: ForkServer | None = None, errors: int | None = None, place: str | None = None) -> None:
        self._server = server
        self._errors = errors
        self._place = place
        self._process: ForkedProcess | _StartedProcess | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._scene: Scene | None = None
        self._declared: dict[str, Declaration] = {}

    def declaration(self, recipe: PluginRecipe) -> Declaration:
        """Return what a detector declares; its code runs in the detector process alone."""
        request = _request(recipe)
        if request["key"] not in self._declared:
            answer, _ = self._ask({**request, "view": None}, [])
            name, requires, numbers, place_streams = answer["declaration"]
            self._declared[request["key"]] = Declaration(name, tuple(requires), tuple(numbers), place_streams)
        return self._declared[request["key"]]

    def detect(self, recipe: PluginRecipe, scene: Scene, stream: np.random.Generator) -> tuple[Footprints, Cost]:
        """Detect on a scene, and return unchecked footprints with their cost.

        The measurements of the scene are sent unless they were sent last.

        Raises
        ------
        MissingInputError
            The detector lacks an input or a program.
        DetectionFailedError
            It failed, or its process ended.
        """
        visible = scene.for_detection()
        request = _request(recipe)
        request["view"] = {"ground_cell": visible.ground_cell, "core": visible.core, "whole": dict(visible.whole)}
        bits = stream.bit_generator
        request["stream"] = {"entropy": bits.seed_seq.entropy, "state": bits.state}  # type: ignore[attr-defined]
        arrays: list[NDArray[Any]] = []
        request["layers"] = None
        if scene is not self._scene or self._process is None:
            about, named = measured_arrays(visible)
            request["layers"], arrays = {**about, "names": list(named)}, list(named.values())
            self._scene = None
        answer, parts = self._ask(request, arrays)
        self._scene = scene
        return _received(answer, parts)

    def close(self) -> None:
        """End the process."""
        process, self._process, self._scene = self._process, None, None
        self._declared.clear()
        if process is None:
            return
        process.end()
        for stream in (process.stdin, process.stdout):
            with suppress(OSError):
                if stream is not None:
                    stream.close()
        if self._folder is not None:
            self._folder.cleanup()

    def _ask(self, request: Mapping[str, Any], arrays: list[NDArray[Any]]) -> tuple[dict[str, Any], list[NDArray[Any]]]:
        started = time.perf_counter()
        process = self._running()
        output: IO[bytes] | None = process.stdout
        assert output is not None
        try:
            send_parts(process.stdin, request, arrays)
            answer, parts = receive_parts(output)
        except (EOFError, OSError, ValueError):  # ValueError: nonsense, or a closed stream
            code, peak = process.ended()
            cost = Cost(seconds=time.perf_counter() - started, peak_memory=peak)
            self.close()
            reason = death_reason(code, "the worker process")
            raise DetectionFailedError(reason, self._written(), cost, process_ended=True) from None
        if answer["status"] == "skipped":
            raise MissingInputError(answer["reason"])
        if answer["status"] == "failed":
            cost = Cost(**answer["cost"])
            raise DetectionFailedError(answer["reason"], answer["traceback"], cost, process_ended=False)
        return answer, parts

    def _written(self) -> str:
        """Return the end of what it wrote to standard error, where that is a file."""
        descriptor = 2 if self._errors is None else self._errors
        try:
            size = os.fstat(descriptor).st_size
            return os.pread(descriptor, 4000, max(0, size - 4000)).decode(errors="replace")
        except (OSError, AttributeError):  # a terminal or a pipe; a system without pread
            return ""

    def _running(self) -> ForkedProcess | _StartedProcess:
        if self._process is None:
            self._folder = tempfile.TemporaryDirectory(prefix="roofbench-", dir=self._place, ignore_cleanup_errors=True)
            if self._server is None:
                self._process = _StartedProcess(self._folder.name, self._errors)
            else:
                self._process = self._server.fork(self._folder.name)
        return self._process


class DetectorProcesses:
    """One process for the detectors of roofbench, and one for the plugin that ran last.

    Parameters
    ----------
    server, errors, place : optional
        Of each process; see `DetectorProcess`.
    """

    def __init__(self, server: ForkServer | None = None, errors: int | None = None, place: str | None = None) -> None:
        self._built_in, self._plugin = (DetectorProcess(server, errors, place) for _ in range(2))
        self._latest = ""

    def of(self, recipe: PluginRecipe) -> DetectorProcess:
        """Return the process of a detector; that of another plugin is ended."""
        if DETECTORS.is_builtin(recipe.use):
            return self._built_in
        if recipe.use != self._latest:
            self._plugin.close()
            self._latest = recipe.use
        return self._plugin


def _request(recipe: PluginRecipe) -> dict[str, Any]:
    parameters = {**recipe.parameters, **recipe.execution}
    return {"key": json.dumps([recipe.use, parameters]), "use": recipe.use, "parameters": parameters}


def _received(answer: Mapping[str, Any], parts: list[NDArray[Any]]) -> tuple[Footprints, Cost]:
    ids, lengths, whole = parts[:3]
    data, ends = whole.tobytes(), np.cumsum(lengths).tolist()
    blobs = [data[end - length : end] or None for end, length in zip(ends, lengths.tolist(), strict=True)]
    polygons = np.empty(len(blobs), dtype=object)
    polygons[:] = shapely.from_wkb(blobs) if blobs else []
    labels = answer["building_ids"]
    footprints = Footprints(
        polygons=polygons,
        building_ids=None if labels is None else _column(labels, parts),
        crs=answer["crs"],
        ids=ids,
        attributes={name: _column(column, parts) for name, column in answer["attributes"].items()},
        metadata=answer["facts"],
        repairs=tuple(Repair(**repair) for repair in answer["repairs"]),
    )
    return footprints, Cost(**answer["cost"])


def _column(given: int | list[Any], parts: list[NDArray[Any]]) -> NDArray[Any]:
    return parts[given] if isinstance(given, int) else np.asarray(given)
