"""The simulator's parameters: those in force, and those that wait for the next episode."""

from collections.abc import Callable, Mapping

from msgs_config.bus.live_parameters import LiveParameters
from msgs_config.bus.node import BusNode
from msgs_config.errors import ConfigurationError
from msgs_config.messages.state import StampedState
from msgs_config.parameters import Values
from sim_node.initial_state import (
    INITIAL_STATE,
    POSITION,
    VELOCITY,
    CharacterSettings,
    as_values,
    changed_start,
)
from sim_node.parameters import SimulatorParameters


class EpisodeParameters:
    """The parameters of a node that counts episodes.

    In `in_force` the live ones keep the values that they began with.
    """

    def __init__(
        self, node: BusNode, loaded: SimulatorParameters, take: Callable[[Values], None]
    ) -> None:
        """Declare the node's parameters, and hand their values to `take` after each change.

        Those that wait for controllers are declared when these have published them.
        """
        self.in_force = loaded
        self._node, self._take = node, take
        self._upcoming = loaded.values
        self._begun = False
        unknown = loaded.open
        known = [each for each in loaded.declared if each not in unknown]
        node.declare(known, loaded.values)
        self._live = LiveParameters(node, loaded.declared, loaded.values, self._change, self._check)

    def begin_in(self, states: Mapping[str, StampedState]) -> None:
        """Let characters begin in the first states of their references, by their names."""
        waited_for, self._begun = self.in_force.open, True
        self.in_force = self.in_force.with_values({n: as_values(s) for n, s in states.items()})
        known = {each.name: self.in_force.values[each.name] for each in waited_for}
        self._upcoming = Values(self._upcoming | known)
        self._live.declare(waited_for, self.in_force.values)

    def begin_episode(self, states: Mapping[str, StampedState]) -> dict[str, StampedState] | None:
        """Put what was changed into force.

        Characters of these names that begin with their references do so in these states.

        Returns the starts that are others than before, by name; None if nothing has changed.
        """
        before = self.in_force
        after = before.at_reset(self._upcoming)
        states = {
            each.name: states[each.name]
            for each in after.characters
            if each.name in states and CharacterSettings.of(each.values).begins_with_reference
        }
        after = after.with_values({name: as_values(state) for name, state in states.items()})
        if after.values == before.values:
            return None
        self.in_force = after
        if states:
            self._show_starts(states)
        starts = {
            each.name: changed_start(each.values, own.values)
            for each, own in zip(before.characters, after.characters, strict=True)
        }
        return {name: start for name, start in starts.items() if start is not None}

    def refusal(self, changes: Mapping[str, object]) -> str:
        """Why changes of parameters cannot be taken; empty if they can."""
        return self._live.refusal(changes)

    def _show_starts(self, names: Mapping[str, object]) -> None:
        """Give the node's parameters the values that came from controllers."""
        shown = {
            name: self.in_force.values[name]
            for each in self.in_force.characters
            if each.name in names
            for name in (each.prefix + POSITION, each.prefix + VELOCITY)
        }
        self._upcoming = Values(self._upcoming | shown)
        self._node.set_own_parameters(shown)

    def _check(self, values: Values) -> None:
        self.in_force.check_starts(self._upcoming, values)
        kinds = (each.prefix + INITIAL_STATE for each in self.in_force.characters)
        if not self._begun and any(values[each] != self._upcoming[each] for each in kinds):
            raise ConfigurationError(
                f"parameter '{INITIAL_STATE}' may change once the first episode has begun"
            )

    def _change(self, values: Values) -> None:
        self._upcoming = values
        self._take(values)
