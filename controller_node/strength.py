"""How firmly each joint is driven: shares of its gains and of its effort limit."""

from dataclasses import dataclass

import numpy as np

from controller_node.control_laws import GainArrays
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout
from msgs_config.errors import MotionError, one_of

_MOST_WAITING = 100  # messages


def weakened(layout: JointLayout, gains: GainArrays, strengths: FloatArray) -> GainArrays:
    """Gains and limits times strengths (b,), 0 to 1, one a physical vector.

    At strength 0 a vector has no effort, whatever the law adds to its gains. All at 1 they are
    the same object.
    """
    if (strengths == 1.0).all():
        return gains
    entries = np.repeat(strengths, layout.vector_lengths)
    return GainArrays(
        gains.stiffness * entries,
        gains.damping * entries,
        gains.integral * entries,
        limits_of(gains.effort_limits, strengths),
    )


def limits_of(limits: FloatArray, strengths: FloatArray) -> FloatArray:
    """Limits (b,) times strengths (b,); nothing of an infinite one is nothing."""
    weak = strengths > 0.0
    return np.where(weak, limits * np.where(weak, strengths, 1.0), 0.0)


@dataclass(frozen=True)
class Strengths:
    """Strengths of all physical vectors, from a stamp on."""

    start_ns: int
    values: FloatArray  # (b,)

    def by_joint(self, layout: JointLayout) -> dict[str, float]:
        """The strength of each driven joint."""
        vectors = [joint.name for joint in layout.joints for _ in joint.vectors]
        driven = layout.actuated_joint_names
        return {name: float(self.values[vectors.index(name)]) for name in driven}


def strengths_of(
    layout: JointLayout, names: tuple[str, ...], strengths: tuple[float, ...], start_ns: int
) -> Strengths:
    """Strengths by names of joints; those that are not named are at 1, and so is the root.

    Raises:
        MotionError: a name is no driven joint or comes twice, or a strength is not within 0 to 1.
    """
    if len(names) != len(strengths):
        raise MotionError(
            f"strength: it has {len(names)} names and {len(strengths)} efforts; it must have one "
            "strength a joint, in effort"
        )
    driven = layout.actuated_joint_names
    vectors = [joint.name for joint in layout.joints for _ in joint.vectors]
    values = np.ones(len(vectors))
    for name, strength in zip(names, strengths, strict=True):
        if name not in driven:
            raise MotionError(f"strength: {one_of('joint', name, driven)}")
        if names.count(name) > 1:
            raise MotionError(f"strength: joint '{name}' is named twice")
        if not 0.0 <= strength <= 1.0:
            raise MotionError(f"strength: that of '{name}' is {strength:g}; it must be 0 to 1")
        values[vectors.index(name)] = strength
    return Strengths(start_ns, values)


class StrengthSchedule:
    """Strengths that come over time: each holds from its stamp on, until the next one's."""

    def __init__(self, layout: JointLayout) -> None:
        self._none = Strengths(0, np.ones(len(layout.vector_starts)))
        self.clear()

    def clear(self) -> None:
        """All at 1 again; what waits is forgotten."""
        self._in_force, self._waiting = self._none, list[Strengths]()

    def add(self, strengths: Strengths) -> None:
        """Take strengths; of two of one stamp the later ones count.

        Raises:
            MotionError: too many wait for their stamps.
        """
        if len(self._waiting) >= _MOST_WAITING:
            raise MotionError(f"strength: more than {_MOST_WAITING} are yet to begin")
        self._waiting.append(strengths)
        self._waiting.sort(key=lambda waiting: waiting.start_ns)  # stable

    def at(self, stamp_ns: int) -> FloatArray:
        """The strengths (b,) at a stamp; stamps must not go back."""
        while self._waiting and self._waiting[0].start_ns <= stamp_ns:
            self._in_force = self._waiting.pop(0)
        return self._in_force.values
