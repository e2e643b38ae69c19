"""Fetching of open data, against a server on this machine."""

import hashlib
import io
import json
import threading
import tomllib
import zipfile
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from roofbench.cli.scenes_fetch import import_command
from roofbench.core.errors import InputError, ParameterError, UnknownNameError
from roofbench.scenes.download import download
from roofbench.scenes.fetching import fetch, open_data, open_data_names

CONTENT = bytes(range(256)) * 4000


class Handler(BaseHTTPRequestHandler):
    """Serve `server.files`; with `server.breaks_after` the connection ends early."""

    def do_GET(self):
        server = self.server
        server.asked.append((self.path, self.headers.get("Range")))
        content = server.files.get(self.path)
        if content is None:
            self.send_error(404, "Not Found")
            return
        tag, start = f'"{hashlib.md5(content).hexdigest()}"', 0
        asked = self.headers.get("Range")
        if asked and server.ranges and self.headers.get("If-Range") == tag:
            start = int(asked.removeprefix("bytes=").rstrip("-"))
            if start >= len(content):
                self.send_error(416)
                return
        self.send_response(206 if start else 200)
        self.send_header("ETag", tag)
        self.send_header("Content-Length", str(len(content) - start))
        self.end_headers()
        end = len(content) if server.breaks_after is None else start + server.breaks_after
        self.wfile.write(content[start:end])
        self.close_connection = True

    def log_message(self, *_):
        pass


@pytest.fixture
def server():
    served = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    served.files, served.asked, served.breaks_after, served.ranges = {"/a.laz": CONTENT}, [], None, True
    served.url = f"http://127.0.0.1:{served.server_port}"
    thread = threading.Thread(target=served.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    yield served
    served.shutdown()
    thread.join()
    served.server_close()


@pytest.mark.parametrize("ranges", [True, False])
def test_an_interrupted_download_continues(server, tmp_path, ranges):
    server.breaks_after, server.ranges = 300_000, ranges
    target = tmp_path / "a.laz"
    with pytest.raises(InputError, match=r"300,000 of 1,024,000 bytes arrived; call again to continue"):
        download(f"{server.url}/a.laz", target)
    assert not target.exists()
    assert (tmp_path / "a.laz.part").stat().st_size == 300_000
    server.breaks_after = None
    assert download(f"{server.url}/a.laz", target) == hashlib.sha256(CONTENT).hexdigest()
    assert target.read_bytes() == CONTENT
    assert [path.name for path in tmp_path.iterdir()] == ["a.laz"]
    assert server.asked[-1] == ("/a.laz", "bytes=300000-")


def test_a_file_that_changed_meanwhile_is_downloaded_from_its_start(server, tmp_path):
    server.breaks_after = 300_000
    with pytest.raises(InputError):
        download(f"{server.url}/a.laz", tmp_path / "a.laz")
    server.breaks_after, server.files["/a.laz"] = None, b"other" * 100_000
    download(f"{server.url}/a.laz", tmp_path / "a.laz")
    assert (tmp_path / "a.laz").read_bytes() == b"other" * 100_000


def test_a_part_that_is_complete_is_asked_for_again(server, tmp_path):
    (tmp_path / "a.laz.part").write_bytes(CONTENT)
    (tmp_path / "a.laz.part.tag").write_text(f'"{hashlib.md5(CONTENT).hexdigest()}"')
    download(f"{server.url}/a.laz", tmp_path / "a.laz")
    assert (tmp_path / "a.laz").read_bytes() == CONTENT


def test_what_cannot_be_downloaded_is_said_in_a_sentence(server, tmp_path):
    with pytest.raises(InputError, match=r"/none: the server answers 404 Not Found"):
        download(f"{server.url}/none", tmp_path / "a")
    with pytest.raises(InputError, match=r"cannot be downloaded: .*refused"):
        download("http://127.0.0.1:9/a", tmp_path / "a")
    with pytest.raises(InputError, match=r"only addresses that start with https"):
        download("file:///etc/passwd", tmp_path / "a")
    assert list(tmp_path.iterdir()) == []


def recipe(server, tmp_path, files):
    lines = ['title = "T"', 'licence = "CC0 1.0"', 'attribution = "A"', 'crs = "EPSG:28992"', 'building_id = "id"']
    lines += ["[values]", 'tile = "map sheet"']
    for file in files:
        lines += ["[[files]]", *(f"{key} = {json.dumps(value)}" for key, value in file.items())]
    path = tmp_path / "own.toml"
    path.write_text("\n".join(lines).replace("SERVER", server.url))
    return open_data(str(path))


POINTS = {"kind": "points", "url": "SERVER/{tile}.laz", "name": "{tile}.laz"}


def test_the_checksum_is_recorded_at_the_first_download_and_checked_after(server, tmp_path):
    chosen, folder, said = recipe(server, tmp_path, [POINTS]), tmp_path / "raw", []
    files = fetch(chosen, folder, values={"tile": "a"}, note=said.append)
    assert files == {"points": [folder / "a.laz"]}
    record = tomllib.loads((folder / "fetched.toml").read_text())["files"]["a.laz"]
    assert record == {
        "url": f"{server.url}/a.laz",
        "sha256": hashlib.sha256(CONTENT).hexdigest(),
        "bytes": len(CONTENT),
    }
    fetch(chosen, folder, values={"tile": "a"}, note=said.append)
    assert len(server.asked) == 1
    assert "there already" in said[-1]
    (folder / "a.laz").write_bytes(b"edited")
    with pytest.raises(InputError, match="changed since it was downloaded"):
        fetch(chosen, folder, values={"tile": "a"})
    (folder / "a.laz").unlink()
    server.files["/a.laz"] = b"another edition"
    with pytest.raises(InputError, match=r"is not the file that http.* had before"):
        fetch(chosen, folder, values={"tile": "a"})


def test_a_list_names_the_files_and_the_extent_is_part_of_the_address(server, tmp_path):
    listed = {"kind": "points", "url": "SERVER/tiles?{xmin},{ymax}", "name": "tiles.json", "listed": "url"}
    houses = {"kind": "reference", "url": "SERVER/houses", "name": "houses.geojson", "most": 2}
    features = [{"properties": {"url": f"{server.url}/a.laz"}}]
    server.files |= {
        "/tiles?10,30.5": json.dumps({"features": features}).encode(),
        "/houses": json.dumps({"features": features}).encode(),
    }
    chosen = recipe(server, tmp_path, [listed, houses])
    extent = (10.0, 20.0, 40.0, 30.5)
    files = fetch(chosen, tmp_path / "raw", values={"tile": "a"}, extent=extent)
    assert files["points"] == [tmp_path / "raw" / "a.laz"]
    assert "--extent 10 20 40 30.5" in import_command(chosen, files, extent)
    assert "--building-id id" in import_command(chosen, files, extent)
    server.files["/houses"] = json.dumps({"features": features * 2}).encode()
    with pytest.raises(InputError, match="stops at 2 features: choose a smaller extent="):
        fetch(chosen, tmp_path / "new", values={"tile": "a"}, extent=extent)


def test_archives_are_unpacked_without_their_folders(server, tmp_path):
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("../../deep/b.las", b"points")
        archive.writestr("readme.txt", b"text")
    server.files["/a.zip"] = packed.getvalue()
    chosen = recipe(server, tmp_path, [{"kind": "points", "url": "SERVER/{tile}.zip", "name": "{tile}.zip"}])
    files = fetch(chosen, tmp_path / "raw", values={"tile": "a"})
    assert files == {"points": [tmp_path / "raw" / "b.las"]}
    assert (tmp_path / "raw" / "b.las").read_bytes() == b"points"


def test_what_a_recipe_needs_is_asked_for(server, tmp_path):
    chosen = recipe(server, tmp_path, [POINTS])
    with pytest.raises(ParameterError, match="needs the parameter tile: map sheet"):
        fetch(chosen, tmp_path / "raw")
    with pytest.raises(ParameterError, match="needs the parameter tile"):
        fetch(chosen, tmp_path / "raw", values={"tile": "../a"})
    with pytest.raises(ParameterError, match=r"no value 'tiel' \(did you mean 'tile'\?\)"):
        fetch(chosen, tmp_path / "raw", values={"tiel": "a"})
    with pytest.raises(ParameterError, match="needs extent="):
        fetch(open_data("lidarhd-bdtopo"), tmp_path / "raw")
    assert not (tmp_path / "raw").exists()


@pytest.mark.parametrize("name", open_data_names())
def test_the_recipes_name_licence_pages_and_how_they_were_tried(name):
    found = open_data(name)
    assert found.licence
    assert found.pages
    assert "only against a local server" in found.tried
    assert {file.kind for file in found.files} == {"points", "reference"}
    assert all(file.url.startswith("https://") for file in found.files)


def test_an_unknown_recipe_is_answered_with_the_nearest():
    with pytest.raises(UnknownNameError, match=r"did you mean 'ahn4-bag'"):
        open_data("anh4-bag")
