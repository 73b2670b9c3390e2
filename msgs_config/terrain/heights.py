"""How high a terrain is, seen from above."""

from collections.abc import Sequence

import mujoco
import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.model import Shape
from msgs_config.character.mujoco_world import Contacts, add_ground

_ABOVE = 1e4  # m: higher than any terrain
_DOWN = np.array((0.0, 0.0, -1.0))


class Heights:
    """Shapes that do not move, as MuJoCo has them."""

    def __init__(self, shapes: Sequence[Shape]) -> None:
        """Take a terrain's shapes. Raises CharacterError if a mesh cannot be used."""
        self._shapes = shapes
        spec = mujoco.MjSpec()
        add_ground(spec, Contacts(1e-3, 1.0, 1.0), plane=False, shapes=shapes)
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        mujoco.mj_kinematics(self._model, self._data)

    def __reduce__(self) -> tuple[object, ...]:
        return Heights, (self._shapes,)

    def at(self, places: FloatArray) -> FloatArray:
        """The height z (r,) in m of the highest surface at places (r, 2) in m; NaN without one."""
        return self.below(np.column_stack((places, np.full(len(places), _ABOVE))))

    def below(self, points: FloatArray) -> FloatArray:
        """The height z (r,) in m of the highest surface below points (r, 3) in m; NaN without."""
        heights = np.full(len(points), np.nan)
        for row, point in enumerate(points):
            way = mujoco.mj_ray(self._model, self._data, point, _DOWN, None, True, -1, None)
            if way >= 0.0:
                heights[row] = point[2] - way
        return heights
