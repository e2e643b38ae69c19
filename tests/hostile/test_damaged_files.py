"""Damaged files end in one sentence: no traceback, no hang, no partial output, bounded memory."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from harness import effort

from hostile.mutations import MUTATIONS, mutate
from hostile.samples import SAMPLES, make_files

#: Another number here gives other damage.
SEED = int(os.environ.get("ROOFBENCH_SEED", "0"))
MOST_MEMORY = 1 << 30


@pytest.fixture(scope="session")
def sound_files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sound")
    make_files(folder)
    return folder


def lay_out(sample, sound_files, folder):
    """Copy what a sample needs."""
    for name in {*sample.beside, Path(sample.damaged).parts[0]}:
        if (sound_files / name).is_dir():
            shutil.copytree(sound_files / name, folder / name, dirs_exist_ok=True)
        else:
            shutil.copy(sound_files / name, folder / name)


def content(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def check(outcome, sample, before, folder):
    """Raise unless the call ended as it should on any input."""
    shown = f"exit code {outcome.code}\n{outcome.stdout[-2000:]}\n{outcome.stderr[-4000:]}"
    assert not outcome.hung, f"no answer within {outcome.seconds:.0f} s"
    assert outcome.code in {0, 1, 2, 3, 4}, shown
    assert "Traceback" not in outcome.stderr, shown
    assert "Warning: " not in outcome.stderr, shown
    assert outcome.peak_memory < MOST_MEMORY, f"{outcome.peak_memory / 1e6:.0f} MB"
    if outcome.code == 2:
        errors = [line for line in outcome.stderr.splitlines() if line.startswith("Error: ")]
        assert len(errors) == 1, shown
        assert outcome.stdout == "", shown
    after = content(folder)
    made = {path for path in after if path not in before}
    assert {path: after.get(path) for path in before} == before, "the inputs were changed"
    allowed = set() if sample.output is None or outcome.code == 2 else {sample.output}
    assert {path.parts[0] for path in made} <= allowed, sorted(made)


@pytest.mark.parametrize("name", SAMPLES)
def test_sound_files_are_read(name, sound_files, sandbox, tmp_path):
    sample = SAMPLES[name]
    lay_out(sample, sound_files, tmp_path)
    before = content(tmp_path)
    outcome = sandbox.run(*sample.arguments, folder=tmp_path)
    check(outcome, sample, before, tmp_path)
    assert outcome.code == 0, outcome.stderr


@pytest.mark.parametrize("number", range(effort.of(11, 110)))
@pytest.mark.parametrize("name", SAMPLES)
def test_damaged_files_end_in_one_sentence(name, number, sound_files, sandbox, tmp_path):
    sample = SAMPLES[name]
    lay_out(sample, sound_files, tmp_path)
    rng = np.random.default_rng([SEED, number, *name.encode()])
    damaged = tmp_path / sample.damaged
    damaged.write_bytes(mutate(damaged.read_bytes(), rng))
    before = content(tmp_path)
    check(sandbox.run(*sample.arguments, folder=tmp_path), sample, before, tmp_path)


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda mutation: mutation.__name__)
def test_every_mutation_changes_bytes(mutation):
    content = bytes(np.random.default_rng(0).integers(0, 256, 5000, dtype=np.uint8))
    changed = 0
    for seed in range(20):
        data = bytearray(content)
        mutation(data, np.random.default_rng(seed))
        changed += bytes(data) != content
    assert changed >= 15


def test_mutated_bytes_differ_and_can_be_made_again():
    for seed in range(50):
        content = b"some text that is damaged"
        first, second = (mutate(content, np.random.default_rng(seed)) for _ in range(2))
        assert first == second != content
