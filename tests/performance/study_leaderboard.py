"""One leaderboard of every detector, the tools of others included.

Run by hand: ``python tests/performance/study_leaderboard.py ../shared/scenes -o board -j 1``. It imports the real
scenes of that folder (once; the DEM comes from the ground filter, never from classes), adds the scenes of the suite
`papers` and those that come with roofbench, writes all to ``board/leaderboard.toml`` and runs it. The store
``board/roofbench.sqlite`` resumes: what has a result is not run again. Further options are those of `roofbench run`.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from importlib import resources
from pathlib import Path

from roofbench.scenes.importing.request import ImportRequest
from roofbench.scenes.importing.scene_import import import_scene

#: Real scenes: name, then points, and the other files and options of the import, relative to the folder given.
REAL = {
    "delft-houses": {
        "points": ["delft-ahn3/ahn3_cropped_1.laz", "delft-ahn3/ahn3_cropped_2.laz"],
        "crs": "EPSG:28992",
        "reference": "delft-ahn3/bgt_pand_footprints.gpkg",
        "area": "delft-ahn3/evaluation_area.gpkg",
    },
    "delft-blocks": {
        "points": ["delft-ahn3/ahn3_cropped_1.laz", "delft-ahn3/ahn3_cropped_2.laz"],
        "crs": "EPSG:28992",
        "reference": "delft-ahn3/reference_from_class.gpkg",
    },
    "french-village": {
        "points": ["ign-870200-colour/870000_6618000.subset.postValidation.laz"],
        "reference": "ign-870200-colour/reference_from_class.gpkg",
        "ortho_from_points": True,
    },
    "bratislava": {
        "points": ["bratislava/points.laz"],
        "reference": "bratislava/reference_from_class.gpkg",
    },
    "st-barth": {
        "points": ["st-barth/points.laz"],
        "crs": "EPSG:5490",
        "reference": "st-barth/reference_from_class.gpkg",
    },
    "kentucky": {
        "points": ["kentucky-suburb/points.laz"],
        "ortho": "kentucky-suburb/ortho.tif",
        "reference": "kentucky-suburb/footprints.gpkg",
        "area": "kentucky-suburb/evaluation_area.gpkg",
    },
}
SHIPPED = ("delft", "ign")

MODES = ({}, {"mode": "paper"}, {"mode": "program"})
#: Detectors, each a table of a suite.
DETECTORS = [
    {"use": "ndsm"},
    {"use": "dempster-shafer"},
    *({"use": "command", "recipe": recipe} for recipe in ("whitebox", "cloth-filter", "pysmrf", "grass")),
    *(
        {"use": use, **mode}
        for use in ("original", "improved")
        for mode in ({}, {"mode": "paper"}, {"mode": "program"})
    ),
    {"use": "mpp", "level": "part"},
    {"use": "mpp"},
    {"use": "mpp-printed"},
]


def imported(shared, folder):
    """Import the real scenes that are not there yet, and return the folders."""
    for name, given in REAL.items():
        if (folder / name).exists():
            continue
        files = {key: shared / given[key] for key in ("ortho", "reference", "area") if key in given}
        options = {key: given[key] for key in ("crs", "ortho_from_points") if key in given}
        points = [shared / file for file in given["points"]]
        import_scene(folder / name, ImportRequest(points=points, ground_filter="opening", **files, **options))
        print(f"imported {name}", file=sys.stderr)
    return [folder / name for name in REAL]


def suite_text(folders):
    """Return the suite: the scenes of `papers`, those that come with roofbench and those of folders."""
    papers = (resources.files("roofbench") / "benchmark/suites/papers.toml").read_text(encoding="utf-8")
    scenes = papers[papers.index("[[scenes]]") : papers.index("[[detectors]]")]
    tables = ['name = "leaderboard"', scenes.rstrip()]
    tables += [f'[[scenes]]\nname = "{name}"' for name in SHIPPED]
    tables += [f'[[scenes]]\npath = "scenes/{folder.name}"' for folder in folders]
    for detector in DETECTORS:
        tables.append("\n".join(["[[detectors]]", *(f'{key} = "{value}"' for key, value in detector.items())]))
    return "\n\n".join(tables) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("shared", type=Path, help="folder with the real scenes")
    parser.add_argument("-o", "--output", type=Path, default=Path("board"))
    options, others = parser.parse_known_args()
    (options.output / "scenes").mkdir(parents=True, exist_ok=True)
    suite = options.output / "leaderboard.toml"
    suite.write_text(suite_text(imported(options.shared, options.output / "scenes")), encoding="utf-8")
    store = options.output / "roofbench.sqlite"
    command = [sys.executable, "-m", "roofbench", "run", suite, "--store", store, "-o", options.output, "--overwrite"]
    raise SystemExit(subprocess.run([*map(str, command), *others], check=False).returncode)


if __name__ == "__main__":
    main()
