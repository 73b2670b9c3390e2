"""MuJoCo's own functions, for compiled code: by name from its library, so that code can be kept.

Their arguments are addresses, of arrays too; they are for compiled code alone.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import llvmlite.binding
import mujoco
from numba import types

(_LIBRARY,) = Path(mujoco.__file__).parent.glob("libmujoco.so*")
llvmlite.binding.load_library_permanently(str(_LIBRARY))

_ADDRESS, _NUMBER = types.intp, types.intc


def _function(name: str, *arguments: Any) -> Callable[..., None]:
    function = types.ExternalFunction(name, types.void(*arguments))
    return cast(Callable[..., None], function)


def _of_model_and_data(name: str) -> Callable[[int, int], None]:
    return _function(name, _ADDRESS, _ADDRESS)


step_before_forces = _of_model_and_data("mj_step1")
"""`(model, data)`: everything of a step that depends on the state alone."""

step_after_forces = _of_model_and_data("mj_step2")
"""`(model, data)`: the rest of the step, with the forces that were set in between."""

find_frames = _of_model_and_data("mj_kinematics")
"""`(model, data)`: the frames of all links, from the data's position."""

find_centres_of_mass = _of_model_and_data("mj_comPos")
"""`(model, data)`: centres of mass and the joints' axes about them, from the frames."""

find_mass_matrix = _of_model_and_data("mj_crb")
"""`(model, data)`: the mass matrix, from the centres of mass."""

find_velocities = _of_model_and_data("mj_comVel")
"""`(model, data)`: the links' velocities, from the data's."""

find_bias_force = _function("mj_rne", _ADDRESS, _ADDRESS, _NUMBER, _ADDRESS)
"""`(model, data, 0, bias)`: Coriolis, centrifugal and gravity (n,), from the velocities."""

factorise_mass = _of_model_and_data("mj_factorM")
"""`(model, data)`: factorise the data's mass matrix."""

solve_mass = _function("mj_solveM", _ADDRESS, _ADDRESS, _ADDRESS, _ADDRESS, _NUMBER)
"""`(model, data, x, y, rows)`: solve `M x = y` for rows (rows, n) by what was factorised."""

move_position = _function("mj_integratePos", _ADDRESS, _ADDRESS, _ADDRESS, types.float64)
"""`(model, position, velocity, seconds)`: move MuJoCo's position (q,) by a velocity (n,)."""

find_difference = _function(
    "mj_differentiatePos", _ADDRESS, _ADDRESS, types.float64, _ADDRESS, _ADDRESS
)
"""`(model, velocity, seconds, start, end)`: the velocity (n,) that leads from one to another."""

find_position_terms = _of_model_and_data("mj_fwdPosition")
"""`(model, data)`: the first part of `mj_step1`: frames, mass matrix, contacts."""

find_velocity_terms = _of_model_and_data("mj_fwdVelocity")
"""`(model, data)`: the part after it, that depends on the velocity, too."""

find_free_acceleration = _of_model_and_data("mj_fwdAcceleration")
"""`(model, data)`: the acceleration without constraints, by the forces that were set."""

apply_jacobian = _function("mj_mulJacVec", _ADDRESS, _ADDRESS, _ADDRESS, _ADDRESS)
"""`(model, data, rows, velocity)`: of a velocity (n,) that of the constraints' rows (r,)."""

solve_constraints = _of_model_and_data("mj_fwdConstraint")
"""`(model, data)`: the constraints' forces, and the acceleration with them."""

advance_explicitly = _of_model_and_data("mj_Euler")
"""`(model, data)`: position and velocity at the end of the step."""

apply_wrench = _function(
    "mj_applyFT",
    *(_ADDRESS, _ADDRESS, _ADDRESS, _ADDRESS, _ADDRESS),
    *(_NUMBER, _ADDRESS),
)
"""`(model, data, force, torque, point, body, out)`: add a wrench's generalised force to `out`."""

find_contact_force = _function("mj_contactForce", _ADDRESS, _ADDRESS, _NUMBER, _ADDRESS)
"""`(model, data, contact, wrench)`: the force and torque (6,) of a contact, in its own frame."""
