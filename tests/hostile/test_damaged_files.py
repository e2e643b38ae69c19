"""Damaged files end in one sentence: no traceback, no hang, no partial output, bounded memory."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from harness import effort

from hostile.checks import check, content
from hostile.mutations import MUTATIONS, mutate
from hostile.samples import SAMPLES

#: Another number here gives other damage.
SEED = int(os.environ.get("ROOFBENCH_SEED", "0"))


def lay_out(sample, sound_files, folder):
    """Copy what a sample needs."""
    for name in {*sample.beside, Path(sample.damaged).parts[0]}:
        if (sound_files / name).is_dir():
            shutil.copytree(sound_files / name, folder / name, dirs_exist_ok=True)
        else:
            shutil.copy(sound_files / name, folder / name)


@pytest.mark.parametrize("name", SAMPLES)
def test_sound_files_are_read(name, sound_files, sandbox, tmp_path):
    sample = SAMPLES[name]
    lay_out(sample, sound_files, tmp_path)
    before = content(tmp_path)
    outcome = sandbox.run(*sample.arguments, folder=tmp_path)
    check(outcome, before, tmp_path, sample.output)
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
    outcome = sandbox.run(*sample.arguments, folder=tmp_path)
    check(outcome, before, tmp_path, sample.output, checks=sample.checks)


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
