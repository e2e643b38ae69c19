"""Well-formed files with content that no one expects: geometry, numbers, names, places and sizes."""

import json
import os
import shutil
import subprocess

import numpy as np
import pytest
import rasterio
from rasterio import Affine

from hostile.checks import check, content

WEST, SOUTH = 500_000.0, 5_700_000.0
SQUARE = [[WEST, SOUTH], [WEST + 10, SOUTH], [WEST + 10, SOUTH + 10], [WEST, SOUTH + 10], [WEST, SOUTH]]
POLYGON = {"type": "Polygon", "coordinates": [SQUARE]}


def moved(ring, **places):
    """Return a polygon whose vertices of these numbers lie elsewhere."""
    return {
        "type": "Polygon",
        "coordinates": [[places.get(f"at_{number}", point) for number, point in enumerate(ring)]],
    }


def nested(depth):
    geometry = POLYGON
    for _ in range(depth):
        geometry = {"type": "GeometryCollection", "geometries": [geometry]}
    return geometry


def zigzag(count):
    """A comb of `count` teeth: a valid ring of many vertices."""
    x = np.linspace(0, 30, 2 * count)
    teeth = np.stack([WEST + x, SOUTH + np.where(np.arange(2 * count) % 2, 0.0, 20.0)], axis=1)
    return {
        "type": "Polygon",
        "coordinates": [[*teeth.tolist(), [WEST + 30, SOUTH - 5], [WEST, SOUTH - 5], teeth[0].tolist()]],
    }


GEOMETRIES = {
    "null": None,
    "empty polygon": {"type": "Polygon", "coordinates": []},
    "ring of two points": {"type": "Polygon", "coordinates": [[[WEST, SOUTH], [WEST, SOUTH]]]},
    "ring that is not closed": {"type": "Polygon", "coordinates": [SQUARE[:-1]]},
    "no area": {"type": "Polygon", "coordinates": [[SQUARE[0], SQUARE[1], SQUARE[0], SQUARE[0]]]},
    "bow tie": moved(SQUARE, at_1=SQUARE[2], at_2=SQUARE[1]),
    "hole outside": {"type": "Polygon", "coordinates": [SQUARE, [[x + 100, y] for x, y in SQUARE]]},
    "hole that is the ring": {"type": "Polygon", "coordinates": [SQUARE, SQUARE]},
    "NaN": moved(SQUARE, at_1=[float("nan"), SOUTH]),
    "infinite": moved(SQUARE, at_1=[float("inf"), SOUTH]),
    "1e300": moved(SQUARE, at_1=[1e300, SOUTH]),
    "1e-300": {"type": "Polygon", "coordinates": [[[x * 1e-300, y * 1e-300] for x, y in SQUARE]]},
    "1e16": {"type": "Polygon", "coordinates": [[[x + 1e16, y + 1e16] for x, y in SQUARE]]},
    "degrees": {
        "type": "Polygon",
        "coordinates": [[[8 + i * 1e-4, 51 + j * 1e-4] for i, j in np.array(SQUARE) - SQUARE[0]]],
    },
    "point": {"type": "Point", "coordinates": SQUARE[0]},
    "line": {"type": "LineString", "coordinates": SQUARE},
    "nested three deep": nested(3),
    "nested a hundred deep": nested(100),
    "empty collection": {"type": "GeometryCollection", "geometries": []},
    "text as number": {"type": "Polygon", "coordinates": [[["a", "b"]] * 4]},
    "unknown kind": {"type": "Banana", "coordinates": [SQUARE]},
    "four dimensions": {"type": "Polygon", "coordinates": [[[x, y, 5.0, 7.0] for x, y in SQUARE]]},
    "comb of 20 000 teeth": zigzag(20_000),
}


def collection(*geometries, crs="urn:ogc:def:crs:EPSG::25832", **more):
    features = [
        {"type": "Feature", "properties": {"name": "a"}, "geometry": geometry, **more} for geometry in geometries
    ]
    head = {"type": "FeatureCollection", "features": features}
    return head if crs is None else {**head, "crs": {"type": "name", "properties": {"name": crs}}}


@pytest.fixture
def evaluate(sandbox, tmp_path):
    """Compare a GeoJSON text with one square; the name of the file may be chosen."""

    def compare(value, *more, name="detected.geojson"):
        text = value if isinstance(value, str) else json.dumps(value)
        (tmp_path / name).write_text(text, encoding="utf-8", errors="surrogatepass")
        (tmp_path / "truth.geojson").write_text(json.dumps(collection(POLYGON)), encoding="utf-8")
        before = content(tmp_path)
        outcome = sandbox.run("evaluate", name, "truth.geojson", "--format", "json", *more, folder=tmp_path)
        check(outcome, before, tmp_path)
        return outcome

    return compare


@pytest.mark.parametrize("kind", GEOMETRIES)
def test_geometries_that_no_one_expects(kind, evaluate):
    outcome = evaluate(collection(POLYGON, GEOMETRIES[kind]))
    if outcome.code == 0:
        assert json.loads(outcome.stdout)["counts"]["true_positives"] >= 1


@pytest.mark.parametrize("kind", GEOMETRIES)
def test_geometries_that_no_one_expects_alone(kind, evaluate):
    outcome = evaluate(collection(GEOMETRIES[kind]))
    if outcome.code == 0:
        assert "counts" in json.loads(outcome.stdout)


TEXTS = {
    "empty": "",
    "spaces": "  \n ",
    "no JSON": "POLYGON((0 0, 1 1))",
    "another root": "[]",
    "a number": "7",
    "only a brace": "{",
    "deep brackets": "[" * 5000,
    "no features": '{"type": "FeatureCollection"}',
    "features null": '{"type": "FeatureCollection", "features": null}',
    "CRS null": json.dumps({**collection(POLYGON, crs=None), "crs": None}),
    "CRS unknown": json.dumps(collection(POLYGON, crs="urn:ogc:def:crs:EPSG::1")),
    "CRS in degrees": json.dumps(collection(POLYGON, crs="urn:ogc:def:crs:EPSG::4326")),
    "CRS in feet": json.dumps(collection(POLYGON, crs="urn:ogc:def:crs:EPSG::2263")),
    "CRS geocentric": json.dumps(collection(POLYGON, crs="urn:ogc:def:crs:EPSG::4978")),
    "CRS vertical": json.dumps(collection(POLYGON, crs="urn:ogc:def:crs:EPSG::5783")),
    "another zone": json.dumps(collection(POLYGON, crs="urn:ogc:def:crs:EPSG::25833")),
    "byte order mark": "\ufeff" + json.dumps(collection(POLYGON)),
    "null byte": json.dumps(collection(POLYGON)).replace('"a"', '"a\\u0000b"'),
    "lone surrogate": json.dumps(collection(POLYGON)).replace('"a"', '"\\ud800"'),
    "one name twice": json.dumps(collection(POLYGON)).replace('"name": "a"', '"name": "a", "NAME": "b", "name": 3'),
    "identifiers of all kinds": json.dumps(collection(POLYGON, POLYGON, id="x" * 10_000)),
}


@pytest.mark.parametrize("kind", TEXTS)
def test_texts_that_are_hardly_geojson(kind, evaluate):
    evaluate(TEXTS[kind])


@pytest.mark.parametrize(
    "crs", ["EPSG:1", "EPSG:32600", "EPSG:4326", "nonsense", "", "EPSG:99999999999999999999", "\n"]
)
def test_systems_that_cannot_be_named(crs, evaluate):
    assert evaluate(collection(POLYGON, crs=None), "--crs", crs).code == 2


NAMES = ["a b.geojson", "ä€.geojson", "<script>.geojson", "-x.geojson", "a|b.geojson"]
NAMES += ["a!b.geojson", "a\nb.geojson", "a;b.geojson", "zip:a.geojson", " a.geojson", "a?b#c.geojson"]
NAMES += ["%s.geojson", "a'b\".geojson", "[1].geojson", "x" * 240 + ".geojson"]


@pytest.mark.parametrize("name", NAMES)
def test_files_may_have_any_name(name, sandbox, tmp_path):
    for file in (name, "truth.geojson"):
        (tmp_path / file).write_text(json.dumps(collection(POLYGON)), encoding="utf-8")
    before = content(tmp_path)
    outcome = sandbox.run("evaluate", "--format", "json", "--", name, "truth.geojson", folder=tmp_path)
    check(outcome, before, tmp_path)
    assert outcome.code == 0, outcome.stderr
    assert json.loads(outcome.stdout)["counts"]["true_positives"] == 1


PLACES = ["missing", "folder", "broken link", "link to itself", "pipe", "empty", "device"]


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("ending", ["geojson", "gpkg", "parquet", "laz", "tif", "toml", "sqlite", "json"])
def test_places_that_are_no_files(place, ending, sandbox, tmp_path):
    path = tmp_path / f"input.{ending}"
    make = {
        "missing": lambda: None,
        "folder": path.mkdir,
        "broken link": lambda: path.symlink_to("nowhere"),
        "link to itself": lambda: path.symlink_to(path),
        "pipe": lambda: os.mkfifo(path),
        "empty": path.touch,
        "device": lambda: path.symlink_to("/dev/null"),
    }
    make[place]()
    (tmp_path / "truth.geojson").write_text(json.dumps(collection(POLYGON)), encoding="utf-8")
    arguments = {
        "laz": ("scenes", "import", path.name, "-o", "out"),
        "tif": ("scenes", "import", path.name, "-o", "out"),
        "toml": ("run", path.name, "--dry-run"),
        "sqlite": ("ls", "--store", path.name),
        "json": ("gate", path.name),
    }.get(ending, ("evaluate", path.name, "truth.geojson"))
    before = content(tmp_path)
    outcome = sandbox.run(*arguments, folder=tmp_path)
    if (ending, place) in {("sqlite", "empty"), ("sqlite", "device")}:
        assert "Traceback" not in outcome.stderr
        return
    check(outcome, before, tmp_path)
    assert outcome.code == 2, outcome.stderr


def test_an_image_that_unpacks_to_gigabytes_is_refused_or_read_in_bounds(sandbox, sound_files, tmp_path):
    side = 60_000
    profile = {"driver": "GTiff", "width": side, "height": side, "count": 3, "dtype": "uint8", "crs": "EPSG:25832"}
    profile |= {"compress": "deflate", "tiled": True, "transform": Affine(0.01, 0, WEST, 0, -0.01, SOUTH + 600)}
    with rasterio.open(tmp_path / "bomb.tif", "w", sparse_ok=True, **profile):
        pass
    before = content(tmp_path)
    outcome = sandbox.run("scenes", "import", "bomb.tif", "-o", "out", folder=tmp_path)
    check(outcome, before, tmp_path, "out")


@pytest.fixture
def small_disk(tmp_path):
    place = tmp_path / "disk"
    place.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=16k", "tmpfs", str(place)], capture_output=True)
    if mounted.returncode:
        pytest.skip("mounting is not permitted here")
    yield place
    subprocess.run(["umount", str(place)], check=True)


@pytest.mark.parametrize("command", ["import", "run", "report", "verdicts"])
def test_a_full_disk_is_one_sentence_and_leaves_nothing(command, small_disk, sandbox, sound_files, tmp_path):
    for name in ("points.laz", "ortho.tif", "runs.sqlite", "houses.gpkg", "truth.geojson"):
        shutil.copy(sound_files / name, tmp_path / name)
    arguments = {
        "import": ("scenes", "import", "points.laz", "ortho.tif", "-o", "disk/out"),
        "run": ("run", "hamlet", "-d", "ndsm", "-j", "0", "--store", "disk/runs.sqlite"),
        "report": ("report", "runs.sqlite", "-o", "disk/out.html"),
        "verdicts": ("evaluate", "houses.gpkg", "truth.geojson", "--verdicts", "disk/out.gpkg"),
    }[command]
    outcome = sandbox.run(*arguments, folder=tmp_path)
    assert outcome.code in {2, 3}, outcome.stderr
    assert "Traceback" not in outcome.stderr
    left = {path.name for path in small_disk.iterdir()}
    assert left <= ({"runs.sqlite", "runs.sqlite-wal", "runs.sqlite-shm"} if command == "run" else set()), left
