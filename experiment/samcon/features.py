"""What the cost of a state looks at: pose, root, end effectors, centre of mass."""

import numpy as np

from controller_node.dynamics import DynamicsModel
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character import Character


class Features:
    """Turns states into rows of numbers: position, velocity, then what the model says of them."""

    def __init__(self, character: Character) -> None:
        self._size = character.layout.size
        self._model = DynamicsModel(character)
        self._links = end_effectors(character)

    @property
    def width(self) -> int:
        """Length of a row."""
        return 2 * self._size + 6 + 3 * len(self._links)

    def row(self, position: FloatArray, velocity: FloatArray) -> FloatArray:
        """The features (f,) of a state: m, rad, m/s, rad/s."""
        self._model.update(position, velocity)
        points, _ = self._model.link_frames(self._links)
        centre, moving = self._model.centre_of_mass(), self._model.centre_of_mass_velocity()
        return np.concatenate((position, velocity, centre, moving, points.ravel()))


def end_effectors(character: Character) -> IntArray:
    """The links that carry no other, as indices of `Character.links`."""
    parents = {link.parent for link in character.links}
    ends = [index for index in range(len(character.links)) if index not in parents]
    return np.array(ends, dtype=np.intp)
