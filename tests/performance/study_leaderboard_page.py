"""The page docs/results/leaderboard.md from the store of `study_leaderboard`: a table of each matching.

Run by hand: ``python tests/performance/study_leaderboard_page.py board/roofbench.sqlite REVISION > leaderboard.md``.
Stored detections are evaluated here, so that no detector runs. Runs of other code than the installed one are left out;
REVISION is that of the installed code. ``--programs STORE REVISION`` takes the runs of programs of others (`command`)
from another store, made by roofbench as it was at a revision: they take hours and do not depend on the detectors here.
It can be repeated; a run counts in the last store that has it. ``--earlier PAGE`` takes the figures of programs from a
page that this script wrote before, without a store.
"""

from __future__ import annotations

import argparse
import datetime
import statistics
from collections import defaultdict
from contextlib import ExitStack
from pathlib import Path

import roofbench as rb
from roofbench.benchmark.analysis.published import PUBLISHED
from roofbench.benchmark.identity.keys import source_closure
from roofbench.benchmark.store.writer import Store
from roofbench.detectors.registry import DETECTORS as DETECTORS_BY_NAME

AREAS = {
    "Fairfield": ("fairfield",),
    "Fairfield 1-3": ("fairfield-1", "fairfield-2", "fairfield-3"),
    "Moonee Ponds": ("moonee-ponds",),
    "Knox": ("knox",),
    "Toronto": ("toronto-a", "toronto-b"),
    "Vaihingen": ("vaihingen-a", "vaihingen-b"),
}
REAL = (
    *("delft", "delft-houses", "delft-blocks", "kentucky", "french-village"),
    *("ign", "bratislava", "st-barth"),
)
MATCHINGS = {
    "nearest": "every object goes to the nearest centre (the default)",
    "one-pass": "one pass in file order, as the papers' text can be read",
    "overlap": "the largest overlap decides",
}
PROGRAMS = ("command:whitebox", "command:cloth-filter", "command:grass")
DETECTORS = (
    *("original", "original[mode=paper]", "original[mode=program]"),
    *("improved", "improved[mode=paper]", "improved[mode=program]"),
    *("mpp", "mpp[level=part]", "mpp-printed", "dempster-shafer", "ndsm"),
    *PROGRAMS,
)
QUALITY = ("object.quality", "pixel.quality")


def newest(store):
    """Return the last run of every label, scene and seed, of those by the code that is installed."""
    rows = sorted((row for row in store.runs() if row.label in DETECTORS), key=lambda row: row.id)
    digests = {name: source_closure(DETECTORS_BY_NAME.get(name)).digest for name in {row.detector for row in rows}}
    return last_of(row for row in rows if store.code(row.id).digest == digests[row.detector])


def newest_of_programs(stores):
    """Return the last run of every program of others on every scene, of the last store that has one, by store."""
    known, parts = set(), []
    for store in reversed(stores):
        rows = last_of(sorted((row for row in store.runs() if row.label in PROGRAMS), key=lambda row: row.id))
        parts.append([row for row in rows if run_of(row) not in known])
        known |= set(map(run_of, rows))
    return parts[::-1]


def last_of(rows):
    return list({run_of(row): row for row in rows}.values())


def run_of(row):
    return row.label, row.scene, row.seed


def column_of(row):
    """Return the column of a run: an area of the papers, or a real scene."""
    recipe = row.recipe
    if recipe.kind == "preset":
        return next((area for area, presets in AREAS.items() if recipe.place in presets), None)
    return row.scene if row.scene in REAL else None


def add_qualities(found, store, rows, matching):
    """Add object and pixel quality of every good run, percent, by label and column."""
    evaluator = rb.make_evaluator("threshold-free", matching=matching)
    scenes = {}
    for row in rows:
        column = column_of(row)
        if row.status != "ok" or column is None:
            continue
        scene = scenes.setdefault(row.scene_id, store.scene(row.scene_id))
        values = evaluator.evaluate(store.detections(row.id), scene.reference, area=scene.area, grid=scene.grid).values
        found[row.label][column].append(tuple(values[name] for name in QUALITY))


def cell(values):
    """Return the means of a list of pairs, percent; an object quality without any object is left out."""
    means = []
    for column in zip(*values, strict=True):
        known = [value for value in column if value is not None]
        means.append(f"{100 * statistics.fmean(known):.1f}" if known else "-")
    return " / ".join(means)


def table(found, texts, columns, *, published):
    """Return the lines of a table: a row for each detector, and beneath it what its paper prints.

    `texts` stand, by label and column, where nothing was found.
    """
    lines = ["| detector | " + " | ".join(columns) + " |", "|---|" + "--:|" * len(columns)]
    for label in DETECTORS:
        cells = [cell(found[label][name]) if found[label][name] else texts.get((label, name), "") for name in columns]
        lines.append(f"| `{label}` | " + " | ".join(cells) + " |")
    for detector in dict.fromkeys(row.detector for row in PUBLISHED) if published else ():
        cells = [printed(detector, AREAS[name]) for name in columns]
        lines.append(f"| *printed for `{detector}`* | " + " | ".join(cells) + " |")
    return lines


def printed(detector, presets):
    """Return the mean of what a paper prints of its scenes of an area."""
    rows = [row for row in PUBLISHED if row.detector == detector and not row.average and set(row.presets) <= {*presets}]
    texts = [[row.printed[symbol] for row in rows if symbol in row.printed] for symbol in ("Q_l", "Q_lp")]
    means = [f"*{statistics.fmean(map(float, values)):.1f}*" if values else "-" for values in texts]
    return " / ".join(means) if rows else ""


def without_result(rows):
    """Return what stands in place of a figure by label and column, and the sentences of failures and skips."""
    states, sentences = {}, defaultdict(list)
    for row in rows:
        if row.status != "ok" and (column := column_of(row)):
            states[row.label, column] = row.status
            reason = row.reason.replace(f"scene {row.scene!r} ", "the scene ")
            sentences[row.status, row.label, reason].append(row.scene)
    lines = []
    for (status, label, reason), scenes in sorted(sentences.items()):
        if label in DETECTORS:
            lines.append(f"- {status}: `{label}` on {', '.join(sorted(scenes))}: {reason}.")
    return states, lines


class EarlierPage:
    """What a page says of programs of others: their runs, and figures by matching, label and column."""

    def __init__(self, text=""):
        lines = text.splitlines()
        self.runs = [line for line in lines if line.startswith("Programs of others:")]
        self.sentences = [
            line for line in lines if line.startswith("- ") and any(f"`{one}`" in line for one in PROGRAMS)
        ]
        self.figures = defaultdict(dict)
        matching, columns = "", []
        for line in lines:
            if line.startswith("## Matching"):
                matching = line.split("`")[1]
            cells = [cell.strip() for cell in line.split("|")[1:-1]]
            if cells[:1] == ["detector"]:
                columns = cells[1:]
            elif cells and cells[0].strip("`") in PROGRAMS:
                label = cells[0].strip("`")
                self.figures[matching] |= {(label, name): cell for name, cell in zip(columns, cells[1:], strict=True)}


def page(parts, earlier):
    """Return the page of (store, rows, revision)."""
    rows = [row for _, some, _ in parts for row in some]
    states, sentences = without_result(rows)
    by_matching = {matching: defaultdict(lambda: defaultdict(list)) for matching in MATCHINGS}
    for matching, found in by_matching.items():
        for store, some, _ in parts:
            add_qualities(found, store, some, matching)
    lines = [
        "# One leaderboard",
        "",
        "Every detector on the scenes of the suite `papers` (three seeds of each preset) and on eight real scenes:",
        "object quality / pixel quality, percent, means over the scenes of a column. Printed figures are of other",
        "data, the real places that the presets follow, so they allow a comparison and no more.",
        "",
        *sentences_of_runs(parts),
        *earlier.runs,
        "`python tests/performance/study_leaderboard.py FOLDER -o board` runs them; the folder holds the real scenes.",
        "`tests/performance/study_leaderboard_page.py` writes this page. An empty cell was not run.",
    ]
    for matching, meaning in MATCHINGS.items():
        found, texts = by_matching[matching], earlier.figures[matching] | states
        lines += ["", f"## Matching `{matching}`: {meaning}", "", "Suite `papers`:", ""]
        lines += table(found, texts, list(AREAS), published=True)
        lines += ["", "Real scenes:", ""]
        lines += table(found, texts, list(REAL), published=False)
    sentences = sorted({*sentences, *earlier.sentences})
    lines += ["", "## Failures and skips", "", *(sentences or ["None."])]
    return "\n".join(lines) + "\n"


def sentences_of_runs(parts):
    """Return how many runs there are of each kind, how many have a result, and of what code they are."""
    made = {}
    for _, rows, revision in parts:
        for kind, some in kinds_of(rows):
            total, good, of = made.get(kind, (0, 0, []))
            known = sum(row.status == "ok" for row in some)
            made[kind] = total + len(some), good + known, [*of, f"revision {revision}, {days_of(some)}"]
    return [
        f"{kind}: {total} runs, {good} with a result ({'; '.join(of)})." for kind, (total, good, of) in made.items()
    ]


def kinds_of(rows):
    """Return what rows are of, in words, and the rows of each kind that has some."""
    others = [row for row in rows if row.label in PROGRAMS]
    own = [row for row in rows if row.label not in PROGRAMS]
    return [pair for pair in (("Detectors of roofbench", own), ("Programs of others", others)) if pair[1]]


def days_of(rows):
    """Return the days of the runs."""
    days = sorted({datetime.date.fromisoformat(row.finished[:10]).isoformat() for row in rows})
    return days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("store", type=Path)
    parser.add_argument("revision")
    parser.add_argument("--programs", nargs=2, action="append", default=[], metavar=("STORE", "REVISION"))
    parser.add_argument("--earlier", type=Path, metavar="PAGE")
    options = parser.parse_args()
    with ExitStack() as stack:
        store = stack.enter_context(Store(options.store))
        rows = newest(store)
        parts = [(store, rows, options.revision)]
        if options.programs or options.earlier:
            others = [stack.enter_context(Store(Path(file))) for file, _ in options.programs]
            revisions = [revision for _, revision in options.programs]
            own = [row for row in rows if row.label not in PROGRAMS]
            parts = [(store, own, options.revision), *zip(others, newest_of_programs(others), revisions, strict=True)]
        earlier = EarlierPage(options.earlier.read_text(encoding="utf-8") if options.earlier else "")
        print(page(parts, earlier), end="")


if __name__ == "__main__":
    main()
