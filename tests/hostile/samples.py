"""Sound small files of every format that roofbench reads, each with the command that reads it.

A *sample* is a folder of sound files, the file to be damaged, and a command line.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import laspy
from builders import small_scenes
from builders.copc_files import write_copc
from harness.command_line import roofbench

import roofbench as rb
from roofbench.benchmark.analysis.baseline import Baseline, BaselineScene, Measured
from roofbench.benchmark.identity.provenance import CodeVersion
from roofbench.benchmark.identity.recipes import PluginRecipe, SceneRecipe
from roofbench.evaluators.registry import make_evaluator

__all__ = ["SAMPLES", "Sample", "make_files"]


@dataclass(frozen=True)
class Sample:
    """A file to damage, the files beside it, and the arguments of the command that reads it.

    A command that `checks` prints what it found, all problems included.
    """

    damaged: str
    beside: tuple[str, ...]
    arguments: tuple[str, ...]
    output: str | None = None
    checks: bool = False


_EVALUATE = ("evaluate", "--format", "json")
_IMPORT = ("scenes", "import", "-q", "-o", "out")
_SHAPEFILE = ("houses.shp", "houses.shx", "houses.dbf", "houses.prj", "houses.cpg")


def _evaluated(damaged: str, read: str, *beside: str) -> Sample:
    return Sample(damaged, ("truth.geojson", *beside), (*_EVALUATE, read, "truth.geojson"))


def _imported(damaged: str, *more: str, beside: tuple[str, ...] = ()) -> Sample:
    return Sample(damaged, beside, (*_IMPORT, "--extent", *_EXTENT, *more), "out")


_EXTENT = tuple(str(value) for value in (small_scenes.WEST, small_scenes.SOUTH, small_scenes.WEST + 40))
_EXTENT = (*_EXTENT, str(small_scenes.SOUTH + 40))

#: By name. A shapefile is damaged in each of its files.
SAMPLES: dict[str, Sample] = {
    "geojson": _evaluated("houses.geojson", "houses.geojson"),
    "geopackage": _evaluated("houses.gpkg", "houses.gpkg"),
    "flatgeobuf": _evaluated("houses.fgb", "houses.fgb"),
    "geoparquet": _evaluated("houses.parquet", "houses.parquet"),
    **{
        f"shapefile-{name[7:]}": _evaluated(name, "houses.shp", *(other for other in _SHAPEFILE if other != name))
        for name in _SHAPEFILE
    },
    "las": _imported("points.las", "points.las", "--dem", "dem.tif", beside=("dem.tif",)),
    "laz": _imported("points.laz", "points.laz", "--dem", "dem.tif", beside=("dem.tif",)),
    "copc": _imported("points.copc.laz", "points.copc.laz", "--dem", "dem.tif", beside=("dem.tif",)),
    "orthoimage": _imported("ortho.tif", "ortho.tif"),
    "elevation": _imported("dem.tif", "ortho.tif", "--dem", "dem.tif", beside=("ortho.tif",)),
    "manifest": Sample("scene/scene.toml", ("scene",), ("scenes", "check", "scene"), checks=True),
    "suite": Sample("suite.toml", (), ("run", "suite.toml", "--dry-run", "--store", "new.sqlite"), "new.sqlite"),
    "store-ls": Sample("runs.sqlite", (), ("ls", "--format", "json", "--store", "runs.sqlite")),
    "store-report": Sample("runs.sqlite", (), ("report", "runs.sqlite", "-q", "-o", "out.html"), "out.html"),
    "store-export": Sample("runs.sqlite", (), ("export", "1", "--store", "runs.sqlite", "-o", "out.gpkg"), "out.gpkg"),
    "baseline": Sample("new.json", ("old.json",), ("gate", "old.json", "new.json")),
}

_SUITE = """
name = "own"
[[scenes]]
preset = "hamlet"
seeds = [1, 2]
[[detectors]]
use = "ndsm"
height = 3.0
"""


def make_files(folder: Path) -> None:
    """Write the sound files of all samples into a folder."""
    scene = small_scenes.scene(points=small_scenes.cloud(count=1500))
    rb.save_scene(scene, folder / "scene")
    for name in ("points.laz", "ortho.tif", "dem.tif"):
        (folder / name).write_bytes((folder / "scene" / name).read_bytes())
    for name in ("houses.geojson", "houses.gpkg", "houses.fgb", "houses.parquet", "houses.shp", "truth.geojson"):
        rb.write_footprints(scene.reference, folder / name)
    with laspy.open(folder / "points.laz") as packed:
        packed.read().write(folder / "points.las")
    flat = small_scenes.cloud(count=600)
    write_copc(folder / "points.copc.laz", flat, crs=small_scenes.CRS)
    (folder / "suite.toml").write_text(_SUITE, encoding="utf-8")
    roofbench("run", "hamlet", "-d", "ndsm", "-q", "-j", "0", "--store", "runs.sqlite", folder=folder)
    _baselines(folder)


def _baselines(folder: Path) -> None:
    """Write two baselines of one suite; the newer one is a little better."""
    evaluator = make_evaluator("threshold-free")
    for name, quality in (("old", 0.8), ("new", 0.81)):
        values = {index.key: quality for index in evaluator.indices}
        Baseline(
            suite="own",
            version=CodeVersion("1", name, False),
            created="2026-01-01T00:00:00+00:00",
            evaluator=PluginRecipe("threshold-free", evaluator.values()),
            scenes={f"s-{n}": BaselineScene(SceneRecipe.of_preset("hamlet", seed=n), f"hash{n}") for n in range(12)},
            detectors={"ndsm": Measured(PluginRecipe("ndsm", {}), (0,), {(f"s-{n}", 0): values for n in range(12)})},
        ).save(folder / f"{name}.json")
