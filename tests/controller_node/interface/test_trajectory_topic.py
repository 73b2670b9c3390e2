"""Trajectories over `~/joint_trajectory`: when they begin, what they lead to, what is refused."""

from collections.abc import Iterator, Sequence

import numpy as np
import pytest
from builtin_interfaces.msg import Duration
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from controller_node.references.hold import HoldReference
from controller_node.references.trajectory import TrajectoryPoints, TrajectoryReference
from msgs_config.messages import topics
from msgs_config.messages.cdr import split_stamp
from msgs_config.messages.clock import TickClock
from tests.support.physics import character
from tests.support.ros import ControllerClient, Processes, ReceivedMessages, joint_state, stamp_ns

CLOCK = TickClock(240)
REST = 0.5  # rad, of the pendulum
TARGET = 0.9


def trajectory(
    *positions: float, names: Sequence[str] = ("hinge",), start_ns: int = 0
) -> JointTrajectory:
    """Positions a tenth of a second apart."""
    message = JointTrajectory(joint_names=list(names))
    message.header.stamp.sec, message.header.stamp.nanosec = split_stamp(start_ns)
    for number, position in enumerate(positions, start=1):
        point = JointTrajectoryPoint(positions=[position])
        point.time_from_start = Duration(sec=0, nanosec=number * 10**8)
        message.points.append(point)
    return message


class Pendulum:
    """A controller that is given the state of each tick, and trajectories."""

    def __init__(self, client: ControllerClient) -> None:
        controller = topics.CONTROLLER_NODE
        self._client = client
        self.active: ReceivedMessages = client.listen(topics.ACTIVE_TRAJECTORY.of(controller))
        self._trajectories = client.speak(topics.JOINT_TRAJECTORY.of(controller))
        self.tick = 0

    def next(self, *, first: bool = False) -> JointState:
        """The reference at the next tick."""
        self.tick += 1
        effort = [] if first else [0.0]
        state = joint_state(CLOCK.stamp_ns(self.tick), ["hinge"], [REST], [0.0], effort)
        self._client.ask(state)
        return self._client.reference(state)

    def send(self, message: JointTrajectory) -> None:
        """Send a trajectory to the controller, which is there."""
        self._client.spin_until(self._trajectories.get_subscription_count, "a subscriber")
        self._trajectories.publish(message)

    def start(self, message: JointTrajectory) -> int:
        """Send a trajectory and go on from tick to tick until it is taken; its start in ns."""
        before = len(self.active)
        self.send(message)
        for _ in range(500):
            self.next()
            if len(self.active) > before:
                return stamp_ns(self.active.last)
        raise AssertionError("it was not taken within 500 ticks")


@pytest.fixture
def pendulum(processes: Processes, simulator: ControllerClient) -> Iterator[Pendulum]:
    processes.controller("pendulum")
    driver = Pendulum(simulator)
    driver.next(first=True)
    yield driver


def expected(start_ns: int, *positions: float) -> TrajectoryReference:
    """What the controller is to track, on time since the first tick."""
    whole = character("pendulum")
    still = TrajectoryReference(whole, HoldReference(whole))
    return still.replaced(points(*positions), since_first(start_ns))


def points(*positions: float) -> TrajectoryPoints:
    """The points of `trajectory`."""
    times = np.arange(1, len(positions) + 1) * 0.1
    return TrajectoryPoints(("hinge",), times, np.array(positions).reshape(-1, 1))


def since_first(stamp: int) -> float:
    """Time of a stamp since the first tick, s."""
    return (stamp - CLOCK.stamp_ns(1)) / 1e9


def test_a_trajectory_without_a_stamp_begins_at_the_next_state_and_leads_to_its_points(
    pendulum: Pendulum,
) -> None:
    start_ns = pendulum.start(trajectory(0.7, TARGET))

    tracked = expected(start_ns, 0.7, TARGET)
    assert CLOCK.tick(start_ns) <= pendulum.tick
    last = REST
    for _ in range(60):
        reference = pendulum.next()
        state = tracked.sample(since_first(stamp_ns(reference)))
        assert list(reference.position) == state.configuration.position.tolist()
        assert list(reference.velocity) == state.velocity.tolist()
        assert abs(reference.position[0] - last) < 0.2  # no jump
        last = reference.position[0]
    assert last == pytest.approx(TARGET, abs=1e-9)


def test_a_stamped_trajectory_begins_at_exactly_its_tick(pendulum: Pendulum) -> None:
    later = CLOCK.stamp_ns(400)

    assert pendulum.start(trajectory(TARGET, start_ns=later)) == later

    while pendulum.tick < 400:
        assert pendulum.next().position[0] == REST
    assert pendulum.next().position[0] > REST


def test_another_one_takes_over_where_the_first_one_is(pendulum: Pendulum) -> None:
    first_ns = pendulum.start(trajectory(TARGET))
    for _ in range(12):
        before = pendulum.next()

    second_ns = pendulum.start(trajectory(0.2))

    first = expected(first_ns, TARGET)
    tracked = first.replaced(points(0.2), since_first(second_ns))
    assert REST + 0.1 < before.position[0] < TARGET - 0.05  # it is on its way
    at = tracked.sample(since_first(second_ns))
    assert at.configuration.position[0] == pytest.approx(
        first.sample(since_first(second_ns)).configuration.position[0], abs=1e-12
    )
    for _ in range(60):
        reference = pendulum.next()
        state = tracked.sample(since_first(stamp_ns(reference)))
        assert list(reference.position) == state.configuration.position.tolist()
        assert list(reference.velocity) == state.velocity.tolist()
    assert reference.position[0] == pytest.approx(0.2, abs=1e-9)


def test_a_new_episode_forgets_it(pendulum: Pendulum) -> None:
    pendulum.start(trajectory(TARGET))
    for _ in range(40):
        moved = pendulum.next()

    after = pendulum.next(first=True)

    assert moved.position[0] == pytest.approx(TARGET)
    assert after.position[0] == REST


def broken(message: JointTrajectory) -> JointTrajectory:
    message.points[0].positions = []
    return message


def unsorted() -> JointTrajectory:
    message = trajectory(0.6, 0.7)
    message.points[1].time_from_start = Duration(sec=0, nanosec=10**7)
    return message


REFUSED = {
    "empty": (trajectory(), "point"),
    "unsorted": (unsorted(), "0.01"),
    "unknown": (trajectory(0.6, names=["tail"]), "tail"),
    "not a number": (trajectory(float("nan")), "hinge"),
    "without positions": (broken(trajectory(0.6)), "positions"),
    "over": (trajectory(0.6, start_ns=1), "over"),
}


def test_what_cannot_be_followed_is_refused_in_a_line_and_what_ran_goes_on(
    processes: Processes, simulator: ControllerClient
) -> None:
    # Arrange
    node = processes.controller("pendulum")
    pendulum = Pendulum(simulator)
    pendulum.next(first=True)

    # Act: a good one after the bad ones says when they are through
    for message, _ in REFUSED.values():
        pendulum.send(message)
    pendulum.send(trajectory(0.6, start_ns=2))  # over as well, which is logged once
    start_ns = pendulum.start(trajectory(TARGET))

    # Assert
    assert len(pendulum.active) == 1
    assert start_ns > 1
    lines = [line for line in node.stderr.splitlines() if "refused trajectory" in line]
    assert len(lines) == len(REFUSED)
    for line, (_, word) in zip(lines, REFUSED.values(), strict=True):
        assert word in line
