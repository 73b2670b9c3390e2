"""What the simulator publishes of one character, tick by tick."""

from collections.abc import Iterator

from builtin_interfaces.msg import Time
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_msgs.msg import Header, String

from msgs_config.character.robot_description import robot_description
from msgs_config.messages import topics
from msgs_config.messages.joint_state import JointStateEncoder, split_stamp, with_stamp
from msgs_config.messages.session import episode_text
from msgs_config.messages.topics import Outgoing, Topic
from msgs_config.messages.wrenches import WrenchArrays, encode_wrenches, select
from sim_node.interface.display import Display
from sim_node.physics.simulated_character import SimulatedCharacter


class Publishers:
    """The publishers of one character. A topic that nobody listens to costs nothing."""

    def __init__(
        self, node: Node, actor: SimulatedCharacter, display_ticks: int, session: str
    ) -> None:
        """Offer the topics, below the character's name; markers come every `display_ticks`.

        What is said names the simulator's session.
        """
        self._actor = actor
        self._session = session
        self._no_wrenches = encode_wrenches(WrenchArrays.of_rows(0, [], [], [], session))
        namespace = actor.role.name
        self._display_ticks = display_ticks
        self._encoder = JointStateEncoder(actor.layout.dof_names, session)
        self._links = [link.name for link in actor.character.links]

        def offer(topic: Topic) -> Publisher:
            return topics.create_publisher(node, topic.under(namespace))

        self._episode = offer(topics.EPISODE)
        self._configuration = offer(topics.CONFIGURATION.of(node.get_name()))
        self._states = offer(topics.JOINT_STATES)
        self._contacts = offer(topics.CONTACTS)
        self._wrenches = offer(topics.APPLIED_WRENCH)
        self._display = Display(node, actor, namespace)
        self._last_state = b""
        self._last_episode: Header | None = None
        description = robot_description(actor.character)
        if description is not None:
            self._description = offer(topics.ROBOT_DESCRIPTION)
            self._description.publish(String(data=description))

    @property
    def state_subscribers(self) -> int:
        """How many subscribe to the states."""
        return int(self._states.get_subscription_count())

    @property
    def wants_contacts(self) -> bool:
        """Whether anybody listens to the contacts."""
        return bool(self._contacts.get_subscription_count())

    def publish_configuration(self, text: str) -> None:
        """Publish the JSON text that a bag needs to repeat the run."""
        self._configuration.publish(String(data=text))

    def publish_episode(self, number: int, stamp_ns: int) -> None:
        """Publish that an episode begins with the state of this stamp."""
        seconds, nanoseconds = split_stamp(stamp_ns)
        stamp = Time(sec=seconds, nanosec=nanoseconds)
        frame_id = episode_text(number, self._session)
        self._last_episode = Header(stamp=stamp, frame_id=frame_id)
        self._episode.publish(self._last_episode)

    def before_state(self) -> Iterator[Outgoing]:
        """What a controller may wait for beside a tick's state, which comes after it."""
        if self._actor.contacts is not None and self.wants_contacts:
            yield self._contacts, self._encode_contacts()
        if self._wrenches.get_subscription_count():
            yield self._wrenches, self._encode_applied()

    def state(self) -> Outgoing:
        """The state of a tick."""
        state = self._actor.state
        effort = () if state.effort is None else (state.effort,)
        self._last_state = self._encoder.encode(
            state.stamp_ns, state.position, state.velocity, *effort
        )
        return self._states, self._last_state

    def publish_display(self, tick: int) -> None:
        """Publish what shows a tick's state; made while the controller works on that."""
        self._display.publish_base()
        if tick % self._display_ticks == 0 or self._actor.state.effort is None:
            self._display.publish_markers()

    def republish(self, *, with_state: bool, with_episode: bool) -> None:
        """Publish the markers again, and the last state, the same bytes, for late joiners.

        A controller that needs the contacts waits for those as well. The episode shows that a
        simulator that is paused or held back is still there.
        """
        self._display.publish_markers()
        if with_episode and self._last_episode is not None:
            self._episode.publish(self._last_episode)
        if with_state:
            if self.wants_contacts:
                self._contacts.publish(self._encode_contacts())
            self._states.publish(self._last_state)

    def flush(self, seconds: float) -> bool:
        """Wait until every subscriber has the last tick, at the most `seconds`; whether it has."""
        own = (self._states, self._contacts, self._wrenches)
        return topics.flush((*own, *self._display.publishers), seconds)

    def _encode_contacts(self) -> bytes:
        """What touched; nothing if nobody listened while it happened."""
        contacts, stamp_ns = self._actor.contacts, self._actor.state.stamp_ns
        if contacts is None:
            return with_stamp(self._no_wrenches, stamp_ns)
        touching = (self._links, contacts.wrenches, contacts.touching)
        return encode_wrenches(select(stamp_ns, *touching, self._session))

    def _encode_applied(self) -> bytes:
        """What pushed during the tick."""
        pushes, stamp_ns = self._actor.pushes, self._actor.state.stamp_ns
        if not pushes:
            return with_stamp(self._no_wrenches, stamp_ns)
        return encode_wrenches(
            WrenchArrays.of_rows(
                stamp_ns,
                [self._links[push.link] for push in pushes],
                [push.wrench for push in pushes],
                [push.point for push in pushes],
                self._session,
            )
        )
