"""The leaderboard: stored evaluations, pooled and averaged over scenes, ranked, with failures listed."""

from __future__ import annotations

import itertools
import shlex
import statistics
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np

from ...core.parameter_rules import parameter_text
from ...core.resampling import expanded_level, resampling_weights
from ...core.wording import counted
from ...detectors.registry import DETECTORS
from ...evaluators.base import Evaluation, Evaluator, Index
from ...evaluators.tally import Tallies
from ..plan import KeyedEvaluator
from ..store.records import RunRow
from ..store.writer import Store
from .inference import (
    HALF_SPLITS,
    LEVEL,
    bootstrap_interval,
    first_places,
    holm,
    letter_groups,
    paired_p,
    scenes_needed,
)
from .results import Cell, Entry, Leaderboard, UnsuccessfulRun
from .used_cues import cue_notes, used_cues
from .versions import comparable_runs, version_names

__all__ = ["make_leaderboard", "repeat_command", "unsuccessful_runs"]

#: Fewest scenes that are split into halves.
_FEWEST_SPLIT = 4
_RESAMPLES = 1000  # of pooled indices, each of which is summarised anew
#: Different notes of runs that are shown at most, and scenes that are named in one.
_MOST_ESTIMATES, _MOST_SCENES = 5, 4


def make_leaderboard(
    rows: Sequence[RunRow],
    store: Store,
    keyed: KeyedEvaluator,
    *,
    title: str,
    rank_by: str | None = None,
    all_versions: bool = False,
) -> Leaderboard:
    """Return the leaderboard of stored runs by one evaluator.

    Parameters
    ----------
    rows : sequence of RunRow
        Runs of every status.
    store : Store
    keyed : KeyedEvaluator
    title : str
    rank_by : str, optional
        Key or symbol of an index; by default the one that the evaluator declares.
    all_versions : bool
        Rank the runs of all versions of the benchmark together, not only those of the newest.

    Notes
    -----
    The unit is the scene: the value of a detector with several seeds on a scene is the mean over its seeds. Pooled
    values add the tallies of all runs. Where a detector was skipped on a scene, because that lacks an input, all
    detectors are compared on the other scenes. A detector that failed or never ran on one of these has no rank, because
    its values are over other scenes than those of the other detectors.
    """
    rows, versions = comparable_runs(rows, all_versions=all_versions)
    evaluations = store.evaluations([row.id for row in rows if row.status == "ok"], keyed.evaluator, keyed.key)
    failures = store.evaluation_failures([row.id for row in rows if row.status == "ok"], keyed.key)
    counts = store.reference_counts()
    bare = tuple(dict.fromkeys(row.scene for row in rows if counts.get(row.scene_id, 0) is None))
    rows = [row for row in rows if row.scene not in bare]
    scenes, skipping = _common_scenes(rows)
    indices = tuple(index for index in keyed.evaluator.indices if index.main)
    ranking = keyed.evaluator.ranking_index(rank_by)
    summary = keyed.evaluator.summary_indices(ranking)
    indices = tuple(dict.fromkeys((*indices, *summary)))
    boards = [
        _Tally([row for row in rows if row.label == label], evaluations, keyed.evaluator, counts, scenes)
        for label in dict.fromkeys(row.label for row in rows)
    ]
    sign = -1 if ranking.better == "higher" else 1

    def order(board: _Tally) -> tuple[bool, bool, float]:
        value = board.pooled(ranking).value
        return board.scenes < len(scenes), value is None, sign * (value or 0.0)

    boards.sort(key=order)
    entries: list[Entry] = []
    complete = [board for board in boards if board.scenes == len(scenes)]
    groups, group_note = _groups(complete, ranking)
    for place, board in enumerate(boards):
        measured = board.scenes == len(scenes) and board.pooled(ranking).value is not None
        same = place > 0 and order(boards[place - 1]) == order(board)
        rank = None if not measured else entries[-1].rank if same else place + 1
        entries += board.entries(indices, rank=rank, group=groups.get(board.label, ""))
    cues = used_cues(rows, store)
    notes = [
        *versions,
        *skipping,
        *group_note,
        *_stability(complete, ranking),
        *_notes(boards, scenes),
        *(f"{scene} has no reference and is left out" for scene in bare),
        *cue_notes(cues),
        *_estimates(rows, store),
    ]
    return Leaderboard(
        title=title,
        evaluator=_described(keyed.evaluator),
        rank_by=ranking,
        indices=indices,
        summary=summary,
        entries=tuple(entries),
        scenes=scenes,
        by_scene=_by_scene(rows, evaluations, ranking),
        cues=cues,
        notes=tuple(notes),
        unsuccessful=(*unsuccessful_runs(rows), *_unevaluated(rows, keyed, failures)),
    )


def _common_scenes(rows: Sequence[RunRow]) -> tuple[tuple[str, ...], list[str]]:
    """Return the scenes on which no detector was skipped, and a note on the others.

    A detector that was skipped everywhere excludes no scene. Where none would be left, all scenes stay.
    """
    scenes = tuple(dict.fromkeys(row.scene for row in rows))
    measured = {row.label for row in rows if row.status != "skipped"}
    skipped: dict[str, dict[str, None]] = {}
    for row in rows:
        if row.status == "skipped" and row.label in measured:
            skipped.setdefault(row.scene, {})[row.label] = None
    common = tuple(scene for scene in scenes if scene not in skipped)
    if not skipped or not common:
        return scenes, []
    lacking = "; ".join(f"{scene} (skipped by {', '.join(labels)})" for scene, labels in skipped.items())
    used = counted(len(common), "scene")
    return common, [f"Values are over the {used} that all detectors can use, without {lacking}"]


def _by_scene(
    rows: Sequence[RunRow], evaluations: Mapping[int, Evaluation], index: Index
) -> dict[str, dict[str, float | None]]:
    """Return per scene and detector the mean over seeds of an index; None where it is undefined."""
    gathered: dict[str, dict[str, list[float]]] = {}
    for row in rows:
        cells = gathered.setdefault(row.scene, {})
        if row.id in evaluations:
            found = cells.setdefault(row.label, [])
            value = evaluations[row.id].values[index.key]
            found += [] if value is None else [value]
    return {
        scene: {label: statistics.fmean(found) if found else None for label, found in cells.items()}
        for scene, cells in gathered.items()
    }


class _Tally:
    """The runs of one detector; its values are over the given scenes."""

    def __init__(
        self,
        rows: Sequence[RunRow],
        evaluations: Mapping[int, Evaluation],
        evaluator: Evaluator,
        references: Mapping[int, int | None],
        scenes: Sequence[str],
    ) -> None:
        self.label = rows[0].label
        self.rows = rows
        self._evaluator = evaluator
        self._done = [row for row in rows if row.status == "ok" and row.scene in scenes]
        self._evaluated = [row for row in self._done if row.id in evaluations]
        self._evaluations = [evaluations[row.id] for row in self._evaluated]
        self._sum = evaluator.pool(self._evaluations) if self._evaluations else None
        self._reference = sum(references[row.scene_id] or 0 for row in self._evaluated)

    @property
    def scenes(self) -> int:
        """Number of scenes on which all runs have a result."""
        done = {row.id for row in self._evaluated}
        return len({row.scene for row in self._evaluated} - {row.scene for row in self.rows if row.id not in done})

    def pooled(self, index: Index) -> Cell:
        """Return the ratio of the tallies of all runs, with its interval over resampled scenes."""
        if self._sum is None:
            return Cell(None, self.scenes)
        low, high = self._pooled_intervals.get(index.key, (None, None))
        return Cell(self._sum.values[index.key], self.scenes, low, high)

    @cached_property
    def _pooled_intervals(self) -> dict[str, tuple[float, float]]:
        """Return the interval of every pooled index: scenes are resampled and their tallies added."""
        scenes: dict[str, Tallies] = {}
        for row, evaluation in zip(self._evaluated, self._evaluations, strict=True):
            known = scenes.get(row.scene)
            scenes[row.scene] = evaluation.tallies if known is None else known + evaluation.tallies
        if len(scenes) < 2:
            return {}
        weights = resampling_weights(len(scenes), _RESAMPLES)
        resampled: dict[str, list[float]] = {}
        for tallies in self._evaluator.tallies_type.resampled([scenes[name] for name in sorted(scenes)], weights):
            for index in self._evaluator.indices:
                value = index.formula(tallies)
                if value is not None:
                    resampled.setdefault(index.key, []).append(value)
        tail = expanded_level(len(scenes))
        intervals = {}
        for key, found in resampled.items():
            if len(found) == _RESAMPLES:
                low, high = np.quantile(found, [tail, 1 - tail])
                intervals[key] = (float(low), float(high))
        return intervals

    def scene_values(self, index: Index) -> dict[str, float]:
        """Return the mean over seeds of each scene where the index is defined."""
        values: dict[str, list[float]] = {}
        for row, evaluation in zip(self._evaluated, self._evaluations, strict=True):
            value = evaluation.values[index.key]
            if value is not None:
                values.setdefault(row.scene, []).append(value)
        return {scene: statistics.fmean(found) for scene, found in values.items()}

    def mean(self, index: Index) -> Cell:
        """Return the mean over scenes, with its interval."""
        values = list(self.scene_values(index).values())
        low, high = bootstrap_interval(values) or (None, None)
        return Cell(statistics.fmean(values) if values else None, len(values), low, high)

    def entries(self, indices: Iterable[Index], *, rank: int | None, group: str) -> list[Entry]:
        """Return the pooled and the mean entry."""
        indices = list(indices)
        done = self._done
        entries = []
        for pooling, cell in (("pooled", self.pooled), ("mean", self.mean)):
            entries.append(
                Entry(
                    label=self.label,
                    detector=self.label.partition("[")[0],
                    parameters=self.rows[0].parameters,
                    pooling="pooled" if pooling == "pooled" else "mean",
                    rank=rank,
                    group=group,
                    scenes=self.scenes,
                    runs=len(self.rows),
                    failed=sum(row.status == "failed" for row in self.rows),
                    skipped=sum(row.status == "skipped" for row in self.rows),
                    detected=sum(row.detected or 0 for row in self._evaluated),
                    reference=self._reference,
                    cpu_seconds=statistics.median(row.cpu_seconds for row in done) if done else None,
                    peak_memory=max((row.peak_memory for row in done), default=None),
                    cells={index.key: cell(index) for index in indices},
                    benchmark="+".join(version_names(self.rows)),
                )
            )
        return entries


def _groups(boards: Sequence[_Tally], index: Index) -> tuple[dict[str, str], list[str]]:
    """Return letters shared by detectors whose difference is not significant, and a note on the tests."""
    if len(boards) < 2:
        return {}, []
    values = [board.scene_values(index) for board in boards]
    pairs = list(itertools.combinations(range(len(boards)), 2))
    common = {(i, j): sorted(values[i].keys() & values[j].keys()) for i, j in pairs}
    fewest, needed = min(map(len, common.values())), scenes_needed(len(pairs))
    if fewest < needed:
        return {}, [f"Too few scenes for significance tests: {needed} needed, {fewest} available"]
    p_values = [paired_p([values[i][scene] - values[j][scene] for scene in common[i, j]]) for i, j in pairs]
    differing = {pair for pair, p in zip(pairs, holm(p_values), strict=True) if p <= LEVEL}
    letters = letter_groups(len(boards), lambda i, j: (i, j) in differing)
    note = (
        f"Detectors that share a letter do not differ significantly in {index.title} (paired tests over {fewest} "
        f"scenes, Holm, level {LEVEL:g})"
    )
    return {board.label: letter for board, letter in zip(boards, letters, strict=True)}, [note]


def _stability(boards: Sequence[_Tally], index: Index) -> list[str]:
    """Return a note on how often the first detector is first on half of the scenes; none for fewer than four scenes."""
    values = [board.scene_values(index) for board in boards]
    scenes = sorted(set.intersection(*(set(found) for found in values))) if values else []
    if len(boards) < 2 or len(scenes) < _FEWEST_SPLIT or index.better == "neither":
        return []
    sign = -1 if index.better == "lower" else 1
    counts = first_places([[sign * found[scene] for scene in scenes] for found in values])
    others = [
        f"{board.label} in {count}" for board, count in zip(boards[1:], counts[1:].tolist(), strict=True) if count
    ]
    text = (
        f"{boards[0].label} is first by mean {index.title.removeprefix('mean ')} in {counts[0]} of {HALF_SPLITS} "
        "random halves of the scenes"
    )
    text = f"{text}; {', '.join(others)}" if others else text
    # Else the reader wonders why another detector has the first rank.
    return [f"{text} (the rank is by the pooled value)" if counts[0] < counts.max() else text]


def _described(evaluator: Evaluator) -> str:
    """Return the evaluator with the parameters that decide its values, defaults included."""
    words = [f"{name} {value}" for name, value in evaluator.values().items() if isinstance(value, str)]
    words += [f"{name} {value}" for name, value in evaluator.changed().items() if not isinstance(value, str)]
    return f"{evaluator.name} ({', '.join(words)})" if words else evaluator.name


def _notes(boards: Sequence[_Tally], scenes: Sequence[str]) -> tuple[str, ...]:
    short = [board for board in boards if board.scenes < len(scenes)]
    return tuple(
        f"{board.label} has no rank: it has a result on {board.scenes} of {len(scenes)} scenes" for board in short
    )


def _estimates(rows: Sequence[RunRow], store: Store) -> Iterator[str]:
    """Yield what was estimated for lack of data, such as a ground without a DEM, with the scenes concerned.

    The detectors are named where others have a result on these scenes without that note.
    """
    row_of = {row.id: row for row in rows}
    scenes: dict[str, dict[str, dict[str, None]]] = {}
    for run, notes in sorted(store.run_notes(row_of).items()):
        for note in notes:
            scenes.setdefault(note, {}).setdefault(row_of[run].scene, {})[row_of[run].label] = None
    for note, noted in list(scenes.items())[:_MOST_ESTIMATES]:
        some = list(noted)[:_MOST_SCENES]
        more = f" and {len(noted) - len(some)} more" if len(noted) > len(some) else ""
        without = any(row.scene in noted and row.status == "ok" and row.label not in noted[row.scene] for row in rows)
        labels = dict.fromkeys(label for found in noted.values() for label in found)
        whose = f"{', '.join(labels)} on " if without else ""
        yield f"{whose}{', '.join(some)}{more}: {note}"
    if len(scenes) > _MOST_ESTIMATES:
        yield f"{len(scenes) - _MOST_ESTIMATES} further estimates; 'roofbench why RUN' shows those of a run"


def unsuccessful_runs(rows: Iterable[RunRow]) -> tuple[UnsuccessfulRun, ...]:
    """Return failures, then skips."""
    found = [row for status in ("failed", "skipped") for row in rows if row.status == status]
    return tuple(
        UnsuccessfulRun(
            status=row.status,
            label=row.label,
            scene=row.scene,
            seed=row.seed,
            reason=row.reason,
            command=repeat_command(row),
        )
        for row in found
    )


def _unevaluated(
    rows: Iterable[RunRow], keyed: KeyedEvaluator, failures: Mapping[int, str]
) -> Iterator[UnsuccessfulRun]:
    """Yield the runs on which the evaluator failed, with the command that evaluates them."""
    _, bracket, changed = keyed.label.partition("[")
    for row in rows:
        if row.id in failures:
            yield UnsuccessfulRun(
                status="not evaluated",
                label=row.label,
                scene=row.scene,
                seed=row.seed,
                reason=f"{keyed.label}: {failures[row.id]}",
                command=shlex.join(["roofbench", "score", "-e", keyed.recipe.use + bracket + changed]),
            )


def repeat_command(row: RunRow) -> str:
    """Return the command that repeats one run in the foreground."""
    if row.label.startswith(f"{row.detector}:"):  # a label of its own says nothing of the parameters
        detector = f"{row.detector}[{_changed_text(row)}]"
    else:
        _, bracket, changed = row.label.partition("[")
        detector = row.detector + bracket + changed
    words = ["roofbench", "detect", detector, row.recipe.word, "--seed", str(row.seed), "-o", "out.gpkg"]
    return shlex.join(words)


def _changed_text(row: RunRow) -> str:
    """Return the stored parameters that are not the defaults of the detector, as a selection has them."""
    rules = DETECTORS.get(row.detector).parameters()
    values = {name: value for name, value in row.parameters.items() if value != rules[name].default}
    texts = {name: parameter_text(value) for name, value in values.items()}
    return ",".join(f'{name}="{text}"' if "," in text else f"{name}={text}" for name, text in texts.items())
