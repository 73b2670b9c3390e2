"""The publishers of one character: state, contacts, wrenches, sensors, episode, and displays."""

import time
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from msgs_config.bus.composition import UNTIL_A_MESSAGE, Turns
from msgs_config.bus.node import BusNode, Publisher, StopFlag
from msgs_config.bus.publishing import Outgoing, has_subscribers, publish_together
from msgs_config.character.model import UrdfOptions
from msgs_config.messages import configuration, topics
from msgs_config.messages.cdr import encode_header, encode_string, with_stamp
from msgs_config.messages.joint_state import JointStateEncoder
from msgs_config.messages.pins import PinArrays, encode_pins
from msgs_config.messages.probe import DynamicsSample
from msgs_config.messages.session import episode_text
from msgs_config.messages.topic import Topic
from msgs_config.messages.wrenches import SelectionEncoder, WrenchArrays, encode_wrenches
from msgs_config.parameters import Values
from sim_node.interface.display import DisplayPublishers
from sim_node.interface.sensors import SensorPublishers
from sim_node.node_settings import NodeSettings, SensingSettings
from sim_node.physics.simulated_character import SimulatedCharacter
from sim_node.timing.watchdog import Watchdog, WatchdogEvent


class _OfTick(NamedTuple):
    """A topic that has a message of each tick."""

    publisher: Publisher
    encode: Callable[[], bytes]
    needs_contacts: bool = False  # there is no message of a tick whose contacts were not found

    @property
    def is_heard(self) -> bool:
        return has_subscribers(self.publisher)


class CharacterPublishers:
    """The publishers of one character. A topic without subscribers costs nothing."""

    def __init__(
        self, node: BusNode, character: SimulatedCharacter, settings: NodeSettings, session: str
    ) -> None:
        """Offer the topics, below the character's name; messages name the simulator's `session`."""
        self._character = character
        self._session = session
        self._links = [link.name for link in character.character.links]
        self._last_state = b""
        self._last_episode: bytes | None = None
        self._state_encoder = JointStateEncoder(character.layout.dof_names, session)
        self._no_wrenches = encode_wrenches(WrenchArrays.of_rows(0, [], [], [], session))
        self._contacts_encoder = SelectionEncoder(self._links, session)

        def create(topic: Topic) -> Publisher:
            return node.publisher(topic.under(character.setup.name))

        self._episode = create(topics.EPISODE)
        self.configuration = create(topics.CONFIGURATION.of(node.get_name()))
        self._states = create(topics.JOINT_STATES)
        self._before_state = [  # in the order of publishing
            _OfTick(create(topics.CONTACTS), self._encode_contacts, needs_contacts=True),
            _OfTick(create(topics.APPLIED_WRENCH), self._encode_applied),
        ]
        self._throttled = [
            _OfTick(create(topics.CONTACTS_THROTTLE), self._encode_contacts, needs_contacts=True),
            _OfTick(create(topics.APPLIED_WRENCH_THROTTLE), self._encode_applied),
            _OfTick(create(topics.JOINT_STATES_THROTTLE), lambda: self._last_state),
        ]
        self._pins = create(topics.APPLIED_PIN)
        self._sensors = SensorPublishers(node, character, settings)
        self._display = DisplayPublishers(node, character, settings)

    @property
    def state_subscribers(self) -> int:
        """Number of subscribers of the states."""
        return self._states.get_subscription_count()

    def wants_contacts(self, *, throttled: bool) -> bool:
        """Whether the contacts have subscribers, their wrenches for viewers, or force sensors.

        Subscribers of the `throttled` ones count where the tick is one of theirs.
        """
        due = [*self._before_state, *(self._throttled if throttled else ())]
        return (
            any(each.needs_contacts and each.is_heard for each in due)
            or self._display.wants_contacts
            or self._sensors.wants_contacts
        )

    def publish_configuration(
        self,
        values: Values,
        sample: DynamicsSample,
        terrain: UrdfOptions | None,
        characters: Sequence[str],
        since_ns: int | None,
    ) -> None:
        """Publish all that the character's run depends on, as a bag needs it to repeat the run.

        `values` are the character's parameters, its initial state among them; `characters` are the
        names of all in the world, where there are several. `since_ns` is the stamp of the last
        state before the parameters were in force, None from the start.

        Raises:
            CharacterError: a mesh of the character or of the terrain cannot be read.
        """
        text = configuration.describe(
            self._character.setup.character,
            values,
            since_ns,
            probe=sample,
            terrain=terrain,
            name=self._character.setup.name,
            characters=characters,
            session=self._session,
        )
        self.configuration.publish(encode_string(text))

    def change_sensing(self, settings: SensingSettings) -> None:
        """Read the sensors by other settings from now on."""
        self._sensors.change(settings)

    def publish_episode(self, number: int, stamp_ns: int) -> None:
        """Publish that an episode begins with the state of this stamp."""
        self._last_episode = encode_header(stamp_ns, episode_text(number, self._session))
        self._episode.publish(self._last_episode)

    def before_state(self) -> Iterator[Outgoing]:
        """The messages that a controller may wait for beside a tick's state, which follows them."""
        if self._character.pins and has_subscribers(self._pins):
            yield self._pins, self._encode_pins()
        yield from self._messages(self._before_state)
        yield from self._sensors.messages()

    def state(self) -> Outgoing:
        """The state of a tick."""
        state = self._character.state
        effort = () if state.effort is None else (state.effort,)
        self._last_state = self._state_encoder.encode(
            state.stamp_ns, state.position, state.velocity, *effort
        )
        return self._states, self._last_state

    def throttled(self) -> Iterator[Outgoing]:
        """The messages of the tick for those who do not need each one, the state last."""
        return self._messages(self._throttled)

    def _messages(self, of_tick: Sequence[_OfTick]) -> Iterator[Outgoing]:
        """The messages of the tick on topics that have subscribers."""
        has_contacts = self._character.contacts is not None
        for each in of_tick:
            if (has_contacts or not each.needs_contacts) and each.is_heard:
                yield each.publisher, each.encode()

    def publish_display(self, tick: int) -> None:
        """Publish what shows a tick's state, while the controller works on that state."""
        self._display.publish(tick)

    def republish(self, *, with_state: bool, with_episode: bool) -> None:
        """Publish what is shown again, and the last state, the same bytes, for late subscribers.

        A controller that needs contacts or sensors waits for those as well. The episode shows that
        a simulator that is paused or held back is still there.
        """
        self._display.republish()
        if with_episode and self._last_episode is not None:
            self._episode.publish(self._last_episode)
        if with_state:
            for each in self._before_state:
                if each.needs_contacts and each.is_heard:
                    each.publisher.publish(each.encode())
            publish_together(self._sensors.messages())
            self._states.publish(self._last_state)

    @property
    def of_ticks(self) -> list[Publisher]:
        """The publishers of what comes again at each tick."""
        return [
            *(self._states, self._pins),
            *(each.publisher for each in (*self._before_state, *self._throttled)),
            *(*self._sensors.publishers, *self._display.streams),
        ]

    def _encode_contacts(self) -> bytes:
        """The contacts; none if the topic had no subscriber while they happened."""
        contacts, stamp_ns = self._character.contacts, self._character.state.stamp_ns
        if contacts is None:
            return with_stamp(self._no_wrenches, stamp_ns)
        return self._contacts_encoder.encode(stamp_ns, contacts.wrenches, contacts.touching)

    def _encode_applied(self) -> bytes:
        """The pushes that acted during the tick, pins' forces among them."""
        pushes, stamp_ns = self._character.pushes, self._character.state.stamp_ns
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

    def _encode_pins(self) -> bytes:
        """The pins in force during the tick."""
        rows = {
            self._links[pin.link]: (*pin.place, *pin.point, pin.force)
            for pin in self._character.pins
        }
        return encode_pins(PinArrays.of_rows(self._character.state.stamp_ns, rows, self._session))


def wait_for_subscribers(
    node: BusNode,
    publishers: Sequence[CharacterPublishers],
    wanted: int,
    stop: StopFlag,
) -> Turns:
    """Wait, in turns, until each character's states have as many subscribers, or until `stop`."""
    watchdog = Watchdog()
    watchdog.restart(time.monotonic())
    while not stop and (found := min(each.state_subscribers for each in publishers)) < wanted:
        yield UNTIL_A_MESSAGE
        if WatchdogEvent.EXPLAIN in watchdog.due(time.monotonic()):
            node.get_logger().warning(
                f"waiting for {wanted} subscribers of joint_states; there are {found}; has one "
                "not started, or ended?"
            )
