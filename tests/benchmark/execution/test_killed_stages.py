"""One kill at stages that write files and stores; ten at each of seven stages in the nightly job."""

import pytest
from harness.effort import of
from harness.killed_stages import kill_stage


@pytest.mark.slow
@pytest.mark.parametrize("stage", ["import", "run"])
def test_a_killed_command_leaves_nothing_partial_and_gives_the_same_when_called_again(stage, tmp_path):
    result = kill_stage(stage, tmp_path, of(1, 10))
    assert result.kills == of(1, 10)
    assert result.partial == 0
    assert result.same
