"""The soft limits of a character's ball joints, in compiled code; see the equations there."""

from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba import types
from numba.experimental import structref

from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character
from msgs_config.compiled.decorator import Compiler
from msgs_config.compiled.dynamics import GIVEN, VIEW
from msgs_config.compiled.mass_matrix import MassMatrix
from msgs_config.compiled.soft_limits import (
    PassedBounds,
    SoftLimits,
    find_effort,
    find_passed,
    make_soft_limits,
    room_for_bounds,
)

_compiled = Compiler(Path(__file__))
_FIELDS = (
    ("step_s", types.float64),
    ("limits", numba.typeof(make_soft_limits([], [], []))),
    ("room", numba.typeof(room_for_bounds(0, 0))),
)


@structref.register
class _LimitsType(types.StructRef):
    pass


class _Limits(structref.StructRefProxy):
    """Step in s, `SoftLimits` in message form, and `PassedBounds`: one argument for both."""


structref.define_proxy(_Limits, _LimitsType, [name for name, _ in _FIELDS])
_LIMITS = _LimitsType(_FIELDS)


def limits_and_room(character: Character) -> tuple[SoftLimits, PassedBounds]:
    """A character's soft limits, in message form, and room for all that may be passed at once."""
    limited = [joint for joint in character.moving_joints if joint.soft_limit is not None]
    limits = [joint.soft_limit for joint in limited if joint.soft_limit is not None]
    starts = [character.layout.joint(joint.name).start for joint in limited]
    room = room_for_bounds(3 * len(limits), character.layout.size)
    return make_soft_limits(limits, starts, starts), room


class SoftLimitForces:
    """What the soft limits do in an engine's step, if there are any."""

    def __init__(self, character: Character, step_s: float) -> None:
        """For engine steps of `step_s`."""
        self._limits = _make_limits(step_s, *limits_and_room(character))
        self._passed = 0

    def find(self, position: FloatArray, velocity: FloatArray) -> bool:
        """Whether a state, each (n,), is beyond bounds, or will pass some in a step."""
        self._passed = _find(self._limits, position, velocity)
        return self._passed > 0

    def effort(self, model: DynamicsModel) -> FloatArray:
        """The effort (n,) of the bounds that were found, N m; of a model in that state."""
        effort: FloatArray = _effort(self._limits, self._passed, model.view)
        return effort


@_compiled.of(_LIMITS(*(kind for _, kind in _FIELDS)))
def _make_limits(step_s: float, limits: SoftLimits, room: PassedBounds) -> Any:
    return _Limits(step_s, limits, room)


@_compiled.of(types.intp(_LIMITS, GIVEN, GIVEN))
def _find(held: Any, position: FloatArray, velocity: FloatArray) -> int:
    return find_passed(position, velocity, held.step_s, held.limits, held.room)


@_compiled.of(types.Array(types.float64, 1, "C")(_LIMITS, types.intp, VIEW))
def _effort(held: Any, count: int, view: Any) -> FloatArray:
    effort = np.empty(len(view.velocity))
    find_effort(effort, count, MassMatrix(view.model, view.data, view.mass), held.room)
    return effort
