"""The hash over the states of a run, by which two runs are told apart or found the same."""

import hashlib
from collections.abc import Iterable

import numpy as np

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.messages.state import StampedState


class StateHash:
    """A hash over every tick's state, its doubles bit for bit.

    A copy goes on from the same states. A pickled one begins again with the hash so far: what
    SHA-256 remembers cannot be sent to another process.
    """

    def __init__(self, before: str = "") -> None:
        """Begin; `before` is the hash of states that are known by nothing else."""
        self._hash = hashlib.sha256(before.encode())

    def __reduce__(self) -> tuple[type["StateHash"], tuple[str]]:
        return StateHash, (self.hexdigest(),)

    def copy(self) -> "StateHash":
        """Another one, of the same states so far."""
        other = StateHash()
        other._hash = self._hash.copy()
        return other

    def add(self, state: StampedState) -> None:
        """Add a state: stamp, position and velocity."""
        self._hash.update(state.stamp_ns.to_bytes(8, "little", signed=True))
        self._hash.update(state.position.tobytes())
        self._hash.update(state.velocity.tobytes())

    def add_rows(self, stamps_ns: IntArray, motion: FloatArray) -> None:
        """Add states in rows: stamps (m,), and positions and velocities (m, 2, n)."""
        size = motion.shape[2]
        rows = np.empty((len(motion), 1 + 2 * size))
        rows[:, 0] = stamps_ns.astype("<i8").view(float)
        rows[:, 1:] = motion.reshape(len(motion), 2 * size)
        self._hash.update(rows.data)

    def hexdigest(self) -> str:
        """The hash of all states so far, hexadecimal."""
        return self._hash.hexdigest()


def hash_of_states(
    stamps_ns: IntArray, position: Iterable[FloatArray], velocity: Iterable[FloatArray]
) -> str:
    """The hash over states in rows, as many as there are velocities."""
    states = StateHash()
    for stamp_ns, position_now, velocity_now in zip(
        stamps_ns.tolist(), position, velocity, strict=False
    ):
        states.add(StampedState(stamp_ns, position_now, velocity_now, None))
    return states.hexdigest()
