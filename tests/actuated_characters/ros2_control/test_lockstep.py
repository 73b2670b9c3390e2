"""A controller manager, played by a process that behaves as one, in lockstep with a simulator."""

from pathlib import Path

import pytest

from tests.support.ros import Processes
from tests.support.ros2_control_run import state_hash


@pytest.mark.slow
def test_the_states_do_not_depend_on_when_its_controllers_become_active(
    domain: int, tmp_path: Path
) -> None:
    del domain
    found = set()
    for number, active_after in enumerate((0.2, 1.1)):
        folder = tmp_path / str(number)
        folder.mkdir()
        processes = Processes(folder)
        try:
            found.add(state_hash(processes, folder, active_after=active_after))
        finally:
            processes.end()

    assert len(found) == 1
