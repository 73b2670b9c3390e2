"""Checks of the controller's model: on its own, and against a simulator's probe."""

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointLayout
from msgs_config.character.model import Character
from msgs_config.errors import CharacterError
from msgs_config.geometry import fixed_order
from msgs_config.messages.probe import DynamicsSample

_MAX_DIFFERENCE = 0.01  # a share; the two engines themselves differ by less than a millionth
_SINGULAR = 1e-6  # least share of a joint's inertia that the joints before it do not move
_TINY_DIVISOR = 1e-150  # keeps 0 / 0 away


def check_inertia(model: DynamicsModel, character: Character) -> None:
    """Raise CharacterError at a joint that moves no inertia, which makes M singular."""
    layout = character.layout
    model.update(np.array(character.rest_position), np.zeros(layout.size))
    diagonal = np.diag(model.mass_matrix())
    if layout.size and diagonal.min() <= 0.0:
        name = layout.dof_names[int(diagonal.argmin())]
        raise CharacterError(f"{character.file}: nothing with mass or inertia moves at '{name}'")


def check_agreement(model: DynamicsModel, layout: JointLayout, probe: DynamicsSample) -> None:
    """Compare the model with a simulator's probe: kinetic energy, and `M dv/dt + C = f`.

    The accelerations are weighed by the masses, and each force is compared with itself: a heavy
    base, which accelerates little, counts as much as a light hand.

    Raises:
        CharacterError: they differ by more than 1 %; the message names the quantity and remedies.
            Where the mass matrix is close to singular, it names the joint.
    """
    model.update(probe.position, probe.velocity)
    mass_matrix = model.mass_matrix()
    measured = [*fixed_order.apply(mass_matrix, probe.acceleration), probe.kinetic_energy]
    expected = [*(probe.effort - model.bias_force()), model.kinetic_energy()]
    size = np.maximum(np.abs(measured), np.abs(expected))
    differences = np.abs(np.subtract(measured, expected)) / np.maximum(size, _TINY_DIVISOR)
    worst = int(np.argmax(differences))  # a NaN is the largest
    if not differences[worst] <= _MAX_DIFFERENCE:
        _check_regular(mass_matrix, layout)
        whats = [*(f"what accelerates '{name}'" for name in layout.dof_names), "kinetic energy"]
        raise CharacterError(
            "the simulator's character is not the controller's: in the same state "
            f"{whats[worst]} differs by {100.0 * differences[worst]:.3g} %; is the character "
            "file, its URDF, 'scale' or 'gravity' another one on the other side, or an inertia in "
            "the URDF an impossible one?"
        )


def _check_regular(mass_matrix: FloatArray, layout: JointLayout) -> None:
    """Raise CharacterError where Gauss' elimination in a mass matrix (n, n) leaves no pivot."""
    rest = mass_matrix.copy()
    for entry, name in enumerate(layout.dof_names):
        pivot = rest[entry, entry]
        if not pivot > _SINGULAR * mass_matrix[entry, entry]:
            raise CharacterError(
                f"nothing with mass or inertia moves at '{name}' that the joints before it do not "
                "move as well; has the URDF a link with a mass but without inertia there?"
            )
        column = rest[:, entry] / pivot
        rest -= column[:, np.newaxis] * rest[entry]
