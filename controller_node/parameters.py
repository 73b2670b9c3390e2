"""The parameters of `controller_node`, and the controller that they make."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from controller_node.balance import BalanceGains
from controller_node.behaviours.factory import (
    BEHAVIOUR_PARAMETERS,
    BehaviourSettings,
    behaviour_clips,
    choose_behaviour,
)
from controller_node.behaviours.onnx_policy.factory import ONNX
from controller_node.behaviours.settings import check_terrain
from controller_node.behaviours.state_machine.factory import STATE_MACHINE
from controller_node.control_laws import LAWS, GainArrays
from controller_node.controller import Controller
from controller_node.controller_settings import ControllerSettings, LawSettings
from controller_node.effort_series import read_effort_series
from controller_node.ground import GroundSettings
from controller_node.planner import factory
from controller_node.planner import settings as planner_settings
from controller_node.planner.settings import NO_PLANNER, PlannerParameters
from controller_node.references.base import Reference
from controller_node.references.factory import MOTION_PARAMETERS
from msgs_config.character.layout import ROOT
from msgs_config.character.model import ROOT_TORQUE, Character
from msgs_config.messages.session import GivenSession
from msgs_config.parameters import Parameter, Values, resolve
from msgs_config.settings import Settings, parameter
from msgs_config.shared_parameters import CharacterSource, KeyframeSettings, SharedSettings

_ROOT_VECTORS = (ROOT, ROOT_TORQUE)


class GainScale(Settings, prefix="gain_scale."):
    """Factors on the gains of all joints."""

    p: float = parameter(1.0, "factor on every joint's stiffness, not the root's", live=True)
    d: float = parameter(1.0, "factor on every joint's damping, not the root's", live=True)


class ControllerOptions(Settings):
    """What the controller does around its law."""

    root_assistance: bool = parameter(
        True, "drive a floating base by the lecture's root force and torque", at_reset=True
    )
    wait_for_subscribers: int = parameter(
        1, "answer when this many subscribe to joint_torques", maximum=1000
    )
    reference_velocity: str = parameter(
        "clip",
        "velocity to track: the reference's own, or zero as in the lecture's second form",
        choices=("clip", "zero"),
        live=True,
    )
    balance: bool = parameter(
        False,
        "add the virtual force that keeps it on its two feet to the law",
        name="balance.enabled",
        live=True,
    )
    balance_gains: BalanceGains = BalanceGains()
    keyframes: KeyframeSettings = KeyframeSettings()
    session: GivenSession = GivenSession()
    gain_scale: GainScale = GainScale()


PARAMETERS = [
    *CharacterSource.declared(),
    *SharedSettings.declared(),
    *LawSettings.declared(),
    *LAWS.parameters,
    *(replace(each, at_reset=True) for each in (*MOTION_PARAMETERS, *BEHAVIOUR_PARAMETERS)),
    *GroundSettings.declared(),
    *PlannerParameters.declared(),
    *ControllerOptions.declared(),
]

_GAINS = {  # the end of a parameter's name: the field of `Gains`, its description, its unit
    "p": ("stiffness", "stiffness of '{}'", "N m/rad or N/m"),
    "d": ("damping", "damping of '{}'", "N m s/rad or N s/m"),
    "i": ("integral", "integral gain of '{}', for the law pid", "N m/(rad s) or N/(m s)"),
}


def resolve_for(character: Character, given: Mapping[str, object]) -> Values:
    """The values of all parameters of a character's controller: those given, or defaults.

    Raises:
        ConfigurationError: a name or a value is wrong.
    """
    return resolve(PARAMETERS + character_parameters(character, given), given)


def character_parameters(
    character: Character, given: Mapping[str, object] = MappingProxyType({})
) -> list[Parameter]:
    """The parameters whose names and defaults depend on the character: gains and limits.

    With a planner, which the parameters given may name, some gains are others.
    """
    parameters = []
    planned = character.planning.gains if given.get("planner", NO_PLANNER) != NO_PLANNER else {}
    for name, limit in zip(character.vector_names, character.effort_limits(), strict=True):
        if name in character.layout.followers:
            continue  # no motor drives it
        gains = planned.get(name, character.gains[name])
        for kind, (field, description, unit) in _GAINS.items():
            described = description.format(name)
            parameters.append(
                Parameter(
                    f"gains.{name}.{kind}", getattr(gains, field), described, unit=unit, live=True
                )
            )
        parameters.append(
            Parameter(
                f"effort_limit.{name}",
                float(limit),
                f"largest effort of '{name}'",
                unit="N m or N",
                maximum=np.inf,
                live=True,
            )
        )
        if name not in _ROOT_VECTORS:
            parameters.append(
                Parameter(
                    f"strength.{name}",
                    1.0,
                    f"share of the gains and the effort limit of '{name}' that counts",
                    maximum=1.0,
                    live=True,
                )
            )
    return parameters


def make_gains(character: Character, values: Values) -> GainArrays:
    """The gains of the law, scaled, and the effort limits that the parameters' values say."""
    names, followers = character.vector_names, character.layout.followers
    scale = ControllerOptions.of(values).gain_scale
    scales = {"p": scale.p, "d": scale.d, "i": 1.0}
    root = float(_assists(values))
    gains = {}
    for kind, (field, _, _) in _GAINS.items():
        scaled = [
            (root if name in _ROOT_VECTORS else scales[kind])
            * (0.0 if name in followers else values.number(f"gains.{name}.{kind}"))
            for name in names
        ]
        gains[field] = np.repeat(np.array(scaled), character.layout.vector_lengths)
    limits = [
        np.inf if name in followers else values.number(f"effort_limit.{name}") for name in names
    ]
    return GainArrays(**gains, effort_limits=np.array(limits))


def make_controller_settings(character: Character, values: Values) -> ControllerSettings:
    """Law, gains and limits that the parameters' values say."""
    undriven = {*_ROOT_VECTORS, *character.layout.followers}
    strengths = [
        1.0 if name in undriven else values.number(f"strength.{name}")
        for name in character.vector_names
    ]
    options, is_ragdoll = ControllerOptions.of(values), _is_ragdoll(values)
    law = "zero" if is_ragdoll else LawSettings.of(values).law
    return ControllerSettings(
        law=law,
        gains=make_gains(character, values),
        follows_velocity=options.reference_velocity == "clip",
        balance=options.balance_gains if options.balance and not is_ragdoll else None,
        strengths=np.array(strengths),
        law_settings=tuple(each.of(values) for each in LAWS.settings(law)),
    )


def _is_ragdoll(values: Values) -> bool:
    return BehaviourSettings.of(values).behaviour == "ragdoll"


def _assists(values: Values) -> bool:
    """Whether the root is driven; not that of planned joint torques, and not by all behaviours."""
    plans = PlannerParameters.of(values).planner != NO_PLANNER
    unassisted = BehaviourSettings.of(values).behaviour in ("ragdoll", STATE_MACHINE, ONNX)
    return ControllerOptions.of(values).root_assistance and not plans and not unassisted


def make_controller(character: Character, reference: Reference, values: Values) -> Controller:
    """The controller that the parameters' values say.

    Raises:
        ActuatedCharactersError: a value is wrong, or a file or clip cannot be used.
    """
    path, shared = LawSettings.of(values).feedforward, SharedSettings.of(values)
    return Controller(
        character,
        reference,
        make_controller_settings(character, values),
        rate_hz=shared.rate,
        gravity=shared.gravity,
        series=read_effort_series(character.layout, path) if path else None,
        behaviour=choose_behaviour(character, values),
        planner=factory.make_planner(character, values, behaviour_clips(character, values)),
    )


def describe_planner(character: Character, values: Values) -> tuple[str, ...]:
    """What the user should know of the planner that the parameters' values say."""
    clips = behaviour_clips(character, values)
    return factory.describe_planner(character, values, clips, make_gains(character, values))


def check_world(values: Values, simulator: Mapping[str, object]) -> None:
    """Raise ConfigurationError if the parameters' values do not go with a simulator's.

    A parameter that is not among the simulator's is taken as one that goes with them.
    """
    planner_settings.check_world(values, simulator)
    behaviour, known = BehaviourSettings.of(values).behaviour, GroundSettings.of(values).terrain
    check_terrain(behaviour, known, simulator.get("terrain"))


def commanded_joints(character: Character, values: Values) -> list[str]:
    """The joints that the controller commands: all that have a motor, and `root` if assisted."""
    assisted = character.layout.has_floating_base and _assists(values)
    return [ROOT] * assisted + character.layout.actuated_joint_names
