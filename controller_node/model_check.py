"""Whether a simulator's character is the one that the controller's model describes."""

import numpy as np

from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import JointLayout
from msgs_config.errors import CharacterError
from msgs_config.geometry import fixed_order
from msgs_config.messages.probe import DynamicsSample

_LARGEST = 0.01  # where the two engines themselves differ by less than a millionth
_TINY = 1e-150  # keeps 0 / 0 away


def check_agreement(model: DynamicsModel, layout: JointLayout, probe: DynamicsSample) -> None:
    """Compare the model with a simulator's probe: kinetic energy, and `M dv/dt + C = f`.

    The accelerations are weighed by the masses, and each force is compared with itself: a heavy
    base, which accelerates little, counts as much as a light hand.

    Raises:
        CharacterError: they differ by more than 1 %; says in what, by how much, and where to look.
    """
    model.update(probe.position, probe.velocity)
    measured = [*fixed_order.apply(model.mass_matrix(), probe.acceleration), probe.kinetic_energy]
    expected = [*(probe.effort - model.bias_force()), model.kinetic_energy()]
    size = np.maximum(np.abs(measured), np.abs(expected))
    differences = np.abs(np.subtract(measured, expected)) / np.maximum(size, _TINY)
    worst = int(np.argmax(differences))  # a NaN is the largest
    if not differences[worst] <= _LARGEST:
        whats = [*(f"what accelerates '{name}'" for name in layout.dof_names), "kinetic energy"]
        raise _disagreement(
            f"in the same state {whats[worst]} differs by {100.0 * differences[worst]:.3g} %"
        )


def _disagreement(how: str) -> CharacterError:
    return CharacterError(
        f"the simulator's character is not the controller's: {how}; is the character file, its "
        "URDF, 'scale' or 'gravity' another one on the other side, or an inertia in the URDF an "
        "impossible one?"
    )
