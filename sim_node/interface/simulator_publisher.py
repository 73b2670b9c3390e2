"""Publishes what concerns the whole simulator: its ticks, episodes and configuration."""

from collections.abc import Iterator, Sequence
from itertools import chain

from msgs_config.bus.node import BusNode
from msgs_config.bus.publishing import Outgoing, flush, has_subscribers, publish_together
from msgs_config.messages import topics
from msgs_config.messages.cdr import encode_clock
from msgs_config.messages.probe import DynamicsSample
from msgs_config.runtime.throttle import Throttle
from sim_node.interface.keyframes import SimulatorKeyframes
from sim_node.interface.publishers import CharacterPublishers
from sim_node.interface.world_interface import WorldInterface
from sim_node.node_settings import NodeSettings
from sim_node.parameters import SimulatorParameters
from sim_node.physics.probe import measure_probe
from sim_node.physics.simulation import Simulation

_ACKNOWLEDGE_TIME = 0.5  # s that subscribers may take to acknowledge a changed configuration


class SimulatorPublisher:
    """Publishes each tick in a row, in the order in which controllers may wait for its messages."""

    def __init__(
        self,
        node: BusNode,
        simulation: Simulation,
        world: WorldInterface,
        of_characters: Sequence[CharacterPublishers],
        samples: Sequence[DynamicsSample],
        keyframes: SimulatorKeyframes,
    ) -> None:
        """Offer the clock. `samples` are the dynamics that the engine has for each character."""
        self._simulation = simulation
        self._world = world
        self.of_characters = of_characters
        self._samples, self._keyframes = samples, keyframes
        self._is_configured = False
        self._clock_topic = node.publisher(topics.CLOCK)
        self._throttle = Throttle()
        self._is_chosen = True  # whether the tick is published on the throttled topics

    def publish_configurations(
        self, parameters: SimulatorParameters, since_ns: int | None = None
    ) -> None:
        """Publish each character's parameters, and the dynamics that the engine has for it.

        `since_ns` is the stamp of the last state before, None from the start.
        """
        self._is_configured = True
        terrain = self._simulation.settings.world.terrain
        for each, own, sample in zip(
            self.of_characters, parameters.characters, self._samples, strict=True
        ):
            each.publish_configuration(own.values, sample, terrain, parameters.names, since_ns)

    def change(self, parameters: SimulatorParameters, since_ns: int | None) -> None:
        """Go on with other parameters, which are published before the next episode's messages."""
        sensing = NodeSettings.of(parameters.values).sensing
        for each in self.of_characters:
            each.change_sensing(sensing)
        engine = self._simulation.settings.world.engine
        self._samples = [
            measure_probe(each.character, sensing.gravity, engine) for each in parameters.characters
        ]
        if self._is_configured:
            self.publish_configurations(parameters, since_ns)
            # each latched topic keeps one message: the next must not push it out
            flush([each.configuration for each in self.of_characters], _ACKNOWLEDGE_TIME)

    def publish_episode(self, first_ns: int) -> None:
        """Publish that the episode began with the state of a stamp."""
        self._keyframes.episode_ns = first_ns
        for each in self.of_characters:
            each.publish_episode(self._simulation.episode, first_ns)

    def republish(self, *, with_states: bool, with_episode: bool) -> None:
        """Publish the present states again, for late subscribers, or the episode."""
        for each in self.of_characters:
            each.republish(with_state=with_states, with_episode=with_episode)
        self._publish_throttled()

    def wants_contacts(self) -> bool:
        """Whether the contacts of the tick that begins now have to be found."""
        self._is_chosen = self._throttle.chooses()
        return any(each.wants_contacts(throttled=self._is_chosen) for each in self.of_characters)

    def publish_tick(self) -> None:
        """Publish the present tick; what is only displayed comes after the states."""
        publish_together(self._messages())
        for each in self.of_characters:
            each.publish_display(self._simulation.tick)
        if self._is_chosen:
            self._publish_throttled()

    def make_up(self) -> None:
        """Publish the last tick on the throttled topics, too, where no other follows it."""
        if self._throttle.makes_up():
            self._publish_throttled()

    def _publish_throttled(self) -> None:
        own = chain.from_iterable(each.throttled() for each in self.of_characters)
        publish_together(chain(self._world.throttled(), own))

    def is_acknowledged(self, seconds: float) -> bool:
        """Wait at most `seconds` until every subscriber has the last tick; whether it has."""
        of_ticks = [each.of_ticks for each in self.of_characters]
        return flush(chain(self._world.publishers, *of_ticks), seconds)

    def _messages(self) -> Iterator[Outgoing]:
        """The messages that are published before the tick can be answered, the states last."""
        yield from self._keyframes.messages()
        if has_subscribers(self._clock_topic):
            yield self._clock_topic, encode_clock(self._simulation.stamp_ns)
        yield from self._world.messages()
        for each in self.of_characters:
            yield from each.before_state()
        for each in self.of_characters:
            yield each.state()
