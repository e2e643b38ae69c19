"""What is printed: on a terminal without control characters of names and messages, elsewhere as it is."""

import pytest

from roofbench.cli.console import print_result

HOSTILE = "red \x1b[31m\x1b]0;title\x07 left \u202eright\nnext"


@pytest.mark.parametrize("terminal", [True, False])
def test_control_characters_do_not_reach_a_terminal(terminal, capsys, monkeypatch):
    monkeypatch.setattr("sys.stdout.isatty", lambda: terminal)
    print_result(HOSTILE)
    written = capsys.readouterr().out
    assert ("\x07" in written) is not terminal
    if terminal:
        assert written == "red  [31m ]0;title  left  right\nnext\n"
