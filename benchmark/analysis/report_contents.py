"""The contents of a report, from the results store.

The runs of a report are the newest of each detector, scene and seed. Tables are over all of them. Where there are many,
maps, gallery and sizes are of a sample, and the report says so.
"""

from __future__ import annotations

import fnmatch
import statistics
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime

from ...core.errors import InputError, RoofbenchError
from ...core.wording import counted
from ...evaluators.base import Evaluator
from ...evaluators.registry import DEFAULT, make_evaluator
from ..identity.provenance import code_version
from ..plan import KeyedEvaluator
from ..store.records import RunRow
from ..store.writer import Store
from .leaderboard import make_leaderboard
from .pooled_curves import pooled_curves
from .published import PUBLISHED, Comparison, OursRow
from .report_data import CostPoint, Provenance, Report, Sensitivity
from .report_scenes import draw_scenes
from .results import GateResult, Leaderboard
from .sensitivity import stored_sensitivities
from .suite_parts import suite_parts
from .versions import comparable_runs, version_names

__all__ = ["fill_report", "newest_runs", "stored_evaluators"]

Values = Mapping[int, Mapping[str, float | None]]


def newest_runs(store: Store, *, detector: str | None = None, scene: str | None = None) -> list[RunRow]:
    """Return the newest run of each detector label, scene and seed, in the order of their ids.

    Parameters
    ----------
    store : Store
    detector, scene : str, optional
        Patterns such as ``ndsm*`` for label and scene name.
    """
    newest: dict[tuple[str, str, int], RunRow] = {}
    for row in store.runs():
        if detector is not None and not fnmatch.fnmatchcase(row.label, detector):
            continue
        if scene is not None and not fnmatch.fnmatchcase(row.scene, scene):
            continue
        newest.setdefault((row.label, row.scene, row.seed), row)
    return sorted(newest.values(), key=lambda row: row.id)


def stored_evaluators(store: Store, rows: Sequence[RunRow]) -> list[KeyedEvaluator]:
    """Return the evaluators of these runs, the one with most evaluations first.

    Of evaluators that differ in their code only, the one with most evaluations, and the newest of those; those of
    missing plugins are left out.
    """
    good = [row.id for row in rows if row.status == "ok"]
    found: dict[str, tuple[int, KeyedEvaluator]] = {}
    for key, recipe in store.evaluators():
        try:
            keyed = KeyedEvaluator(recipe.evaluator(), recipe, key)
        except RoofbenchError:
            continue
        count = len(store.evaluated(good, key))
        if count and count >= found.get(keyed.label, (0, keyed))[0]:
            found[keyed.label] = (count, keyed)
    return [keyed for _, keyed in sorted(found.values(), key=lambda pair: -pair[0])]


def fill_report(
    store: Store,
    rows: Sequence[RunRow],
    *,
    title: str,
    evaluated: Sequence[tuple[KeyedEvaluator, Leaderboard]] | None = None,
    rank_by: str | None = None,
    gate: GateResult | None = None,
    sensitivities: Sequence[Sensitivity] = (),
    level: float = 0.8,
) -> Report:
    """Return everything that a report of these runs shows.

    Parameters
    ----------
    store : Store
    rows : sequence of RunRow
        Of every status; see `newest_runs`. Those of older versions of the benchmark are left out, which a note of the
        leaderboards says.
    title : str
    evaluated : sequence of (KeyedEvaluator, Leaderboard), optional
        Evaluators with their leaderboards, where the caller has them.
    rank_by : str, optional
        Index key.
    gate : GateResult, optional
    sensitivities : sequence of Sensitivity
        Of sweep tables; those of the stored runs are added.
    level : float
        Level of the break-down points.
    """
    every = rows
    rows, _ = comparable_runs(rows)
    parts: list[Leaderboard] = []
    if evaluated is None:
        evaluated = [
            (keyed, make_leaderboard(every, store, keyed, title=title, rank_by=rank_by if place == 0 else None))
            for place, keyed in enumerate(stored_evaluators(store, rows))
        ]
        parts = [
            make_leaderboard(part.rows, store, keyed, title=part.title, rank_by=rank_by)
            for keyed, _ in evaluated[:1]
            for part in suite_parts(rows, store.plans())
        ]
    if not rows or not evaluated:
        raise InputError(f"{store.path} holds no evaluated run to report: 'roofbench run' makes some")
    keyed, board = evaluated[0]
    good = [row for row in rows if row.status == "ok"]
    numbers = [row.id for row in good]
    values = store.index_values(numbers, keyed.key)
    drawn = None
    for other, _ in evaluated:  # the first whose verdicts are stored
        own = values if other is keyed else store.index_values(numbers, other.key)
        drawn = drawn or draw_scenes(store, good, other, own, _labels(board))
    found = [*sensitivities, *stored_sensitivities(good, values, keyed, level=level)]
    return Report(
        title=title,
        boards=tuple(board for _, board in evaluated),
        parts=tuple(part for part in parts if any(entry.rank for entry in part.entries)),
        matrix=board.by_scene,
        scenes=() if drawn is None else drawn.scenes,
        errors=() if drawn is None else drawn.errors,
        sizes=() if drawn is None else drawn.sizes,
        sampling=() if drawn is None else drawn.sampling,
        curves=tuple(filter(None, (pooled_curves(store, good, one, _labels(board)) for one, _ in evaluated))),
        sensitivities=tuple(found),
        costs=_costs(store, good, _labels(board)),
        comparison=_comparison(store, good, [one for one, _ in evaluated]),
        gate=gate,
        provenance=_provenance(store, rows),
    )


def _labels(board: Leaderboard) -> list[str]:
    """Return the detectors in the order of the board."""
    return list(dict.fromkeys(entry.label for entry in board.entries))


def _costs(store: Store, rows: Sequence[RunRow], labels: Sequence[str]) -> tuple[CostPoint, ...]:
    sizes = store.scene_sizes()
    gathered: dict[tuple[str, int], list[RunRow]] = {}
    for row in rows:
        gathered.setdefault((row.label, row.scene_id), []).append(row)
    return tuple(
        CostPoint(
            label=label,
            scene=own[0].scene,
            points=sizes[scene_id][0],
            hectares=sizes[scene_id][1],
            cpu_seconds=statistics.median(row.cpu_seconds for row in own),
            peak_memory=int(statistics.median(row.peak_memory for row in own)),
            runs=len(own),
        )
        for (label, scene_id), own in sorted(gathered.items(), key=lambda item: labels.index(item[0][0]))
        if scene_id in sizes
    )


def _comparison(store: Store, rows: Sequence[RunRow], evaluated: Sequence[KeyedEvaluator]) -> Comparison | None:
    """Return the published rows with ours; None when no detector of theirs ran on a preset of theirs.

    Ours stand there twice: as evaluated, and by the paper's text on correspondence taken literally.
    """
    # The printed rows are by the default evaluator: another one's figures do not stand beside them.
    keyed = next((one for one in evaluated if one.evaluator.name == DEFAULT), None)
    if keyed is None:
        return None
    evaluator, values = keyed.evaluator, store.index_values([row.id for row in rows], keyed.key)
    literal = make_evaluator(DEFAULT, {**evaluator.values(), "matching": "one-pass"})
    one_pass = None if literal == evaluator else _EvaluatedAgain(store, literal)
    by_preset: dict[tuple[str, str], list[RunRow]] = {}
    for row in rows:
        recipe = row.recipe
        if recipe.kind == "preset" and not recipe.parameters and row.id in values:
            by_preset.setdefault((row.label, recipe.place), []).append(row)
    pairs = []
    for published in PUBLISHED:
        entries = []
        for label in published.entries:
            of_presets = [by_preset.get((label, preset), []) for preset in published.presets]
            if all(of_presets):
                entries.append(_ours(label, [row for own in of_presets for row in own], values, one_pass))
        pairs.append((published, tuple(entries)))
    indices = tuple(index for index in evaluator.indices if any(row.text(index) for row in PUBLISHED))
    return Comparison(indices, tuple(pairs)) if any(ours for _, ours in pairs) else None


class _EvaluatedAgain(dict[int, Mapping[str, float | None]]):
    """Values of stored runs by another evaluator; each run is evaluated when it is first asked for."""

    def __init__(self, store: Store, evaluator: Evaluator) -> None:
        self._store, self._evaluator = store, evaluator

    def __missing__(self, run_id: int) -> Mapping[str, float | None]:
        scene = self._store.scene(self._store.run(run_id).scene_id)
        found: Mapping[str, float | None] = {}
        if scene.reference is not None:
            detected = self._store.detections(run_id)
            found = self._evaluator.evaluate(detected, scene.reference, area=scene.area, grid=scene.grid).values
        return self.setdefault(run_id, found)


def _ours(label: str, rows: Sequence[RunRow], values: Values, one_pass: _EvaluatedAgain | None) -> OursRow:
    return OursRow(
        label=label,
        scenes=len({row.scene for row in rows}),
        values=_means(rows, values),
        one_pass={} if one_pass is None else _means(rows, {row.id: one_pass[row.id] for row in rows}),
    )


def _means(rows: Sequence[RunRow], values: Mapping[int, Mapping[str, float | None]]) -> dict[str, float | None]:
    """Return the mean over scenes of the means over seeds."""
    gathered: dict[str, dict[str, list[float]]] = {}
    for row in rows:
        for key, value in values[row.id].items():
            if value is not None:
                gathered.setdefault(key, {}).setdefault(row.scene, []).append(value)
    return {
        key: statistics.fmean(statistics.fmean(found) for found in by_scene.values())
        for key, by_scene in gathered.items()
    }


def _provenance(store: Store, rows: Sequence[RunRow]) -> Provenance:
    last = max(rows, key=lambda row: row.id)
    code, machine = store.code(last.id), store.machine(last.id)
    seeds = sorted({row.seed for row in rows})
    facts = [
        ("report made by", f"roofbench {code_version()}, {datetime.now(UTC):%Y-%m-%d %H:%M} UTC"),
        ("runs made by", "; ".join(f"roofbench {version}" for version in dict.fromkeys(row.version for row in rows))),
        ("version of the benchmark", ", ".join(version_names(rows))),
        ("command", "; ".join(store.commands()) or "not kept"),
        ("runs", f"{len(rows):,} from {min(row.finished for row in rows)} to {max(row.finished for row in rows)}"),
        ("store", f"{store.path.name}, {counted(store.count_runs(), 'run')} in all"),
        ("detectors", ", ".join(dict.fromkeys(row.label for row in rows))[:2000]),
        ("detector seeds", ", ".join(map(str, seeds[:20])) + (", …" if len(seeds) > 20 else "")),
        ("machine", ", ".join(f"{name} {value}" for name, value in machine.items()) or "not known"),
        ("packages", ", ".join(f"{name} {version}" for name, version in code.packages.items()) or "not known"),
    ]
    scenes = {row.scene_id: row for row in rows}
    hashes = store.scene_hashes()
    return Provenance(
        facts=tuple(facts),
        scenes=tuple(
            (row.scene, row.recipe.word, hashes.get(scene_id) or "not opened") for scene_id, row in scenes.items()
        ),
    )
