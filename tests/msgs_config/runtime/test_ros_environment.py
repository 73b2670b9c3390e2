"""The variables by which ROS nodes find each other: one line where they cannot be used."""

import os
from pathlib import Path

import pytest

from actuated_characters.cli import main
from actuated_characters.runs.processes import MODULES
from msgs_config.errors import ConfigurationError
from msgs_config.runtime.ros_environment import check_domain_id
from tests.support.ros import Processes
from tests.support.runs import Run

NO_DOMAINS = ["500", "233", "-1", "lab", "1.5", "0x10", "007", " 5", "5 ", "٣", "9" * 5000]


@pytest.mark.parametrize("text", ["", "0", "7", "101", "232"])
def test_every_domain_that_has_ports_is_taken(text: str) -> None:
    check_domain_id({"ROS_DOMAIN_ID": text})
    check_domain_id({})


@pytest.mark.parametrize("text", NO_DOMAINS, ids=lambda text: text[:8])
def test_a_domain_that_is_none_is_one_line_with_the_bounds(text: str) -> None:
    with pytest.raises(ConfigurationError, match=r"^ROS_DOMAIN_ID is .*, 0 to 232$") as caught:
        check_domain_id({"ROS_DOMAIN_ID": text})

    assert len(str(caught.value)) < 200


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "--character", "pendulum", "--output", "results"),
        ("run", "--character", "pendulum", "--composed", "--view", "--output", "results"),
        ("play", "--no-view", "--output", "results"),
        ("view",),
        ("fork", "results", "--at", "1"),
        ("replay", "results", "--through-topics", "simulator"),
        ("study", "lift", "--output", "results"),
    ],
    ids=" ".join,
)
def test_no_command_begins_anything_in_a_domain_that_is_none(
    arguments: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("ROS_DOMAIN_ID", "500")

    assert main(arguments) == 1

    output = capsys.readouterr()
    assert output.err == "error: ROS_DOMAIN_ID is '500'; it must be a whole number, 0 to 232\n"
    assert output.out == ""
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(MODULES))
def test_no_node_starts_in_a_domain_that_is_none(
    name: str, processes: Processes, tmp_path: Path
) -> None:
    place = ["simulator"] if name == "player" else []
    process = processes.python(
        "-m", MODULES[name], *place, environment={**os.environ, "ROS_DOMAIN_ID": "-1"}
    )

    assert process.wait() == 1

    assert "error: ROS_DOMAIN_ID is '-1'; it must be a whole number, 0 to 232" in process.stderr
    assert "Traceback" not in process.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        pytest.param((), id="processes"),
        pytest.param(("--composed",), id="composed", marks=pytest.mark.nightly),
    ],
)
def test_a_run_s_own_processes_find_each_other_though_discovery_is_off(
    options: tuple[str, ...], processes: Processes, tmp_path: Path
) -> None:
    short = ("run", "--character", "pendulum", "--duration", "0.1", "--no-record")

    run = Run(
        processes,
        *short,
        *options,
        "--output",
        str(tmp_path / "run"),
        ROS_AUTOMATIC_DISCOVERY_RANGE="OFF",
    ).finish()

    told = "ROS_AUTOMATIC_DISCOVERY_RANGE is OFF; the processes of this run have LOCALHOST"
    assert told in run.process.stdout.splitlines()


@pytest.mark.slow
def test_a_node_that_nobody_can_find_says_so(processes: Processes) -> None:
    process = processes.python(
        "-m",
        MODULES["sim_node"],
        *("--ros-args", "-p", "character:=nobody"),
        environment={**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"},
    )
    process.wait()

    warning = "warning: ROS_AUTOMATIC_DISCOVERY_RANGE is OFF: no node of another process can find"
    assert warning in process.stderr
