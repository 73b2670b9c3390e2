"""A foot that reaches, against where the law of balance puts it."""

from dataclasses import replace

import numpy as np
import pytest

from controller_node.behaviours.state_machine import laws
from controller_node.behaviours.state_machine.description import CENTRE, HIP, FootPlacement
from controller_node.behaviours.state_machine.factory import kit_of
from controller_node.behaviours.state_machine.file import read_machine
from controller_node.behaviours.state_machine.legs.footing import ReachingFoot, origin_of
from controller_node.behaviours.state_machine.legs.leg import FootPose
from controller_node.behaviours.state_machine.machine import MachineKit
from controller_node.behaviours.state_machine.situation import Situation, situation_of
from controller_node.references.steering.course import Course
from msgs_config.geometry.scalars import Vector, subtract
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


def reached(
    kit: MachineKit, at: Situation, time: float, later: float = 0.0, **placement: object
) -> FootPose:
    law = replace(FootPlacement(length=LENGTH, gain=GAIN, stance_time=STANCE_TIME), **placement)  # type: ignore[arg-type]
    state = replace(kit.machine.states["flight"], placement=law, duration=0.2)
    origin = origin_of(law, at, kit.legs["left"])
    foot = ReachingFoot.leaving(at.body.feet["left"], origin)
    return foot.pose(state, at, time, origin, later)


def hip(kit: MachineKit, at: Situation) -> Vector:
    return kit.legs["left"].hip(at.body.root, at.body.root_xyzw)


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


def velocity_of(kit: MachineKit, at: Situation, time: float, **placement: object) -> list[float]:
    """The velocity of the foot in the world, m/s, where the body moves on as it does."""
    step = 1e-5
    now, later = (reached(kit, at, time, ahead, **placement) for ahead in (-step, step))
    return [(b - a) / (2.0 * step) for a, b in zip(now.sole, later.sole, strict=True)]


def test_it_sets_out_from_where_it_is_and_carries_on_as_it_moved(kit: MachineKit) -> None:
    at = moving(kit, 0.5, pitch=2.0)  # m/s; rad/s of the knee
    foot = at.body.feet["left"]

    assert reached(kit, at, 0.0).sole == pytest.approx(foot.sole, abs=1e-9)
    for carry, velocity in ((0.0, (0.5, 0.0, 0.0)), (1.0, foot.velocity)):
        start = velocity_of(kit, at, 1e-5, carry=carry, clearance=0.0)
        assert start == pytest.approx(velocity, abs=1e-2)
    assert abs(foot.velocity[0] - 0.5) > 0.3


def test_a_foot_that_retracts_lands_at_the_speed_of_the_ground(kit: MachineKit) -> None:
    at = moving(kit, 1.0)

    landed = velocity_of(kit, at, 0.2, retract=1.0, clearance=0.0, descent=0.0)

    assert landed == pytest.approx((0.0, 0.0, 0.0), abs=1e-2)
    here, fixed = (reached(kit, at, 0.2, retract=share) for share in (1.0, 0.0))
    assert here.sole == pytest.approx(fixed.sole, abs=1e-4)


def test_a_foot_that_has_not_landed_in_time_descends(kit: MachineKit) -> None:
    at = moving(kit, 0.0)

    landed, later = (reached(kit, at, time, descent=0.5) for time in (0.2, 0.3))

    assert landed.sole[2] - later.sole[2] == pytest.approx(0.05)
