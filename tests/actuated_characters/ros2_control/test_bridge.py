"""The bridge on a bus of one process, with a controller manager that a test plays."""

import math
import time
from typing import Any

import numpy as np
import pytest

from actuated_characters.ros2_control import node as module
from actuated_characters.ros2_control.node import BridgeNode
from msgs_config.bus.in_process import Bus, InProcessExecutor
from msgs_config.errors import ConfigurationError
from msgs_config.messages import topics, typed
from msgs_config.messages.clock import TickClock
from msgs_config.messages.joint_state import JointArrays, JointStateDecoder, JointStateEncoder

CLOCK = TickClock(1000)
NAN = math.nan


class Bridge:
    """A bridge of a pendulum between a simulator and a manager that stand still."""

    def __init__(self, **parameters: object) -> None:
        self.warnings: list[str] = []
        bus = Bus(write=lambda name, severity, text: self.warnings.append(text))
        given = {"character": "pendulum", "rate": 1000, **parameters}
        others = bus.node("others", {})
        self._states = others.publisher(topics.JOINT_STATES)
        self._torques = others.subscription(topics.JOINT_TORQUES)
        self._told = others.subscription(topics.ROBOT_JOINT_STATES)
        self._clock = others.subscription(topics.CLOCK)
        self._commands = others.publisher(topics.ROBOT_JOINT_COMMANDS)
        self._decoder = JointStateDecoder()
        self.node = BridgeNode(bus.node(topics.BRIDGE_NODE, given))
        self._turns = self.node.turns(False, InProcessExecutor())  # type: ignore[arg-type]
        self.times: list[float] = []  # of the clock, s

    def publish(self, tick: int, position: float, *, first: bool = False) -> None:
        effort = () if first else (np.zeros(1),)
        encoder = JointStateEncoder(["hinge"], "/sim_node#1")
        state = np.array([position]), np.zeros(1), *effort
        self._states.publish(encoder.encode(CLOCK.stamp_ns(tick), *state))

    def answer(self, command: float | None, patience: int = 400) -> JointArrays | None:
        """Turns until the state is answered; each clock by a command, unless it is None."""
        for _ in range(patience):
            time.sleep(min(next(self._turns), 0.001))  # as long as it needs no turn
            while (raw := self._clock.take()) is not None:
                now = typed.decode(raw, "rosgraph_msgs/msg/Clock").clock
                self.times.append(now.sec + now.nanosec * 1e-9)
                if command is not None:
                    self.command(command)
            if (raw := self._torques.take()) is not None:
                return self._decoder.decode(raw)
        return None

    def command(self, position: float, stamp_ns: int = 77) -> None:
        encoder = JointStateEncoder(["hinge"])
        self._commands.publish(encoder.encode(stamp_ns, np.array([position])))

    def told(self) -> list[JointArrays]:
        found: list[Any] = []
        while (raw := self._told.take()) is not None:
            found.append(self._decoder.decode(raw))
        return found


def test_the_world_stands_until_a_controller_commands_anything() -> None:
    bridge = Bridge(update_rate=250)
    bridge.publish(1, 0.5, first=True)

    assert bridge.answer(None, patience=40) is None  # no manager
    assert bridge.answer(NAN, patience=40) is None  # one without an active controller
    answer = bridge.answer(0.6)

    assert answer is not None and answer.stamp_ns == CLOCK.stamp_ns(1)
    assert answer.frame_id == "/sim_node#1"
    assert {state.position[0] for state in bridge.told()} == {0.5}
    steps = np.diff(sorted(set(bridge.times)))
    assert steps == pytest.approx(0.004)  # the clock went on meanwhile


def test_each_update_has_one_command_whatever_its_stamp_and_ticks_between_none() -> None:
    bridge = Bridge(update_rate=250)
    bridge.publish(1, 0.5, first=True)
    bridge.answer(0.5)
    bridge.told()
    bridge.times.clear()

    for tick in range(2, 10):
        bridge.publish(tick, 0.5)
        assert bridge.answer(0.5) is not None

    assert np.diff(bridge.times) == pytest.approx(0.004) and len(bridge.times) == 2
    assert [round(each.stamp_ns * 1e-9, 6) for each in bridge.told()] == [
        round(time, 6) for time in bridge.times
    ]


def test_a_command_that_was_not_asked_for_is_not_taken() -> None:
    bridge = Bridge(update_rate=1000)
    bridge.publish(1, 0.5, first=True)
    bridge.answer(0.5)
    bridge.command(2.0)
    bridge.publish(2, 0.5)

    answer = bridge.answer(0.5)

    assert answer is not None and abs(answer.effort[0]) < 10.0  # 1.5 rad away it is 75 N m
    assert bridge.node._manager.unasked == 1


def test_the_world_begins_at_its_time() -> None:
    bridge = Bridge(update_rate=250, start_time=0.08)
    bridge.publish(1, 0.5, first=True)

    assert bridge.answer(0.5) is not None
    assert bridge.times[-1] == pytest.approx(0.08)


def test_a_state_that_comes_again_has_the_same_answer() -> None:
    bridge = Bridge(update_rate=250)
    bridge.publish(1, 0.5, first=True)
    first = bridge.answer(0.7)
    count = len(bridge.times)

    bridge.publish(1, 0.5, first=True)
    again = bridge.answer(0.9)

    assert first is not None and again is not None
    assert first.effort.tolist() == again.effort.tolist() and len(bridge.times) == count


def test_the_clock_is_told_again_where_no_command_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("actuated_characters.ros2_control.manager._REPEAT_PERIOD", 0.001)
    bridge = Bridge(update_rate=1000)
    bridge.publish(1, 0.5, first=True)
    bridge.answer(0.5)
    bridge.times.clear()
    bridge.publish(2, 0.5)

    assert bridge.answer(None, patience=30) is None

    assert len(bridge.times) > 4 and len(set(bridge.times)) == 1
    assert any("waiting for a command on '/robot_joint_commands'" in w for w in bridge.warnings)


def test_a_humanoid_is_refused_for_its_ball_joints() -> None:
    bus = Bus(write=lambda *_: None)

    with pytest.raises(ConfigurationError, match="'chest' is a ball joint"):
        module.BridgeNode(bus.node(topics.BRIDGE_NODE, {"character": "humanoid"}))
