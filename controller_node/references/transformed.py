"""A reference carried over the ground: turned about z, shifted, and begun at another time."""

import math
from dataclasses import dataclass

import numpy as np

from controller_node.references.base import Reference, ReferenceState
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition, JointLayout
from msgs_config.geometry import rotations


@dataclass(frozen=True)
class PlanarTransform:
    """A move of the whole character: turned about the world's z, then shifted."""

    turn: float = 0.0  # rad
    x: float = 0.0  # m
    y: float = 0.0
    up: float = 0.0  # m, where the ground is higher

    @classmethod
    def leading(
        cls, from_place: FloatArray, from_heading: float, to_place: FloatArray, to_heading: float
    ) -> "PlanarTransform":
        """The move from one place (3,) in m and heading in rad to others; heights do not count.

        The turn is the shorter one.
        """
        turn = math.remainder(to_heading - from_heading, math.tau)
        cosine, sine = math.cos(turn), math.sin(turn)
        x, y = float(from_place[0]), float(from_place[1])
        return cls(
            turn,
            float(to_place[0]) - (cosine * x - sine * y),
            float(to_place[1]) - (sine * x + cosine * y),
        )

    def moved(self, layout: JointLayout, state: ReferenceState) -> ReferenceState:
        """The state as it is after the move; a character with a fixed base stays where it is."""
        if not layout.has_floating_base or self == PlanarTransform():
            return state
        about_z = rotations.about_z(self.turn)
        position = state.configuration.position.copy()
        orientations = state.configuration.orientations_xyzw.copy()
        velocity, acceleration = state.velocity.copy(), state.acceleration.copy()
        linear = np.array((position[:3], velocity[:3], acceleration[:3]))
        position[:3], velocity[:3], acceleration[:3] = rotations.rotate(about_z, linear)
        position[:3] += (self.x, self.y, self.up)
        orientations[0] = rotations.multiply(about_z, orientations[0])
        position[3:6] = rotations.log(orientations[0])
        return ReferenceState(GeneralizedPosition(position, orientations), velocity, acceleration)


@dataclass(frozen=True)
class TransformedReference:
    """Another reference after a move, whose time `motion_start` is this one's time `start`."""

    layout: JointLayout
    motion: Reference
    carry: PlanarTransform = PlanarTransform()
    start: float = 0.0  # s
    motion_start: float = 0.0  # s

    def sample(self, time: float) -> ReferenceState:
        """The desired state at a time in s; before `start` the motion's at its own start."""
        since = max(time - self.start, 0.0)
        return self.carry.moved(self.layout, self.motion.sample(self.motion_start + since))
