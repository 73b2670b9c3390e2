"""The behaviour that the parameters' values say."""

from dataclasses import dataclass

import numpy as np

from controller_node.behaviours.base import BehaviourMaker, Ragdoll, Tracking
from controller_node.behaviours.motion_library import MotionLibrary
from controller_node.behaviours.posture import Posture
from controller_node.behaviours.reaction import Reaction, ReactionKit
from controller_node.behaviours.settings import reaction_settings
from controller_node.planner.settings import NO_PLANNER
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character
from msgs_config.parameters import Values

_LYING = 0.5  # the part of a get-up clip in which it may begin


@dataclass(frozen=True)
class BehaviourChoice:
    """A behaviour, one for each episode."""

    make: BehaviourMaker = Tracking
    needs_contacts: bool = False


def choose_behaviour(character: Character, values: Values) -> BehaviourChoice:
    """The behaviour of the parameter of that name; libraries of motion are read here, once.

    Raises:
        ConfigurationError: a value is wrong, or the character cannot do it.
        ClipError: a clip of the library is malformed.
    """
    name = values.text("behaviour")
    if name == "tracking":
        return BehaviourChoice()
    if name == "ragdoll":
        return BehaviourChoice(Ragdoll)
    posture = Posture(character)
    settings = reaction_settings(character, values)
    library = get_ups = None
    rest = np.array(character.rest_position)
    if settings.searches:
        library = MotionLibrary(character, settings.library, settings.blend_duration)
    if settings.by_clip:
        sides = [settings.face_up, settings.face_down]
        get_ups = MotionLibrary(character, sides, lasting=0.0, share=_LYING)
    kit = ReactionKit(
        character=character,
        settings=settings,
        model=DynamicsModel(character, values.number("gravity")),
        posture=posture,
        period=1.0 / values.integer("rate"),
        library=library,
        get_ups=get_ups,
        plans=values.text("planner") != NO_PLANNER,
    )
    for made in (library, get_ups):
        if made is not None:  # a first search takes longer than others
            made.nearest(made.predicted(rest, np.zeros_like(rest)))
    return BehaviourChoice(lambda: Reaction(kit), needs_contacts=True)
