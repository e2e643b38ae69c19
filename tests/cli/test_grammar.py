"""One grammar: an option has one name, one metavar and one meaning in every command, and every command has help."""

import subprocess
import sys

import pytest
import typer.main
from harness.command_line import run

from roofbench.benchmark.analysis.gate import GATE_LEVEL
from roofbench.cli.command import option_names
from roofbench.cli.main import app


def commands(group=None, path=()):
    """Yield (words, command) for every command of the command line."""
    group = group or typer.main.get_command(app)
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from commands(command, (*path, name))
        else:
            yield (*path, name), command


COMMANDS = dict(commands())
#: What an option means everywhere: its short form, whether it takes a value, and its metavar.
MEANINGS = {
    "--output": ("-o", ("FILE", "FOLDER")),
    "--format": ("-f", None),
    "--overwrite": (None, None),
    "--quiet": ("-q", None),
    "--verbose": ("-v", None),
    "--jobs": ("-j", ("N",)),
    "--parameter": ("-p", ("NAME=VALUE",)),
    "--detector": ("-d", ("DETECTOR",)),
    "--evaluator": ("-e", ("EVALUATOR",)),
    "--scenes": (None, ("PATTERN",)),
    "--detectors": (None, ("PATTERN",)),
    "--seeds": (None, ("N",)),
    "--index": (None, ("INDEX",)),
    "--store": (None, ("FILE",)),
    "--plugin": (None, ("FILE",)),
}
#: The only other short options.
SHORT = {"-h": "--help", "-n": "--limit"}


def options(command):
    return [parameter for parameter in command.params if parameter.param_type_name == "option"]


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_options_mean_the_same_everywhere(words):
    for option in options(COMMANDS[words]):
        long = max(option.opts, key=len)
        short = next((name for name in option.opts if len(name) == 2), None)
        if long in MEANINGS:
            expected, metavars = MEANINGS[long]
            assert short == expected, f"{long} is short {expected}"
            assert metavars is None or option.metavar in metavars, f"{long} takes {metavars}"
        elif short is not None:
            assert SHORT[short] == long
        if long in ("--overwrite", "--quiet", "--verbose"):
            assert option.is_flag


GROUPS = [(), ("plot",), ("scenes",), ("baseline",)]


@pytest.mark.parametrize("words", [*GROUPS, *COMMANDS], ids=lambda words: " ".join(words) or "roofbench")
def test_help_is_written_for_people(words):
    code, short, _ = run(*words, "-h")
    assert code == 0
    assert (0, short, "") == run(*words, "--help")
    assert short.startswith("Usage: roofbench")
    for technical in ("<", "[default: (", "INTEGER", "PATH", "list["):
        assert technical not in short
    if words not in GROUPS:
        for parameter in COMMANDS[words].params:
            assert getattr(parameter, "help", ""), f"{parameter.name} has no help"


def test_the_level_of_the_gate_is_that_of_the_library():
    (level,) = (option for option in options(COMMANDS["gate",]) if option.name == "level")
    assert level.default == GATE_LEVEL


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        ("a.gpkg has no CRS: set it by crs=", "a.gpkg has no CRS: set it by --crs"),
        ("set overwrite=True or name another file", "set --overwrite or name another file"),
        ("leave out grid=True", "leave out --grid"),
        ("use area='exact'", "use --area exact"),
        ("give extent=(0, 0, 9.5, 9)", "give --extent 0 0 9.5 9"),
        ("margin=object.quality=0.1: too much", "--margin object.quality=0.1: too much"),
        ("threshold-free[crs=1,area=exact] is unknown", "threshold-free[crs=1,area=exact] is unknown"),
        ("set overwrite=False", "set overwrite=False"),
        ("the column crs is missing", "the column crs is missing"),
        ("nosuch=1", "nosuch=1"),
    ],
)
def test_messages_name_the_options_of_the_command(message, expected):
    names = ("crs", "overwrite", "grid", "area", "extent", "margin")
    assert option_names(message, {name: f"--{name}" for name in names}) == expected


def test_no_message_of_the_library_names_an_option():
    import re
    from pathlib import Path

    import roofbench

    root = Path(roofbench.__file__).parent
    allowed = re.compile(
        r"roofbench [\w -]+|ogrinfo|saga_cmd|git|var\(--|BASELINE --format|\"grass\", |"
        r"rev-parse|--porcelain|archive|\"--seed\"|-P:"
    )
    found = [
        f"{path.relative_to(root)}:{number}: {line.strip()}"
        for room in ("core", "scenes", "evaluators", "detectors", "benchmark", "reports")
        for path in (root / room).rglob("*.py")
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if re.search(r"[\"' (]--[a-z]", line) and not allowed.search(line) and not line.lstrip().startswith("#")
    ]
    assert found == []


def test_help_imports_no_command():
    code = (
        "import contextlib, sys\nfrom roofbench.cli.main import main\n"
        "with contextlib.suppress(SystemExit): main()\nprint(*sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code, "--help"], capture_output=True, text=True, check=True)
    loaded = done.stdout.splitlines()[-1].split()
    assert "roofbench.cli.lazy_group" in loaded
    assert not {"numpy", "shapely", "roofbench.cli.run", "roofbench.core.registry"} & set(loaded)


def test_a_mistyped_command_is_answered_with_the_nearest():
    code, _, err = run("evalute")
    assert code == 2
    assert "(did you mean 'evaluate'?)" in err
