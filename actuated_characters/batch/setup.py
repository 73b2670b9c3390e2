"""What the parameters of both sides say of a batch."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from actuated_characters.api import simulator_values
from actuated_characters.runs.plan import choose_reference, with_shared
from controller_node import parameters as controller_parameters
from controller_node.behaviours.factory import BehaviourSettings, make_motion
from controller_node.controller_settings import ControllerSettings, effective_gains
from controller_node.planner.settings import NO_PLANNER, PlannerParameters
from controller_node.references.base import Motion
from msgs_config.character.model import Character
from msgs_config.compiled.law import LawGains
from msgs_config.errors import ConfigurationError, one_of
from msgs_config.parameters import Values
from msgs_config.plain_values import plain_parameters
from msgs_config.shared_parameters import SharedSettings, placed
from sim_node.initial_state import INITIAL_STATE, POSITION, VELOCITY
from sim_node.node_settings import NodeSettings
from sim_node.physics.batch import ActionKind, BatchSetup
from sim_node.simulation_factory import make_character_setup, make_simulation_settings

_ACTIONS = {
    "targets": ActionKind.OFFSET,
    "angles": ActionKind.POSITION,
    "torques": ActionKind.EFFORT,
}


@dataclass(frozen=True)
class GivenBatch:
    """A batch as parameters say it."""

    setup: BatchSetup
    motion: Motion
    follows_velocity: bool  # the reference's; else the velocity to track is zero
    push_ticks: int  # for which a push acts


def make_setup(
    character: Character,
    action: str,
    watches_contacts: bool,
    simulator: Mapping[str, object],
    controller: Mapping[str, object],
) -> GivenBatch:
    """The batch of a character, whose actions are `targets`, `angles` or `torques`.

    Raises:
        ActuatedCharactersError: a name or a value is wrong, or is none for a batch.
    """
    if action not in _ACTIONS:
        raise ConfigurationError(one_of("action", action, list(_ACTIONS)))
    kind = _ACTIONS[action]
    given, ours = with_shared(
        plain_parameters({"engine": "mujoco", **simulator}), plain_parameters(controller)
    )
    for name in (INITIAL_STATE, POSITION, VELOCITY):
        if name in given:
            raise ConfigurationError(
                f"parameter '{name}': worlds begin where the reference does; reset() takes others"
            )
    here = placed(character, given)
    values = controller_parameters.resolve_for(here, {**choose_reference(ours), **ours})
    settings = controller_parameters.make_controller_settings(here, values)
    _check_controller(values, settings, kind)
    motion = make_motion(here, values)
    own = simulator_values(character, motion.first_state(), given)
    setup = BatchSetup(
        make_character_setup(here, own),
        make_simulation_settings(own),
        _gains(here, settings, SharedSettings.of(values).period),
        here.layout.mask(controller_parameters.commanded_joints(here, values)),
        kind,
        watches_contacts,
    )
    return GivenBatch(setup, motion, settings.follows_velocity, NodeSettings.of(own).push_ticks)


def _gains(character: Character, settings: ControllerSettings, period_s: float) -> LawGains:
    layout = character.layout
    gains = effective_gains(layout, settings, np.ones(len(layout.vector_lengths))).gains
    return LawGains(
        period_s,
        gains.stiffness.astype(float),
        gains.damping.astype(float),
        character.passive_damping(),
        gains.effort_limits.astype(float),
        layout.vector_starts.astype(np.intp),
        layout.vector_lengths.astype(np.intp),
    )


def _check_controller(values: Values, settings: ControllerSettings, kind: ActionKind) -> None:
    """Raise ConfigurationError if a controller does what a batch does not."""
    needed: dict[str, tuple[object, object]] = {
        "behaviour": (BehaviourSettings.of(values).behaviour, "tracking"),
        "planner": (PlannerParameters.of(values).planner, NO_PLANNER),
        "balance.enabled": (settings.balance is not None, False),
    }
    if kind is not ActionKind.EFFORT:
        needed["law"] = (settings.law, "stable_pd")
    for name, (value, possible) in needed.items():
        if value != possible:
            raise ConfigurationError(
                f"parameter '{name}' is {value}; in a batch it must be {possible}"
            )
