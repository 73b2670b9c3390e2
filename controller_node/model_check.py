"""Checks of the controller's model: on its own, and against a simulator's probe."""

import numpy as np

from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointLayout
from msgs_config.character.model import Character
from msgs_config.errors import CharacterError
from msgs_config.geometry import fixed_order
from msgs_config.messages.probe import DynamicsSample

_LARGEST = 0.01  # where the two engines themselves differ by less than a millionth
_TINY = 1e-150  # keeps 0 / 0 away


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
    """
    model.update(probe.position, probe.velocity)
    measured = [*fixed_order.apply(model.mass_matrix(), probe.acceleration), probe.kinetic_energy]
    expected = [*(probe.effort - model.bias_force()), model.kinetic_energy()]
    size = np.maximum(np.abs(measured), np.abs(expected))
    differences = np.abs(np.subtract(measured, expected)) / np.maximum(size, _TINY)
    worst = int(np.argmax(differences))  # a NaN is the largest
    if not differences[worst] <= _LARGEST:
        whats = [*(f"what accelerates '{name}'" for name in layout.dof_names), "kinetic energy"]
        raise CharacterError(
            "the simulator's character is not the controller's: in the same state "
            f"{whats[worst]} differs by {100.0 * differences[worst]:.3g} %; is the character "
            "file, its URDF, 'scale' or 'gravity' another one on the other side, or an inertia in "
            "the URDF an impossible one?"
        )
