"""Folders and files without permission, links, archives that unpack to gigabytes, names that are markup."""

import json
import shutil
import zipfile

import numpy as np
import pytest
import rasterio
from harness.effort import NIGHTLY, of
from rasterio import Affine

import roofbench as rb
from hostile.checks import check, content

#: Where each kind of file is read.
READERS = {
    "houses.geojson": ("evaluate", "houses.geojson", "truth.geojson"),
    "houses.gpkg": ("evaluate", "houses.gpkg", "truth.geojson"),
    "houses.shp": ("evaluate", "houses.shp", "truth.geojson"),
    "houses.fgb": ("evaluate", "houses.fgb", "truth.geojson"),
    "houses.parquet": ("evaluate", "houses.parquet", "truth.geojson"),
    "points.laz": ("scenes", "import", "points.laz", "-o", "out"),
    "dem.tif": ("scenes", "import", "ortho.tif", "--dem", "dem.tif", "-o", "out"),
    "suite.toml": ("run", "suite.toml", "--dry-run"),
    "runs.sqlite": ("ls", "--store", "runs.sqlite"),
    "old.json": ("gate", "old.json", "new.json"),
    "scene": ("scenes", "check", "scene"),
}
#: What each command writes below PLACE.
WRITERS = {
    "verdicts": ("evaluate", "houses.gpkg", "truth.geojson", "--verdicts", "PLACE/out.gpkg"),
    "plot": ("evaluate", "houses.gpkg", "truth.geojson", "--plot", "PLACE/out.png"),
    "parts": ("evaluate", "houses.gpkg", "houses.fgb", "--parts", "3", "--verdicts", "PLACE/out.gpkg"),
    "import": ("scenes", "import", "points.laz", "ortho.tif", "-q", "-o", "PLACE/out"),
    "make": ("scenes", "make", "fairfield-3-small", "--seed", "1", "-o", "PLACE/out"),
    "detect": ("detect", "ndsm", "scene", "-o", "PLACE/out.gpkg"),
    "run": ("run", "hamlet", "-d", "ndsm", "-j", "0", "--store", "PLACE/new.sqlite"),
    "report": ("report", "runs.sqlite", "-o", "PLACE/out.html"),
    "export": ("export", "1", "--store", "runs.sqlite", "-o", "PLACE/out.gpkg"),
    "gate": ("gate", "old.json", "new.json", "-o", "PLACE/out.md"),
}


def at_night(names, *always):
    """Return all names at night, else the ones that are always tried."""
    return list(names) if NIGHTLY else list(always)


@pytest.fixture
def laid_out(sound_files, tmp_path):
    shutil.copytree(sound_files, tmp_path, dirs_exist_ok=True)
    return tmp_path


@pytest.fixture
def bound(sandbox, laid_out):
    """Return how to run a command that permissions bind, root or not."""
    (laid_out / "secret").touch(mode=0o000)
    if "No such" in (answer := sandbox.run("ls", "--store", "secret", folder=laid_out, plain=True)).stderr:
        pytest.skip("capabilities cannot be given up here")
    assert answer.code == 2, answer.stderr
    (laid_out / "secret").unlink()

    def run(*words, seconds=20.0):
        return sandbox.run(*words, folder=laid_out, plain=True, seconds=seconds)

    return run


@pytest.mark.parametrize("name", at_night(READERS, "houses.gpkg", "houses.parquet", "points.laz", "runs.sqlite"))
def test_what_may_not_be_read_is_one_sentence(name, bound, laid_out):
    before = content(laid_out)
    (laid_out / name).chmod(0o000)
    outcome = bound(*READERS[name])
    (laid_out / name).chmod(0o755)
    check(outcome, before, laid_out)
    assert outcome.code == 2, outcome.stderr
    assert name in outcome.stderr.replace("\n", "")


@pytest.mark.parametrize("name", at_night(WRITERS, "parts", "run", "report"))
def test_a_folder_that_may_not_be_written_is_one_sentence(name, bound, laid_out):
    place = laid_out / "place"
    place.mkdir(mode=0o755)
    place.chmod(0o555)
    outcome = bound(*(word.replace("PLACE", "place") for word in WRITERS[name]))
    assert outcome.code == 2, outcome.stderr
    assert "Traceback" not in outcome.stderr
    assert not list(place.iterdir())


def test_a_store_in_a_folder_that_may_not_be_written_can_be_read(bound, laid_out):
    place = laid_out / "place"
    place.mkdir()
    shutil.copy(laid_out / "runs.sqlite", place)
    (place / "runs.sqlite").chmod(0o444)
    place.chmod(0o555)
    outcome = bound("ls", "--format", "json", "--store", "place/runs.sqlite")
    assert outcome.code == 0, outcome.stderr
    assert len(json.loads(outcome.stdout)) >= 1


@pytest.mark.parametrize(
    "name", [name for name in WRITERS if name != "run"]
)  # a store may be a link: it is read and written in place
def test_nothing_is_written_through_a_link(name, sandbox, laid_out):
    """A link where the output is to appear is no way to another place."""
    other = laid_out / "other"
    other.mkdir()
    place = laid_out / "place"
    place.mkdir()
    word = next(word for word in WRITERS[name] if word.startswith("PLACE/"))
    link = place / word.removeprefix("PLACE/")
    link.symlink_to(other / "target")
    sandbox.run(*(word.replace("PLACE", "place") for word in WRITERS[name]), folder=laid_out, seconds=20.0)
    assert not list(other.iterdir())


@pytest.mark.parametrize("name", at_night(WRITERS, "import", "report"))
def test_inputs_may_be_links(name, sandbox, laid_out, tmp_path_factory):
    place = tmp_path_factory.mktemp("linked")
    for item in laid_out.iterdir():
        (place / item.name).symlink_to(item)
    (place / "place").mkdir()
    words = [word.replace("PLACE", "place") for word in WRITERS[name]]
    outcome = sandbox.run(*words, folder=place, seconds=20.0)
    assert outcome.code == 0, outcome.stderr


TEXTS = {
    "markup": "<script>alert(1)</script>",
    "image": '"><img src=x onerror=alert(1)>',
    "new line": "one\ntwo",
    "terminal": "\x1b[31mred\x07",
    "path": "../../../escaped",
    "absolute": "/tmp/escaped",
    "percent": "%s%n{0}{scene}",
    "template": "{{ 7 * 7 }}{% raw %}",
    "right to left": "\u202egnp.exe",
    "long": "n" * 5000,
    "empty": "",
}


@pytest.mark.parametrize("kind", at_night(TEXTS, "markup", "terminal", "path"))
def test_a_scene_may_have_any_name(kind, sandbox, laid_out):
    manifest = laid_out / "scene" / "scene.toml"
    lines = manifest.read_text().splitlines()
    lines = [f"name = {json.dumps(TEXTS[kind])}" if line.startswith("name") else line for line in lines]
    manifest.write_text("\n".join(lines) + "\n")
    before = content(laid_out)
    outcome = sandbox.run(
        *("run", "scene", "-d", "ndsm", "-j", "0", "--store", "new.sqlite", "-o", "out"), folder=laid_out, seconds=20.0
    )
    check(outcome, before, laid_out, "out", "new.sqlite")
    if outcome.code == 0:
        page = (laid_out / "out" / "report.html").read_text()
        assert "<script>alert" not in page
        assert "<img src=x" not in page
        assert "\x1b[31m" not in outcome.stdout + outcome.stderr
    assert not list(laid_out.parent.rglob("escaped*"))


@pytest.mark.parametrize("kind", at_night(TEXTS, "markup"))
def test_buildings_may_have_any_name(kind, sandbox, laid_out):
    houses = rb.read_footprints(laid_out / "houses.gpkg")
    named = rb.Footprints.of(houses.polygons, crs=houses.crs, building_ids=[TEXTS[kind]] * len(houses))
    rb.write_footprints(named, laid_out / "named.geojson")
    before = content(laid_out)
    words = ("evaluate", "houses.gpkg", "named.geojson", "--building-id", "building_id")
    for more, output in (
        ((), None),
        (("--verdicts", "out.geojson"), "out.geojson"),
        (("--plot", "out.svg"), "out.svg"),
    ):
        outcome = sandbox.run(*words, *more, folder=laid_out, seconds=20.0)
        check(outcome, before, laid_out, output)
        assert "\x1b[31m" not in outcome.stdout + outcome.stderr
        if output is not None and outcome.code == 0:
            assert "<script>alert" not in (laid_out / output).read_text() or output.endswith("json")
            (laid_out / output).unlink()


@pytest.mark.parametrize("place", ["../outside.laz", "/etc/passwd", "~/points.laz", "points.laz/../../outside.laz"])
def test_a_manifest_cannot_name_files_elsewhere_without_a_word(place, sandbox, laid_out):
    """Nothing is written, and nothing that is no point file is read as one."""
    manifest = laid_out / "scene" / "scene.toml"
    manifest.write_text(manifest.read_text().replace("points.laz", place))
    before = content(laid_out)
    check(sandbox.run("scenes", "check", "scene", folder=laid_out), before, laid_out)


WEST, SOUTH = 500_000.0, 5_700_000.0


def test_an_image_of_zeros_that_unpacks_to_gigabytes_ends_in_bounds(sandbox, tmp_path):
    side = of(4_100, 40_000)
    profile = {"driver": "GTiff", "width": side, "height": side, "count": 1, "dtype": "uint8", "crs": "EPSG:25832"}
    profile |= {"compress": "deflate", "tiled": True, "blockxsize": 4096, "blockysize": 4096}
    with rasterio.open(tmp_path / "bomb.tif", "w", transform=Affine(0.05, 0, WEST, 0, -0.05, SOUTH), **profile) as file:
        empty = np.zeros((1, 4096, 4096), np.uint8)
        for row in range(0, side, 4096):
            for column in range(0, side, 4096):
                window = rasterio.windows.Window(column, row, min(4096, side - column), min(4096, side - row))
                file.write(empty[:, : int(window.height), : int(window.width)], window=window)
    assert (tmp_path / "bomb.tif").stat().st_size < side * side / 100
    before = content(tmp_path)
    outcome = sandbox.run("scenes", "import", "bomb.tif", "-q", "-o", "out", folder=tmp_path, seconds=of(20, 120))
    check(outcome, before, tmp_path, "out", memory=4 << 30)


def test_an_archive_of_zeros_is_not_unpacked(sandbox, laid_out):
    for name in ("houses.zip", "houses.shz", "houses.shp.zip"):
        with zipfile.ZipFile(laid_out / name, "w", zipfile.ZIP_DEFLATED) as archive:
            for suffix in ("shp", "shx", "dbf"):
                with archive.open(f"houses.{suffix}", "w", force_zip64=True) as stream:
                    for _ in range(of(20, 4000)):
                        stream.write(bytes(1 << 20))
        before = content(laid_out)
        check(sandbox.run("evaluate", name, "truth.geojson", folder=laid_out), before, laid_out)


def test_a_column_that_unpacks_to_gigabytes_ends_in_bounds(sandbox, laid_out):
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(laid_out / "houses.parquet")
    zeros = arrow.array([bytes(of(1, 20) * 10_000_000)] * table.num_rows, arrow.large_binary())
    parquet.write_table(table.append_column("zeros", zeros), laid_out / "houses.parquet", compression="zstd")
    before = content(laid_out)
    outcome = sandbox.run("evaluate", "houses.parquet", "truth.geojson", folder=laid_out, seconds=of(20, 60))
    check(outcome, before, laid_out, memory=of(1, 4) << 30)  # attributes are carried along


def test_outlines_of_many_vertices_end_in_bounds(sandbox, tmp_path):
    """10 million vertices at night."""
    turn = np.linspace(0, 2 * np.pi, of(30_000, 10_000_000), endpoint=False)
    ring = np.stack([WEST + 500 * np.cos(turn), SOUTH + 500 * np.sin(turn)], axis=1)
    import shapely

    shape = rb.Footprints.of([shapely.Polygon(ring)], crs="EPSG:25832")
    for name in ("one.fgb", "two.gpkg"):
        rb.write_footprints(shape, tmp_path / name)
    before = content(tmp_path)
    outcome = sandbox.run("evaluate", "one.fgb", "two.gpkg", "--format", "json", folder=tmp_path, seconds=of(20, 600))
    check(outcome, before, tmp_path, memory=of(1 << 30, 6 << 30))
    assert json.loads(outcome.stdout)["counts"]["true_positives"] == 1
