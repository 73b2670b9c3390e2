"""Commands in processes beside the viewer, begun at once or made ready beforehand."""

from pathlib import Path

import pytest

from actuated_characters.viewer.controls.command_process import CommandProcess
from tests.support.ros import wait_until


def _ended(process: CommandProcess) -> CommandProcess:
    wait_until(lambda: process.has_ended, "the end of the command")
    return process


@pytest.mark.slow
@pytest.mark.parametrize("is_ready", [False, True])
def test_what_a_command_says_and_what_went_wrong_is_known_at_its_end(
    tmp_path: Path, is_ready: bool
) -> None:
    wrong = ["take", str(tmp_path / "none.yaml")]
    for arguments, error in ((["take", "bow", "--list"], ""), (wrong, "error: ")):
        process = CommandProcess(None if is_ready else arguments)
        try:
            if is_ready:
                process.begin(arguments)
            assert _ended(process).error.startswith(error)
            assert bool(process.error) == bool(error)
            assert process.lines()
        finally:
            process.cancel()


def test_one_that_was_never_begun_is_ended() -> None:
    process = CommandProcess()

    process.cancel()

    assert process.has_ended
