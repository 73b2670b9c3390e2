"""A run that is watched has the states of one that is not, and a killed viewer does not end it."""

import json
import os
import signal
import socket
from pathlib import Path

import pytest

from actuated_characters.recorder.run_directory import prepare_directory
from actuated_characters.runs.execution import run_over_topics
from actuated_characters.runs.in_process import run_in_process
from actuated_characters.runs.plan import RunPlan, make_plan
from actuated_characters.viewer.web.server import open_socket
from tests.support.page_client import PageClient
from tests.support.ros import Processes, wait_until
from tests.support.runs import Run, summary_of

pytestmark = [pytest.mark.slow, pytest.mark.sharing]

DURATION, PACE = 3.0, 0.5  # s; so much slower than real time that a page comes in time
LEAST_PICTURES = 20
OTHER_ADDRESS = "127.0.0.2"


@pytest.fixture(scope="module")
def plan() -> RunPlan:
    reference = {"reference": "clip", "clip": "walk"}
    return make_plan("humanoid", DURATION, reference, {"real_time_factor": PACE}, {})


def free_port() -> int:
    with open_socket("127.0.0.1", 0) as free:
        return int(free.getsockname()[1])


def test_a_run_that_is_watched_has_the_state_hash_of_one_that_is_not(
    domain: int, plan: RunPlan, tmp_path: Path
) -> None:
    del domain
    watched, unseen, port = tmp_path / "watched", tmp_path / "unseen", free_port()
    for directory in (watched, unseen):
        prepare_directory(directory, overwrite=False)
    with PageClient(port) as page:
        run_over_topics(plan, watched, write_bag=False, viewer={"port": port})
    unwatched = make_plan("humanoid", DURATION, {"reference": "clip", "clip": "walk"}, {}, {})
    run_in_process(unwatched, unseen)

    assert page.pictures > LEAST_PICTURES
    summary = summary_of(watched)
    assert summary["state_hash"] == json.loads((unseen / "summary.json").read_text())["state_hash"]
    assert summary["missing_ticks"] == 0
    assert "Traceback" not in (watched / "logs" / "viewer.log").read_text()


@pytest.mark.nightly
def test_a_run_goes_on_when_its_viewer_is_killed(processes: Processes, tmp_path: Path) -> None:
    run = Run(
        processes,
        *(
            "run",
            "--character",
            "pendulum",
            "--duration",
            "4",
            "--view",
            "--port",
            str(free_port()),
        ),
        *("--no-record", "--output", str(tmp_path / "run")),
    )
    wait_until(lambda: "watch it at http://127.0.0.1:" in run.process.stdout, "the page")

    viewer = run.pid_of("actuated_characters.viewer.main")
    os.kill(viewer, signal.SIGKILL)

    run.finish()
    assert "the run goes on unseen; viewer failed: killed by SIGKILL" in run.process.stdout
    assert not run.family


@pytest.mark.nightly
def test_a_port_in_use_does_not_end_the_run(processes: Processes, tmp_path: Path) -> None:
    with open_socket("127.0.0.1", 0) as taken:
        port = taken.getsockname()[1]
        run = Run(
            processes,
            *("run", "--character", "pendulum", "--duration", "4", "--view", "--port", str(port)),
            *("--no-record", "--output", str(tmp_path / "run")),
        ).finish()

    assert f"the run goes on unseen; viewer failed: cannot listen on 127.0.0.1, port {port}" in (
        run.process.stdout
    )


def test_in_one_process_there_is_nothing_to_view(processes: Processes) -> None:
    command = processes.command("run", "--in-process", "--view")

    assert command.wait() == 1
    assert command.stderr == "error: --view shows what is on ROS' topics; --in-process has none\n"


def test_the_command_ends_with_the_signal_and_says_where_it_listens(processes: Processes) -> None:
    command = processes.command("view", "--port", str(free_port()))
    wait_until(lambda: command.stdout.startswith("http://127.0.0.1:"), "the page")

    assert command.end(signal.SIGINT) == 0
    assert "warning" not in command.stderr.lower()


def test_a_host_that_others_can_reach_is_warned_of(processes: Processes) -> None:
    alone, open_to_all = free_port(), free_port()
    watched = processes.command("view", "--port", str(alone))
    command = processes.command("view", "--host", "0.0.0.0", "--port", str(open_to_all))

    wait_until(lambda: watched.stdout and command.stdout, "the pages")
    warning = f"listening on 0.0.0.0: all who reach port {open_to_all}"
    wait_until(lambda: warning in command.stderr, "a warning")

    # another address of this machine stands for what others reach
    with socket.create_connection((OTHER_ADDRESS, open_to_all), timeout=10.0):
        pass
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((OTHER_ADDRESS, alone), timeout=10.0)


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("--port", "70000"), "port"),
        (("--fps", "0"), "fps"),
        (("--host", "192.0.2.1"), "cannot listen on 192.0.2.1"),
        (("--namespace", "a b"), "a b"),
    ],
)
def test_a_wrong_option_is_one_clear_line(
    processes: Processes, arguments: tuple[str, str], line: str
) -> None:
    command = processes.command("view", *arguments)

    assert command.wait() == 1
    assert command.stderr.startswith("error: ")
    assert len(command.stderr.splitlines()) == 1
    assert line in command.stderr
