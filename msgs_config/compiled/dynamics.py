"""A character's state taken over by MuJoCo, and stable PD in it, each in one compiled call.

They call the functions of MuJoCo's that `msgs_config.character.dynamics` calls, in the same order,
and make the sums of `controller_node.control_laws.stable_pd_effort` entry by entry: the result has
the bits of these, which the tests compare.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.experimental import structref

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.compiled import law
from msgs_config.compiled import mujoco_functions as mj
from msgs_config.compiled.decorator import compiled
from msgs_config.compiled.mass_matrix import MassMatrix

_OWN = types.Array(types.float64, 1, "C")
_ROWS = types.Array(types.float64, 2, "C")
GIVEN = types.Array(types.float64, 1, "A", readonly=True)
"""Any array (n,): it is copied before MuJoCo reads it, as rows that lie apart cannot be."""
_FIELDS = (
    ("model", types.intp),
    ("data", types.intp),
    ("position", _OWN),
    ("velocity", _OWN),
    ("mass", _OWN),
    ("diagonal", types.Array(types.intp, 1, "C")),
    ("identity", _OWN),
    ("desired", _OWN),
    ("passive_damping", _OWN),
)


@structref.register
class _ViewType(types.StructRef):
    pass


class DynamicsView(structref.StructRefProxy):
    """What compiled code has of a `DynamicsModel`; one argument, for many would take a us or two.

    MuJoCo's model and data by their addresses, the data's position (q,), velocity (n,) and entries
    (e,) of the mass matrix, where these have the diagonal (n,), the position (q,) that is none at
    all, room for a desired one (q,), and the joints' passive damping (n,).
    """


structref.define_proxy(DynamicsView, _ViewType, [name for name, _ in _FIELDS])
VIEW = _ViewType(_FIELDS)
"""Its type for compiled code."""


@compiled.of(VIEW(*(kind for _, kind in _FIELDS)))
def make_view(
    model: int,
    data: int,
    position: FloatArray,
    velocity: FloatArray,
    mass: FloatArray,
    diagonal: IntArray,
    identity: FloatArray,
    desired: FloatArray,
    passive_damping: FloatArray,
) -> Any:
    """The view, made by compiled code that is kept; numba's own way compiles in each process."""
    return DynamicsView(
        model,
        data,
        position,
        velocity,
        mass,
        diagonal,
        identity,
        desired,
        passive_damping,
    )


class DynamicsParts(NamedTuple):
    """The same as a tuple, which has no owners where it is borrowed."""

    model: int
    data: int
    position: FloatArray  # (q,)
    velocity: FloatArray  # (n,)
    mass: FloatArray  # (e,)
    diagonal: IntArray  # (n,)
    identity: FloatArray  # (q,)
    desired: FloatArray  # (q,)
    passive_damping: FloatArray  # (n,)


@compiled
def _convert(view: Any, position: FloatArray, out: FloatArray) -> None:
    """Write a position (n,), message form, without gaps, as MuJoCo has it (q,)."""
    if len(position) != len(view.velocity):  # MuJoCo would read what is beyond its end
        raise ValueError("an array has not one entry a degree of freedom")
    out[:] = view.identity
    mj.move_position(view.model, out.ctypes.data, position.ctypes.data, 1.0)


@compiled.of(_ROWS(VIEW, _ROWS))
def convert_rows(view: Any, positions: FloatArray) -> FloatArray:
    """Positions (k, n), message form, as MuJoCo has them (k, q)."""
    rows = np.empty((len(positions), len(view.position)))
    for k in range(len(positions)):
        _convert(view, positions[k], rows[k])
    return rows


@compiled
def enter_state(view: Any, position: FloatArray, velocity: FloatArray) -> None:
    """Take over a state: position (n,), message form, and velocity (n,), without gaps."""
    _convert(view, position, view.position)
    view.velocity[:] = velocity
    mj.find_frames(view.model, view.data)
    mj.find_centres_of_mass(view.model, view.data)
    mj.find_mass_matrix(view.model, view.data)
    mj.find_velocities(view.model, view.data)


@compiled.of(types.void(VIEW, GIVEN, GIVEN))
def take_state(view: Any, position: FloatArray, velocity: FloatArray) -> None:
    """Take over a state: position (n,), message form, and velocity (n,)."""
    enter_state(view, position.copy(), velocity)


@compiled
def add_effort(
    effort: FloatArray,
    view: Any,
    error: FloatArray,
    velocity: FloatArray,
    desired_velocity: FloatArray,
    stiffness: FloatArray,
    damping: FloatArray,
    period: float,
    bias: FloatArray,
    acceleration: FloatArray,
) -> None:
    """Add stable PD against errors (n,) to a feedforward or zero (n,), in the state taken over.

    Bias and acceleration are room (n,).
    """
    law.add_known(effort, error, velocity, desired_velocity, stiffness, damping, period)
    bias[:] = 0.0
    mj.find_bias_force(view.model, view.data, 0, bias.ctypes.data)
    law.subtract_implicit(
        effort,
        bias,
        velocity,
        damping,
        view.passive_damping,
        period,
        MassMatrix(view.model, view.data, view.mass),
        view.diagonal,
        acceleration,
    )


@compiled.of(_OWN(VIEW, *(8 * [GIVEN]), types.float64))
def stable_pd(
    view: Any,
    position: FloatArray,
    velocity: FloatArray,
    desired: FloatArray,
    desired_velocity: FloatArray,
    stiffness: FloatArray,
    damping: FloatArray,
    offset: FloatArray,
    feedforward: FloatArray,
    period: float,
) -> FloatArray:
    """The effort (n,) of stable PD in a state, which is taken over; see `stable_pd_effort`.

    Args:
        view: The model.
        position: Of the state (n,), message form.
        velocity: Of the state (n,).
        desired: The reference's position (n,) at the period's end, message form.
        desired_velocity: The reference's velocity (n,) at the period's end.
        stiffness: (n,) N m/rad or N/m.
        damping: (n,) N m s/rad or N s/m.
        offset: Added to the errors (n,); or (0,).
        feedforward: Acts beside the law (n,); or (0,).
        period: s.
    """
    take_state(view, position, velocity)
    effort, error = np.zeros(len(velocity)), np.empty(len(velocity))
    if len(feedforward):
        effort += feedforward
    _convert(view, desired.copy(), view.desired)
    start, end = view.position.ctypes.data, view.desired.ctypes.data
    mj.find_difference(view.model, error.ctypes.data, 1.0, start, end)
    if len(offset):
        error += offset
    bias, acceleration = np.empty(len(velocity)), np.empty(len(velocity))
    add_effort(
        effort,
        view,
        error,
        velocity,
        desired_velocity,
        stiffness,
        damping,
        period,
        bias,
        acceleration,
    )
    return effort
