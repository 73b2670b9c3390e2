"""What a controller makes of a simulator's configuration, at whatever moment it comes."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from rclpy.context import Context
from std_msgs.msg import String

from controller_node.interface.simulators import Simulators
from controller_node.node import ControllerNode
from msgs_config.bus.composition import ros_node
from msgs_config.messages import configuration, topics
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState
from sim_node import parameters as of_simulator
from sim_node.physics.probe import measure_probe
from tests.support.physics import character
from tests.support.physics import controller as controller_of
from tests.support.ros import ControllerClient, joint_state

PENDULUM = character("pendulum")
SESSION = "/sim_node#1"
MOON = 1.62  # m/s^2


def described(gravity: float) -> String:
    """The configuration of a simulator of the pendulum."""
    values = of_simulator.resolve_alone(PENDULUM, {"character": "pendulum", "gravity": gravity})
    probe = measure_probe(PENDULUM, gravity)
    return String(data=configuration.describe(PENDULUM, values, probe=probe, session=SESSION))


def first_state(tick: int) -> StampedState:
    position = np.add(PENDULUM.rest_position, 0.3)
    return StampedState(TickClock(240).stamp_ns(tick), position, 0.0 * position, None)


class Bench:
    """A controller in the test's own thread, which is given its turns by the test."""

    def __init__(self, node: ControllerNode, client: ControllerClient) -> None:
        self.node, self.client = node, client
        self.configurations = client.speak(topics.CONFIGURATION.of(topics.SIM_NODE))
        self._executor = node.node.make_executor([node.node])
        self._turns = node.turns(False, self._executor)

    def close(self) -> None:
        self._turns.close()
        self._executor.close()

    def publish_first_state(self, tick: int) -> None:
        """Publish it; the controller has it when this returns."""
        state, names = first_state(tick), PENDULUM.layout.dof_names
        message = joint_state(state.stamp_ns, names, list(state.position), list(state.velocity))
        message.header.frame_id = SESSION
        self.client.states.publish(message)
        assert self.client.states.wait_for_all_acked()

    def publish_configuration(self, gravity: float) -> None:
        """Likewise."""
        self.configurations.publish(described(gravity))
        assert self.configurations.wait_for_all_acked()

    def until(self, condition: Callable[[], Any], what: str) -> Any:
        """Give turns until the condition gives something true."""

        def found() -> Any:
            next(self._turns)
            self._executor.serve()
            return condition()

        return self.client.spin_until(found, what)

    def torques(self, tick: int) -> list[float] | None:
        """The first answer to a first state; None if there is none yet."""
        message = self.client.torques.of_stamp(first_state(tick).stamp_ns)
        return None if message is None else list(message.effort)


@pytest.fixture
def bench(context: Context, simulator: ControllerClient) -> Iterator[Bench]:
    node = ControllerNode(
        ros_node(
            topics.CONTROLLER_NODE,
            context=context,
            cli_args=["--ros-args", "-p", "character:=pendulum"],
        )
    )
    bench = Bench(node, simulator)
    yield bench
    bench.close()
    node.destroy_node()


def expected(tick: int, gravity: float) -> list[float]:
    state = first_state(tick)
    effort, _ = controller_of("pendulum", gravity=gravity).compute_effort(state, state.stamp_ns)
    torques: list[float] = effort.tolist()
    return torques


def test_a_configuration_that_comes_just_before_a_first_state_counts_for_it(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where the controller has just looked for configurations."""
    for publisher in (bench.configurations, bench.client.states):
        bench.until(publisher.get_subscription_count, "the controller")
    bench.publish_configuration(gravity=9.81)
    bench.publish_first_state(1)
    assert bench.until(lambda: bench.torques(1), "an answer") == expected(1, 9.81)
    look, calls = Simulators.take_messages, list[float]()

    def look_just_before_a_reset(simulators: Simulators, now: float) -> None:
        look(simulators, now)
        calls.append(now)
        if len(calls) == 1:
            bench.publish_configuration(MOON)
            bench.publish_first_state(9)

    monkeypatch.setattr(Simulators, "take_messages", look_just_before_a_reset)
    bench.until(lambda: calls, "the reset")
    bench.node.node.set_own_parameters({"gravity": MOON})

    assert bench.until(lambda: bench.torques(9), "an answer") == expected(9, MOON)
    assert expected(9, MOON) != expected(9, 9.81)
