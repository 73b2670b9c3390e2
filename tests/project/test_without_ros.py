"""An environment without the extra `wheels`, so without rclpy and any message of ROS."""

import json
import os
import subprocess
import sys
import sysconfig
import urllib.request
from collections.abc import Iterator
from importlib.metadata import distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
MAIN = "import sys; from actuated_characters.cli import main"
COMMANDS = f"""
{MAIN}
from actuated_characters.runs.plan import make_plan
import actuated_characters as ac
pushed = ["--clip", "walk", "--duration", "0.5", "--push", "chest:100,0,0@0.1", "--sensor", "all"]
for command in (
    ["run", *pushed, "--in-process", "--output", "run"],
    ["replay", "run"],
    ["fork", "run", "--at", "0.3", "--output", "fork"],
    ["compare", "run", "fork"],
    ["info", "run", "--ticks"],
    ["report", "run"],
    ["export", "run", "--output", "table.csv"],
):
    assert main(command) == 0, command
ac.run("pendulum", 0.2, output="api", in_process=True)
simulation = ac.Simulation(ac.load_character("pendulum"))
assert not any(name in sys.modules for name in ("rclpy", "std_msgs", "sensor_msgs"))
"""


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Variables with which Python has this package and all others that are installed but ROS'."""
    folder = tmp_path_factory.mktemp("packages")
    of_ros = {
        Path(file).parts[0]
        for each in distributions()
        if each.metadata["Name"].startswith("ros-")
        for file in each.files or ()
    }
    for path in Path(sysconfig.get_paths()["purelib"]).iterdir():
        if path.name not in of_ros:
            (folder / path.name).symlink_to(path)
    assert not (folder / "rclpy").exists()
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return {**kept, "PYTHONPATH": f"{folder}{os.pathsep}{ROOT}"}


def start(environment: dict[str, str], folder: Path, *arguments: str) -> "subprocess.Popen[str]":
    # -S: without the packages of the environment that the tests run in
    return subprocess.Popen(
        [sys._base_executable, "-S", *arguments],  # type: ignore[attr-defined]
        cwd=folder,
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


@pytest.mark.slow
def test_a_run_in_one_process_and_what_is_made_of_it_need_no_ros(
    environment: dict[str, str], tmp_path: Path
) -> None:
    _, errors = (process := start(environment, tmp_path, "-c", COMMANDS)).communicate(timeout=120)

    assert process.returncode == 0, errors
    hashes = [
        json.loads((tmp_path / name / "summary.json").read_text())["state_hash"]
        for name in ("run", "fork")
    ]
    assert hashes[0] == hashes[1]


@pytest.fixture
def viewed(environment: dict[str, str], tmp_path: Path) -> Iterator["subprocess.Popen[str]"]:
    """`view RUN` of a short run."""
    pytest.importorskip("viser")
    arguments = ["--character", "pendulum", "--duration", "0.1", "--in-process", "--output", "run"]
    command = f"{MAIN}; sys.exit(main(sys.argv[1:]))"
    assert start(environment, tmp_path, "-c", command, "run", *arguments).wait(60) == 0
    process = start(environment, tmp_path, "-c", command, "view", "run")
    yield process
    process.terminate()
    process.communicate(timeout=20)


@pytest.mark.slow
def test_a_recording_is_viewed(viewed: "subprocess.Popen[str]") -> None:
    assert viewed.stdout is not None
    address = next(line for line in viewed.stdout if "http://" in line).split()[-1]

    with urllib.request.urlopen(address, timeout=20) as page:
        assert page.status == 200


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (["-m", "sim_node.main"], "a node needs"),
        (["-c", f"{MAIN}; main(['run', '--clip', 'walk'])"], "a run over topics"),
    ],
)
def test_what_needs_ros_says_so_in_a_line(
    environment: dict[str, str], tmp_path: Path, arguments: list[str], what: str
) -> None:
    _, errors = start(environment, tmp_path, *arguments).communicate(timeout=60)

    (line,) = errors.splitlines()
    assert line.startswith(f"error: {what}")
    assert "needs the extra 'wheels' (rclpy is not installed)" in line
