"""Velocities over `cmd_vel` and `cmd_vel_stamped`: when they begin, and what is refused."""

import math
from collections.abc import Iterator

import numpy as np
import pytest
from geometry_msgs.msg import Twist, TwistStamped
from sensor_msgs.msg import JointState

from controller_node.parameters import PARAMETERS
from controller_node.references.factory import make_motion
from controller_node.references.steering.reference import SteeredReference
from controller_node.references.steering.velocity import VelocityCommand
from msgs_config.messages import topics
from msgs_config.messages.cdr import split_stamp
from msgs_config.messages.clock import TickClock
from msgs_config.parameters import resolve
from tests.support.physics import character
from tests.support.ros import ControllerClient, Process, Processes, joint_state, stamp_ns

CLOCK = TickClock(240)
HUMANOID = character("humanoid")
STEERED = {"reference": "steered", "steering.timeout": 0.5}
AS_PARAMETERS = {name.replace(".", "__"): value for name, value in STEERED.items()}


def twist(forward: float, turn: float = 0.0) -> Twist:
    message = Twist()
    message.linear.x, message.angular.z = forward, turn
    return message


def stamped(velocity: Twist, tick: int) -> TwistStamped:
    message = TwistStamped(twist=velocity)
    message.header.stamp.sec, message.header.stamp.nanosec = split_stamp(CLOCK.stamp_ns(tick))
    return message


class Walker:
    """A controller that is given the state of each tick, and velocities."""

    def __init__(self, client: ControllerClient, node: Process) -> None:
        self._client, self.node = client, node
        self.active = client.listen(topics.ACTIVE_CMD_VEL.of(topics.CONTROLLER_NODE))
        self.unstamped = client.speak(topics.CMD_VEL)
        self.stamped = client.speak(topics.CMD_VEL_STAMPED)
        for each in (self.unstamped, self.stamped):
            client.spin_until(each.get_subscription_count, "a subscriber")
        self.tick = 0

    def next(self) -> JointState:
        """The reference at the next tick."""
        self.tick += 1
        rest, names = HUMANOID.rest_position, HUMANOID.layout.dof_names
        effort = [0.0] * len(names) if self.tick > 1 else []
        state = joint_state(
            CLOCK.stamp_ns(self.tick), names, list(rest), [0.0] * len(names), effort
        )
        self._client.ask(state)
        return self._client.reference(state)

    def take(self) -> int:
        """Go on from tick to tick until a velocity is taken; its first tick."""
        before = len(self.active)
        for _ in range(500):
            self.next()
            if len(self.active) > before:
                return CLOCK.tick(stamp_ns(self.active.last))
        raise AssertionError("it was not taken within 500 ticks")


@pytest.fixture
def walker(processes: Processes, simulator: ControllerClient) -> Iterator[Walker]:
    node = processes.controller("humanoid", **AS_PARAMETERS)
    driver = Walker(simulator, node)
    driver.next()
    yield driver


def expected(tick: int, velocity: VelocityCommand) -> list[float]:
    """The reference's position at a tick."""
    made = make_motion(HUMANOID, resolve(PARAMETERS, {**STEERED, "rate": 240})).reference
    assert isinstance(made, SteeredReference)
    steered = made.steered(velocity, 0).reference
    position: list[float] = steered.sample((tick - 1) / 240).configuration.position.tolist()
    return position


def test_a_velocity_without_a_stamp_acts_from_the_next_state_on_which_is_published(
    walker: Walker,
) -> None:
    walker.unstamped.publish(twist(0.8, 0.4))
    begins = walker.take()

    taken = walker.active.last.twist
    assert (taken.linear.x, taken.linear.y, taken.angular.z) == (0.8, 0.0, 0.4)
    assert begins <= walker.tick
    for _ in range(30):
        reference = walker.next()
        found = expected(walker.tick, VelocityCommand(begins - 1, 0.8, 0.0, 0.4))
        assert list(reference.position) == found


def test_a_stamped_velocity_acts_from_its_tick_on(walker: Walker) -> None:
    still = list(walker.next().position)
    walker.stamped.publish(stamped(twist(0.8), 300))
    assert walker.take() == 300

    while walker.tick < 300:
        assert list(walker.next().position) == still
    # ahead at 1.3 m/s^2 for 60 ticks of 1/240 s; the root sways on its way
    for _ in range(60):
        reference = walker.next()
    assert reference.position[0] == pytest.approx(0.5 * 1.3 * 0.25**2, abs=0.03)
    assert list(reference.position) == expected(360, VelocityCommand(299, 0.8))


def test_velocities_beyond_the_limits_are_clamped_and_published_so(walker: Walker) -> None:
    walker.unstamped.publish(twist(50.0, -50.0))
    walker.take()

    taken = walker.active.last.twist
    assert (taken.linear.x, taken.angular.z) == (2.5, -1.0)
    walker.unstamped.publish(twist(60.0))
    walker.take()
    lines = [line for line in walker.node.stderr.splitlines() if "is more than it can" in line]
    assert (
        len(lines) == 1 and "50, 0, -50 is more than it can, and is taken as 2.5, 0, -1" in lines[0]
    )


def test_a_velocity_that_is_not_finite_is_refused_and_changes_nothing(
    walker: Walker,
) -> None:
    still = list(walker.next().position)
    walker.unstamped.publish(twist(math.nan))
    walker.stamped.publish(stamped(twist(0.5), 1))  # over
    walker.stamped.publish(stamped(twist(0.0), 200))  # after them, and a stop

    assert walker.take() == 200
    assert len(walker.active) == 1
    assert np.array_equal(list(walker.next().position), still)
    lines = walker.node.stderr
    assert "refused cmd_vel: the velocity is nan, 0 m/s" in lines
    assert "which is over" in lines
