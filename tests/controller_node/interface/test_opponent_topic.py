"""An opponent's states over topics: those of the very tick, or the state waits for them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from rclpy.context import Context
from sensor_msgs.msg import JointState

from msgs_config.messages import topics
from msgs_config.messages.clock import TickClock
from msgs_config.messages.wrenches import WrenchArrays, encode_wrenches
from tests.support.physics import character
from tests.support.ros import Client, Processes, joint_state, stamp_ns

pytestmark = pytest.mark.slow

HUMANOID = character("humanoid")
CLOCK = TickClock(240)
FORCE = 300.0  # N, of the pull
PLACE = (0.0, 4.0, 0.88)  # m, of the opponent
ROOT = ("root_x", "root_y", "root_z")
PURSUIT = {"behaviour": "pursuit", "opponent": "right", "pursuit__force": FORCE}


@dataclass
class World:
    """The place of a simulator of two characters, of which `left` has a controller."""

    client: Client

    def __post_init__(self) -> None:
        self.torques = self.client.listen(topics.JOINT_TORQUES.under("left"))
        self._states = self.client.speak(topics.JOINT_STATES.under("left"))
        self._contacts = self.client.speak(topics.CONTACTS.under("left"))
        self._opponents = self.client.speak(topics.JOINT_STATES.under("right"))

    def send_state(self, tick: int) -> None:
        """The state at rest of `left`, which begins an episode if it is the first one."""
        now_ns, size = CLOCK.stamp_ns(tick), HUMANOID.layout.size
        position = list(HUMANOID.rest_position)
        effort = [] if tick == 1 else [0.0] * size
        self._contacts.publish(encode_wrenches(WrenchArrays.of_rows(now_ns, [], [], [])))
        names = HUMANOID.layout.dof_names
        self._states.publish(joint_state(now_ns, names, position, [0.0] * size, effort))

    def send_opponent(self, tick: int, place: tuple[float, ...] = PLACE) -> None:
        """Where `right` is."""
        message = joint_state(CLOCK.stamp_ns(tick), ROOT, place, [0.0] * 3, [0.0] * 3)
        self._opponents.publish(message)

    def answered_at(self, tick: int) -> JointState | None:
        return self.torques.of_stamp(CLOCK.stamp_ns(tick))


@pytest.fixture
def world(context: Context) -> Iterator[World]:
    client = Client(context)
    yield World(client)
    client.close()


def root_force(torques: JointState) -> list[float]:
    return [torques.effort[list(torques.name).index(name)] for name in ROOT]


def test_a_state_waits_for_the_opponents_state_of_its_tick(
    processes: Processes, world: World
) -> None:
    controller = processes.node(
        topics.CONTROLLER_NODE, "left", character="humanoid", reference="hold", **PURSUIT
    )

    def before_and_after() -> None:
        world.send_state(1)
        world.send_opponent(2)  # not yet, and not of this tick

    # it says what it waits for, and answers nothing
    world.client.spin_sending(
        before_and_after,
        lambda: "waiting for the opponent's states on '/right/joint_states'" in controller.stderr,
        "a line about the opponent",
    )
    assert not world.torques.messages

    first = world.client.spin_sending(
        lambda: (world.send_state(1), world.send_opponent(1)),
        lambda: world.answered_at(1),
        "an answer",
    )

    # at rest, with the law's implicit step: towards the opponent, and less than the force
    x, y, _ = root_force(first)
    assert abs(x) < 1e-3 * FORCE
    assert 0.5 * FORCE < y <= FORCE
    world.client.spin_sending(
        lambda: (world.send_state(2), world.send_opponent(2, (0.0, -4.0, 0.88))),
        lambda: world.answered_at(2),
        "an answer",
    )
    assert [stamp_ns(each) for each in world.torques.messages] == sorted(
        stamp_ns(each) for each in world.torques.messages
    )


@pytest.mark.parametrize("place", [(np.nan, 0.0, 0.0), ()])
def test_a_state_without_a_finite_place_is_ignored(
    processes: Processes, world: World, place: tuple[float, ...]
) -> None:
    controller = processes.node(
        topics.CONTROLLER_NODE, "left", character="humanoid", reference="hold", **PURSUIT
    )

    world.client.spin_sending(
        lambda: (world.send_state(1), world.send_opponent(1, place)),
        lambda: "state on '/right/joint_states' ignored" in controller.stderr,
        "a line about the message",
    )
    assert not world.torques.messages
    world.client.spin_sending(
        lambda: (world.send_state(1), world.send_opponent(1)),
        lambda: world.answered_at(1),
        "an answer",
    )


@pytest.mark.parametrize("namespace", ["", "right"])
def test_an_opponent_needs_a_place_beside_the_own_one(processes: Processes, namespace: str) -> None:
    controller = processes.node(topics.CONTROLLER_NODE, namespace, character="humanoid", **PURSUIT)

    assert controller.wait() == 1
    assert "error: parameter 'opponent' is right: it must be another character" in controller.stderr
