"""Runs of a Panda that a played controller manager moves, in lockstep.

python -m tests.support.ros2_control_run --runs 20     # one state_hash, beside whatever load
"""

import argparse
import json
import os
import sys
import tempfile
import time
from contextlib import redirect_stdout
from pathlib import Path

from actuated_characters.runs.ros_domain import own_domain
from tests.support.ros import RANGE, Processes

UPDATE_RATE, START = 250, 3.0  # Hz; s on the manager's clock at which the world begins
MOTION_START = START + 0.1
_RATE, _LONGEST = 1000, 300.0  # Hz; s of wall time


def state_hash(
    processes: Processes, folder: Path, *, ticks: int = 400, active_after: float = 0.5
) -> str:
    """The hash of all states; the manager's controller becomes active after so many s (wall)."""
    character = {"character": "franka_panda", "rate": _RATE}
    recording = folder / "recording"
    recorder = processes.node("recorder", directory=str(recording), write_bag=False)
    processes.node("ros2_control_bridge", update_rate=UPDATE_RATE, start_time=START, **character)
    here = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
    manager = processes.python(
        *("-m", "tests.support.played_manager"),
        *(str(UPDATE_RATE), str(MOTION_START), str(active_after)),
        environment=here,
    )
    given = character | {"max_ticks": ticks, "wait_for_subscribers": 2}
    simulator = processes.python(
        *("-m", "sim_node.main", "--ros-args", "-r", "/clock:=sim_clock"),
        *("-p", "ros2_control:=['position']"),
        *(word for name, value in given.items() for word in ("-p", f"{name}:={value}")),
        environment=here,
    )
    assert simulator.wait(_LONGEST) == 0, simulator.stderr
    assert recorder.end() == 0, recorder.stderr
    assert manager.exit_code is None, manager.stderr
    summary = json.loads((recording / "summary.json").read_text())
    assert summary["ticks"] == ticks
    return str(summary["state_hash"])


def main() -> int:
    """Run so many times; whether all had one hash."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=20)
    runs, found = parser.parse_args().runs, set[str]()
    for number in range(runs):
        with own_domain() as domain, tempfile.TemporaryDirectory() as folder:
            os.environ |= {"ROS_DOMAIN_ID": str(domain), RANGE: "LOCALHOST"}
            processes = Processes(Path(folder))
            try:
                found.add(
                    own := state_hash(processes, Path(folder), active_after=0.2 + 0.07 * number)
                )
            finally:
                with redirect_stdout(sys.stderr):  # it says what the processes said
                    processes.end()
        print(f"{time.strftime('%X')}  load {os.getloadavg()[0]:.1f}  {own}", flush=True)
    print(f"{runs} runs, {len(found)} hash{'es' * (len(found) != 1)}")
    return int(len(found) != 1)


if __name__ == "__main__":
    sys.exit(main())
