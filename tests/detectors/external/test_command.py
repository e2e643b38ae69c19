"""Programs as detectors: what they get, what they may write, and how each way of failing is reported."""

import json
import os
import stat
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import roofbench as rb
from roofbench.benchmark.execution.executors import Execution
from roofbench.benchmark.execution.runner import run_plan
from roofbench.benchmark.identity.recipes import SceneRecipe, label_of
from roofbench.benchmark.plan import make_plan
from roofbench.benchmark.store.writer import Store
from roofbench.benchmark.suite import DetectorEntry, Suite, read_suite
from roofbench.core.errors import MissingInputError, ParameterError, ProgramError
from roofbench.core.program import telling_line
from roofbench.detectors.registry import make_detector
from roofbench.evaluators.registry import make_evaluator
from roofbench.scenes.builtin import hamlet


def collection(scene, *, z="", crs="", ring=None):
    """Return GeoJSON of a square of 10 m in a scene."""
    x, y = scene.extent[:2]
    ring = ring or [(10, 10), (20, 10), (20, 20), (10, 20), (10, 10)]
    places = ",".join(f"[{x + east},{y + north}{z}]" for east, north in ring)
    feature = f'{{"type":"Feature","properties":{{}},"geometry":{{"type":"Polygon","coordinates":[[{places}]]}}}}'
    system = f'"crs":{{"type":"name","properties":{{"name":"{crs}"}}}},' if crs else '"crs":null,'
    return f'{{"type":"FeatureCollection",{system}"features":[{feature}]}}'


@pytest.fixture
def program(tmp_path):
    """Return a function that writes a shell script and returns it as a detector; ``$3`` is the file to be written."""

    def write(body, name="detect.sh", **parameters):
        file = tmp_path / name
        file.write_text(f"#!/bin/sh\n{body}\n")
        file.chmod(file.stat().st_mode | stat.S_IXUSR)
        return make_detector("command", {"run": str(file), **parameters})

    return write


@pytest.fixture(scope="module")
def scene():
    return hamlet(1)


@pytest.fixture
def square(scene, tmp_path):
    file = tmp_path / "square.geojson"
    file.write_text(collection(scene))
    return file


def test_the_footprints_of_a_program_are_returned(program, scene, square):
    found = rb.detect(scene, program(f"cp {square} $3; echo done"))
    assert found.areas == pytest.approx([100.0])
    assert found.crs == scene.crs
    assert found.metadata["program_output"] == "done"


@pytest.mark.parametrize("output", ["geojson", "gpkg", "fgb"])
def test_each_format_is_read(program, scene, tmp_path, output):
    corners = np.add([(10, 10), (20, 10), (20, 20), (10, 20)], scene.extent[:2])
    wanted = rb.Footprints.from_rectangles([corners], crs=scene.crs)
    rb.write_footprints(wanted, tmp_path / f"square.{output}")
    detector = program(f"cp {tmp_path}/square.{output} $3", output=output)
    assert rb.detect(hamlet(1), detector).areas == pytest.approx([100.0])


def bow_tie(scene):
    return collection(scene, ring=[(10, 10), (20, 20), (20, 10), (10, 20), (10, 10)])


CASES = {
    "exits": ("echo one; echo no roofs >&2; exit 3", r"detect.sh exited with code 3: no roofs"),
    "is killed": ("kill -9 $$", r"detect.sh was killed by signal 9 \(SIGKILL\)"),
    "hangs": ("sleep 60", r"time limit of 0.5 s exceeded"),
    "nothing": ("true", r"detect.sh wrote no footprints"),
    "empty": (": > $3", r"detect.sh wrote an empty file"),
    "broken": ('echo \'{"type": "Feature\' > $3', r"wrote what cannot be used: footprints.geojson cannot be read"),
    "no polygons": (
        'echo \'{"type":"Point","coordinates":[1000000,1]}\' > $3',
        r"no polygons among 1 feature",
    ),
    "gigabyte": ("head -c 1000000000 /dev/zero > $3", r"footprints.geojson is larger than 5 MB"),
    "folder": ("mkdir $3", r"wrote no footprints but a folder"),
    "removes": ("rm -r $(dirname $1)", r"wrote no footprints: it must write"),
    "talks": ("yes | head -c 100000000", r"log.txt is larger than 5 MB"),
}


@pytest.mark.parametrize("case", CASES)
def test_a_failure_is_one_sentence(program, scene, case):
    body, reason = CASES[case]
    limits = {"time_limit": 0.5 if case == "hangs" else 60, "size_limit": 5}
    with pytest.raises(ProgramError, match=reason) as raised:
        rb.detect(scene, program(body, **limits))
    assert "\n" not in str(raised.value)
    assert "/tmp" not in str(raised.value)


@pytest.mark.parametrize(
    ("printed", "line"),
    [
        ("Loading\nError: no roofs\nExecution halted", "Error: no roofs"),
        ("Error in f(x) : \n  too few points\nCalls: f\nExecution halted", "Error in f(x) : too few points"),
        ("TypeError: x is undefined\n    at main (d.js:1:2)\n\nNode.js v20.20.2", "TypeError: x is undefined"),
        ("ERROR 1: first\nERROR 4: no such file\nUsage: tool a b", "ERROR 4: no such file"),
        ("java.lang.RuntimeException: bad\n\tat Main.main(Main.java:3)", "java.lang.RuntimeException: bad"),
        ("no errors so far\nstopped", "stopped"),
        ("", ""),
    ],
)
def test_the_line_that_says_why_a_program_failed(printed, line):
    assert telling_line(printed) == line


def test_the_log_of_a_failure_is_kept(program, scene):
    with pytest.raises(ProgramError) as raised:
        rb.detect(scene, program("echo first; echo second >&2; exit 1"))
    assert raised.value.log == "first\nsecond"


def test_another_crs_is_refused(program, tmp_path):
    scene = rb.Scene("utm", (500_000, 5_700_000, 500_100, 5_700_100), crs="EPSG:25832", points=hamlet(1).points)
    file = tmp_path / "other.geojson"
    file.write_text(collection(scene, crs="urn:ogc:def:crs:EPSG::25833"))
    with pytest.raises(ProgramError, match=r"polygons in EPSG:25833.*but the scene is in EPSG:25832"):
        rb.detect(scene, program(f"cp {file} $3"))
    file.write_text(collection(scene, crs="urn:ogc:def:crs:EPSG::25832"))
    assert len(rb.detect(scene, program(f"cp {file} $3"))) == 1
    file.write_text('{"type":"Polygon","coordinates":[[[9,50],[9.1,50],[9.1,50.1],[9,50]]]}')
    with pytest.raises(ProgramError, match="degrees"):
        rb.detect(scene, program(f"cp {file} $3"))


def test_polygons_with_heights_are_refused(program, scene, tmp_path):
    file = tmp_path / "z.geojson"
    file.write_text(collection(scene, z=",12.5"))
    with pytest.raises(ProgramError, match=r"wrote polygons in three dimensions.*-dim XY"):
        rb.detect(scene, program(f"cp {file} $3"))


def test_one_geometry_with_heights_among_others_is_refused(program, scene, tmp_path):
    flat = json.loads(collection(scene))
    raised = json.loads(collection(scene, z=",12.5"))["features"][0]
    raised["geometry"] = {"type": "MultiPolygon", "coordinates": [raised["geometry"]["coordinates"]]}
    file = tmp_path / "mixed.geojson"
    measured = json.loads(collection(scene, z=",12.5,0.1"))  # a fourth number, with which OGR says "Polygon"
    for content in ({**flat, "features": [*flat["features"], raised]}, measured):
        file.write_text(json.dumps(content))
        with pytest.raises(ProgramError, match="three dimensions"):
            rb.detect(scene, program(f"cp {file} $3"))


def test_invalid_polygons_are_repaired(program, scene, tmp_path):
    file = tmp_path / "bow-tie.geojson"
    file.write_text(bow_tie(scene))
    found = rb.detect(scene, program(f"cp {file} $3"))
    assert [repair.action for repair in found.repairs] == ["repaired"]


def test_a_collection_without_features_means_no_buildings(program, scene):
    found = rb.detect(scene, program('echo \'{"type":"FeatureCollection","features":[]}\' > $3'))
    assert len(found) == 0
    assert found.metadata["notes"] == ["detect.sh wrote a file without footprints"]


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux counts the highest memory")
def test_a_memory_limit_stops_it(scene, tmp_path):
    file = tmp_path / "eats.py"
    file.write_text("import time\nhoard = [bytearray(b'x') * 10_000_000 for _ in range(40)]\ntime.sleep(60)\n")
    detector = make_detector("command", {"run": f"{sys.executable} {file}", "memory_limit": 200})
    with pytest.raises(ProgramError, match="memory limit of 200 MB exceeded"):
        rb.detect(scene, detector)


@pytest.mark.skipif(sys.platform != "linux", reason="the command setsid is of Linux")
@pytest.mark.parametrize("start", ["sleep 300 & echo $!", "(setsid sleep 300 & echo $!)"], ids=["child", "daemon"])
def test_what_a_program_starts_ends_with_it(program, scene, square, tmp_path, start):
    import psutil

    rb.detect(scene, program(f"{start} > {tmp_path}/child; cp {square} $3"))
    child = int((tmp_path / "child").read_text())
    deadline = time.monotonic() + 10
    while psutil.pid_exists(child) and psutil.Process(child).status() != psutil.STATUS_ZOMBIE:
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_no_shell_reads_the_command(program, scene, square, tmp_path):
    detector = program(f'echo "$1" > {tmp_path}/seen; cp {square} $4')
    spoiled = make_detector("command", {"run": f"{detector.run} '$(touch {tmp_path}/spoiled); *'"})
    rb.detect(scene, spoiled)
    assert (tmp_path / "seen").read_text() == f"$(touch {tmp_path}/spoiled); *\n"
    assert not (tmp_path / "spoiled").exists()


def test_places_may_be_named_in_any_order(program, scene, square):
    detector = program(f"test -f $2/scene.toml && cp {square} $1")
    placed = make_detector("command", {"run": f"{detector.run} {{output}} {{scene}}"})
    assert len(rb.detect(scene, placed)) == 1


def test_settings_and_seed_reach_the_parameter_file(program, scene, square, tmp_path):
    body = f"cp $2 {tmp_path}/parameters.json; cp {square} $3"
    detector = program(body, settings="height=2.5 flat=true kind='two words'", seeded=True)
    seen = []
    for seed in (0, 1, 0):
        rb.detect(scene, detector, seed=seed)
        seen.append(json.loads((tmp_path / "parameters.json").read_text()))
    assert {name: seen[0][name] for name in ("height", "flat", "kind")} == {
        "height": 2.5,
        "flat": True,
        "kind": "two words",
    }
    assert seen[0]["seed"] == seen[2]["seed"] != seen[1]["seed"]
    rb.detect(scene, program(body, settings="height=3"))
    assert (tmp_path / "parameters.json").read_text() == '{\n "height": 3\n}\n'
    rb.detect(scene, program(body, settings="classes=[2,6] name=Süd none=NaN"))
    lines = (tmp_path / "parameters.json").read_text(encoding="utf-8").splitlines()
    assert lines == ["{", ' "classes": [2, 6],', ' "name": "Süd",', ' "none": "NaN"', "}"]


def test_the_fingerprint_follows_the_content_of_program_and_files(program, tmp_path):
    model = tmp_path / "model"
    model.mkdir()
    (model / "weights").write_text("1")

    def fingerprint(body="true"):
        return program(body, files=str(model)).fingerprint()

    before = fingerprint()
    assert fingerprint() == before
    assert fingerprint("false") != before
    (model / "weights").write_text("22")
    assert fingerprint() != before


def test_a_script_after_its_interpreter_counts(tmp_path):
    script = tmp_path / "x.py"
    script.write_text("1")
    detector = make_detector("command", {"run": f"{sys.executable} {script}"})
    before = detector.fingerprint()
    script.write_text("22")
    assert detector.fingerprint() != before


def test_a_file_after_an_equals_sign_is_found_and_counts(program, scene, square, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("trees.pt").write_text("1")
    program(f"test -f ${{1#--model=}} && cp {square} $4")
    detector = make_detector("command", {"run": "./detect.sh --model=trees.pt"})
    assert detector.run == f"{tmp_path}/detect.sh --model={tmp_path}/trees.pt"
    assert len(rb.detect(scene, detector)) == 1
    before = detector.fingerprint()
    Path("trees.pt").write_text("22")
    assert detector.fingerprint() != before
    assert Path("trees.pt").absolute() in detector.code_files()


@pytest.mark.parametrize(
    ("run", "expected"),
    [
        ("sh detect.sh", "sh {here}/detect.sh"),  # the folder sh is no program
        ("cat detect.sh", "cat {here}/detect.sh"),  # a file without a slash is not what a shell would start
        ("./cat", "{here}/cat"),
        ("detect.sh", "{here}/detect.sh"),
        ("python -m trees model", "python -m trees {here}/model"),
        (f"sh -c '{300 * 'x'}'", f"sh -c {300 * 'x'}"),
    ],
)
def test_the_words_of_a_command_are_those_that_a_shell_would_take(program, tmp_path, monkeypatch, run, expected):
    monkeypatch.chdir(tmp_path)
    for folder in ("sh", "trees", "model"):
        Path(folder).mkdir()
    Path("cat").touch()
    program("true")
    assert make_detector("command", {"run": run}).run == expected.format(here=tmp_path)


def test_a_missing_tool_is_a_skip(program, scene):
    with pytest.raises(MissingInputError, match=r"detect.sh cannot run here: install it first"):
        rb.detect(scene, program("echo install it first; exit 77"))


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        ({}, "give either run"),
        ({"run": " "}, "give either run"),
        ({"recipe": "x"}, "recipe must be one of cloth-filter, .*, whitebox, or empty, not 'x'"),
        ({"run": "sh", "recipe": "whitebox"}, "give either run"),
        (
            {"run": "no-such-program-anywhere x"},
            "run names the program 'no-such-program-anywhere', which does not exist",
        ),
        ({"run": "sh 'x"}, "run cannot be split into words: No closing quotation"),
        ({"run": "sh", "inputs": "points smell"}, "inputs must be some of points, image, .*, not 'smell'"),
        ({"run": "sh", "files": "no/such"}, "files names no/such, which does not exist"),
        ({"run": "sh", "settings": "height"}, "settings must be written NAME=VALUE"),
        ({"run": "sh", "settings": "seed=1"}, "'seed' is set by the run"),
    ],
)
def test_parameters_that_cannot_work_are_refused(parameters, reason):
    with pytest.raises(ParameterError, match=reason):
        make_detector("command", parameters)


def test_a_program_without_a_first_line_or_permission_is_explained(scene, tmp_path):
    file = tmp_path / "bare"
    file.write_text("exit 0\n")
    with pytest.raises(ProgramError, match=r"bare cannot be started: it is not executable: .*chmod \+x"):
        rb.detect(scene, make_detector("command", {"run": str(file)}))
    file.chmod(0o755)
    with pytest.raises(ProgramError, match=r"a script needs a first line such as #!/bin/sh"):
        rb.detect(scene, make_detector("command", {"run": str(file)}))


def test_a_suite_names_programs_from_its_own_folder(tmp_path, scene):
    folder = tmp_path / "suite"
    folder.mkdir()
    (folder / "detect.sh").write_text("#!/bin/sh\n")
    (folder / "detect.sh").chmod(0o755)
    (folder / "model").write_text("x")
    (folder / "my.toml").write_text(
        '[[scenes]]\npreset = "hamlet"\n\n[[detectors]]\nuse = "command"\nrun = "./detect.sh --fast"\nfiles = "model"\n'
        'label = "own"\nsettings = "height=2.5"\ninputs = "points image"\n'
    )
    (entry,) = read_suite(folder / "my.toml").detectors
    assert entry.detector.run == f"{folder}/detect.sh --fast"
    assert entry.detector.files == f"{folder}/model"
    assert entry.detector.requires == ("points", "image")
    assert entry.label == "command:own"
    assert label_of(make_detector("command", {"recipe": "whitebox"})) == "command:whitebox"


def test_the_rest_of_a_suite_completes(program, scene, square, tmp_path, misbehaving):
    """Each way to fail is a failed row with its reason, in a worker process, and the good runs are scored."""
    bad = [
        program(body, name=f"{case.replace(' ', '-')}.sh", label=case, time_limit=2, size_limit=5)
        for case, (body, _) in CASES.items()
    ]
    good = program(f"cp {square} $3", name="good.sh", label="good")
    absent = program("echo no tool; exit 77", name="absent.sh", label="absent")
    suite = Suite(
        "programs",
        (SceneRecipe.of_preset("hamlet", seed=1),),
        tuple(DetectorEntry(detector) for detector in (*bad, absent, good)),
        (make_evaluator("threshold-free"),),
    )
    with Store(tmp_path / "store.sqlite") as store:
        result = run_plan(make_plan(suite, store), store, execution=Execution(jobs=1))
        reasons = {row.label: row.reason for row in result.failed}
        assert set(reasons) == {f"command:{case}" for case in CASES}
        assert reasons["command:exits"] == "exits.sh exited with code 3: no roofs"
        assert [(row.label, row.reason) for row in result.skipped] == [
            ("command:absent", "absent.sh cannot run here: no tool")
        ]
        (row,) = result.ok
        assert row.detected == 1
        trace = next(row.traceback for row in result.failed if row.label == "command:exits")
        assert trace.rstrip().endswith("one\nno roofs")


@pytest.mark.skipif(sys.platform != "linux", reason="the command setsid is of Linux")
def test_a_worker_that_is_stopped_leaves_nothing_behind(program, tmp_path, monkeypatch):
    """The time limit of the run, not of the program: neither its processes nor its files are left."""
    import psutil

    from roofbench.benchmark.execution.isolation import IsolatedProcess
    from roofbench.benchmark.execution.tasks import Task
    from roofbench.benchmark.identity.recipes import PluginRecipe
    from roofbench.benchmark.store.outcomes import Outcome
    from roofbench.core.processes import Limits

    place = tmp_path / "temporary"
    place.mkdir()
    monkeypatch.setenv("TMPDIR", str(place))
    monkeypatch.setattr("tempfile.tempdir", str(place))
    detector = program(
        f"echo $$ > {tmp_path}/pid; (setsid sleep 300 & echo $! > {tmp_path}/child); touch many; sleep 300"
    )
    task = Task(
        scene=SceneRecipe.of_preset("hamlet", seed=1), detector=PluginRecipe.of(detector), seed=0, evaluators=()
    )
    process = IsolatedProcess()
    outcome = Outcome.from_bytes(process.call(task.to_json(), Limits(seconds=15)))
    assert outcome.reason == "time limit of 15 s exceeded"
    for name in ("pid", "child"):
        number = int((tmp_path / name).read_text())
        assert not psutil.pid_exists(number) or psutil.Process(number).status() == psutil.STATUS_ZOMBIE
    assert list(place.iterdir()) == []


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux counts the highest memory")
def test_the_memory_limit_of_a_run_covers_its_program(tmp_path):
    from roofbench.benchmark.execution.isolation import IsolatedProcess
    from roofbench.benchmark.execution.tasks import Task
    from roofbench.benchmark.identity.recipes import PluginRecipe
    from roofbench.benchmark.store.outcomes import Outcome
    from roofbench.core.processes import Limits

    file = tmp_path / "eats.py"
    file.write_text("import time\nhoard = bytearray(b'x') * 900_000_000\ntime.sleep(60)\n")
    detector = make_detector("command", {"run": f"{sys.executable} {file}"})
    task = Task(
        scene=SceneRecipe.of_preset("hamlet", seed=1), detector=PluginRecipe.of(detector), seed=0, evaluators=()
    )
    process = IsolatedProcess()
    outcome = Outcome.from_bytes(process.call(task.to_json(), Limits(seconds=120, memory=800_000_000)))
    process.close()
    assert outcome.reason.startswith("memory limit of 800 MB exceeded")


def test_the_folder_of_a_program_reveals_nothing(program, square, tmp_path, scene):
    """Neutral names, no reference, recipe, seed, provenance or times; the environment names no folder of the caller."""
    kept = tmp_path / "kept"
    body = f"cp -rp $1 {kept}; echo $1 > {tmp_path}/path; env > {tmp_path}/environment; pwd > {tmp_path}/pwd; "
    found = rb.make_scene("knox-small", seed=3)
    square.write_text(collection(found))
    rb.detect(found, program(f"{body} cp {square} $3"))
    assert sorted(file.name for file in kept.iterdir()) == ["dem.tif", "ortho.tif", "points.laz", "scene.toml"]
    manifest = (kept / "scene.toml").read_text()
    assert 'name = "scene"' in manifest
    for word in ("knox", "seed", "preset", "source", "licence", "facts", "derived", "notes", "reference"):
        assert word not in manifest
        assert word not in (tmp_path / "path").read_text()
    assert {file.stat().st_mtime for file in (*kept.iterdir(), kept)} == {946_684_800.0}
    again = rb.open_scene(kept)
    assert again.points.classification is None or not again.points.classification.any()
    everything = b"".join(file.read_bytes() for file in kept.iterdir())
    assert b"knox" not in everything
    assert (tmp_path / "pwd").read_text() != f"{Path.cwd()}\n"
    environment = (tmp_path / "environment").read_text()
    assert f"OLDPWD={os.getcwd()}" not in environment


@pytest.mark.parametrize("recipe", ["cloth-filter", "grass", "pysmrf", "saga", "whitebox"])
def test_recipes_run_or_say_what_is_missing(recipe, tmp_path):
    """A house of 12 x 16 m on a meadow: every tool that is installed finds it."""
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 100, (2, 40_000))
    roof = (abs(x - 50) < 6) & (abs(y - 50) < 8)
    z = np.where(roof, 6.0, 0.0) + rng.normal(0, 0.02, len(x)) + 100
    once = np.ones(len(x), np.uint8)
    points = rb.PointCloud(x + 500_000, y + 5_700_000, z, return_number=once, number_of_returns=once)
    scene = rb.Scene("house", (500_000, 5_700_000, 500_100, 5_700_100), crs="EPSG:25832", points=points)
    try:
        found = rb.detect(scene, f"command[recipe={recipe},time_limit=300]")
    except MissingInputError as missing:
        pytest.skip(str(missing))
    if recipe == "grass":  # it needs pulses with several returns
        return
    assert found.areas.sum() == pytest.approx(12 * 16, rel=0.25)


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ("echo no licence; exit 3", r"saga exited with code 3: no licence"),
        ("kill -9 $$", r"saga exited with code 1: saga_cmd was killed by signal 9"),
    ],
)
def test_the_reason_of_a_broken_tool_is_its_last_line(program, scene, tmp_path, monkeypatch, body, reason):
    program(body, name="saga_cmd")
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    with pytest.raises(ProgramError, match=reason):
        rb.detect(scene, "command[recipe=saga]")


def test_settings_of_a_recipe_must_be_numbers(program, scene, tmp_path, monkeypatch):
    program("exit 1", name="saga_cmd")
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    with pytest.raises(ProgramError, match='the setting cell must be a number of at least 0, not "low"'):
        rb.detect(scene, "command[recipe=saga,settings=cell=low]")
