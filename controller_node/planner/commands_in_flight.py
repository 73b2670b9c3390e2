"""Commands that act late: the state in which one that is given now will act.

Between a state and the tick in which its answer acts, the commands of the ticks before act. They
are known, so that the model of the world foresees that state, and plan and law work for it. (Smith
1957, "Closer Control of Loops with Dead Time".)
"""

from collections.abc import Mapping
from functools import partial

import numpy as np

from controller_node.control_laws import GainArrays
from controller_node.planner.compiled.rollout import let_act
from controller_node.planner.contact_model import ContactModel
from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState


class CommandsInFlight:
    """The commands on their way, which take one tick or more. It remembers them."""

    def __init__(self, character: Character, model: ContactModel, delay_ticks: int) -> None:
        """Build the model of the world once more; the first time it is compiled."""
        size = character.layout.size
        nothing = np.zeros(size)
        gains = GainArrays(nothing, nothing, nothing, character.effort_limits())
        self.delay_ticks = delay_ticks
        self._model, self._engine, self._body = model, model.engine(), model.body(gains)
        self._clipped = partial(character.layout.clipped, limits=character.effort_limits())
        self._sent: dict[int, FloatArray] = {}  # (n,) by the tick of the state that it answers
        self._nothing = nothing  # what acts before the first command
        self.state_then(0, np.array(character.rest_position), nothing)

    def clear(self) -> None:
        """Begin with no command on its way."""
        self._sent.clear()

    def sent(self) -> dict[int, FloatArray]:
        """The commands on their way, by the tick of the state that each answers."""
        return dict(self._sent)

    def restore(self, sent: Mapping[int, FloatArray]) -> None:
        """Go on with commands on their way."""
        self._sent = dict(sent)

    def send(self, tick: int, effort: FloatArray) -> None:
        """Remember the effort (n,) that answers the state of a tick, which may come once more."""
        self._sent[tick] = self._clipped(effort)
        before = sorted(sent for sent in self._sent if sent < tick - self.delay_ticks)
        for old in before[:-1]:
            del self._sent[old]

    def acting_state(self, tick: int, state: StampedState, clock: TickClock) -> StampedState:
        """The state in which the answer to a tick's state acts, as far as it can be foreseen."""
        position, velocity = self.state_then(tick, state.position, state.velocity)
        stamp_ns = clock.stamp_ns(tick + self.delay_ticks)
        return StampedState(stamp_ns, position, velocity, state.effort)

    def state_then(
        self, tick: int, position: FloatArray, velocity: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Position and velocity (n,) in which the answer to a tick's state will act.

        A state that had no answer, as in real time, goes on with the command before. Where the
        model diverges it is the state itself.
        """
        first = tick - self.delay_ticks
        before = max((sent for sent in self._sent if sent < first), default=None)
        acting = self._nothing if before is None else self._sent[before]
        efforts = np.empty((self.delay_ticks, len(position)))
        for row, each in enumerate(range(first, tick)):
            efforts[row] = acting = self._sent.get(each, acting)
        start = self._model.position_of(position)
        if not let_act(start, velocity.copy(), efforts, self._body, self._engine):
            return position, velocity
        return self._model.message_position(self._engine.position), self._engine.velocity.copy()
