"""What return numbers that say nothing in a part of a cloud cost: the table of docs/results/real-scenes.md.

Run by hand: ``python tests/performance/study_returns.py --folders delft,ign --presets knox -d ndsm``. Folders are
scenes with a reference; detectors see their points without classes and without a DEM. Each cloud is scored as it is and
in copies whose return numbers are replaced in half of the area (west, or stripes of 40 m) or in half of the points
everywhere (mixed; sources: with a point source id of their own), as if a second provider had flown there: 1 of 1,
2 of 2 or 0 of 0. *nowhere*: the cloud without numbers.

Columns: object quality, pixel quality and agreement, percent, and the cues that the detector used.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from study_real import agreement, blind

import roofbench as rb

_DETECTORS = ("ndsm", "dempster-shafer", "mpp")


def parts_of(scene: rb.Scene) -> dict[str, NDArray[np.bool_]]:
    """Return which points another provider has, by the name of the part."""
    points = scene.points
    assert points is not None
    west, south, east, _ = scene.extent
    mixed = np.random.default_rng(0).random(len(points)) < 0.5
    return {
        "west": points.x < (west + east) / 2,
        "stripes": (points.y - south) // 40 % 2 == 0,
        "mixed": mixed,
        "sources": mixed,
    }


def variants(scene: rb.Scene) -> Iterator[tuple[str, rb.Scene]]:
    """Yield the cloud as it is, without numbers, and with numbers replaced in a part."""
    points = scene.points
    assert points is not None
    yield "as it is", scene
    yield "nowhere", _with(scene, None, None)
    for part, chosen in parts_of(scene).items():
        for number in (1, 2, 0):
            numbers = [
                np.where(chosen, np.uint8(number), column)
                for column in (points.return_number, points.number_of_returns)
            ]
            source = chosen.astype(np.uint16) if part == "sources" else None
            yield f"{part}: {number} of {number}", _with(scene, *numbers, source)


def _with(
    scene: rb.Scene,
    number: NDArray[np.uint8] | None,
    total: NDArray[np.uint8] | None,
    source: NDArray[np.uint16] | None = None,
) -> rb.Scene:
    points = replace(scene.points, return_number=number, number_of_returns=total, source=source)
    return rb.Scene(
        scene.name,
        scene.extent,
        crs=scene.crs,
        points=points,
        image=scene.image,
        reference=scene.reference,
        area=scene.area,
    )


def main() -> None:
    """Print a row for each scene, detector and copy."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folders", default="", help="folders of scenes, separated by commas")
    parser.add_argument("--presets", default="", help="presets, separated by commas")
    parser.add_argument("-d", dest="detectors", action="append", help="detectors [ndsm, dempster-shafer, mpp]")
    options = parser.parse_args()
    scenes = [blind(rb.open_scene(folder)) for folder in filter(None, options.folders.split(","))]
    scenes += [blind(rb.open_scene(preset)) for preset in filter(None, options.presets.split(","))]
    print("| detector | scene | numbers | Q_l | Q_lp | agreement | cues |\n|---|---|---|--:|--:|--:|---|")
    means: dict[tuple[str, str], list[tuple[float, float, float]]] = {}
    for scene in scenes:
        for detector in options.detectors or _DETECTORS:
            for name, variant in variants(scene):
                found = rb.detect(variant, detector)
                score = rb.evaluate(found, scene.reference, area=scene.area)
                numbers = (score.object.quality or 0.0, score.pixel.quality or 0.0, agreement(found, scene))
                means.setdefault((detector, name), []).append(numbers)
                _row(detector, Path(scene.name).name, name, numbers, ", ".join(found.metadata.get("cues", ())))
    for (detector, name), rows in means.items():
        mean = np.mean(rows, axis=0)
        _row(detector, f"mean of {len(rows)}", name, (mean[0], mean[1], mean[2]), "")


def _row(detector: str, scene: str, name: str, numbers: tuple[float, float, float], cues: str) -> None:
    values = " | ".join(f"{100 * value:.1f}" for value in numbers)
    print(f"| `{detector}` | {scene} | {name} | {values} | {cues} |", flush=True)


if __name__ == "__main__":
    main()
