"""A controller in C on another DDS, built and run as its page says, has the same states."""

import json
import math
import os
import re
import shutil
import signal
import socket
import subprocess
from pathlib import Path

import numpy as np
import pytest

import actuated_characters as ac
from msgs_config.messages import topics
from tests.support.ros import Processes

ROOT = Path(__file__).parents[2]
EXAMPLE, PAGE = ROOT / "examples" / "without_rclpy", ROOT / "docs" / "without_rclpy.md"
TICKS = 480
HAS_CYCLONE = bool(shutil.which("idlc") and shutil.which("cc")) and any(
    Path(prefix, "dds", "dds.h").is_file() for prefix in ("/usr/include", "/usr/local/include")
)

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not HAS_CYCLONE, reason="cyclonedds-dev and cyclonedds-tools are needed"),
]


def commands() -> list[str]:
    """The page's lines that build the controller."""
    (block,) = re.findall(r"```sh\n(.*?)```", PAGE.read_text("utf-8"), flags=re.DOTALL)
    return [line for line in block.splitlines() if line.startswith(("idlc", "cc "))]


@pytest.fixture
def controller(tmp_path: Path) -> Path:
    """The program, built by the page's lines."""
    folder = tmp_path / "build" / "without_rclpy"
    folder.mkdir(parents=True)
    shutil.copytree(EXAMPLE, tmp_path / "examples" / "without_rclpy")
    for command in commands():
        subprocess.run(command.split(), cwd=folder, check=True, timeout=120)
    return folder / "pd_controller"


def environment(folder: Path) -> dict[str, str]:
    """That of the page, with the names of this machine's interfaces."""
    text = (EXAMPLE / "cyclonedds.xml").read_text("utf-8")
    up = [name for _, name in socket.if_nameindex() if _is_up(name) and name != "lo"]
    line = '        <NetworkInterface name="eth0"/>\n'
    assert text.count(line) == 1
    settings = folder / "cyclonedds.xml"
    settings.write_text(text.replace(line, "".join(line.replace("eth0", name) for name in up[:1])))
    return {**os.environ, "CYCLONEDDS_URI": settings.as_uri()}


def _is_up(name: str) -> bool:
    return Path("/sys/class/net", name, "operstate").read_text().strip() == "up"


def test_a_controller_in_c_has_the_states_of_its_law_to_the_last_bit(
    controller: Path, processes: Processes, tmp_path: Path
) -> None:
    directory = tmp_path / "recording"
    recorder = processes.node(topics.RECORDER_NODE, directory=str(directory))
    answers = subprocess.Popen([controller], env=environment(tmp_path))
    try:
        simulator = processes.simulator("pendulum", max_ticks=TICKS, wait_for_subscribers=2)
        assert simulator.wait() == 0, simulator.stderr
    finally:
        answers.terminate()
        answers.wait(10)
    assert recorder.end(signal.SIGINT) == 0, recorder.stderr
    summary = json.loads((directory / "summary.json").read_text("utf-8"))

    with ac.Simulation(ac.load_character("pendulum")) as simulation:
        for _ in range(TICKS):
            (q,), (v,) = simulation.state.position, simulation.state.velocity
            weight = 1.0 * 9.81 * 0.5 * math.sin(q)
            simulation.step(np.array([50.0 * (1.0 - q) - 5.0 * v + weight]))
        assert summary["state_hash"] == simulation.state_hash
        assert simulation.state.position[0] == pytest.approx(1.0, abs=0.05)
