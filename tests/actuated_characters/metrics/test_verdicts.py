"""The verdict on a fall against a test's own eyes: height and tilt of the root, nothing else.

They see a fall where the root is lower than half of where it stands, or tilted by more than a
right angle's two thirds, for 0.3 s on end; the verdict is on the centre of mass.
"""

import math
from pathlib import Path

import numpy as np
import pybullet_data
import pytest

from lecture.framework.study import RunResult, RunSpec, plan_push
from msgs_config.arrays import FloatArray
from msgs_config.geometry import rotations
from tests.support.in_process import InProcessRunner
from tests.support.physics import character

pytestmark = pytest.mark.slow

RATE = 240
DATA = Path(pybullet_data.getDataPath())
ROBOTS = {
    "a1": "a1/a1.urdf",
    "laikago": "laikago/laikago_toes.urdf",
    "r2d2": "r2d2.urdf",
    "teddy": "teddy_large.urdf",
    "mini_cheetah": "mini_cheetah/mini_cheetah.urdf",
}
SLOW_TO_LOAD = pytest.param("mini_cheetah", marks=pytest.mark.nightly)  # for its meshes


def seen_to_fall(name: str, position: FloatArray) -> bool:
    """Whether the root of a character is low or tilted for 0.3 s, by its states (t, n)."""
    rest = np.array(character(name).rest_position)
    up = rotations.rotate(rotations.conjugate(rotations.exp(rest[3:6])), np.array((0.0, 0.0, 1.0)))
    upright = rotations.rotate(rotations.exp(position[:, 3:6]), up)[:, 2] > math.cos(math.pi / 3)
    down = ~upright | (position[:, 2] < 0.5 * rest[2])
    longest = np.diff(np.flatnonzero(np.r_[True, ~down, True])).max() - 1
    return bool(longest >= 0.3 * RATE)


def pushed(folder: Path, seed: int) -> RunResult:
    """A machine that walks as it is told, and is pushed at random."""
    rng = np.random.default_rng(seed)
    force, angle = rng.uniform(50.0, 450.0), rng.uniform(0.0, math.tau)
    vector = (force * math.cos(angle), force * math.sin(angle), 0.0)
    spec = RunSpec(
        "pushed",
        "humanoid",
        4.5,
        {"reference": "steered"},
        {"wrench_duration": 0.2},
        {"behaviour": "state_machine", "machine": "walk"},
        [plan_push(float(rng.uniform(1.0, 2.0)), RATE, "root", vector)],
        commands=f"{rng.uniform(0.0, 0.9):.2f},0,{rng.uniform(-0.3, 0.3):.2f}@0.3",
    )
    return InProcessRunner(folder).run(spec)


@pytest.mark.parametrize(
    ("seeds", "of_each"),
    [(range(6, 9), 1), pytest.param(range(24), 3, marks=pytest.mark.nightly)],
)
def test_of_pushed_machines_those_fell_that_are_seen_to(
    tmp_path: Path, seeds: range, of_each: int
) -> None:
    runs = [pushed(tmp_path, seed) for seed in seeds]

    seen = [seen_to_fall("humanoid", run.recording.position) for run in runs]
    told = [run.summary["fell"] for run in runs]
    assert told == seen
    assert of_each <= sum(seen) <= len(seeds) - of_each


@pytest.mark.parametrize("turn_deg", [0.0, 90.0])
@pytest.mark.parametrize("robot", [*list(ROBOTS)[:-1], SLOW_TO_LOAD])
def test_a_robot_fell_that_is_seen_to(tmp_path: Path, robot: str, turn_deg: float) -> None:
    """It is put down on its feet or on its side, and holds its joints."""
    name = str(DATA / ROBOTS[robot])
    start = np.array(character(name).rest_position)
    turn = rotations.exp(np.array((math.radians(turn_deg), 0.0, 0.0)))
    start[3:6] = rotations.log(rotations.multiply(turn, rotations.exp(start[3:6])))
    start[2] += 0.05 if turn_deg == 0.0 else 0.2
    simulator = {"initial_position": start.tolist()}
    controller = {"root_assistance": False}
    spec = RunSpec(robot, name, 2.5, {"reference": "hold"}, simulator, controller)

    run = InProcessRunner(tmp_path).run(spec)

    assert run.summary["fell"] is seen_to_fall(name, run.recording.position)
    assert run.summary["fell"] or turn_deg == 0.0
