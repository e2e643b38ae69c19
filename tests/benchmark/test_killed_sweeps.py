from killed_sweeps import kill_and_resume


def test_a_sweep_killed_at_random_moments_resumes_to_the_same_store(tmp_path):
    at_kill, resumed, uninterrupted = kill_and_resume(tmp_path, 2, sides=2)
    assert len(uninterrupted) == 12
    assert resumed == uninterrupted
    assert at_kill == sorted(at_kill)  # nothing that was stored is ever lost
    assert at_kill[-1] > 0
