"""Run the command line in this process."""

import sys

from roofbench.benchmark.cli.main import main


def run(monkeypatch, capsys, *arguments):
    """Return (exit code, standard output, standard error) of ``roofbench ARGUMENTS``."""
    monkeypatch.setattr(sys, "argv", ["roofbench", *map(str, arguments)])
    code = 0
    try:
        main()
    except SystemExit as stop:
        code = stop.code or 0
    out, err = capsys.readouterr()
    return code, out, err
