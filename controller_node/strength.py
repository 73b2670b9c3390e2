"""Strengths of joints over time: shares of their gains and of their effort limits."""

from dataclasses import dataclass

import numpy as np

from controller_node.schedule import Schedule
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointLayout
from msgs_config.errors import MotionError, one_of


@dataclass(frozen=True)
class Strengths:
    """Strengths of all physical vectors, from a stamp on."""

    start_ns: int
    values: FloatArray  # (b,)

    def by_joint(self, layout: JointLayout) -> dict[str, float]:
        """The strength of each driven joint."""
        vectors = _vectors(layout)
        return {name: float(self.values[vectors[name]]) for name in layout.actuated_joint_names}


def _vectors(layout: JointLayout) -> dict[str, int]:
    """The number of each joint's last physical vector; a driven joint has one."""
    names = [joint.name for joint in layout.joints for _ in joint.vectors]
    return {name: number for number, name in enumerate(names)}


def strengths_of(
    layout: JointLayout, names: tuple[str, ...], strengths: tuple[float, ...], start_ns: int
) -> Strengths:
    """Strengths by names of joints; joints that are not named, and the root, are at 1.

    Raises:
        MotionError: a name is no driven joint or comes twice, or a strength is not within 0 to 1.
    """
    if len(names) != len(strengths):
        raise MotionError(
            f"strength: it has {len(names)} names and {len(strengths)} efforts; it must have one "
            "strength a joint, in effort"
        )
    driven, vectors = layout.actuated_joint_names, _vectors(layout)
    values = np.ones(len(layout.vector_starts))
    for name, strength in zip(names, strengths, strict=True):
        if name not in driven:
            raise MotionError(f"strength: {one_of('joint', name, driven)}")
        if names.count(name) > 1:
            raise MotionError(f"strength: joint '{name}' is named twice")
        if not 0.0 <= strength <= 1.0:
            raise MotionError(f"strength: that of '{name}' is {strength:g}; it must be 0 to 1")
        values[vectors[name]] = strength
    return Strengths(start_ns, values)


def strength_schedule(layout: JointLayout) -> Schedule[Strengths]:
    """The strengths of an episode, which begins with all of them at 1."""
    return Schedule("strength", Strengths(0, np.ones(len(layout.vector_starts))))
