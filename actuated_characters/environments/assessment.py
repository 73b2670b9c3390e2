"""What an environment makes of a state: an observation, a reward, and whether the motion is lost.

The reward is that of DeepMimic (Peng et al. 2018, "DeepMimic", section 5), where the weight of the
end effectors, which it leaves out, goes to the centre of mass:
`0.65 exp(-2 sum |q_d - q|^2) + 0.1 exp(-0.1 sum |v_d - v|^2) + 0.25 exp(-10 |c_d - c|^2)`, the sums
over joints, c the centre of mass, d of the desired state at the new state's time.
"""

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np

from actuated_characters.metrics.error_measures import FARTHEST
from actuated_characters.metrics.falls import FallWatch, reader_for
from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character, UrdfOptions
from msgs_config.geometry import fixed_order, scalars

Motion: TypeAlias = Sequence[FloatArray] | FloatArray
"""Position and velocity (n,) each, message form."""
Terrain: TypeAlias = UrdfOptions | None
_DOWNWARDS = (0.0, 0.0, -1.0)
_BASE_DOFS = 6  # entries of a floating base
_OF_BASE = 10  # numbers in an observation: height, gravity, velocity, angular velocity


class Assessment:
    """Observations (k,) and rewards of one character's states, by a model of its dynamics."""

    def __init__(
        self,
        character: Character,
        model: DynamicsModel,
        step_rate_hz: float,
        terrain: Terrain,
        *,
        falls: bool,
    ) -> None:
        """For steps at a rate, on a terrain; without gravity nothing `falls`.

        The model is in another state after each call.
        """
        self._model = model
        reader = reader_for(character, terrain) if falls else None
        self.fall = None if reader is None else FallWatch(reader, step_rate_hz)
        """Watches the states that are judged for a fall; None where there is none."""
        self._floats = character.layout.has_floating_base
        self._joints = slice(_BASE_DOFS if self._floats else 0, None)
        size = character.layout.size
        joints = size - (_BASE_DOFS if self._floats else 0)
        self._parts = np.cumsum([_OF_BASE * self._floats, joints, joints, size, size]).tolist()

    @property
    def size(self) -> int:
        """How many numbers an observation has."""
        return int(self._parts[-1])

    def observation(self, state: Motion, ahead: Motion) -> FloatArray:
        """The observation (k,) of a state, with the desired state that lies ahead."""
        base, position, velocity, error, _ = self._parts
        where, speed = state
        seen = np.empty(self.size)
        if self._floats:
            axes = scalars.axes(scalars.exp(where[3:_BASE_DOFS].tolist()))
            seen[0] = where[2]
            seen[1:4] = scalars.to_child(axes, _DOWNWARDS)
            seen[4:7] = scalars.to_child(axes, speed[:3].tolist())
            seen[7:base] = speed[3:_BASE_DOFS]
        seen[base:position] = where[self._joints]
        seen[position:velocity] = speed[self._joints]
        seen[velocity:error] = self._error(state, ahead)
        seen[error:] = ahead[1]
        return seen

    def reward(self, state: Motion, desired: Motion) -> tuple[float, bool]:
        """The reward of a state, 0 to 1, and whether the motion is lost."""
        turn = self._error(state, desired)[self._joints]
        spin = (desired[1] - state[1])[self._joints]
        centre = self._model.centre_of_mass_at(state[0])
        wanted = self._model.centre_of_mass_at(desired[0])
        pose = 0.65 * math.exp(-2.0 * float(fixed_order.dot(turn, turn)))
        speed = 0.1 * math.exp(-0.1 * float(fixed_order.dot(spin, spin)))
        away = wanted - centre
        place = 0.25 * math.exp(-10.0 * float(fixed_order.dot(away, away)))
        return pose + speed + place, self._is_over(state, desired, away)

    def _is_over(self, state: Motion, desired: Motion, away: FloatArray) -> bool:
        """Whether an episode ends: it fell, or its centre of mass is far, by `away` (3,) m."""
        fell = self.fall is not None and self.fall.has_fallen(state[0], desired[0])
        return fell or (self._floats and bool(fixed_order.norm(away) > FARTHEST))

    def _error(self, state: Motion, desired: Motion) -> FloatArray:
        """The error (n,) from a state to a desired one: `JointLayout.difference`."""
        return self._model.compute_error(state[0], desired[0])
