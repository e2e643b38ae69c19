"""Make the two real scenes that ship inside the package, from the files as they are published.

Run by hand: ``python tests/performance/make_real_scenes.py DELFT IGN -o scenes/data``. DELFT is a folder with
``example_data/ahn3/*.laz`` and ``example_data/bgt/bgt_pand.sqlite`` (or the same layer as GeoPackage) of
github.com/tudelft3d/3dfier at commit 238782d; IGN one with ``870000_6618000.subset.postValidation.laz`` of
github.com/IGNF/lidar-prod at commit 2cb12d9, folder ``tests/files``.

Delft is cut to one block of the old town. The register was published for that block only, so its reference is complete
inside its convex hull (widened by 6 m, which is half a street). Footprints that the cut divides are no part of the
evaluation area. In the French file one house carries the class "unclassified", but the mark that it lies inside a
building of the map; such points above 2 m count as building points before the reference is derived.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import laspy
import numpy as np
import pyogrio
import shapely

from roofbench.scenes.folder import open_scene, save_scene
from roofbench.scenes.geodata.las_files import read_points
from roofbench.scenes.importing.request import ImportRequest
from roofbench.scenes.importing.scene_import import import_scene
from roofbench.scenes.scene import Scene

DELFT_EXTENT = (84894.0, 447448.0, 85066.0, 447584.0)
HULL_MARGIN = 6.0  # m
MAP_HOUSE_HEIGHT = 2.0  # m above ground

DELFT_SOURCE = (
    "AHN3 points (2014, Rijkswaterstaat and the water authorities) and the register BGT (Kadaster, municipality of "
    "Delft), from the example data of github.com/tudelft3d/3dfier at commit 238782d, cut to one block"
)
IGN_SOURCE = (
    "IGN, LiDAR HD with the colours of BD ORTHO, from github.com/IGNF/lidar-prod at commit 2cb12d9, "
    "tests/files/870000_6618000.subset.postValidation.laz; reference from building points and the mark BDTopoOverlay"
)
DELFT_LICENCE = """\
Scene delft
===========

Points: AHN3 (Actueel Hoogtebestand Nederland), (c) Rijkswaterstaat and the Dutch water authorities.
Reference: BGT (Basisregistratie Grootschalige Topografie), object type pand, (c) Kadaster, municipality of Delft.
Obtained from the example data of 3dfier, https://github.com/tudelft3d/3dfier, commit 238782d4e14c.
Licence of both data sets: CC0 1.0 Universal, https://creativecommons.org/publicdomain/zero/1.0/

Changes: cut to the extent of scene.toml; coordinate reference system EPSG:28992 assigned; elevation model derived from
ground points; evaluation area derived from the register. The scene has the same licence.
"""
IGN_LICENCE = """\
Scene ign
=========

Points and colours: (c) IGN, LiDAR HD and BD ORTHO. Marks of buildings: (c) IGN, BD TOPO.
Obtained from https://github.com/IGNF/lidar-prod, commit 2cb12d9ef5ac.
Licence: Licence Ouverte / Open Licence 2.0 (Etalab),
https://www.etalab.gouv.fr/wp-content/uploads/2018/11/open-licence.pdf

Changes: points reduced to the attributes that roofbench reads; orthoimage derived from the colours of the points;
elevation model derived from ground points; reference footprints derived from building points. The scene has the same
licence.
"""


def make_delft(folder: Path, output: Path) -> None:
    """Cut one block of Delft; its register gives the reference."""
    register = next(path for ending in ("sqlite", "gpkg") for path in sorted(folder.rglob(f"bgt_pand*.{ending}")))
    footprints = pyogrio.read_dataframe(register).geometry.values
    with tempfile.TemporaryDirectory() as scratch:
        request = ImportRequest(
            points=sorted(folder.rglob("ahn3_cropped_*.laz")),
            crs="EPSG:28992",
            reference=register,
            building_id="identificatiebagpnd",
            extent=DELFT_EXTENT,
            name="delft",
            source=DELFT_SOURCE,
            licence="CC0 1.0",
        )
        scene = import_scene(Path(scratch) / "delft", request)
        box = shapely.box(*scene.extent)
        cut = scene.reference.polygons[~shapely.covers(box, scene.reference.polygons)]
        hull = shapely.buffer(shapely.convex_hull(shapely.union_all(footprints)), HULL_MARGIN)
        area = shapely.difference(shapely.intersection(hull, box), shapely.union_all(cut))
        how = f"convex hull of the register, widened by {HULL_MARGIN:g} m, without the {len(cut)} divided footprints"
        notes = [note for note in scene.facts["notes"] if "evaluation area" not in note]
        facts = {
            **scene.facts,
            "derived": {**scene.facts["derived"], "area": how},
            "notes": [*notes, f"the evaluation area is the {how}"],
        }
        save_scene(_changed(scene, area=area, facts=facts), output, overwrite=True)
    (output / "LICENCE.txt").write_text(DELFT_LICENCE)


def make_ign(folder: Path, output: Path) -> None:
    """Take the whole French file; its image and reference are derived from its points."""
    with tempfile.TemporaryDirectory() as scratch:
        published = next(folder.rglob("870000_6618000.subset.postValidation.laz"))
        marked = Path(scratch) / published.name
        cloud = laspy.read(published)
        in_map = (np.asarray(cloud["BDTopoOverlay"]) == 1) & (np.asarray(cloud.classification) == 1)
        ground = import_scene(Path(scratch) / "ground", ImportRequest(points=[published])).dem
        height = np.asarray(cloud.z) - ground.sample(np.asarray(cloud.x), np.asarray(cloud.y))
        classes = np.asarray(cloud.classification).copy()
        classes[in_map & (height > MAP_HOUSE_HEIGHT)] = 6
        cloud.classification = classes
        cloud.write(marked)
        request = ImportRequest(
            points=[marked],
            reference_from_class=True,
            ortho_from_points=True,
            name="ign",
            source=IGN_SOURCE,
            licence="Licence Ouverte / Open Licence 2.0 (Etalab)",
        )
        scene = import_scene(Path(scratch) / "ign", request)
        # The image has the colours; the classes are those of the publisher.
        points = replace(scene.points, colour=None, classification=read_points(published).classification)
        save_scene(_changed(scene, points=points), output, overwrite=True)
    (output / "LICENCE.txt").write_text(IGN_LICENCE)


def _changed(scene: Scene, **changes: object) -> Scene:
    layers = {name: getattr(scene, name) for name in ("points", "image", "dem", "reference", "area")}
    values = {"crs": scene.crs, "facts": scene.facts, **layers, **changes}
    return Scene(scene.name, scene.extent, **values)


def main() -> None:
    """Make both scenes and print what they hold."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("delft", type=Path)
    parser.add_argument("ign", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    make_delft(given.delft, given.output / "delft")
    make_ign(given.ign, given.output / "ign")
    for folder in sorted(given.output.iterdir()):
        size = sum(file.stat().st_size for file in folder.iterdir()) / 1e6
        scene = open_scene(folder)
        print(f"{scene.name}: {len(scene.points):,} points, {len(scene.reference)} footprints, {size:.2f} MB")


if __name__ == "__main__":
    main()
