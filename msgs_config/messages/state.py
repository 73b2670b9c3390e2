"""The two things that cross between simulator and controller, as arrays in layout order."""

from dataclasses import dataclass

from msgs_config.arrays import FloatArray


@dataclass(frozen=True)
class StampedState:
    """The generalised state at a tick, as `joint_states` carries it.

    `effort` (n,) is what was really applied during the tick before; None in the first state of
    an episode. Units and frames: docs/topics.md, "Conventions".
    """

    stamp_ns: int
    position: FloatArray  # (n,)
    velocity: FloatArray  # (n,)
    effort: FloatArray | None


@dataclass(frozen=True)
class StampedReference:
    """The desired state at a stamp, as `~/reference` carries it."""

    stamp_ns: int
    position: FloatArray  # (n,)
    velocity: FloatArray  # (n,)
