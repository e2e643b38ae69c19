"""The leaderboard of a results store by every evaluator, and the ranks that change from one to the other.

``roofbench run papers --store papers.sqlite``, then ``python tests/performance/study_ranks.py papers.sqlite`` prints
the tables of docs/results/evaluators.md. Stored detections are evaluated where that is missing; nothing is detected.
"""

import itertools
import sys

from roofbench.benchmark.analysis.leaderboard import make_leaderboard
from roofbench.benchmark.analysis.report_contents import newest_runs
from roofbench.benchmark.execution.runner import score_stored
from roofbench.benchmark.plan import KeyedEvaluator
from roofbench.benchmark.store.writer import Store
from roofbench.evaluators.registry import EVALUATORS, make_evaluator
from roofbench.reports.format import number_text, unit_text


def boards_of(path):
    """Return the name and leaderboard of every evaluator."""
    with Store(path, must_exist=True) as store:
        rows = newest_runs(store)
        good = [row.id for row in rows if row.status == "ok"]
        for name in sorted(EVALUATORS.names(), key=lambda name: name != "threshold-free"):
            keyed = KeyedEvaluator.of(make_evaluator(name))
            known = store.evaluated(good, keyed.key)
            for run in good:
                if run not in known:
                    score_stored(store, run, (keyed,))
            yield name, make_leaderboard(rows, store, keyed, title=name)


def row(*cells):
    print("| " + " | ".join(cells) + " |")


def main():
    boards = dict(boards_of(sys.argv[1]))
    found = {
        name: {entry.label: entry for entry in board.entries if entry.pooling == "pooled"}
        for name, board in boards.items()
    }
    first = next(iter(found.values()))
    print(f"{len(next(iter(boards.values())).scenes)} scenes\n")
    row("detector", *(f"{name} {board.rank_by.symbol}" for name, board in boards.items()))
    row("---", *["--:"] * len(boards))
    for label in first:
        cells = []
        for name, board in boards.items():
            entry = found[name][label]
            unit = board.rank_by.unit
            value = f"{number_text(entry.cells[board.rank_by.key].value, unit)} {unit_text(unit)}".strip()
            cells.append(f"{entry.rank} ({value}) {entry.group}".strip())
        row(f"`{label}`", *cells)
    print()
    row("evaluator", "first place in random halves of the scenes")
    row("---", "---")
    for name, board in boards.items():
        row(f"`{name}`", next((note for note in board.notes if "random halves" in note), "–"))
    print()
    print("Pairs that change places against threshold-free, with the difference significant on both sides in bold:\n")
    for name in list(boards)[1:]:
        swaps = []
        for one, two in itertools.combinations(first, 2):
            here, there = (found[side] for side in ("threshold-free", name))
            if (here[one].rank - here[two].rank) * (there[one].rank - there[two].rank) < 0:
                sure = all(not set(side[one].group) & set(side[two].group) for side in (here, there))
                swaps.append(f"**{one} and {two}**" if sure else f"{one} and {two}")
        print(f"- `{name}`: {len(swaps)} of {len(first) * (len(first) - 1) // 2} pairs: {'; '.join(swaps) or 'none'}")


if __name__ == "__main__":
    main()
