"""What the cost of a state looks at: pose, root, end effectors, centre of mass."""

import numpy as np

from msgs_config import rotations
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character import Character
from msgs_config.dynamics import DynamicsModel
from msgs_config.geometry import fixed_order


class Features:
    """Turns states into rows of numbers: position, velocity, then what the model says of them."""

    def __init__(self, character: Character) -> None:
        self._size = character.layout.size
        self._floating = character.layout.has_floating_base
        self._model = DynamicsModel(character)
        self._links = end_effectors(character)

    @property
    def width(self) -> int:
        """Length of a row."""
        return 2 * self._size + 9 + 3 * len(self._links)

    def row(self, position: FloatArray, velocity: FloatArray) -> FloatArray:
        """The features (f,) of a state: m, rad, m/s, rad/s, and kg m^2/s of momentum."""
        self._model.update(position, velocity)
        points, _ = self._model.link_frames(self._links)
        centre, moving = self._model.centre_of_mass(), self._model.centre_of_mass_velocity()
        spin = self._angular_momentum(position, velocity, centre)
        return np.concatenate((position, velocity, centre, moving, spin, points.ravel()))

    def _angular_momentum(
        self, position: FloatArray, velocity: FloatArray, centre: FloatArray
    ) -> FloatArray:
        """The angular momentum (3,) about the centre of mass, world axes; zero of a fixed base.

        The generalised momentum of the root's rotation is the one about the root's origin, in the
        base frame (Featherstone 2008, section 9.6).
        """
        if not self._floating:
            return np.zeros(3)
        momentum = fixed_order.apply(self._model.mass_matrix()[:6], velocity)
        about_root = rotations.rotate(rotations.exp(position[3:6]), momentum[3:])
        return about_root - np.cross(centre - position[:3], momentum[:3])


def end_effectors(character: Character) -> IntArray:
    """The links that carry no other, as indices of `Character.links`."""
    parents = {link.parent for link in character.links}
    ends = [index for index in range(len(character.links)) if index not in parents]
    return np.array(ends, dtype=np.intp)
