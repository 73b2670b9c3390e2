"""MuJoCo's own functions, for compiled code: by name from its library, so that code can be kept."""

from collections.abc import Callable
from pathlib import Path
from typing import cast

import llvmlite.binding
import mujoco
from numba import types

(_LIBRARY,) = Path(mujoco.__file__).parent.glob("libmujoco.so*")
llvmlite.binding.load_library_permanently(str(_LIBRARY))


def _of_model_and_data(name: str) -> Callable[[int, int], None]:
    """A function of MuJoCo's, for compiled code alone; its arguments are addresses."""
    function = types.ExternalFunction(name, types.void(types.intp, types.intp))
    return cast(Callable[[int, int], None], function)


step_before_forces = _of_model_and_data("mj_step1")
"""`(model, data)`: everything of a step that depends on the state alone."""

step_after_forces = _of_model_and_data("mj_step2")
"""`(model, data)`: the rest of the step, with the forces that were set in between."""

factorise_mass = _of_model_and_data("mj_factorM")
"""`(model, data)`: factorise the data's mass matrix."""

solve_mass = cast(
    Callable[[int, int, int, int, int], None],
    types.ExternalFunction("mj_solveM", types.void(*(4 * [types.intp]), types.intc)),
)
"""`(model, data, x, y, rows)`: solve `M x = y` for rows (rows, n) by what was factorised."""
