"""The commands of README and docs: which there are, and running them page by page.

Nouns
-----
block
    A fenced block of ``sh``, ``console`` or ``python`` of a page. In ``console`` blocks, lines that start with ``$ ``
    are commands, and the lines below one are what it prints. Blocks of other languages are not run.
mark
    A comment above a block: ``<!-- nightly -->`` (more than ten seconds) or ``<!-- not run: REASON -->``. Blocks
    without a mark run in CI.
session
    A folder in which the commands of one page run in their order. ``<!-- files: NAME ... -->`` at the top of a page
    names the files (`documentation.files`) that a reader brings.

Expected lines must be printed in their order, one below the other. ``…`` stands for any text, a line ``…`` for any
lines. Durations and sizes of memory are masked.

``python -m tests.documentation.commands`` lists the commands with the place where they run.
"""

from __future__ import annotations

import contextlib
import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

__all__ = ["Block", "Session", "blocks_of", "files_of", "mismatch", "pages"]

ROOT = Path(__file__).resolve().parents[2]
_FENCE = re.compile(r"((?:^<!--[^\n]*-->\n)*)^```(sh|console|python)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_FILES = re.compile(r"<!-- files: ([\w\- ]+) -->")
_MARK = re.compile(r"<!-- (nightly|not run: [^\n]*?) -->")
_MASKED = re.compile(r"\d+(?:[.,]\d+)*(\s?)(s|ms|min|kB|MB|GB)\b")
#: Commands that start two workers by themselves. The result is the same in this process, and starts at once.
_WORKERS = ("run", "sweep", "gate", "baseline")
_LONGEST = 1800


@dataclass(frozen=True)
class Block:
    """A fenced block: its page, first line, language, text, and `mark` ("" where it runs in CI)."""

    page: Path
    line: int
    language: str
    text: str
    mark: str = ""

    @property
    def commands(self) -> list[tuple[str, list[str] | None]]:
        """The shell commands with the lines that the page shows (None in blocks that show none)."""
        found: list[tuple[str, list[str] | None]] = []
        lines = self.text.replace("\\\n", "\x00").splitlines()
        for line in (entry.replace("\x00", "\\\n") for entry in lines):
            if self.language == "sh":
                if line.strip() and not line.lstrip().startswith("#"):
                    found.append((line, None))
            elif line.startswith("$ "):
                found.append((line[2:], None))
            elif found and line.strip():
                command, expected = found[-1]
                found[-1] = (command, [*(expected or []), line])
        return found


def pages() -> list[Path]:
    """Return README, CONTRIBUTING and the pages below ``docs``."""
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(ROOT.glob("docs/**/*.md"))]


def blocks_of(page: Path) -> list[Block]:
    """Return the blocks of a page that are commands or Python."""
    text = page.read_text(encoding="utf-8")
    return [
        Block(page, text[: found.start(3)].count("\n") + 1, found[2], found[3], _mark(found[1]))
        for found in _FENCE.finditer(text)
    ]


def _mark(comments: str) -> str:
    found = _MARK.search(comments)
    return found[1] if found else ""


def files_of(page: Path) -> list[str]:
    """Return the names of the files that the reader of a page brings."""
    return [name for found in _FILES.findall(page.read_text(encoding="utf-8")) for name in found.split()]


def mismatch(printed: str, expected: list[str]) -> str | None:
    """Return the first expected line that was not printed below the one before it; None if all were.

    >>> mismatch("a 1.2 s\\nb\\nc", ["a 3 s", "…", "c"]), mismatch("a\\nb", ["b", "a"])
    (None, 'a')
    >>> mismatch("a\\nb\\nc", ["a", "c"])
    'c'
    """
    rows = [_masked(row) for row in printed.splitlines() if row.strip()]
    at, free = 0, True
    for line in expected:
        if line.strip() == "…":
            free = True
            continue
        pattern = re.compile(".*".join(re.escape(part) for part in _masked(line).split("…")))
        reach = range(at, len(rows)) if free else range(at, min(at + 1, len(rows)))
        hit = next((number for number in reach if pattern.fullmatch(rows[number])), None)
        if hit is None:
            return line
        at, free = hit + 1, False
    return None


def _masked(line: str) -> str:
    return re.sub(r"\s+", " ", _MASKED.sub(r"#\1\2", line)).strip()


@dataclass
class Session:
    """The folder of a page, with the variables of its Python blocks."""

    folder: Path
    names: dict[str, object] = field(default_factory=dict)

    def run(self, block: Block) -> list[str]:
        """Run a block; return what was wrong, as text for the reader of a test."""
        where = f"{block.page.relative_to(ROOT)}:{block.line}"
        if block.language == "python":
            with contextlib.chdir(self.folder):
                exec(compile(block.text, where, "exec"), self.names)
            return []
        wrong = []
        for command, expected in block.commands:
            code, printed = self._call(command)
            ends = [int(line.removeprefix("exit code ")) for line in expected or [] if line.startswith("exit code ")]
            shown = [line for line in expected or [] if not line.startswith("exit code ")]
            if code != (ends[0] if ends else 0):
                wrong.append(f"{where}: {command}\nexit code {code}\n{printed}")
            elif missing := mismatch(printed, shown):
                wrong.append(f"{where}: {command}\nthe page shows\n  {missing}\nbut printed was\n{printed}")
        return wrong

    def _call(self, command: str) -> tuple[int, str]:
        words = _words(command)
        if words is None:
            return self._shell(command)
        from harness.command_line import run

        if words[0] in _WORKERS and "-j" not in words:
            words.append("-j0")
        with contextlib.chdir(self.folder):
            code, stdout, stderr = run(*words)
        return code, f"{stdout}\n{stderr}"

    def _shell(self, command: str) -> tuple[int, str]:
        tools = self.folder.parent / "tools"
        tools.mkdir(exist_ok=True)
        shim = tools / "roofbench"
        shim.write_text(f'#!/bin/sh\nexec {sys.executable} -m roofbench "$@"\n')
        shim.chmod(0o755)
        path = f"{tools}{os.pathsep}{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        ended = subprocess.run(
            [shutil.which("bash") or "bash", "-euo", "pipefail", "-c", command],
            cwd=self.folder,
            env={**os.environ, "PATH": path, "COLUMNS": "80"},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=_LONGEST,
        )
        return ended.returncode, ended.stdout


def _words(command: str) -> list[str] | None:
    """Return the arguments of one plain call of roofbench; None where a shell is needed."""
    lexer = shlex.shlex(command.replace("\\\n", " "), posix=True, punctuation_chars="|&;<>()")
    lexer.whitespace_split = True
    lexer.commenters = "#"
    words = list(lexer)
    shell = any(set(word) <= set("|&;<>()") for word in words if word) or re.search(r"[*?$`]", _unquoted(command))
    return None if shell or words[0] != "roofbench" else words[1:]


def _unquoted(command: str) -> str:
    return re.sub(r"'[^']*'|\"[^\"]*\"|\s#.*", "", command)


def main() -> None:
    """List the commands by the place where they run."""
    for place in ("", "nightly", "not run"):
        print(f"== {place or 'CI'}")
        for block in (block for page in pages() for block in blocks_of(page) if block.mark.startswith(place)):
            if not place and block.mark:
                continue
            reason = block.mark.partition(": ")[2]
            texts = ["Python"] if block.language == "python" else [text for text, _ in block.commands]
            for text in texts:
                print(f"{block.page.relative_to(ROOT)}:{block.line}: {text}" + (f"   ({reason})" if reason else ""))


if __name__ == "__main__":
    main()
