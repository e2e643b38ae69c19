"""The package itself: its name, folder and versions, and where its public names live.

The *benchmark version* is that of what results depend on besides the detectors: definitions of the indices, suites and
generator. Results of different benchmark versions cannot be compared; results of releases with the same one can.

`HOMES` maps each name of the public API to the module that defines it; the root resolves names by it, and content keys
follow it when a plugin writes ``roofbench.name``.
"""

from __future__ import annotations

from pathlib import Path

__all__ = ["BENCHMARK_VERSION", "FOLDER", "HOMES", "NAME", "VERSION"]

NAME = __package__.partition(".")[0]
FOLDER = Path(__file__).resolve().parents[1]
VERSION = "0.2.0"
#: Raised when a definition, a suite or the generator changes; stores of release 0.1 did not record it.
BENCHMARK_VERSION = 1

#: Public name to the module that defines it.
HOMES = {
    "Detector": "detectors.base",
    "Elevation": "scenes.geodata.raster",
    "Evaluation": "evaluators.base",
    "Evaluator": "evaluators.base",
    "Footprints": "scenes.geodata.footprints",
    "Grid": "scenes.geodata.raster",
    "Image": "scenes.geodata.raster",
    "ImportRequest": "scenes.importing.request",
    "Index": "evaluators.base",
    "PointCloud": "scenes.geodata.points",
    "RoofbenchError": "core.errors",
    "Scene": "scenes.scene",
    "Step": "detectors.steps",
    "block_intervals": "evaluators.uncertainty.intervals",
    "compare": "evaluators.uncertainty.paired",
    "detect": "benchmark.session",
    "evaluate": "evaluators.comparison",
    "execution_option": "core.parameters",
    "import_scene": "scenes.importing.scene_import",
    "list_detectors": "reports.listings",
    "list_evaluators": "reports.listings",
    "list_indices": "reports.listings",
    "list_scenes": "reports.listings",
    "list_suites": "reports.listings",
    "make_detector": "detectors.registry",
    "make_evaluator": "evaluators.registry",
    "make_scene": "scenes.synthetic",
    "open_scene": "scenes.folder",
    "parameter": "core.parameters",
    "pool": "evaluators.comparison",
    "redraw_changes": "evaluators.uncertainty.redrawn",
    "read_footprints": "scenes.geodata.vector_files",
    "run": "reports.board",
    "save_scene": "scenes.folder",
    "write_footprints": "scenes.geodata.vector_files",
}
