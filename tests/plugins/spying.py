"""A detector that looks for the truth wherever its process could hold it, and returns it when it finds it."""

import gc
import inspect
import os
import sys
import threading
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import roofbench as rb

#: What a detector must not learn of the tests: their folder, suite and store, and the name of the scene.
SECRETS = ("wombat", "hamlet-5")
#: Classes of roofbench that lead to a scene or to a plan.
RECIPES = ("SceneRecipe", "PluginRecipe", "Task", "Plan", "PlannedRun", "Suite", "Store")


@dataclass(frozen=True, kw_only=True)
class Spying(rb.Detector):
    """The first reference that it finds; what else it learns is in the metadata."""

    name = "spying"

    search: str = rb.parameter("all", choices=("all", "frames", "objects"), doc="where it looks")

    def detect(self, scene, rng):
        held = [value for _, value in _held(self.search)]
        references = [thing for thing in held if isinstance(thing, rb.Footprints) and len(thing)]
        scenes = [thing for thing in held if isinstance(thing, rb.Scene) and thing.reference is not None]
        references += [thing.reference for thing in scenes]
        texts = _texts()
        seen = {
            "references": len(references),
            "recipes": sorted({kind.__name__ for kind in map(type, held) if _leads_on(kind)}),
            "secrets": sorted({text for text in [*texts, *_strings(held)] if any(word in text for word in SECRETS)}),
        }
        found = references[0] if references else rb.Footprints.empty()
        return rb.Footprints(polygons=found.polygons, crs=scene.crs, metadata=seen)


def _leads_on(kind):
    return kind.__name__ in RECIPES and kind.__module__.startswith("roofbench.benchmark")


def _held(search):
    """Yield the values of frames, threads and modules, and all objects that the collector knows."""
    if search in ("all", "frames"):
        for frame in _frames():
            yield from {**frame.f_globals, **frame.f_locals}.items()
        for thread in threading.enumerate():
            yield from vars(thread).items()
        yield from vars(sys.modules["__main__"]).items()
    if search in ("all", "objects"):
        yield from (("", thing) for thing in gc.get_objects())


def _frames():
    frame = sys._getframe()
    while frame is not None:
        yield frame
        frame = frame.f_back
    yield from (record.frame for record in inspect.stack())
    yield from sys._current_frames().values()


def _strings(held):
    for thing in held:
        if isinstance(thing, str):
            yield thing
        elif isinstance(thing, dict):
            yield from (value for value in list(thing.values()) if isinstance(value, str) and len(value) < 10_000)


def _texts():
    """Yield the facts of this process and of its parent: environment, command line, folder, open files."""
    yield from (*sys.argv, *sys.orig_argv, os.getcwd(), *os.environ.values())
    for process in ("self", str(os.getppid())):
        for name in ("environ", "cmdline"):
            with suppress(OSError):
                yield from Path(f"/proc/{process}/{name}").read_bytes().decode(errors="replace").split("\0")
        with suppress(OSError):
            yield os.readlink(f"/proc/{process}/cwd")
        with suppress(OSError):
            for entry in Path(f"/proc/{process}/fd").iterdir():
                with suppress(OSError):
                    yield os.readlink(entry)
