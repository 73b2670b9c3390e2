"""The states in which references begin, as their controllers publish them."""

import time
from collections.abc import Generator, Iterable, Mapping

from msgs_config.bus.composition import UNTIL_A_MESSAGE
from msgs_config.bus.node import BusNode, StopFlag
from msgs_config.bus.once_logger import OnceLogger
from msgs_config.errors import LayoutError, MessageError, SimulationError
from msgs_config.messages import topics
from msgs_config.messages.joint_state import JointStateDecoder, state_in_layout
from msgs_config.messages.state import StampedState
from msgs_config.parameters import Values
from sim_node.initial_state import (
    GIVEN,
    INITIAL_STATE,
    CharacterSettings,
    check_state,
    describe_start,
)
from sim_node.interface.publisher_diagnosis import describe_publishers, publisher_names
from sim_node.node_settings import NodeSettings
from sim_node.parameters import SimulatorParameters
from sim_node.physics.engine import describe_default_engine
from sim_node.physics.settings import SimulationSettings
from sim_node.physics.short_links import describe_speed_bound
from sim_node.physics.simulated_character import SimulatedCharacter
from sim_node.timing.watchdog import Watchdog, WatchdogEvent

_REMEDY = (
    f"start controller_node with the same character, in the character's namespace, or set "
    f"'{INITIAL_STATE}' to {GIVEN}"
)


class InitialStates:
    """The initial states that controllers have to publish."""

    def __init__(
        self,
        node: BusNode,
        characters: Iterable[SimulatedCharacter],
        parameters: SimulatorParameters,
    ) -> None:
        """Subscribe to the controllers of the characters that begin with their references."""
        self._node = node
        self._timeout = NodeSettings.of(parameters.values).initial_state_timeout
        self._speed_limit = SimulationSettings.of(parameters.values).speed_limit
        self._complete = False
        self._characters = {each.setup.name: each for each in characters}
        self._subscriptions: list[_Subscription] = []
        self.watch(parameters, parameters.values)

    def watch(self, parameters: SimulatorParameters, values: Values) -> None:
        """Subscribe to the controllers of those that these values let begin with references."""
        watched = {each.name for each in self._subscriptions}
        for each in parameters.characters:
            begins_so = CharacterSettings.of(values, each.prefix).begins_with_reference
            if begins_so and each.name not in watched:
                character = self._characters[each.name]
                self._subscriptions.append(_Subscription(self._node, character, self._speed_limit))

    def wait(self, stop: StopFlag) -> Generator[float, None, dict[str, StampedState]]:
        """Wait, in turns, for the states, by the characters' names; none if `stop` comes first.

        Raises:
            SimulationError: a controller has published none within `initial_state_timeout`.
        """
        watchdog = Watchdog(timeout=self._timeout)
        watchdog.restart(time.monotonic())
        while missing := self._missing(found := self._look()):
            if stop:
                return {}
            yield UNTIL_A_MESSAGE
            for event in watchdog.due(time.monotonic()):
                sentence = "; ".join(each.describe() for each in missing)
                if event is WatchdogEvent.TIMEOUT:
                    raise SimulationError(
                        f"no initial state within {self._timeout:g} s; {sentence}; {_REMEDY}"
                    )
                self._node.get_logger().warning(f"waiting for the initial state; {sentence}")
        self._complete = True
        return found

    def newest(self) -> dict[str, StampedState]:
        """The states that were published last, by the characters' names.

        Empty before all have been there; without those that cannot be, which are logged.
        """
        if not self._complete:
            return {}
        found = self._look()
        for each in self._missing(found):
            self._node.get_logger().warning(f"the start stays what it was; {each.describe()}")
        return found

    def _look(self) -> dict[str, StampedState]:
        found = {each.name: each.last_state() for each in self._subscriptions}
        return {name: state for name, state in found.items() if state is not None}

    def _missing(self, found: Mapping[str, StampedState]) -> list["_Subscription"]:
        return [each for each in self._subscriptions if each.name not in found]


class _Subscription:
    """The state in which one character's reference begins, as its one controller publishes it."""

    def __init__(self, node: BusNode, character: SimulatedCharacter, speed_limit: float) -> None:
        self.name = character.setup.name
        self._state: StampedState | None = None
        self._character = character.character
        self._speed_limit = speed_limit
        self._node = node
        self._topic = topics.INITIAL_STATE.of(topics.CONTROLLER_NODE).under(self.name)
        self._of = f" of '{self.name}'" if self.name else ""
        self._once_logger = OnceLogger(node.get_logger())
        self._decoder = JointStateDecoder()
        self._messages = node.subscription(self._topic)
        self._contested = False
        self._rejection = ""

    def last_state(self) -> StampedState | None:
        """The last state of the only controller; None while it is missing.

        A message does not name its publisher. So while there are several, their states do not
        count, and the one that remains is asked again.
        """
        if self._node.count_publishers(self._topic.name) > 1:
            self._contested, self._state = True, None
        elif self._contested:
            self._contested = False
            self._messages.close()
            self._messages = self._node.subscription(self._topic)
        elif (raw := self._messages.take()) is not None:
            self._take(raw)
        return self._state

    def _take(self, raw: bytes) -> None:
        self._state, self._rejection = None, ""
        try:
            state = state_in_layout(self._character.layout, self._decoder.decode(raw))
            check_state(self._character, state, self._speed_limit)
        except (MessageError, LayoutError) as error:
            self._rejection = f"initial state{self._of} rejected: {error}"
            self._once_logger.log_once(self._rejection)
            return
        self._state = state

    def describe(self) -> str:
        """One sentence: why there is no state."""
        if self._contested:
            nodes = ", ".join(publisher_names(self._node, self._topic))
            return f"several controllers publish on '{self._topic.name}': {nodes}; one must remain"
        return self._rejection or describe_publishers(self._node, self._topic)


def log_warnings(node: BusNode, parameters: SimulatorParameters) -> None:
    """Log likely mistakes in files, where a character begins below the ground, and its bounds.

    And an engine that stands in for another one.
    """
    for warning in describe_default_engine(SimulationSettings.of(parameters.values).world.engine):
        node.get_logger().warning(warning)
    for each in parameters.characters:
        character, values = each.character, each.values
        bound = describe_speed_bound(character, SimulationSettings.of(values))
        for warning in (*character.warnings, *describe_start(character, values), *bound):
            node.get_logger().warning(f"{each.prefix}{warning}")
