"""The behaviour `state_machine`, as the parameters' values say."""

from dataclasses import replace
from functools import partial

from controller_node.behaviours.base import BEHAVIOURS, BehaviourChoice
from controller_node.behaviours.state_machine.body import BodyReader
from controller_node.behaviours.state_machine.check import check_machine
from controller_node.behaviours.state_machine.description import Machine
from controller_node.behaviours.state_machine.effort_maker import EffortMaker
from controller_node.behaviours.state_machine.file import read_machine
from controller_node.behaviours.state_machine.legs.leg import make_leg, standing_frames
from controller_node.behaviours.state_machine.machine import MachineKit, StateMachine
from controller_node.behaviours.state_machine.pose import PoseMaker
from controller_node.controller_settings import LawSettings
from controller_node.planner.settings import NO_PLANNER, PlannerParameters
from controller_node.references.base import Motion
from controller_node.references.factory import MotionSettings
from controller_node.references.steering.reference import SteeredReference
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError
from msgs_config.parameters import Values
from msgs_config.settings import Settings, parameter
from msgs_config.shared_parameters import COMMAND_DELAY, SharedSettings

STATE_MACHINE = "state_machine"


class MachineSettings(Settings):
    """The machine whose states it goes through."""

    machine: str = parameter(
        "walk", "state_machine: a shipped machine, or the path of a .yaml file"
    )


@BEHAVIOURS.register(STATE_MACHINE, MachineSettings)
def _state_machine(character: Character, values: Values) -> BehaviourChoice:
    _check(character, values)
    kit = make_kit(character, values)
    return BehaviourChoice(
        partial(StateMachine, kit), needs_contacts=True, makes_effort=True, follows_motion=False
    )


def limited(motion: Motion, values: Values) -> Motion:
    """A motion for the machine of the values, whose limits are those of its commands.

    Raises:
        ConfigurationError: there is no such machine, or its file is wrong.
    """
    steered = motion.reference
    if not isinstance(steered, SteeredReference):
        return motion
    machine = read_machine(MachineSettings.of(values).machine)
    return replace(motion, reference=steered.within(machine.limits))


def make_kit(character: Character, values: Values) -> MachineKit:
    """What a machine works with. Raises ConfigurationError if it does not fit the character."""
    machine = read_machine(MachineSettings.of(values).machine)
    shared = SharedSettings.of(values)
    return kit_of(machine, character, shared.gravity, shared.period)


def kit_of(machine: Machine, character: Character, gravity: float, period: float) -> MachineKit:
    """What a machine works with: m/s^2, and s of a tick. Raises as `make_kit`."""
    check_machine(machine, character)
    model, layout = DynamicsModel(character, gravity), character.layout
    legs = {
        side: make_leg(character, *(joints[part] for part in ("hip", "knee", "ankle")))
        for side, joints in machine.sides.items()
    }
    _, upright = standing_frames(character)
    return MachineKit(
        machine=machine,
        layout=layout,
        legs=legs,
        reader=BodyReader(model, legs, upright[0]),
        poses=PoseMaker(character, machine, legs, upright, period),
        efforts=EffortMaker(model, layout, machine, legs, period),
        gravity=gravity,
        period=period,
    )


def _check(character: Character, values: Values) -> None:
    """Raise ConfigurationError if other parameters do not go with a state machine."""
    if not character.layout.has_floating_base:
        raise ConfigurationError(
            f"parameter 'behaviour' is {STATE_MACHINE}, which needs a floating base; "
            f"'{character.name}' is fixed to the world"
        )
    for name, value, wanted in (
        ("planner", PlannerParameters.of(values).planner, NO_PLANNER),
        ("reference", MotionSettings.of(values).reference, "steered"),
        ("law", LawSettings.of(values).law, "stable_pd"),
    ):
        if value != wanted:
            raise ConfigurationError(
                f"parameter 'behaviour' is {STATE_MACHINE}, which needs '{name}' to be {wanted}; "
                f"it is {value}"
            )
    shared = SharedSettings.of(values)
    if shared.gravity <= 0.0:
        raise ConfigurationError(
            f"parameter 'behaviour' is {STATE_MACHINE}, which needs 'gravity' to be more than 0"
        )
    if shared.command_delay_ticks:
        raise ConfigurationError(
            f"parameter 'behaviour' is {STATE_MACHINE}, which needs '{COMMAND_DELAY.name}' to be 0"
        )
