"""What moves in a MuJoCo model, and its share of the model's arrays."""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointType
from msgs_config.character.model import Link, layout_of

_POSITIONS = {JointType.FLOATING: 7, JointType.SPHERICAL: 4}  # a quaternion has one more


class Place(NamedTuple):
    """Where the numbers of some links are among those of all."""

    links: slice  # of bodies; MuJoCo's first one is the world
    positions: slice
    velocities: slice


class Part:
    """A character's links, or a ball, in a world's model."""

    place: Place
    """Where it is in the model that the world has now."""

    def __init__(self, links: Sequence[Link]) -> None:
        self.is_placed = False  # whether the world's model has it
        self._layout = layout_of(links)
        self._link_count = len(links)
        self._position_count = sum(
            int(_POSITIONS.get(joint.type, 1)) for joint in self._layout.joints
        )

    def put_after(self, place: Place) -> Place:
        """Take its place in a model after another part's; returns it."""
        links, positions, velocities = (each.stop for each in place)
        self.place = Place(
            slice(links, links + self._link_count),
            slice(positions, positions + self._position_count),
            slice(velocities, velocities + self._layout.size),
        )
        self.is_placed = True
        return self.place

    def state(self, data: mujoco.MjData) -> tuple[FloatArray, FloatArray]:
        """Its positions and velocities as MuJoCo has them."""
        return data.qpos[self.place.positions].copy(), data.qvel[self.place.velocities].copy()

    def restore(self, data: mujoco.MjData, state: Sequence[FloatArray]) -> None:
        """Restore a state of `state`."""
        data.qpos[self.place.positions], data.qvel[self.place.velocities] = state


NOTHING = Place(slice(0, 1), slice(0, 0), slice(0, 0))
"""The place of what is there in every model: the ground."""
