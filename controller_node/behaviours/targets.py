"""Targets of a reaction's phases; at a change an offset leads on from the target before."""

from dataclasses import dataclass
from typing import ClassVar, Protocol

from controller_node.references.base import ReferenceState
from controller_node.references.inertialised import InertializationOffset
from controller_node.references.transformed import PlanarTransform, TransformedReference
from msgs_config.character.layout import JointLayout

_NO_CARRY = PlanarTransform()


class Target(Protocol):
    """The state to track over time, which may depend on the reference's own."""

    @property
    def clip(self) -> str:
        """The clip of the library that it is of; empty: the reference, or no motion."""
        ...

    def state_at(self, time: float, own: ReferenceState) -> ReferenceState:
        """The state to track at a time in s, where the reference has the state `own`."""
        ...


@dataclass(eq=False)
class ReferenceTarget:
    """The reference, carried to where the character goes on with it."""

    layout: JointLayout
    carry: PlanarTransform = _NO_CARRY
    offset: InertializationOffset | None = None
    clip: ClassVar[str] = ""

    def state_at(self, time: float, own: ReferenceState) -> ReferenceState:
        """The reference's state, carried, with the rest of the offset."""
        carried = self.carry.moved(self.layout, own)
        return carried if self.offset is None else self.offset.applied(carried, time)


@dataclass(eq=False)
class ClipTarget:
    """A motion of the library."""

    clip: str  # its name
    motion: TransformedReference
    offset: InertializationOffset

    @classmethod
    def entered(
        cls,
        clip: str,
        motion: TransformedReference,
        body: ReferenceState,
        start: float,
        blend: float,
    ) -> "ClipTarget":
        """One that goes over to a motion from a state at `start`, within `blend`; both in s."""
        there = motion.sample(start)
        return cls(clip, motion, InertializationOffset(motion.layout, there, body, start, blend))

    def state_at(self, time: float, own: ReferenceState) -> ReferenceState:
        """The motion's state, with the rest of the offset."""
        return self.offset.applied(self.motion.sample(time), time)


@dataclass(eq=False)
class CurrentStateTarget:
    """The character's present state, to which the target comes: nothing draws the character."""

    state: ReferenceState  # kept up to date by its owner
    offset: InertializationOffset
    clip: ClassVar[str] = ""

    def state_at(self, time: float, own: ReferenceState) -> ReferenceState:
        """The present state, with the rest of the offset."""
        return self.offset.applied(self.state, time)
