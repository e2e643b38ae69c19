"""Scenes on a server: a window fetches the files that it meets, each once, and checks them."""

import functools
import http.server
import threading

import numpy as np
import pytest
import shapely
from builders.copc_files import write_copc
from builders.town import HOUSES, SIDE, SOUTH, WEST, town

import roofbench as rb
from roofbench.benchmark.execution.city import City, detect_city
from roofbench.benchmark.execution.executors import Execution
from roofbench.benchmark.suite import scenes_of
from roofbench.core.errors import InputError
from roofbench.detectors.registry import make_detector
from roofbench.scenes.folder import open_scene, write_reference
from roofbench.scenes.geodata.las_files import write_points
from roofbench.scenes.geodata.raster import Grid, Image
from roofbench.scenes.geodata.raster_files import write_elevation, write_image
from roofbench.scenes.importing.tile_index import index_folder
from roofbench.scenes.remote import copy_of


@pytest.fixture
def tiles(tmp_path, monkeypatch):
    """The town as three point files and one elevation model."""
    monkeypatch.setenv("ROOFBENCH_SCENES", str(tmp_path / "copies"))
    copy_of.cache_clear()
    folder, whole = tmp_path / "served" / "town", town()
    folder.mkdir(parents=True)
    for n in range(3):
        column = (WEST + 64 * n, SOUTH, WEST + 64 * n + 64, SOUTH + SIDE)
        write_points(whole.window(column).points, folder / f"{n} of 3.laz", crs="EPSG:25832")
    write_elevation(whole.dem, folder / "dem.tif", crs="EPSG:25832")
    index_folder(folder)
    return folder


@pytest.fixture
def served(tiles):
    """Its address on a local server, and what was asked for."""
    asked = []

    class Handler(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_):
            asked.append(self.path.rpartition("/")[2])

    handler = functools.partial(Handler, directory=tiles.parent)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/town", asked
        server.shutdown()


def test_a_window_fetches_the_files_that_it_meets_once(tiles, served):
    address, asked = served
    window = (WEST + 10, SOUTH + 10, WEST + 40, SOUTH + 40)
    for _ in range(2):
        part, same = open_scene(address).window(window), open_scene(tiles).window(window)
        assert np.array_equal(part.points.x, same.points.x)
        assert np.array_equal(part.dem.values, same.dem.values)
    # The server answers an index of chunks that is not there with an error.
    assert sorted(set(asked)) == ["0%20of%203.laz", "chunks.npz", "dem.tif", "scene.toml"]
    assert asked.count("0%20of%203.laz") == asked.count("dem.tif") == 1


@pytest.mark.parametrize("scheme", ["http", "file"])
def test_a_city_is_detected_from_its_address(tiles, served, tmp_path, scheme):
    (recipe,) = scenes_of([served[0] if scheme == "http" else tiles.as_uri()])
    city, detector = City(tile=64.0), make_detector("ndsm[cell=0.5]")
    result = detect_city(recipe, detector, tmp_path / "city.fgb", city, execution=Execution(jobs=0))
    assert not result.failed
    assert result.footprints == len(HOUSES)
    here = rb.detect(rb.open_scene(tiles), detector)
    assert len(here) == result.footprints


def test_a_file_that_is_not_the_one_of_the_manifest_is_refused(tiles, served):
    (tiles / "1 of 3.laz").write_bytes((tiles / "0 of 3.laz").read_bytes())
    with pytest.raises(InputError, match="changed since the scene was indexed"):
        _ = open_scene(served[0]).points


@pytest.mark.parametrize("address", ["http://127.0.0.1:9/nothing", "file:///nothing/here", "noscheme://x/y"])
def test_an_address_without_a_scene_is_one_sentence(tmp_path, monkeypatch, address):
    monkeypatch.setenv("ROOFBENCH_SCENES", str(tmp_path))
    with pytest.raises(InputError, match=address.partition("://")[0]):
        open_scene(address)


@pytest.fixture
def bucket(tiles, monkeypatch):
    """The town with COPC, an orthoimage and a reference besides, in an object storage on this machine: its address."""
    reason = "object storage is not tested: pip install s3fs 'moto[server]'"
    pytest.importorskip("s3fs", reason=reason)
    server = pytest.importorskip("moto.server", reason=reason).ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    boto3 = pytest.importorskip("boto3", reason=reason)
    whole = town()
    (tiles / "1 of 3.laz").unlink()
    east = (WEST + 64, SOUTH, WEST + 128, SOUTH + SIDE)
    write_copc(tiles / "1 of 3.copc.laz", whole.window(east).points, crs="EPSG:25832")
    grid = Grid.covering(whole.extent, 1.0)
    colours = np.random.default_rng(2).integers(1, 255, (3, *grid.shape), dtype=np.uint8)
    write_image(Image(colours, ("red", "green", "blue"), grid), tiles / "ortho.tif", crs="EPSG:25832")
    boxes = rb.Footprints.of([shapely.box(*box) for box in HOUSES.values()], crs="EPSG:25832")
    write_reference(boxes, tiles / "reference.gpkg", "EPSG:25832")
    index_folder(tiles)
    server.start()
    try:
        for name, value in {
            "AWS_ENDPOINT_URL": "http://{}:{}".format(*server.get_host_and_port()),
            "AWS_ACCESS_KEY_ID": "any",
            "AWS_SECRET_ACCESS_KEY": "any",
            "AWS_DEFAULT_REGION": "us-east-1",
        }.items():
            monkeypatch.setenv(name, value)
        client = boto3.client("s3")
        client.create_bucket(Bucket="towns")
        for file in tiles.iterdir():
            client.upload_file(str(file), "towns", f"one/{file.name}")
        yield "s3://towns/one"
    finally:
        server.stop()


@pytest.mark.filterwarnings("ignore")  # warnings of the libraries of the object storage are theirs
def test_a_city_in_object_storage_gives_what_its_folder_gives(tiles, bucket, tmp_path):
    far, near = open_scene(bucket), open_scene(tiles)
    window = (WEST + 50, SOUTH + 20, WEST + 90, SOUTH + 60)
    for part, same in ((far.window(window), near.window(window)), (far, near)):
        assert np.array_equal(part.points.x, same.points.x)
        assert np.array_equal(part.dem.values, same.dem.values)
        assert np.array_equal(part.image.values, same.image.values)
        assert len(part.reference) == len(same.reference) > 0
    contents = []
    for address in (bucket, str(tiles)):
        (recipe,) = scenes_of([address])
        output, city, detector = tmp_path / "city.fgb", City(tile=64.0), make_detector("ndsm[cell=0.5]")
        detect_city(recipe, detector, output, city, execution=Execution(jobs=2), overwrite=True)
        contents.append(output.read_bytes())
    assert contents[0] == contents[1]
