"""Decodes the states that a controller can answer."""

from msgs_config.arrays import all_finite
from msgs_config.character.layout import JointLayout
from msgs_config.errors import MessageError
from msgs_config.messages.clock import TickClock
from msgs_config.messages.joint_state import JointStateDecoder, state_in_layout
from msgs_config.messages.state import StampedState


class StateDecoder:
    """Decodes messages of `joint_states` in a layout's order, and checks them."""

    def __init__(self, layout: JointLayout, clock: TickClock) -> None:
        """For states of `layout` whose stamps are ticks of `clock`."""
        self._layout, self._clock = layout, clock
        self._decoder = JointStateDecoder()

    def decode(self, raw: bytes) -> tuple[StampedState, str]:
        """The state in a message, whose stamp is a tick, and its `frame_id`.

        Raises:
            MessageError: the bytes are no JointState, or a number is not finite.
            LayoutError: a name is unknown, or a degree of freedom is missing.
            ClockError: the stamp is no tick.
        """
        arrays = self._decoder.decode(raw)
        state = state_in_layout(self._layout, arrays)
        if not (all_finite(state.position) and all_finite(state.velocity)):
            raise MessageError("it is not finite")
        self._clock.tick(state.stamp_ns)
        return state, arrays.frame_id
