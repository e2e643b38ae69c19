"""A city: tiles give what the whole gives, in any order, with any number of workers, and after any interruption."""

import dataclasses
import os
import random
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import shapely
from builders.town import HOUSES, SIDE, SOUTH, STREET, WEST, same_footprints, street, town, town_folder
from harness.command_line import run

import roofbench as rb
from roofbench.benchmark.execution.city import City, detect_city
from roofbench.benchmark.execution.executors import Execution
from roofbench.benchmark.execution.runner import run_plan
from roofbench.benchmark.identity.recipes import SceneRecipe
from roofbench.benchmark.plan import make_plan
from roofbench.benchmark.store.writer import Store
from roofbench.benchmark.suite import read_suite
from roofbench.core.errors import InputError, OutputError, ParameterError
from roofbench.detectors.registry import make_detector
from roofbench.scenes.folder import save_scene
from roofbench.scenes.geodata.las_files import read_points, write_points
from roofbench.scenes.importing.tile_index import index_folder

HERE = Execution(jobs=0)
NDSM = make_detector("ndsm[cell=0.5]")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return town_folder(tmp_path_factory.mktemp("scene") / "town")


def detect(folder, output, *, detector=NDSM, tile=64.0, execution=HERE, **options):
    return detect_city(SceneRecipe.of_folder(folder), detector, output, City(tile=tile), execution=execution, **options)


def work_folder(output):
    return output.with_name(output.name + ".tiles")


def test_tiles_give_what_the_whole_gives(folder, tmp_path):
    result = detect(folder, tmp_path / "city.gpkg")
    city, whole = rb.read_footprints(tmp_path / "city.gpkg"), rb.detect(rb.open_scene(folder), NDSM)
    assert result.tiles == 16
    assert len(city) == len(whole) == len(HOUSES)
    assert same_footprints(whole, city).all()
    assert not work_folder(tmp_path / "city.gpkg").exists()


def test_a_hall_that_no_tile_sees_whole_is_joined(folder, tmp_path):
    city = City(tile=32.0, halo=24.0)
    recipe = SceneRecipe.of_folder(folder)
    result = detect_city(recipe, NDSM, tmp_path / "city.gpkg", city, execution=HERE)
    found = rb.read_footprints(tmp_path / "city.gpkg")
    hall = shapely.box(*HOUSES["hall"])
    (match,) = [polygon for polygon in found.polygons if polygon.intersects(hall)]
    assert result.seams.joined > 1
    assert match.intersection(hall).area / match.union(hall).area > 0.9
    assert len(found) == len(HOUSES)


def test_a_hall_of_300_m_a_row_over_four_tiles_and_a_house_on_a_seam_are_those_of_the_whole(tmp_path):
    """Tiles of 64 m with a halo of 64 m: none sees the hall whole."""
    save_scene(street(), tmp_path / "street")
    detector = make_detector("ndsm[cell=0.5]")
    result = detect(tmp_path / "street", tmp_path / "city.gpkg", detector=detector)
    found, whole = rb.read_footprints(tmp_path / "city.gpkg"), rb.detect(rb.open_scene(tmp_path / "street"), detector)
    assert result.seams.joined > 1
    assert len(found) == len(whole) == 3
    same = same_footprints(whole, found, least=0.01)
    assert same.all()
    hall = shapely.box(*STREET["hall"])
    (match,) = [polygon for polygon in found.polygons if polygon.intersects(hall)]
    assert match.intersection(hall).area / match.union(hall).area > 0.98


@pytest.mark.slow
def test_a_hall_longer_than_the_largest_rectangle_is_whole_in_small_tiles(tmp_path):
    save_scene(street(), tmp_path / "street")
    detect(tmp_path / "street", tmp_path / "city.gpkg", detector=make_detector("mpp"), tile=128.0)
    found, hall = rb.read_footprints(tmp_path / "city.gpkg"), shapely.box(*STREET["hall"])
    (match,) = [polygon for polygon in found.polygons if polygon.intersects(hall)]
    assert match.intersection(hall).area > 0.98 * match.union(hall).area


@pytest.mark.slow
def test_houses_of_a_row_over_four_tiles_stay_single(tmp_path):
    save_scene(street(without=["hall"]), tmp_path / "street")
    recipe, detector = SceneRecipe.of_folder(tmp_path / "street"), make_detector("mpp[level=part,largest_side=60]")
    result = detect_city(recipe, detector, tmp_path / "city.gpkg", City(tile=64.0), execution=HERE)
    found = rb.read_footprints(tmp_path / "city.gpkg")
    assert result.tiles == 14
    truth = np.array([shapely.box(*box) for name, box in STREET.items() if name != "hall"])
    first, second = shapely.STRtree(found.polygons).query(truth, predicate="intersects")
    common = shapely.area(shapely.intersection(truth[first], found.polygons[second]))
    together = shapely.area(shapely.union(truth[first], found.polygons[second]))
    assert len(found) == len(truth) == 17
    assert np.bincount(first[common > 0.85 * together], minlength=17).tolist() == [1] * 17


def test_neither_workers_nor_order_change_a_bit(folder, tmp_path):
    contents = []
    for name, options in {
        "one": {},
        "two": {"execution": Execution(jobs=2)},
        "shuffled": {"order": lambda tiles: random.Random(1).sample(tiles, len(tiles))},
    }.items():
        (tmp_path / name).mkdir()
        detect(folder, tmp_path / name / "city.fgb", **options)
        contents.append((tmp_path / name / "city.fgb").read_bytes())
    assert contents[0] == contents[1] == contents[2]


def test_values_that_a_detector_measures_are_shared_by_all_tiles(folder, tmp_path):
    result = detect(folder, tmp_path / "city.fgb", detector=make_detector("ndsm"))
    assert result.measured.parameters == {"cell": 22 / 32}
    assert result.measured.ground_cell is not None


def command(folder, output):
    words = ["detect", "ndsm[cell=0.5]", str(folder), "--tile", "32", "-j", "2", "-o", str(output)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.Popen([sys.executable, "-m", "roofbench", *words], env=environment, stderr=subprocess.PIPE)


def finished_tiles(output):
    # A tile that is being written lies in a hidden folder.
    return len(list(work_folder(output).glob("[!.]*_*"))) if work_folder(output).exists() else 0


def test_a_killed_run_resumes_without_loss(folder, tmp_path):
    (tmp_path / "whole").mkdir()
    whole, output = tmp_path / "whole" / "city.fgb", tmp_path / "city.fgb"
    detect(folder, whole, tile=32.0)
    process = command(folder, output)
    while finished_tiles(output) < 4 and process.poll() is None:
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert not output.exists()
    before = finished_tiles(output)
    assert before >= 4
    resumed = command(folder, output)
    message = resumed.communicate()[1].decode()
    assert resumed.returncode == 0, message
    assert f"{before} of them finished before" in message
    assert output.read_bytes() == whole.read_bytes()
    assert not work_folder(output).exists()


def test_outcomes_of_other_parameters_are_not_used(folder, tmp_path, misbehaving):
    output = tmp_path / "city.fgb"
    bad = make_detector(misbehaving, {"mode": "raises"})
    assert len(detect(folder, output, detector=bad).failed) == 16
    result = detect(folder, output, overwrite=True)
    assert (result.reused, result.footprints) == (0, len(HOUSES))


def test_another_seed_reuses_the_tiles_of_a_detector_that_draws_no_random_numbers(folder, tmp_path):
    recipe, output = SceneRecipe.of_folder(folder), tmp_path / "city.fgb"
    seen = []
    for seed in (0, 1):
        with pytest.raises(KeyboardInterrupt):
            detect_city(
                recipe, NDSM, output, City(tile=64.0, seed=seed), execution=HERE, progress=lambda *_: interrupt()
            )
        seen.append(finished_tiles(output))
    assert seen == [1, 2]


def interrupt():
    raise KeyboardInterrupt


def test_bad_sizes_and_places_are_refused(folder, tmp_path):
    with pytest.raises(ParameterError, match="tile=5 "):
        City(tile=5)
    with pytest.raises(OutputError, match="no folder"):
        detect(folder, tmp_path / "missing" / "city.fgb")
    with pytest.raises(OutputError, match="file ending"):
        detect(folder, tmp_path / "city.xyz")


def columns_of_files(folder, *, overlap=0.0):
    """The town as three files from west to east that overlap by so many metres on either side."""
    whole = town()
    folder.mkdir()
    for n in range(3):
        column = (WEST + 64 * n - overlap, SOUTH, WEST + 64 * n + 64 + overlap, SOUTH + SIDE)
        write_points(whole.window(column).points, folder / f"{n}.laz", crs="EPSG:25832")
    index_folder(folder)
    return folder


@pytest.fixture(scope="module")
def columns(tmp_path_factory):
    """Three files, and what is detected on them."""
    place = tmp_path_factory.mktemp("columns")
    detect(columns_of_files(place / "tiles"), place / "city.fgb")
    return place / "tiles", (place / "city.fgb").read_bytes()


def missing(file):
    file.unlink()


def broken(file):
    content = file.read_bytes()
    file.write_bytes(content[:4000] + bytes(len(content) - 8000) + content[-4000:])


def of_another_zone(file):
    write_points(read_points(file), file, crs="EPSG:25833")


def in_feet(file):
    write_points(read_points(file), file, crs="EPSG:2263")


@pytest.mark.parametrize(
    ("spoil", "indexed"), [(missing, False), (broken, False), (broken, True), (of_another_zone, True), (in_feet, True)]
)
def test_a_bad_file_costs_its_tiles_alone_and_a_repaired_one_is_computed_then(columns, tmp_path, spoil, indexed):
    folder, output = tmp_path / "tiles", tmp_path / "city.fgb"
    shutil.copytree(columns[0], folder)
    content = (folder / "2.laz").read_bytes()
    spoil(folder / "2.laz")
    if indexed:
        code, _, message = run("scenes", "index", folder)
        # A header can be sound where the points are not.
        assert code == (0 if spoil is broken else 3)
        assert spoil is broken or "2.laz is left out" in message
    words = ("detect", "ndsm[cell=0.5]", folder, "--tile", 64, "-j", 0, "-o", output)
    code, _, message = run(*words)
    assert code == 3
    assert "2.laz" in message
    assert 0 < len(rb.read_footprints(output)) < len(HOUSES)
    if indexed and spoil is not broken:
        code, _, message = run("detect", "ndsm[cell=0.5]", folder, "-o", tmp_path / "whole.fgb")
        assert code == 3
        assert "1 file is not part of the scene" in message
    (folder / "2.laz").write_bytes(content)
    assert run("scenes", "index", folder)[0] == 0
    code, _, message = run(*words, "--overwrite")
    assert code == 0, message
    assert "finished before" in message
    assert "cues used on tiles: " in message
    assert "roughness" in message
    assert output.read_bytes() == columns[1]


def test_tiles_without_any_file_are_not_computed(columns, tmp_path):
    """The easternmost file, 300 km away."""
    folder, output = tmp_path / "tiles", tmp_path / "city.fgb"
    shutil.copytree(columns[0], folder)
    east = (WEST + 128, SOUTH, WEST + SIDE, SOUTH + SIDE)
    points = town().window(east).points
    write_points(dataclasses.replace(points, x=points.x + 300_032), folder / "2.laz", crs="EPSG:25832")
    index_folder(folder)
    result = detect(folder, output)
    assert result.tiles < 40
    assert not result.failed
    moved = rb.detect(rb.Scene("east", east, crs="EPSG:25832", points=points, dem=town().dem), NDSM)
    assert (rb.read_footprints(output).centres[:, 0] > 300_000).sum() == len(moved) > 0


def test_files_that_overlap_give_what_files_side_by_side_give(columns, tmp_path):
    detect(columns_of_files(tmp_path / "tiles", overlap=7.0), tmp_path / "city.fgb")
    (tmp_path / "apart.fgb").write_bytes(columns[1])
    one, two = rb.read_footprints(tmp_path / "city.fgb"), rb.read_footprints(tmp_path / "apart.fgb")
    assert len(one) == len(two)
    # The ground is filtered from the points, whose order differs.
    assert same_footprints(one, two, least=1e-3).all()


SUITE = """
[[scenes]]
path = "town"
tile = 64
[[detectors]]
use = "ndsm"
cell = 0.5
[[detectors]]
use = "original"
"""


def test_a_city_in_a_suite_is_detected_tile_by_tile_and_scored(tmp_path, monkeypatch):
    whole = town()
    reference = rb.Footprints.of([shapely.box(*box) for box in HOUSES.values()], crs=whole.crs)
    layers = {"points": whole.points, "dem": whole.dem, "reference": reference}
    save_scene(rb.Scene(whole.name, whole.extent, crs=whole.crs, **layers), tmp_path / "town")
    suite, store = tmp_path / "suite.toml", tmp_path / "a.sqlite"
    suite.write_text(SUITE)
    recipe, seen = SceneRecipe.of_folder(tmp_path / "town", tile=64), []
    window = rb.Scene.window
    monkeypatch.setattr(rb.Scene, "window", lambda self, *args: seen.append(args) or window(self, *args))
    with Store(store) as opened:
        rows = run_plan(make_plan(read_suite(suite), opened), opened, execution=HERE).rows
    assert len(seen) > 16
    ok, skipped = sorted(rows, key=lambda row: row.status)
    assert (ok.status, ok.detected) == ("ok", len(HOUSES))
    assert skipped.status == "skipped"
    assert "no orthoimage" in skipped.reason
    assert recipe.key != SceneRecipe.of_folder(tmp_path / "town").key
    detect_city(recipe, NDSM, tmp_path / "city.gpkg", City(tile=64.0), execution=HERE)
    with Store(store) as stored:
        assert same_footprints(rb.read_footprints(tmp_path / "city.gpkg"), stored.detections(ok.id)).all()


def test_a_tile_of_a_suite_is_checked(tmp_path):
    town_folder(tmp_path / "town")
    suite = tmp_path / "suite.toml"
    suite.write_text(SUITE.replace("64", "3"))
    with pytest.raises(InputError, match="line 4: tile must be from 16 to 100000 metres, not 3"):
        read_suite(suite)
