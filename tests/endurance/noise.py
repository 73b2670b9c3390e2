"""`make noise`: a run with 20,000 mutated messages on each topic that a node listens to.

Each is a mutant of what another simulator, or its controller, would say. The states must be those
of the run alone, to the bit, and the memory of both nodes must not grow.
"""

import argparse
import json
import os
import struct
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from msgs_config.runtime.process import limit_threads

limit_threads()

import numpy as np  # noqa: E402 - after the limit on threads
import rclpy  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.serialization import serialize_message  # noqa: E402
from rich.console import Console  # noqa: E402
from sensor_msgs.msg import JointState, MultiDOFJointState  # noqa: E402
from std_msgs.msg import Header, String  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402

from actuated_characters.metrics.state_hash import StateHash  # noqa: E402
from actuated_characters.runs.bare_loop import ticks_in_process  # noqa: E402
from actuated_characters.runs.plan import make_plan  # noqa: E402
from actuated_characters.runs.processes import Child, Children  # noqa: E402
from actuated_characters.runs.ros_domain import own_domain  # noqa: E402
from benchmarks.support.nodes import private_memory  # noqa: E402
from msgs_config.bus.polling import DirectSubscription  # noqa: E402
from msgs_config.errors import MessageError  # noqa: E402
from msgs_config.messages import topics  # noqa: E402
from msgs_config.messages.cdr import read_frame_id  # noqa: E402
from msgs_config.messages.joint_state import (  # noqa: E402
    JointStateDecoder,
    state_in_layout,
)
from msgs_config.messages.session import make_session  # noqa: E402
from msgs_config.messages.topic import Topic  # noqa: E402

_RATE = 240  # Hz
_MOST_GROWTH = 5.0  # MB
_FIRST_TICKS = 2_000  # before the noise
_FIRST_NOISE = 6_000  # messages on each topic that fill what queues there are
_A_TURN = 10  # messages on each topic
_PATIENCE = 120.0  # s without a new tick
_MOVING = {"reference": "sine", "signal.dofs": ["hinge"]}
_OTHER = "/other/sim_node#00000000000b"


def mutants(message: Any, rng: np.random.Generator) -> Iterator[bytes]:
    """Endless: a message with bytes changed, cut off, with a hostile length, or random bytes."""
    valid = bytes(serialize_message(message))
    valid += bytes(-len(valid) % 4)  # what is no multiple of four long the middleware fills up
    while True:
        content = bytearray(valid)
        place = 4 * int(rng.integers(1, len(valid) // 4))
        match int(rng.integers(4)):
            case 0:
                content = bytearray(rng.bytes(4 * int(rng.integers(1, 75))))
            case 1:
                del content[place:]
            case 2:
                content[int(rng.integers(4, len(content)))] = int(rng.integers(256))
            case _:
                length = int(rng.choice([0, 1, 10**6, 2**31, 0xFFFF_FFF0]))
                struct.pack_into("<I", content, place, length)
        yield bytes(content)


def foreign_messages() -> list[tuple[Topic, Any]]:
    """What another simulator and its controller would say, on each topic that a node hears."""
    state = JointState(name=["hinge"], position=[1.0], velocity=[1.0], effort=[0.5])
    state.header.stamp.sec, state.header.frame_id = 1_000, _OTHER
    wrench = MultiDOFJointState(joint_names=["tail"], header=state.header)
    configuration = json.dumps({"session": _OTHER, "character": "x", "joints": []})
    controller = topics.CONTROLLER_NODE
    return [
        (topics.JOINT_STATES, state),
        (topics.CONTACTS, wrench),
        (topics.EPISODE, Header(frame_id=f"3 {_OTHER}", stamp=state.header.stamp)),
        (topics.CONFIGURATION.of(topics.SIM_NODE), String(data=configuration)),
        (topics.JOINT_TRAJECTORY.of(controller), JointTrajectory(joint_names=["tail"])),
        (topics.STRENGTH.of(controller), JointState(name=["tail"], effort=[0.5])),
        (topics.JOINT_TORQUES, state),
        (topics.EXTERNAL_WRENCH, wrench),
        (topics.THROW, state),
    ]


class _Noise:
    """Listens to every state of a session, and sends."""

    def __init__(self, node: Node, session: str) -> None:
        rng = np.random.default_rng(1)
        self._session = session
        self._sources = [
            (node.create_publisher(topic.message_type, topic.name, topic.qos), mutants(each, rng))
            for topic, each in foreign_messages()
        ]
        self._states = DirectSubscription(node, topics.JOINT_STATES.for_listener())
        self._decoder, self._last_ns = JointStateDecoder(), 0
        self._layout = make_plan("pendulum", 1.0, {}, {}, {}).character.layout
        self._heard_at = time.monotonic()
        self.hash, self.states = StateHash(), 0

    def send(self, messages: int) -> None:
        """Send as many on each topic, and hear what comes meanwhile."""
        for _ in range(messages // _A_TURN):
            for publisher, source in self._sources:
                for _ in range(_A_TURN):
                    publisher.publish(next(source))
            self.hear()

    def hear_until(self, states: int) -> None:
        """Hear until there were so many states."""
        while self.states < states:
            self.hear()
            time.sleep(0.001)

    def hear(self) -> None:
        """Take the states that have come.

        Raises:
            RuntimeError: there was none for long.
        """
        while (raw := self._states.take()) is not None:
            try:
                if read_frame_id(raw) != self._session:
                    continue
                state = state_in_layout(self._layout, self._decoder.decode(raw))
            except MessageError:
                continue
            if state.stamp_ns > self._last_ns:
                self._last_ns = state.stamp_ns
                self.hash.add(state)
                self.states += 1
                self._heard_at = time.monotonic()
        if time.monotonic() > self._heard_at + _PATIENCE:
            raise RuntimeError(f"no state for {_PATIENCE:g} s, after {self.states}")


def run(messages: int, started: dict[str, Child], noise: _Noise) -> dict[str, float]:
    """Send so many messages on each topic; by how much the memory of each node grew, MB."""
    noise.hear_until(_FIRST_TICKS)
    noise.send(_FIRST_NOISE)
    noise.hear_until(noise.states + 100)
    before = {name: private_memory(child) for name, child in started.items()}
    noise.send(messages)
    noise.hear_until(noise.states + 100)
    return {name: private_memory(child) - before[name] for name, child in started.items()}


def hash_alone(states: int) -> str:
    """The state hash of the same run's first states, without topics."""
    alone = StateHash()
    plan = make_plan("pendulum", (states - 1) / _RATE, _MOVING, {}, {})
    for count, tick in enumerate(ticks_in_process(plan)):
        if count == 0:
            alone.add(tick.state)
        alone.add(tick.following)
    return alone.hexdigest()


def main() -> int:
    """Run, print what was found, and return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.endurance.noise", description=__doc__)
    parser.add_argument("--messages", type=int, default=20_000, help="on each topic")
    messages = parser.parse_args().messages
    session = make_session("/sim_node")
    plan = make_plan("pendulum", 1.0, _MOVING, {}, {})
    first = {name: plan.simulator[name] for name in ("initial_position", "initial_velocity")}
    given = {"character": "pendulum", "session": session}
    console = Console()
    with (
        own_domain() as domain,
        tempfile.TemporaryDirectory() as name,
        Children(Path(name)) as children,
    ):
        os.environ |= {
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        }
        rclpy.init()
        noise = _Noise(Node("noise"), session)
        parameters = {"wait_for_subscribers": 2}
        started = {
            topics.CONTROLLER_NODE: children.start_node(
                topics.CONTROLLER_NODE, {**given, **_MOVING}
            ),
            topics.SIM_NODE: children.start_node(topics.SIM_NODE, {**given, **first, **parameters}),
        }
        growth = run(messages, started, noise)
        ended = [node for node, child in started.items() if child.exit_code is not None]
        rclpy.try_shutdown()
    same = noise.hash.hexdigest() == hash_alone(noise.states)
    topics_hit = len(foreign_messages())
    console.print(f"{messages} messages on each of {topics_hit} topics, {noise.states} states")
    console.print(f"state hash: {'that of the run alone' if same else 'ANOTHER ONE'}")
    for node, megabytes in growth.items():
        console.print(f"memory of {node}: {megabytes:+.2f} MB (at most {_MOST_GROWTH:g})")
    if ended:
        console.print(f"ended: {', '.join(ended)}")
    return int(not same or bool(ended) or max(growth.values()) > _MOST_GROWTH)


if __name__ == "__main__":
    sys.exit(main())
