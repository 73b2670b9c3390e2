"""`pusher`: sends pushes, throws, velocities, strengths, pins and behaviours, planned before."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from actuated_characters.runs.planned.behaviours import read_behaviours
from actuated_characters.runs.planned.pins import read_pins
from actuated_characters.runs.planned.strengths import read_strengths
from actuated_characters.runs.planned.throws import read_throws
from actuated_characters.runs.planned.velocities import read_velocities
from actuated_characters.runs.planned.wrenches import read_pushes
from msgs_config.bus.composition import AT_ONCE, UNTIL_A_MESSAGE, ComposableNode, Turns, ros_node
from msgs_config.bus.node import BusNode, Executor, StopFlag, declared_settings
from msgs_config.messages import topics
from msgs_config.messages.pins import encode_pins
from msgs_config.messages.projectiles import ThrowCodec
from msgs_config.messages.session import GivenSession
from msgs_config.messages.topic import Topic
from msgs_config.messages.wrenches import encode_wrenches
from msgs_config.settings import Settings, parameter


class PerturbationSettings(Settings):
    """What is sent, and to how many."""

    file: str = parameter("pushes.json", "the pushes, as a run writes them")
    throws: str = parameter("", "the throws, as a run writes them; empty: none")
    velocities: str = parameter("", "the velocities, as a run writes them; empty: none")
    strengths: str = parameter("", "the strengths, as a run writes them; empty: none")
    pins: str = parameter("", "the pins, as a run writes them; empty: none")
    behaviours: str = parameter("", "the behaviours, as a run writes them; empty: none")
    wait_for_subscribers: int = parameter(
        1, "send when this many subscribe to external_wrench", maximum=1000
    )
    throw_subscribers: int = parameter(1, "likewise to throw", maximum=1000)
    velocity_subscribers: int = parameter(1, "likewise to cmd_vel_stamped", maximum=1000)
    strength_subscribers: int = parameter(1, "likewise to controller_node/strength", maximum=1000)
    pin_subscribers: int = parameter(1, "likewise to pin", maximum=1000)
    behaviour_subscribers: int = parameter(1, "likewise to controller_node/behaviour", maximum=1000)
    heard_by: str = parameter(
        topics.JOINT_TORQUES.name,
        "the topic that it subscribes to when all is there; whoever waits for that misses nothing",
        choices=(topics.JOINT_TORQUES.name, topics.JOINT_STATES.name),
    )
    session: GivenSession = GivenSession()


_TIMEOUT = 10.0  # s until the simulator has the messages


class PerturbationNode(ComposableNode):
    """Sends what was planned, and only then subscribes to the torques, or to the states.

    A controller, or a simulator, that waits for that subscription does not begin before all of it
    is there.
    """

    def __init__(self, node: BusNode | None = None) -> None:
        """Read all that is to be sent.

        Without a place on a bus it is a node of ROS.

        Raises:
            ActuatedCharactersError: a parameter is wrong, or a file cannot be read.
        """
        super().__init__(node or ros_node("pusher"))
        settings = declared_settings(self.node, PerturbationSettings)
        known = {topic.name: topic for topic in (topics.JOINT_TORQUES, topics.JOINT_STATES)}
        self._heard_by = known[settings.heard_by]
        self._outgoing = [
            _PlannedPublisher(self.node, topic, list(messages(Path(file))), subscribers)
            for topic, file, subscribers, messages in _planned(settings)
            if file
        ]

    def turns(self, stop: StopFlag, executor: Executor) -> Turns:
        """Send as soon as all subscribers are there, then stay until `stop`."""
        while not stop and not all(each.is_ready for each in self._outgoing):
            yield UNTIL_A_MESSAGE
        if stop:
            return
        for each in self._outgoing:
            each.send()
        heard = self.node.subscription(self._heard_by)
        while not stop:
            is_heard = heard.take() is not None
            if is_heard:
                executor.received()
            yield AT_ONCE if is_heard else UNTIL_A_MESSAGE


def _planned(
    settings: PerturbationSettings,
) -> Iterator[tuple[Topic, str, int, Callable[[Path], Iterator[bytes]]]]:
    """Of each kind: the topic, the file, how many are to hear it, and the file's messages."""
    session = settings.session.id
    codec = ThrowCodec(session)

    def pushes(file: Path) -> Iterator[bytes]:
        for each in read_pushes(file):
            yield encode_wrenches(replace(each.arrays(), frame_id=session))

    def throws(file: Path) -> Iterator[bytes]:
        return (codec.encode(each.stamp_ns, each.throw) for each in read_throws(file))

    def velocities(file: Path) -> Iterator[bytes]:
        return (each.encode() for each in read_velocities(file))

    def strengths(file: Path) -> Iterator[bytes]:
        return (each.encode() for each in read_strengths(file))

    def pins(file: Path) -> Iterator[bytes]:
        return (encode_pins(each.arrays(session)) for each in read_pins(file))

    def behaviours(file: Path) -> Iterator[bytes]:
        return (each.encode() for each in read_behaviours(file))

    strength = topics.STRENGTH.of(topics.CONTROLLER_NODE)
    behaviour = topics.BEHAVIOUR.of(topics.CONTROLLER_NODE)
    yield topics.EXTERNAL_WRENCH, settings.file, settings.wait_for_subscribers, pushes
    yield topics.THROW, settings.throws, settings.throw_subscribers, throws
    yield topics.CMD_VEL_STAMPED, settings.velocities, settings.velocity_subscribers, velocities
    yield strength, settings.strengths, settings.strength_subscribers, strengths
    yield topics.PIN, settings.pins, settings.pin_subscribers, pins
    yield behaviour, settings.behaviours, settings.behaviour_subscribers, behaviours


class _PlannedPublisher:
    """Serialised messages for one topic, and how many subscribers they wait for."""

    def __init__(
        self, node: BusNode, topic: Topic, messages: Sequence[bytes], subscribers: int
    ) -> None:
        self._publisher = node.publisher(topic)
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
