"""The papers' printed rows beside ours, by the default matching and by one pass: Markdown for the documentation.

``roofbench run papers --store papers.sqlite``, then ``python tests/performance/study_published.py papers.sqlite``.
"""

import sys

from roofbench.benchmark.analysis.report_contents import fill_report, newest_runs
from roofbench.benchmark.store.writer import Store
from roofbench.evaluators.registry import make_evaluator
from roofbench.reports.format import number_text

SYMBOLS = ("C_m", "C_r", "Q_l", "M_d", "D_o", "C_rd", "C_rr", "C_mp", "C_rp", "Q_lp", "RMSE")


def main():
    indices = [make_evaluator().index(symbol) for symbol in SYMBOLS]
    with Store(sys.argv[1], must_exist=True) as store:
        report = fill_report(store, newest_runs(store), title="papers")
    print("| detector | scene | row | " + " | ".join(SYMBOLS) + " |")
    print("|---|---|---|" + "--:|" * len(SYMBOLS))
    for published, ours in report.comparison.rows:
        rows = [("published", [published.text(index) for index in indices])]
        rows = [(published.detector, *row) for row in rows]
        for entry in ours:
            for name, values in (("nearest", entry.values), ("one-pass", entry.one_pass)):
                cells = [number_text(values.get(index.key), index.unit) for index in indices]
                rows.append((entry.label, name, cells))
        for label, name, cells in rows:
            print(f"| `{label}` | {published.scene} | {name} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
