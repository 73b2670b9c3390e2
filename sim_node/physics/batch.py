"""Many worlds of one character each, side by side: what an engine is asked for to simulate them."""

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.compiled.law import LawGains
from sim_node.physics.settings import SimulationSettings
from sim_node.physics.simulated_character import CharacterSetup


class ActionKind(IntEnum):
    """What an action (n,) of a world is."""

    OFFSET = 0  # to the tracking errors, rad or m; a rotation vector in the child frame
    POSITION = 1  # of the joints, message form, in place of the reference's
    EFFORT = 2  # N m or N, without a law


@dataclass(frozen=True)
class BatchSetup:
    """What all worlds of a batch have in common."""

    character: CharacterSetup
    settings: SimulationSettings
    law: LawGains
    driven: BoolArray  # (n,) what the law or an action may drive
    action: ActionKind
    watches_contacts: bool


@dataclass(frozen=True)
class BatchStates:
    """The worlds between two ticks; the arrays stay the same ones."""

    motion: FloatArray  # (count, 2, n) position, message form, and velocity
    ticks: IntArray  # (count,) of the states' stamps
    rows: IntArray  # (count,) of the reference at the states
    failed: BoolArray  # (count,) has diverged, and stays as it was before
    contacts: FloatArray  # (count, links, 6) of the last tick, N and N m, world axes; or (0, ...)


class Batch(Protocol):
    """Many worlds of one character each. No bit of one depends on the others, nor on threads."""

    states: BatchStates

    def place(self, worlds: IntArray, position: FloatArray, velocity: FloatArray) -> None:
        """Begin an episode in worlds (k,), in states (k, n) and (k, n), message form.

        Nothing is left of what was; ticks and the reference's rows are the caller's.
        """

    def set_reference(self, first: int, position: FloatArray, velocity: FloatArray) -> None:
        """Set the reference: positions, message form, and velocities (rows, n), a row a tick.

        `first` is the number of the first row.
        """

    def push(
        self, world: int, link: int, wrench: FloatArray, point: FloatArray, ticks: int
    ) -> None:
        """Push a link of a world from its present tick on: see `Body.push`."""

    def advance(self, ticks: int, actions: FloatArray | None, history: FloatArray) -> None:
        """Advance all worlds that have not failed, holding actions (count, n), or none.

        `history` (count, ticks, 2, n) gets all states on the way, or is (count, 0, 2, n). The
        reference has rows for all of them.
        """

    def close(self) -> None:
        """End it; it cannot be used any more."""
