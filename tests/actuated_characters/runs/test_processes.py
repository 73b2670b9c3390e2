"""What is told of a child process that fails, and of one that waits for something."""

import signal
from pathlib import Path

import pytest

from actuated_characters.runs.execution import wait_for_end
from actuated_characters.runs.processes import Child
from tests.support.ros import wait_until

WAITS = "[WARN] [1795640914.507989722] [sim_node]: waiting for 2 subscribers of joint_states"


def child(folder: Path, name: str, code: str) -> Child:
    return Child(["-c", code], folder / f"{name}.log")


def ended(folder: Path, code: str) -> Child:
    process = child(folder, "node", code)
    process.end()
    return process


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_the_last_lines_of_either_stream_are_the_reason_where_there_is_no_error(
    stream: str, tmp_path: Path
) -> None:
    lines = r"first\n\nCalculated port number is too high\nsee the manual\nI give up\n"

    process = ended(tmp_path, f"import sys; sys.{stream}.write('{lines}'); sys.exit(3)")

    words = "Calculated port number is too high | see the manual | I give up"
    assert process.last_words() == words


def test_an_error_of_the_node_s_own_comes_before_all_else(tmp_path: Path) -> None:
    code = r"import sys; print('noise'); sys.stderr.write('error: no such clip\nmore\n'); exit(1)"

    assert ended(tmp_path, code).last_words() == "no such clip"


def test_progress_is_no_reason(tmp_path: Path) -> None:
    process = ended(tmp_path, r"print('tick 12\nflushed 11\nstate 3'); exit(4)")

    assert process.last_words() == "exit code 4; it printed nothing"


def test_of_a_process_that_was_killed_the_signal_and_the_last_lines_are_told(
    tmp_path: Path,
) -> None:
    code = "import os, signal; print('heap is corrupt', flush=True); os.kill(os.getpid(), {})"

    process = ended(tmp_path, code.format(int(signal.SIGABRT)))

    assert process.last_words() == "killed by SIGABRT; its last output: heap is corrupt"
    assert ended(tmp_path, "import os; os.kill(os.getpid(), 9)").last_words() == "killed by SIGKILL"


@pytest.mark.slow
def test_what_a_node_waits_for_is_shown_once_while_no_tick_comes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    warn = f"import sys, time; sys.stderr.write({WAITS + chr(10)!r} * 3); time.sleep(12)"
    simulator = child(tmp_path, "sim_node", warn)
    recorder = child(tmp_path, "recorder", "import time; print('tick 0'); time.sleep(60)")
    try:
        wait_for_end(simulator, [recorder], lambda ticks: None)
    finally:
        recorder.end(signal.SIGTERM)

    told = capsys.readouterr().out.splitlines()
    assert told == ["sim_node: waiting for 2 subscribers of joint_states"]


DEAF_ONCE = """
import signal, sys, time
came = []
signal.signal(signal.SIGINT, lambda number, frame: came.append(number))
print("ready", flush=True)
while len(came) < 2:
    time.sleep(0.01)
"""


def test_a_signal_that_a_child_has_not_taken_is_sent_again(tmp_path: Path) -> None:
    process = child(tmp_path, "deaf", DEAF_ONCE)
    try:
        wait_until(process.read_lines, "it has a handler")
        assert process.end(signal.SIGINT, patience=30.0) == 0
    finally:
        process.end(signal.SIGKILL)
