import pytest
from harness.killed_sweeps import kill_and_resume


@pytest.mark.slow
def test_a_sweep_killed_at_ten_random_moments_resumes_to_the_same_store(tmp_path):
    at_kill, resumed, uninterrupted = kill_and_resume(tmp_path, 10, sides=10)
    assert len(at_kill) == 10
    assert len(uninterrupted) == 60
    assert resumed == uninterrupted
    assert at_kill == sorted(at_kill)  # nothing that was stored is ever lost
    assert at_kill[-1] > 0
    assert at_kill[-2] < 60  # it was killed in mid-run, not when all was done
