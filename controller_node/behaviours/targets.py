"""What is tracked in each phase of a reaction: ways that lead on from one another."""

from typing import Protocol

from controller_node.references.base import Reference, ReferenceState
from controller_node.references.inertialised import InertializationOffset
from controller_node.references.transformed import PlanarTransform
from msgs_config.character.layout import JointLayout

_NO_CARRY = PlanarTransform()


class Target(Protocol):
    """What is tracked; its state at a time in s may depend on that of the own reference."""

    def target(self, time: float, own: ReferenceState) -> ReferenceState:
        """The state to track at a time."""
        ...


class _AsItIs:
    """The own reference."""

    def target(self, time: float, own: ReferenceState) -> ReferenceState:
        """The own reference's state."""
        return own


AS_IT_IS: Target = _AsItIs()


class ReferenceTarget:
    """The own reference, where the character has been carried to, and the way onto it."""

    def __init__(
        self,
        layout: JointLayout,
        carry: PlanarTransform = _NO_CARRY,
        offset: InertializationOffset | None = None,
    ) -> None:
        self._layout = layout
        self.carry = carry
        self._offset = offset

    def target(self, time: float, own: ReferenceState) -> ReferenceState:
        """The own reference's state, carried, with what is left of the offset."""
        carried = self.carry.moved(self._layout, own)
        return carried if self._offset is None else self._offset.applied(carried, time)


class ClipTarget:
    """A motion that was found."""

    def __init__(self, reference: Reference) -> None:
        self._reference = reference

    def target(self, time: float, own: ReferenceState) -> ReferenceState:
        """The motion's state."""
        return self._reference.sample(time)


class CurrentStateTarget:
    """The body itself: nothing is tracked, and the target comes to the state that there is."""

    def __init__(self, offset: InertializationOffset, state: ReferenceState) -> None:
        """From what `offset` leads to; `state` is the present one, to be kept up to date."""
        self._offset = offset
        self.state = state

    def target(self, time: float, own: ReferenceState) -> ReferenceState:
        """The present state, with what is left of the offset."""
        return self._offset.applied(self.state, time)
