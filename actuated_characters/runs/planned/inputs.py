"""All that is planned to be sent in a run, each with the stamp from which on it counts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from actuated_characters.runs.planned.behaviours import PlannedBehaviour
from actuated_characters.runs.planned.files import Planned
from actuated_characters.runs.planned.pins import PlannedPin
from actuated_characters.runs.planned.strengths import PlannedStrengths
from actuated_characters.runs.planned.throws import PlannedThrow
from actuated_characters.runs.planned.velocities import PlannedVelocity
from actuated_characters.runs.planned.wrenches import PlannedPush


@dataclass(frozen=True)
class PlannedInputs:
    """What is sent to simulator and controller."""

    pushes: Sequence[PlannedPush] = ()
    throws: Sequence[PlannedThrow] = ()
    velocities: Sequence[PlannedVelocity] = ()
    strengths: Sequence[PlannedStrengths] = ()
    pins: Sequence[PlannedPin] = ()
    behaviours: Sequence[PlannedBehaviour] = ()

    def by_name(self) -> Mapping[str, Sequence[Planned]]:
        """Each kind by its name."""
        return vars(self)


NO_INPUTS = PlannedInputs()
