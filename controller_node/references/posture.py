"""Place, heading and side of a floating base."""

import math

import numpy as np

from controller_node.references.transformed import PlanarTransform
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import GeneralizedPosition
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError
from msgs_config.geometry import fixed_order, rotations

_UP = np.array((0.0, 0.0, 1.0))
_FORWARD = np.array((1.0, 0.0, 0.0))
_FALLEN_TILT = math.radians(60.0)  # rad, between the upward axes of body and target
_FALLEN_HEIGHT = 0.5  # share of the height of the target's root
_FALLEN_DROP = 0.2  # share of the rest height, below the target's root: what lies cannot fall


class Posture:
    """Heading, tilt and side of the base, measured from the rest pose: upright, facing along x."""

    def __init__(self, character: Character) -> None:
        """From a character's rest pose. Raises ConfigurationError if its base is fixed."""
        if not character.layout.has_floating_base:
            raise ConfigurationError(
                f"character '{character.name}' has a fixed base; a behaviour other than tracking "
                "and ragdoll needs one that floats"
            )
        self._drop = _FALLEN_DROP * (character.rest_position[2] - character.placement.z)
        rest = rotations.exp(np.array(character.rest_position[3:6]))
        # in the character's own world, which its placement may have turned
        self._upright = rotations.multiply(rotations.about_z(-character.placement.yaw), rest)

    def _from_upright(self, root_xyzw: FloatArray) -> FloatArray:
        return rotations.multiply(root_xyzw, rotations.conjugate(self._upright))

    def heading(self, root_xyzw: FloatArray) -> FloatArray:
        """Angle (...) in rad about z of the way that it faces; arbitrary where upside down."""
        return rotations.yaw(self._from_upright(root_xyzw))

    def carry(self, start: GeneralizedPosition, end: GeneralizedPosition) -> PlanarTransform:
        """The move from where one root is, and faces, to where another one is."""
        return PlanarTransform.leading(
            start.position[:3],
            float(self.heading(start.orientations_xyzw[0])),
            end.position[:3],
            float(self.heading(end.orientations_xyzw[0])),
        )

    def tilt(self, root_xyzw: FloatArray, reference_xyzw: FloatArray) -> float:
        """Angle in rad between its upward axis and that of a reference."""
        up, wanted = (
            rotations.rotate(self._from_upright(q), _UP) for q in (root_xyzw, reference_xyzw)
        )
        return math.acos(min(max(float(fixed_order.dot(up, wanted)), -1.0), 1.0))

    def has_fallen(
        self, body: GeneralizedPosition, target: GeneralizedPosition, ground: float = 0.0
    ) -> bool:
        """Whether the root of a body is far below a target's, or far from as upright.

        Both are seen from the height of the ground below the body, m.
        """
        height, wanted = (float(each.position[2]) - ground for each in (body, target))
        if height < _FALLEN_HEIGHT * wanted and wanted - height > self._drop:
            return True
        return self.tilt(body.orientations_xyzw[0], target.orientations_xyzw[0]) > _FALLEN_TILT

    def faces_up(self, root_xyzw: FloatArray) -> bool:
        """Whether its front points up rather than down."""
        front = rotations.rotate(self._from_upright(root_xyzw), _FORWARD)
        return bool(front[2] > 0.0)
