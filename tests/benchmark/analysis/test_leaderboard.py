"""Ranking, pooling and significance of leaderboards, on evaluations of a few squares."""

import itertools
import json
import shlex

import pytest
import shapely

from roofbench.benchmark.analysis.leaderboard import make_leaderboard, repeat_command, unsuccessful_runs
from roofbench.benchmark.identity.recipes import SceneRecipe
from roofbench.benchmark.plan import KeyedEvaluator
from roofbench.benchmark.store.records import RunRow
from roofbench.core.errors import UnknownNameError
from roofbench.evaluators.registry import make_evaluator
from roofbench.scenes.geodata.footprints import Footprints

KEYED = KeyedEvaluator.of(make_evaluator("threshold-free"))
CRS = "EPSG:25832"


def squares(count, shift=0.0):
    return Footprints.of([shapely.box(20 * n + shift, 0, 20 * n + 10 + shift, 10) for n in range(count)], crs=CRS)


class Memory:
    """What a leaderboard asks of a store."""

    def __init__(self, evaluations, references, notes, cues):
        self._evaluations, self._references, self._notes, self._cues = evaluations, references, notes, cues

    def evaluations(self, run_ids, evaluator, key):
        assert key == KEYED.key
        return {run_id: self._evaluations[run_id] for run_id in run_ids if run_id in self._evaluations}

    def evaluation_failures(self, run_ids, key):
        assert key == KEYED.key
        return {}

    def reference_counts(self):
        return self._references

    def run_notes(self, run_ids):
        return {run_id: self._notes[run_id] for run_id in run_ids if run_id in self._notes}

    def run_cues(self, run_ids):
        return {run_id: self._cues[run_id] for run_id in run_ids if run_id in self._cues}


class Runs:
    """Rows and evaluations, run by run."""

    def __init__(self):
        self.rows, self.evaluations, self.references, self.notes, self.cues = [], {}, {}, {}, {}

    def add(self, label, scene, found=None, *, of=10, shift=0.5, seed=0, status="ok", **costs):
        number = len(self.rows) + 1
        recipe = SceneRecipe.of_preset("hamlet", seed=scene)
        values = dict.fromkeys(RunRow._fields, "") | {
            "id": number,
            "detector": label.partition("[")[0],
            "label": label,
            "parameters_text": "{}",
            "seed": seed,
            "scene": recipe.name,
            "recipe_text": json.dumps(recipe.to_dict()),
            "scene_id": scene,
            "status": status,
            "benchmark": 1,
            "cpu_seconds": 1.0,
            "peak_memory": 10**8,
            "detected": found,
        }
        self.rows.append(RunRow(**{**values, **costs}))
        self.references.setdefault(scene, of)
        if status == "ok" and of is not None:
            self.evaluations[number] = KEYED.evaluator.evaluate(squares(found, shift), squares(of))
        return self

    def board(self, **options):
        memory = Memory(self.evaluations, self.references, self.notes, self.cues)
        return make_leaderboard(self.rows, memory, KEYED, title="t", **options)


def ranks(board, pooling="pooled"):
    return {entry.label: entry.rank for entry in board.entries if entry.pooling == pooling}


def cell(board, label, key, pooling="pooled"):
    return next(e for e in board.entries if (e.label, e.pooling) == (label, pooling)).cells[key]


def test_the_better_detector_comes_first_whatever_its_direction():
    runs = Runs()
    for scene in (1, 2):
        runs.add("far", scene, 9, shift=3.0).add("near", scene, 5, shift=0.5)
    assert ranks(runs.board()) == {"far": 1, "near": 2}
    assert ranks(runs.board(rank_by="geometric.rmse")) == {"near": 1, "far": 2}
    assert ranks(runs.board(rank_by="RMSE")) == {"near": 1, "far": 2}


def test_equal_detectors_share_a_rank_and_the_next_one_is_counted():
    runs = Runs().add("a", 1, 8).add("b", 1, 8).add("c", 1, 5)
    assert ranks(runs.board()) == {"a": 1, "b": 1, "c": 3}


def test_an_undefined_value_and_a_missing_scene_have_no_rank():
    runs = Runs().add("none", 1, 0).add("none", 2, 0).add("good", 1, 8).add("good", 2, 8)
    runs.add("half", 1, 9).add("half", 2, status="failed", reason="no")
    board = runs.board(rank_by="geometric.rmse")
    assert ranks(board) == {"good": 1, "none": None, "half": None}
    assert cell(board, "none", "geometric.rmse").value is None
    assert "half has no rank: it has a result on 1 of 2 scenes" in board.notes


def test_detectors_are_compared_on_the_scenes_that_none_of_them_skips():
    runs = Runs()
    for scene, found in ((1, 2), (2, 8), (3, 8)):
        runs.add("any", scene, found)
        runs.add("colour", scene, 9, **({"status": "skipped", "reason": "no image"} if scene == 1 else {}))
        runs.add("nowhere", scene, status="skipped", reason="no image")
    board = runs.board()
    assert board.scenes == ("hamlet-2", "hamlet-3")
    assert ranks(board) == {"colour": 1, "any": 2, "nowhere": None}
    assert cell(board, "any", "object.completeness").value == pytest.approx(16 / 20)
    assert board.by_scene["hamlet-1"] == {"any": pytest.approx(0.2)}
    assert board.by_scene["hamlet-2"] == {"any": pytest.approx(0.8), "colour": pytest.approx(0.9)}
    assert board.notes[0] == (
        "Values are over the 2 scenes that all detectors can use, without hamlet-1 (skipped by colour)"
    )


def test_where_every_scene_is_skipped_by_some_detector_all_scenes_stay():
    runs = Runs().add("a", 1, 8).add("a", 2, status="skipped").add("b", 1, status="skipped").add("b", 2, 8)
    board = runs.board()
    assert board.scenes == ("hamlet-1", "hamlet-2")
    assert ranks(board) == {"a": None, "b": None}


def test_pooled_adds_objects_and_mean_averages_scenes():
    runs = Runs().add("d", 1, 10, of=10).add("d", 2, 10, of=40)
    board = runs.board()
    assert cell(board, "d", "object.completeness").value == pytest.approx(20 / 50)
    mean = cell(board, "d", "object.completeness", "mean")
    assert (mean.value, mean.scenes) == (pytest.approx((1 + 0.25) / 2), 2)


def test_seeds_are_averaged_before_scenes():
    runs = Runs()
    for seed, found in enumerate((10, 4)):
        runs.add("d", 1, found, seed=seed)
    runs.add("d", 2, 1, seed=0)
    assert cell(runs.board(), "d", "object.completeness", "mean").value == pytest.approx((0.7 + 0.1) / 2)


def test_a_mean_leaves_out_scenes_where_the_index_is_undefined():
    board = Runs().add("d", 1, 10).add("d", 2, 0).board()
    mean = cell(board, "d", "geometric.rmse", "mean")
    assert (mean.scenes, mean.value) == (1, pytest.approx(cell(board, "d", "geometric.rmse").value))


def test_intervals_hold_the_value_and_need_two_scenes():
    runs = Runs()
    for scene, found in enumerate((3, 5, 7, 9), start=1):
        runs.add("d", scene, found)
    for pooling in ("pooled", "mean"):
        found = cell(runs.board(), "d", "object.completeness", pooling)
        assert found.low < found.value < found.high
    alone = cell(Runs().add("d", 1, 5).board(), "d", "object.completeness")
    assert (alone.low, alone.high) == (None, None)


def test_intervals_do_not_depend_on_the_order_of_the_scenes():
    """A run lists scenes as its suite does, a report as they were stored."""
    found = dict(zip(range(1, 11), (3, 9, 5, 7, 1, 8, 2, 6, 10, 4), strict=True))
    boards = []
    for order in (range(1, 11), (3, 1, 4, 2, 10, 8, 9, 5, 7, 6)):
        runs = Runs()
        for scene in order:
            runs.add("d", scene, found[scene])
        boards.append(runs.board())
    for pooling in ("pooled", "mean"):
        one, other = (cell(board, "d", "object.completeness", pooling) for board in boards)
        assert (one.low, one.high) == (other.low, other.high)


def test_detectors_without_a_significant_difference_share_a_letter():
    runs = Runs()
    for scene, found in zip(range(1, 11), itertools.cycle((7, 8)), strict=False):
        runs.add("good", scene, found).add("as good", scene, 15 - found).add("bad", scene, 2)
    board = runs.board()
    letters = {entry.label: entry.group for entry in board.entries}
    assert letters["good"] == letters["as good"] != letters["bad"]
    assert board.notes == (
        "Detectors that share a letter do not differ significantly in quality (paired tests over 10 scenes, Holm, "
        "level 0.05)",
        "good is first by mean quality in 28 of 50 random halves of the scenes; as good in 22",
    )


def test_too_few_scenes_for_tests_are_said_with_the_number_needed():
    board = Runs().add("a", 1, 8).add("b", 1, 5).board()
    assert board.notes == ("Too few scenes for significance tests: 6 needed, 1 available",)
    assert {entry.group for entry in board.entries} == {""}


def test_a_scene_without_reference_is_left_out():
    board = Runs().add("d", 1, 8).add("d", 2, 3, of=None).board()
    assert board.scenes == ("hamlet-1",)
    assert board.notes == ("hamlet-2 has no reference and is left out",)
    assert ranks(board) == {"d": 1}


def test_costs_are_the_median_time_and_the_highest_memory():
    runs = Runs()
    for scene, seconds in enumerate((1.0, 2.0, 9.0), start=1):
        runs.add("d", scene, 5, cpu_seconds=seconds, peak_memory=int(seconds))
    (entry,) = [entry for entry in runs.board().entries if entry.pooling == "mean"]
    assert (entry.cpu_seconds, entry.peak_memory, entry.detected, entry.reference) == (2.0, 9, 15, 30)


def test_failures_are_listed_before_skips_with_the_command_that_repeats_them():
    runs = Runs().add("a[x=1]", 1, status="skipped", reason="no image", seed=2)
    runs.add("b", 2, status="failed", reason="no roof")
    first, second = unsuccessful_runs(runs.rows)
    assert (first.label, first.reason) == ("b", "no roof")
    assert (second.status, second.scene, second.seed) == ("skipped", "hamlet-1", 2)
    assert second.command == repeat_command(runs.rows[0])
    assert second.command == "roofbench detect 'a[x=1]' 'hamlet[seed=1]' --seed 2 -o out.gpkg"
    assert runs.board().unsuccessful == (first, second)


def test_the_command_that_repeats_a_program_has_its_parameters():
    from types import SimpleNamespace

    from roofbench.detectors.registry import make_detector

    made = make_detector("command", {"run": "sh -c 'a, b'", "label": "mine", "seeded": True})
    recipe = Runs().add("a", 1, 1).rows[0].recipe
    row = SimpleNamespace(detector="command", label="command:mine", parameters=made.values(), recipe=recipe, seed=3)
    assert shlex.split(repeat_command(row))[2] == """command[run="sh -c 'a, b'",seeded=True,label=mine]"""
    again = make_detector(shlex.split(repeat_command(row))[2])
    assert again.values() == made.values()


def test_an_unknown_index_is_answered_with_the_nearest():
    with pytest.raises(UnknownNameError, match=r"did you mean 'pixel\.quality'"):
        Runs().add("d", 1, 8).board(rank_by="pixel.qualty")


def test_a_note_of_several_runs_stands_once_with_its_scenes():
    runs = Runs()
    for scene in range(1, 7):
        runs.add("one", scene, 9).add("two", scene, 8)
        runs.notes |= {len(runs.rows) - 1: ("no DEM",), len(runs.rows): ("no DEM",)}
    runs.notes[1] = ("no DEM", "no point")
    assert runs.board().notes[-2:] == (
        "hamlet-1, hamlet-2, hamlet-3, hamlet-4 and 2 more: no DEM",
        "one on hamlet-1: no point",
    )


def test_cues_that_a_detector_used_are_noted_with_the_number_of_scenes():
    runs = Runs()
    for scene in range(1, 4):
        runs.add("one", scene, 9).add("other", scene, 8).add("none", scene, 8)
        runs.cues |= {len(runs.rows) - 2: ("returns", "texture") if scene < 3 else ("texture",), len(runs.rows): ()}
    board = runs.board()
    assert board.cues["one"]["returns"] == ("hamlet-1", "hamlet-2")
    assert "other" not in board.cues
    assert board.notes[-2:] == ("cues that one used: texture; returns on 2 of 3 scenes", "cues that none used: none")


def test_cues_of_failed_runs_do_not_count():
    runs = Runs().add("one", 1, 9).add("one", 2, status="failed")
    runs.cues |= {1: ("texture",), 2: ("returns",)}
    assert runs.board().cues == {"one": {"": ("hamlet-1",), "texture": ("hamlet-1",)}}


def test_many_different_notes_are_counted():
    runs = Runs()
    for scene in range(1, 9):
        runs.add("one", scene, 9)
        runs.notes[scene] = (f"the DEM covers {scene} % of the scene",)
    assert runs.board().notes[-2] == "hamlet-5: the DEM covers 5 % of the scene"
    assert runs.board().notes[-1] == "3 further estimates; 'roofbench why RUN' shows those of a run"
