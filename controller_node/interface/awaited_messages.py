"""The messages beside a state that a behaviour needs to answer it."""

from controller_node.behaviours.base import Surroundings
from controller_node.controller import Controller
from controller_node.interface.contact_subscription import ContactSubscription
from controller_node.interface.opponent_subscription import OpponentSubscription, states_of
from controller_node.interface.simulators import Simulators
from msgs_config.bus.node import BusNode
from msgs_config.bus.once_logger import OnceLogger
from msgs_config.character.model import Character


class AwaitedMessages:
    """Takes what a controller's behaviour needs, and has that of each state ready."""

    def __init__(
        self,
        node: BusNode,
        controller: Controller,
        character: Character,
        simulators: Simulators,
        logger: OnceLogger,
    ) -> None:
        """Subscribe. Raises ConfigurationError if an opponent is needed, and there can be none."""
        self._node, self._simulators, self._logger = node, simulators, logger
        self._character = character
        self._contacts: ContactSubscription | None = None
        self._opponent: OpponentSubscription | None = None
        self.use(controller)

    def check(self, controller: Controller) -> None:
        """Raise ConfigurationError if a controller needs an opponent, and there can be none."""
        if controller.opponent:
            states_of(self._node, controller.opponent)

    def use(self, controller: Controller) -> None:
        """Take what this controller needs from now on. Raises as `check` does."""
        node, simulators, logger = self._node, self._simulators, self._logger
        if self._contacts is not None and not controller.needs_contacts:
            self._contacts.close()
            self._contacts = None
        elif self._contacts is None and controller.needs_contacts:
            self._contacts = ContactSubscription(node, self._character, simulators, logger)
        if self._opponent is not None and self._opponent.opponent != controller.opponent:
            self._opponent.close()
            self._opponent = None
        if self._opponent is None and controller.opponent:
            self._opponent = OpponentSubscription(node, controller.opponent, simulators, logger)

    def begin(self) -> None:
        """An episode begins, whose stamps may be those of another simulator's episode before."""
        if self._contacts is not None:
            self._contacts.begin()

    def restart(self) -> None:
        """Forget all: what comes from now on is another simulator's."""
        for each in (self._contacts, self._opponent):
            if each is not None:
                each.restart()

    def until(self, stamp_ns: int, episode_ns: int) -> Surroundings | None:
        """What goes with a state; None as long as some of it is yet to come."""
        opponent = contacts = None
        if self._opponent is not None:
            opponent = self._opponent.at(stamp_ns)
            if opponent is None:
                return None
        if self._contacts is not None:  # last: it hands out the contacts of a state only once
            contacts = self._contacts.until(stamp_ns, episode_ns)
            if contacts is None:
                return None
        return Surroundings(contacts, opponent)
