from killed_sweeps import kill_and_resume


def test_a_sweep_killed_at_ten_random_moments_resumes_to_the_same_store(tmp_path):
    at_kill, resumed, uninterrupted = kill_and_resume(tmp_path, 10, sides=5)
    assert len(at_kill) == 10
    assert len(uninterrupted) == 30
    assert resumed == uninterrupted
    assert at_kill == sorted(at_kill)  # nothing that was stored is ever lost
    assert 0 < at_kill[-1] < 30  # it was killed in mid-run
