"""Print the summary of a nightly run as Markdown: parts with result and time, and tests counted by kind.

Arguments: the folder in which ``.ci/nightly`` keeps ``parts.txt`` and one JUnit file for each part with tests;
optionally a page, ``docs/reference/reliability.md``, into which the summary is written between its two markers.
"""

import platform
import re
import subprocess
import sys
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).parents[1]
#: Kinds of tests by the beginning of their module, the first that fits.
KINDS = {
    "damaged files": "tests.hostile.test_damaged_files",
    "hostile content and places": "tests.hostile",
    "random scenes against the oracle, blocks of 50 or 10": "tests.evaluators.threshold_free.test_against_oracle",
    "areas against exact rationals": "tests.evaluators.threshold_free.test_exact_areas",
    "two processes on one store, jumping clock": "tests.benchmark.execution.test_two_processes",
    "gate of an author": "tests.benchmark.analysis.test_author_gate",
    "report in Chromium": "tests.reports.test_report_in_browser",
    "all other tests": "",
}


def counted(file: Path) -> dict[str, Counter[str]]:
    """Return how many tests of each kind passed, failed and were skipped."""
    found: dict[str, Counter[str]] = {}
    for case in ElementTree.parse(file).iter("testcase"):
        name = case.get("classname", "")
        kind = next(kind for kind, start in KINDS.items() if name.startswith(start))
        outcome = {"failure": "failed", "error": "failed", "skipped": "skipped"}
        result = next((outcome[child.tag] for child in case if child.tag in outcome), "passed")
        found.setdefault(kind, Counter())[result] += 1
    return found


def summary(folder: Path) -> str:
    """Return the summary."""
    commit = subprocess.run(
        ["git", "-C", ROOT, "log", "-1", "--format=%H"], capture_output=True, text=True, check=False
    )
    parts = [line.split("\t") for line in (folder / "parts.txt").read_text().splitlines()]
    seconds = sum(int(part[2]) for part in parts)
    lines = [
        f"Run of `.ci/nightly` that ended {datetime.now(UTC):%Y-%m-%d %H:%M} UTC, "
        f"commit {commit.stdout[:10] or 'unknown'}, "
        f"{seconds // 60} min {seconds % 60} s, Python {platform.python_version()}, {platform.machine()}.",
        "",
        "| part | result | time, s | processor time, s | tests passed | failed | skipped |",
        "| --- | --- | --: | --: | --: | --: | --: |",
    ]
    kinds: dict[str, Counter[str]] = {}
    for name, result, wall, processor in parts:
        file = folder / f"{name}.xml"
        found = counted(file) if file.exists() else {}
        total = sum(found.values(), Counter())
        numbers = [str(total[key]) if found else "" for key in ("passed", "failed", "skipped")]
        lines.append(f"| {name} | {result} | {wall} | {processor} | {' | '.join(numbers)} |")
        if name == "random":
            kinds = found
    if kinds:
        lines += ["", "| tests of the part `random` | passed | failed | skipped |", "| --- | --: | --: | --: |"]
        lines += [
            f"| {kind} | {kinds[kind]['passed']} | {kinds[kind]['failed']} | {kinds[kind]['skipped']} |"
            for kind in KINDS
            if kind in kinds
        ]
    texts = {file.stem: file.read_text() for file in sorted(folder.glob("*.log"))}
    kills = re.findall(r"^\w+ +\d+ kills.*$", texts.get("kills", ""), flags=re.MULTILINE)
    covered = re.findall(r"^TOTAL\b.* ([\d.]+)%$", texts.get("coverage", ""), flags=re.MULTILINE)
    if kills:
        lines += ["", "Kills:", "", "```text", *kills, "```"]
    if covered:
        lines += ["", f"Coverage of lines, without the compiled kernels: {covered[-1]} %."]
    failed = {name: re.findall(r"^(?:FAILED|ERROR) [^\n]*", text, flags=re.MULTILINE) for name, text in texts.items()}
    for name, tests in failed.items():
        if tests:
            lines += ["", f"Failed in `{name}`:", "", "```text", *(line[:200] for line in tests[:30]), "```"]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    text = summary(Path(sys.argv[1]))
    if len(sys.argv) > 2:
        page = Path(sys.argv[2])
        before, start, rest = page.read_text(encoding="utf-8").partition("<!-- nightly summary -->\n")
        end = rest.index("<!-- end -->")
        page.write_text(before + start + text + rest[end:], encoding="utf-8")
    print(text, end="")
