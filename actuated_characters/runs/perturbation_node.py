"""`pusher`: sends pushes, throws and velocities that were planned before a run."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rclpy.node import Node

from actuated_characters.runs.planned_throws import read_throws
from actuated_characters.runs.planned_velocities import read_velocities
from actuated_characters.runs.planned_wrenches import read_pushes
from msgs_config.bus.dds import create_publisher
from msgs_config.bus.polling import DirectSubscription, PollingExecutor
from msgs_config.bus.ros_parameters import declare, given_parameters
from msgs_config.messages import topics
from msgs_config.messages.cdr import encode
from msgs_config.messages.projectiles import ThrowCodec
from msgs_config.messages.session import SESSION, given_session
from msgs_config.messages.topic import Topic
from msgs_config.messages.wrenches import encode_wrenches
from msgs_config.parameters import Parameter, resolve
from msgs_config.runtime.process import StopSignal

PARAMETERS = [
    Parameter("file", "pushes.json", "the pushes, as a run writes them"),
    Parameter("throws", "", "the throws, as a run writes them; empty: none"),
    Parameter("velocities", "", "the velocities, as a run writes them; empty: none"),
    Parameter(
        "wait_for_subscribers", 1, "send when this many subscribe to external_wrench", maximum=1000
    ),
    Parameter("throw_subscribers", 1, "likewise to throw", maximum=1000),
    Parameter("velocity_subscribers", 1, "likewise to cmd_vel_stamped", maximum=1000),
    SESSION,
]

_TIMEOUT = 10.0  # s until the simulator has the messages


class PerturbationNode(Node):
    """Sends what was planned, and only then subscribes to the torques.

    A controller that waits for that subscription answers no state before all of it is there.
    """

    def __init__(self) -> None:
        """Read the pushes, the throws and the velocities.

        Raises:
            ActuatedCharactersError: a parameter is wrong, or a file cannot be read.
        """
        super().__init__("pusher")
        values = resolve(PARAMETERS, given_parameters(self))
        declare(self, PARAMETERS, values)
        session = given_session(values)
        pushes = read_pushes(Path(values.text("file")))
        self._outgoing = [
            _PlannedPublisher(
                self,
                topics.EXTERNAL_WRENCH,
                [encode_wrenches(replace(push.arrays(), frame_id=session)) for push in pushes],
                values.integer("wait_for_subscribers"),
            )
        ]
        if values.text("throws"):
            throws, codec = read_throws(Path(values.text("throws"))), ThrowCodec(session)
            self._outgoing.append(
                _PlannedPublisher(
                    self,
                    topics.THROW,
                    [codec.encode(each.stamp_ns, each.throw) for each in throws],
                    values.integer("throw_subscribers"),
                )
            )
        if values.text("velocities"):
            velocities = read_velocities(Path(values.text("velocities")))
            self._outgoing.append(
                _PlannedPublisher(
                    self,
                    topics.CMD_VEL_STAMPED,
                    [encode(each.message()) for each in velocities],
                    values.integer("velocity_subscribers"),
                )
            )
        self._torques: DirectSubscription | None = None

    def run(self, stop: StopSignal) -> None:
        """Send as soon as all subscribers are there, then stay until `stop`."""
        executor = PollingExecutor(self)
        try:
            while not stop:
                if self._torques is None and all(each.is_ready for each in self._outgoing):
                    for each in self._outgoing:
                        each.send()
                    self._torques = DirectSubscription(self, topics.JOINT_TORQUES)
                if self._torques is None or self._torques.take() is None:
                    executor.rest()
                else:
                    executor.received()
        finally:
            executor.close()


class _PlannedPublisher:
    """Serialised messages for one topic, and how many subscribers they wait for."""

    def __init__(
        self, node: Node, topic: Topic, messages: Sequence[bytes], subscribers: int
    ) -> None:
        self._publisher = create_publisher(node, topic)
        self._messages = messages
        self._subscribers = subscribers

    @property
    def is_ready(self) -> bool:
        """Whether all subscribers are there, or there is nothing to send."""
        return not self._messages or self._publisher.get_subscription_count() >= self._subscribers

    def send(self) -> None:
        """Send all; they have arrived when this returns."""
        for message in self._messages:
            self._publisher.publish(message)
        self._publisher.is_acknowledged(_TIMEOUT)
