"""Two laws as somebody adds them, each one registration; it says what becomes of them, as JSON.

They are registered before anything asks what laws there are, so it runs in a process of its own:
`python -m tests.support.new_laws`.
"""

import json
from functools import partial

import numpy as np

from controller_node.control_laws import GainArrays, Law, LawContext, TrackingInput, law
from msgs_config.arrays import FloatArray
from msgs_config.errors import ConfigurationError
from msgs_config.settings import Settings, parameter

_HEIGHT = 0.25  # m, of a state of the lift, whose target is 1 m
_CHANGES: dict[str, list[dict[str, object]]] = {  # of live parameters, one after the other
    "spring": [{}, {"spring.stiffness": 8.0}, {"gain_scale.p": 2.0}],
    "ramp": [
        *({}, {}, {"gain_scale.p": 2.0}),
        *({"ramp.step": 2.0}, {"ramp.step": 9.0}, {"spring.stiffness": 4.0}),
    ],
}


class SpringSettings(Settings, prefix="spring."):
    """A spring towards the target."""

    stiffness: float = parameter(3.0, "of every joint", unit="N m/rad or N/m", live=True)


class RampSettings(Settings, prefix="ramp."):
    """A ramp of effort."""

    step: float = parameter(1.0, "by which each answer grows", unit="N m or N", live=True)


@law("spring", SpringSettings, is_static_feedback=True)
def _make_spring(context: LawContext, settings: SpringSettings) -> Law:
    return partial(_spring, context, settings)


def _spring(
    context: LawContext, settings: SpringSettings, tracking: TrackingInput, gains: GainArrays
) -> FloatArray:
    return settings.stiffness * tracking.error(context.model, tracking.now)


@law("ramp", RampSettings, SpringSettings)
class _Ramp:
    def __init__(self, context: LawContext, ramp: RampSettings, spring: SpringSettings) -> None:
        if ramp.step > spring.stiffness:
            raise ConfigurationError("law 'ramp' needs 'ramp.step' up to 'spring.stiffness'")
        self._size, self._step, self._answers = context.layout.size, ramp.step, 0

    def __call__(self, tracking: TrackingInput, gains: GainArrays) -> FloatArray:
        self._answers += 1
        return np.full(self._size, self._step * self._answers)


def main() -> None:
    """Print the laws' efforts, one after each change, and the errors."""
    from actuated_characters.environments.track import TrackEnv
    from controller_node.controller_setups import ControllerSetups
    from controller_node.parameters import PARAMETERS, resolve_for
    from msgs_config.messages.state import StampedState
    from tests.support.physics import character

    lift, found = character("lift"), dict[str, list[object]]()
    for name, changes in _CHANGES.items():
        given: dict[str, object] = {"law": name}
        setups = ControllerSetups(lift, PARAMETERS, resolve_for(lift, given))
        found[name] = []
        for change in changes:
            try:
                setups.take(resolve_for(lift, given | change))
                given |= change
            except ConfigurationError as error:
                found[name].append(str(error))
            controller = setups.in_force.controller
            stamp_ns = controller.clock.stamp_ns(1)
            state = StampedState(stamp_ns, np.array([_HEIGHT]), np.zeros(1), None)
            found[name] += controller.compute_effort(state, stamp_ns)[0].tolist()
        try:
            environment = TrackEnv("lift", action="targets", reference="hold", controller=given)
            found[name].append(environment.action_space.shape)
        except ConfigurationError as error:
            found[name].append(str(error))
    print(json.dumps(found))


if __name__ == "__main__":
    main()
