"""README and docs: every relative link and picture is there, and the version is stated once."""

import ast
import re
from pathlib import Path

import pytest

from roofbench.detectors.registry import DETECTORS
from roofbench.evaluators.registry import EVALUATORS

ROOT = Path(__file__).parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md")])
ROOMS = ("core", "scenes", "evaluators", "detectors", "benchmark", "reports", "cli")
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)


def anchors(page):
    """Return the anchors of a page, as GitHub makes them of its headings."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in HEADING.findall(text)}


def broken_links(page):
    """Return the relative links of a page that lead nowhere."""
    broken = []
    for target in LINK.findall(page.read_text(encoding="utf-8")):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        file = (page.parent / name).resolve() if name else page
        if not file.exists() or (anchor and file.suffix == ".md" and anchor not in anchors(file)):
            broken.append(target)
    return broken


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_relative_link_leads_somewhere(page):
    assert broken_links(page) == []


def test_a_link_that_leads_nowhere_is_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "# A heading, twice\n[a](none.md) ![b](#a-heading-twice) [c](#elsewhere) [d](https://example.org)\n"
    )
    assert broken_links(page) == ["none.md", "#elsewhere"]


def test_every_page_is_linked_from_another():
    linked = {
        (page.parent / target.partition("#")[0]).resolve()
        for page in PAGES
        for target in LINK.findall(page.read_text(encoding="utf-8"))
    }
    assert [page for page in PAGES if page.parent != ROOT and page not in linked] == []


def test_every_picture_is_shown_on_a_page():
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert [picture.name for picture in ROOT.glob("docs/images/*") if f"images/{picture.name}" not in text] == []


def test_the_changelog_has_short_lines_under_versions():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    headings = re.findall(r"^## (.*)$", text, re.MULTILINE)
    assert headings[0].startswith("0.2.0")
    assert all(re.fullmatch(r"\d+\.\d+\.\d+( \((unreleased|\d{4}-\d\d-\d\d)\))?", heading) for heading in headings)
    assert [line for line in text.splitlines() if len(line) > 200] == []
    assert [line for line in text.splitlines() if line and not line.startswith(("#", "- "))] == []


def rows_of(page):
    """Return the cells of every table row of a page, without headings and rules."""
    lines = [line.strip() for line in page.read_text(encoding="utf-8").splitlines()]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    return [row for row in rows if row[0] != "term" and not set(row[0]) <= set("-: ")]


GLOSSARY = ROOT / "docs" / "reference" / "glossary.md"


def test_the_glossary_explains_each_noun_once():
    terms = [row[0] for row in rows_of(GLOSSARY)]
    assert len(terms) > 50
    assert len(set(terms)) == len(terms)


def test_the_code_uses_the_names_of_the_glossary():
    package = "\n".join(path.read_text(encoding="utf-8") for room in ROOMS for path in (ROOT / room).rglob("*.py"))
    words = set(re.findall(r"\w+", package))
    names = [name for row in rows_of(GLOSSARY) for name in re.findall(r"`(\w+)`", row[-1])]
    assert [name for name in names if name not in words] == []


def test_the_glossary_has_every_symbol_of_the_threshold_free_evaluator():
    from roofbench.evaluators.registry import make_evaluator

    symbols = {symbol for row in rows_of(GLOSSARY) if len(row) == 4 for symbol in row[1].split(", ")}
    assert {index.symbol for index in make_evaluator("threshold-free").indices} <= symbols


def test_the_tasks_of_a_contributor_touch_files_that_are_there():
    rows = rows_of(ROOT / "docs" / "reference" / "architecture.md")
    tasks = [row for row in rows if len(row) == 3 and (row[0].startswith(("add", "change", "find")))]
    assert len(tasks) == 7
    modules = [path.as_posix() for room in ROOMS for path in (ROOT / room).rglob("*.py")]
    for task, _, now in tasks:
        names = re.findall(r"`([\w/]+\.py)`", now)
        assert 1 <= len(names) <= 3, task
        assert [name for name in names if not any(module.endswith(f"/{name}") for module in modules)] == [], task


#: Phrases and words that plain English does without, each with what to write instead.
PLAIN = {
    r"(cannot be|are not|is not) told apart": "not significant",
    r"name no CRS, so we": "carry no CRS",
    r"computes? nothing again": "reuse stored results",
    r"that is borne": "significance level",
    r"who stands for whom": "matching",
    r"leaves? the interpreter": "exits",
    r"returns? nonsense": "returns invalid output",
    r"is nothing that a": "is not supported",
    r"stochastic exactly if": "`stochastic` matches the behaviour",
    r"is the dearest": "is the most expensive",
    r"what still runs has nobody": "running tasks are abandoned",
    r"Bridges are buildings": "bridges are detected as buildings",
    r"says of every object why": "explains why",
    # Also in names: an underscore is no letter.
    r"(?<![a-z])told(?![a-z])": "reported, printed",
    r"^\s*(for )?mine(, \w+)* (=|in) ": "own",
    r"(?<![a-z])judge[sd]?(?![a-z])": "evaluator, evaluates",
    r"(?<![a-z])mend(ed|ing)?(?![a-z])": "repaired",
    r"(?<![a-z])borne(?![a-z])": "tolerated",
    r"(?<![a-z])entrants?(?![a-z])": "detector entry",
    r"(?<![a-z])incidents?(?![a-z])": "failure or skip",
    r"(?<![a-z])knobs?(?![a-z])": "parameter",
    r"is the dearer|times dearer": "more expensive",
    r"\btells? [a-z ]+ from (trees|roofs|buildings|crowns)": "separates",
    r"(?<![a-z])booked(?![a-z])": "assigned",
    r"where no land is": "implausible heights",
    r"memory does not suffice": "out of memory",
    r"(is|are|be) (not )?believed": "reliable",
    r"with their fate": "outcome",
    r"\b(thereof|whereby|hereby|wherein|therein|albeit|whilst|amongst|lest|hitherto|forthwith)\b": "a plain word",
}
TEXTS = [
    path
    for room in (*ROOMS, "docs", "tests")
    for pattern in ("*.py", "*.md", "*.toml", "*.j2", "*.template")
    for path in (ROOT / room).rglob(pattern)
    if path.name not in ("test_documentation.py", "published.py")
]


@pytest.mark.parametrize("phrase", PLAIN)
def test_the_texts_are_in_plain_english(phrase):
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()}"
        for path in [*TEXTS, *ROOT.glob("*.md")]
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if re.search(phrase, line, re.IGNORECASE)
    ]
    assert found == [], f"write: {PLAIN[phrase]}"


def texts_of_code():
    """Yield place and text of every string that is no docstring; braces stand for values."""
    for path in (path for room in ROOMS for path in (ROOT / room).rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        inside = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
        inside |= {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.JoinedStr):
                parts = (part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)
                yield f"{path.relative_to(ROOT)}:{node.lineno}", "".join(parts)
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inside:
                yield f"{path.relative_to(ROOT)}:{node.lineno}", node.value


@pytest.mark.parametrize(
    ("phrase", "instead"),
    [
        (r"(\{\}|\bit) is no (?!longer|such|more)[a-z]", "is not a ..."),
        (r" and no (scene|suite|metres|pixels)\b", ", not a ..."),
        (r"\bnam(e|es|ed) no (CRS|coordinate)", "has no CRS"),
        (
            r"(^|, )\{\} (runs|problems|scenes|files|tiles|rows|detections|pairs|modules|footprints)\b",
            "counted()",
        ),
    ],
)
def test_messages_are_in_plain_english(phrase, instead):
    found = [f"{place}: {text}" for place, text in texts_of_code() if re.search(phrase, text)]
    assert found == [], f"write: {instead}"


def test_the_generated_pages_are_those_of_the_code(monkeypatch):
    """Indices, command line and Python API; older versions of typer write the help in another form."""
    for registry in (DETECTORS, EVALUATORS):  # without the plugins of other tests
        monkeypatch.setattr(registry, "_added", {})
    import typer
    from documentation.reference import generated

    texts = generated()
    if tuple(map(int, typer.__version__.split(".")[:2])) < (0, 20):
        del texts["reference/cli.md"]
    stale = [name for name, text in texts.items() if (ROOT / "docs" / name).read_text(encoding="utf-8") != text]
    assert stale == [], "run: python -m tests.documentation.reference"


def test_studies_are_no_commands_of_ci():
    """Blocks without a mark run in CI: a study among them would take its whole time."""
    from documentation.commands import blocks_of, pages

    commands = [
        f"{page.relative_to(ROOT)}: {command}"
        for page in pages()
        for block in blocks_of(page)
        if not block.mark and block.language != "python"
        for command, _ in block.commands
    ]
    long = [command for command in commands if re.search(r": python |roofbench run papers|tests/performance", command)]
    assert long == [], "put <!-- nightly --> or <!-- not run: REASON --> above the block"
