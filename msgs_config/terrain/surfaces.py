"""Which surfaces of a terrain a character's links reach."""

from collections.abc import Sequence

import mujoco
import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Character, Shape
from msgs_config.character.mujoco_model import geometry
from msgs_config.character.mujoco_world import Contacts, add_ground
from msgs_config.geometry import fixed_order, rotations

MARGIN = 0.03  # m, from a shape to a surface that it reaches
_ALIKE = 2  # decimals of a normal, by which two are told apart


class Surfaces:
    """A terrain's surfaces and a character's links, by MuJoCo's collision of their shapes."""

    def __init__(self, character: Character, terrain: Sequence[Shape]) -> None:
        """Take a character and a terrain. Raises CharacterError if a mesh cannot be used."""
        spec = mujoco.MjSpec()
        add_ground(spec, Contacts(1e-3, 1.0, 1.0), plane=False, shapes=terrain)
        for each in spec.worldbody.geoms:
            each.contype, each.conaffinity = 1, 0
        for link in character.links:
            body = spec.worldbody.add_body(mass=1.0, inertia=(1.0, 1.0, 1.0))
            body.explicitinertial = True
            body.add_freejoint()
            for shape in link.collision_shapes:
                body.add_geom(**geometry(spec, shape), contype=0, conaffinity=1, margin=MARGIN)
        self._links = len(character.links)
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)

    def normals(self, origins: FloatArray, turns_xyzw: FloatArray) -> Sequence[FloatArray]:
        """For each link the unit normals (k, 3) of the surfaces that it reaches, world.

        The link frames are at (links, 3) in m and (links, 4).
        """
        model, data = self._model, self._data
        turns = rotations.wxyz_from_xyzw(turns_xyzw)
        data.qpos[:] = np.concatenate((origins, turns), axis=1).ravel()
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        contact = data.contact
        bodies = model.geom_bodyid[contact.geom.reshape(-1, 2)]
        away = np.where(bodies[:, :1] == 0, 1.0, -1.0) * contact.frame.reshape(-1, 9)[:, :3]
        found = [away[bodies.max(axis=1) == link + 1] for link in range(self._links)]
        return [_told_apart(each) for each in found]


def _told_apart(normals: FloatArray) -> FloatArray:
    """Unit normals (k, 3), each once."""
    rounded = np.unique(np.round(normals, _ALIKE) + 0.0, axis=0)
    return rounded / fixed_order.norm(rounded)[:, np.newaxis]
