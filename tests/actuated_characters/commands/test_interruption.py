"""A signal that the import of a module has swallowed ends the command all the same."""

import signal
from pathlib import Path

import pytest

from tests.support.ros import Processes

SWALLOWS = """
import signal, sys

from actuated_characters import cli
from msgs_config.character import loading

load = loading.load_character

def load_amid_a_signal(*given):
    try:
        signal.raise_signal(int(sys.argv[-1]))
    except BaseException:  # as an extension may do
        pass
    return load(*given)

loading.load_character = load_amid_a_signal
sys.exit(cli.main(sys.argv[1:-1]))
"""


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_was_swallowed_ends_the_run_before_it_begins(
    processes: Processes, tmp_path: Path, number: signal.Signals
) -> None:
    (tmp_path / "swallows.py").write_text(SWALLOWS)

    run = processes.python(
        *("swallows.py", "run", "--character", "pendulum", "--duration", "1e6"),
        *("--output", "run", str(int(number))),
    )

    assert run.wait() == 130
    assert "interrupted" in run.stderr
    assert "Traceback" not in run.stderr
