"""A foot that reaches, against where the law of balance puts it."""

from dataclasses import replace

import numpy as np
import pytest

from controller_node.behaviours.state_machine import laws
from controller_node.behaviours.state_machine.description import CENTRE, HIP, Placement
from controller_node.behaviours.state_machine.factory import kit_of
from controller_node.behaviours.state_machine.file import read_machine
from controller_node.behaviours.state_machine.footing import ReachingFoot
from controller_node.behaviours.state_machine.leg import FootPose
from controller_node.behaviours.state_machine.machine import MachineKit
from controller_node.behaviours.state_machine.situation import Situation, situation_of
from controller_node.references.steering.reference import Course
from msgs_config.geometry.single_rotations import Vector, subtract
from tests.support.physics import character

HUMANOID = character("humanoid")
LENGTH, GAIN, STANCE_TIME = 0.75, 0.1, 0.3
COURSE = Course(forward=0.4)


@pytest.fixture(scope="module")
def kit() -> MachineKit:
    return kit_of(read_machine("jump"), HUMANOID, 9.81, 1.0 / 240.0)


def moving(kit: MachineKit, speed: float, pitch: float = 0.0) -> Situation:
    """A body above the ground that goes ahead; with bent legs, so that it is no straight line."""
    position, velocity = np.array(HUMANOID.rest_position), np.zeros(HUMANOID.layout.size)
    position[2] += 0.3
    velocity[0], velocity[kit.legs["left"].knee_entry] = speed, pitch
    contacts = np.zeros((len(HUMANOID.links), 6))
    body = kit.reader.read(position, velocity, contacts)
    return situation_of(body, COURSE, "right", "left", 9.81)


def reached(kit: MachineKit, at: Situation, time: float, **placement: object) -> FootPose:
    law = replace(Placement(length=LENGTH, gain=GAIN, stance_time=STANCE_TIME), **placement)  # type: ignore[arg-type]
    state = replace(kit.machine.states["flight"], placement=law, duration=0.2)
    foot = at.body.feet["left"]
    return ReachingFoot.leaving(foot, at.body, hip(kit, at)).pose(state, at, time, hip(kit, at))


def hip(kit: MachineKit, at: Situation) -> Vector:
    return kit.poses.hip("left", at.body)


@pytest.mark.parametrize("origin", [HIP, CENTRE])
def test_it_goes_ahead_as_raibert_says_of_its_hip_or_of_the_centre_of_mass(
    kit: MachineKit, origin: str
) -> None:
    at = moving(kit, 1.0)

    pose = reached(kit, at, 0.2, origin=origin, ahead=0.02, width=0.2)

    ahead = 0.02 + laws.neutral_placement(1.0, 0.4, STANCE_TIME, GAIN)
    base = hip(kit, at) if origin == HIP else at.body.centre
    x, y, _ = subtract(pose.sole, base)
    assert x == pytest.approx(ahead, abs=1e-9)
    assert y == pytest.approx(0.0 if origin == HIP else 0.1, abs=1e-9)
    assert hip(kit, at)[2] - pose.sole[2] == pytest.approx(LENGTH, abs=1e-9)


def test_it_sets_out_from_where_it_is_and_carries_on_as_it_moved(kit: MachineKit) -> None:
    at = moving(kit, 0.0, pitch=2.0)  # rad/s of the knee
    foot, step = at.body.feet["left"], 1e-4

    for carry in (0.0, 1.0):
        now, later = (reached(kit, at, time, carry=carry, clearance=0.0) for time in (0.0, step))
        speed = [(b - a) / step for a, b in zip(now.sole, later.sole, strict=True)]

        assert now.sole == pytest.approx(foot.sole, abs=1e-9)
        assert speed == pytest.approx([carry * value for value in foot.velocity], abs=1e-2)
    assert max(abs(value) for value in foot.velocity) > 0.3


def test_a_foot_that_retracts_lands_at_the_speed_of_the_ground(kit: MachineKit) -> None:
    at, step = moving(kit, 1.0), 1e-5
    here, later = (
        reached(kit, at, time, retract=1.0, clearance=0.0) for time in (0.2 - step, 0.2 + step)
    )
    fixed = reached(kit, at, 0.2, retract=0.0)

    assert here.sole == pytest.approx(fixed.sole, abs=1e-4)
    assert (later.sole[0] - here.sole[0]) / (2.0 * step) == pytest.approx(-1.0, abs=1e-2)
