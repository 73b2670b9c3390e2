"""Friction of contacts in MuJoCo's world: Coulomb's, also of what slides."""

import math

import numpy as np
from numba import types

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.compiled import mujoco_functions as mj
from msgs_config.compiled.data_layout import DataFields, RawData
from msgs_config.compiled.decorator import compiled

_FREELY = 10.0  # m/s^2, about gravity: more than what slides by its own weight can get
_SHARE = 0.3  # of what a contact pushes back with, that may be taken off it

_NUMBERS = types.Array(types.float64, 1, "C")
_COEFFICIENTS = types.Array(types.float64, 2, "A")
_ROWS = types.Array(types.int32, 1, "A")


@compiled
def ask_of_contact(row: int, coefficient: float, reference: FloatArray, smooth: FloatArray) -> None:
    """Change what one contact asks for, whose rows begin at `row`: see `ask_for_friction`."""
    along, across = reference[row + 1], reference[row + 2]
    asked = math.sqrt(along * along + across * across)
    if asked > _FREELY:
        pushes = _SHARE * max(reference[row] - smooth[row], 0.0)
        missing = min(asked - _FREELY, pushes / coefficient)
        reference[row] -= coefficient * missing
        share = (_FREELY + missing) / asked
        reference[row + 1] *= share
        reference[row + 2] *= share


@compiled.of(types.void(_NUMBERS, _NUMBERS, _COEFFICIENTS, _ROWS))
def ask_for_friction(
    reference: FloatArray, smooth: FloatArray, friction: FloatArray, rows: IntArray
) -> None:
    """Change what contacts ask for, so that what slides is not lifted off the ground.

    MuJoCo's solver treats friction as convex (Todorov 2014, "Convex and analytically-invertible
    dynamics with contacts and constraints"): what asks for more friction than it gets is pushed off
    by the friction coefficient times what is missing, and so a sliding foot would hop. De Saxce and
    Feng 1998, "The bipotential method", take just that off what is asked for along the normal; here
    it is foreseen that no more is got than by what lies there freely. The rest of the contact must
    go on pressing, so that no more is asked for than some of that can make up for.

    Args:
        reference: Accelerations (r,) that the rows of MuJoCo's constraints ask for, of a contact
            one along its normal and two along its surface, m/s^2; those are changed.
        smooth: Accelerations (r,) without constraints.
        friction: Friction coefficients (c, k) of contacts, the first one along the surface, not 0.
        rows: First rows (c,) of the contacts; negative for one that has none.
    """
    for number in range(len(rows)):
        if rows[number] >= 0:  # else apart, or between what cannot move
            ask_of_contact(rows[number], friction[number, 0], reference, smooth)


@compiled.inlined
def set_friction(
    model: int, data: int, acceleration: FloatArray, fields: DataFields, raw: RawData
) -> None:
    """Have MuJoCo's contacts ask for friction as `ask_for_friction` says.

    To be called after the acceleration (n,) without constraints was found, and before constraints
    are solved.

    Args:
        model: MuJoCo's model, by its address.
        data: MuJoCo's data, by its address.
        acceleration: The data's, `qacc_smooth`.
        fields: Where fields are.
        raw: The data's memory.
    """
    contacts = raw.numbers[fields.contacts]
    if contacts == 0:
        return
    smooth = np.empty(raw.numbers[fields.rows])
    mj.apply_jacobian(model, data, smooth.ctypes.data, acceleration.ctypes.data)
    start = (raw.words[fields.contact_pointer] - raw.arena_start) // 8
    reference = raw.arena[(raw.words[fields.reference_pointer] - raw.arena_start) // 8 :]
    for number in range(contacts):
        first = start + number * fields.contact_words
        row = raw.arena_numbers[2 * first + fields.constraint]
        if row >= 0:  # else apart, or between what cannot move
            ask_of_contact(row, raw.arena[first + fields.friction], reference, smooth)
