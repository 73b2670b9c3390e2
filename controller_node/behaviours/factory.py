"""The behaviour that the parameters' values say."""

from controller_node.behaviours import reaction_factory  # noqa: F401  registers its own
from controller_node.behaviours.base import BEHAVIOURS, BehaviourChoice
from controller_node.behaviours.motion_library import clips_of_library
from controller_node.behaviours.onnx_policy import factory as onnx_policy  # noqa: F401  registers its own
from controller_node.behaviours.pursuit import PursuitSettings
from controller_node.behaviours.settings import REACTIONS, ReactionSettings
from controller_node.behaviours.state_machine import factory as state_machine
from controller_node.behaviours.state_machine.factory import STATE_MACHINE
from controller_node.ground import GroundSettings, on_ground
from controller_node.planner.settings import NO_PLANNER, POLICY, RECORDED, PlannerParameters
from controller_node.references import factory
from controller_node.references.base import Motion
from controller_node.references.steering.reference import SteeredReference
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError
from msgs_config.parameters import Values
from msgs_config.settings import Settings, parameter
from msgs_config.shared_parameters import PLANE


class BehaviourSettings(Settings):
    """What a character does beside tracking."""

    behaviour: str = parameter(
        "tracking",
        "track whatever comes; be limp; track, and go limp on a hard hit; likewise, and go for an "
        "opponent; track, and react to a hit; go through the states of a machine; or play another "
        "trainer's policy",
        choices=BEHAVIOURS.names,
    )


BEHAVIOUR_PARAMETERS = [*BehaviourSettings.declared(), *BEHAVIOURS.parameters]


def make_motion(character: Character, values: Values) -> Motion:
    """The motion that the parameters' values name, commanded as far as the behaviour can go.

    Raises:
        ActuatedCharactersError: a file or a name does not exist, or does not fit the character.
    """
    motion = factory.make_motion(character, values)
    terrain, behaviour = GroundSettings.of(values).terrain, BehaviourSettings.of(values).behaviour
    if (
        behaviour in REACTIONS
        and terrain != PLANE
        and isinstance(motion.reference, SteeredReference)
    ):
        raise ConfigurationError(
            f"parameter 'behaviour' is {behaviour}, which carries a reference to where it gets up; "
            f"one that is steered over 'terrain' {terrain} cannot be carried"
        )
    motion = on_ground(motion, character, terrain)
    return state_machine.limited(motion, values) if behaviour == STATE_MACHINE else motion


def choose_behaviour(character: Character, values: Values) -> BehaviourChoice:
    """The behaviour of the parameter of that name; libraries of motion are read here, once.

    Raises:
        ConfigurationError: a value is wrong, the character cannot do it, or no planner with it.
        ClipError: a clip of the library is malformed.
    """
    behaviour = BehaviourSettings.of(values).behaviour
    _check_planner(behaviour, PlannerParameters.of(values).planner)
    return BEHAVIOURS[behaviour](character, values)


def behaviour_clips(character: Character, values: Values) -> list[str]:
    """The clips that the behaviour may go over to.

    Raises:
        ActuatedCharactersError: a name or a folder is wrong.
    """
    behaviour = BehaviourSettings.of(values).behaviour
    if behaviour not in REACTIONS:
        return []
    settings, clips = ReactionSettings.of(values), list[str]()
    if behaviour == "reactive":
        clips += clips_of_library(character, settings.library)
    if settings.by_clip:
        clips += settings.face_up, settings.face_down
    if behaviour == "pursuit" and (strikes := PursuitSettings.of(values).strikes):
        clips += clips_of_library(character, strikes)
    return list(dict.fromkeys(clips))


def _check_planner(behaviour: str, planner: str) -> None:
    if planner == RECORDED and behaviour != "tracking":
        wanted = "the behaviour tracking"
    elif planner == POLICY and behaviour == STATE_MACHINE:
        wanted = "a behaviour that follows clips"
    elif planner != NO_PLANNER and behaviour == "ragdoll":
        wanted = "a behaviour that follows a motion"
    else:
        return
    raise ConfigurationError(f"planner '{planner}' is for {wanted}; 'behaviour' is {behaviour}")
