"""The behaviours that react to hits, as the parameters' values say."""

from functools import partial

import numpy as np

from controller_node.behaviours.base import BEHAVIOURS, BehaviourChoice
from controller_node.behaviours.motion_library import MotionLibrary
from controller_node.behaviours.pursuit import Pursuit, PursuitSettings, pursuit_settings
from controller_node.behaviours.reaction import Reaction, ReactionKit
from controller_node.behaviours.settings import ReactionSettings, reaction_settings
from controller_node.ground import FELT, GroundSettings, Terrain, ground_shapes
from controller_node.planner.settings import NO_PLANNER, PlannerParameters
from controller_node.references.posture import Posture
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError
from msgs_config.parameters import Values
from msgs_config.shared_parameters import PLANE, SharedSettings

LYING_PART = 0.5
"""The part of a get-up clip in which it may begin."""


@BEHAVIOURS.register("active_ragdoll", ReactionSettings)
def _active_ragdoll(character: Character, values: Values) -> BehaviourChoice:
    kit = _make_kit(character, values)
    return BehaviourChoice(partial(Reaction, kit), needs_contacts=True, can_be_asked=True)


@BEHAVIOURS.register("reactive")
def _reactive(character: Character, values: Values) -> BehaviourChoice:
    kit = _make_kit(character, values, searches=True)
    return BehaviourChoice(partial(Reaction, kit), needs_contacts=True, can_be_asked=True)


@BEHAVIOURS.register("pursuit", PursuitSettings)
def _pursuit(character: Character, values: Values) -> BehaviourChoice:
    settings = pursuit_settings(character, values)
    kit, strikes = _make_kit(character, values), None
    if settings.strikes:
        strikes = MotionLibrary(character, settings.strikes, lasting=0.0)
    return BehaviourChoice(
        partial(Pursuit, kit, settings, strikes), needs_contacts=True, opponent=settings.opponent
    )


def _make_kit(character: Character, values: Values, *, searches: bool = False) -> ReactionKit:
    posture, shared = Posture(character), SharedSettings.of(values)
    settings = reaction_settings(character, values, searches=searches)
    library = get_ups = None
    if settings.searches:
        library = MotionLibrary(character, settings.library, settings.blend_duration)
    if settings.by_clip:
        sides = [settings.face_up, settings.face_down]
        get_ups = MotionLibrary(character, sides, lasting=0.0, share=LYING_PART)
    kit = ReactionKit(
        character=character,
        settings=settings,
        model=DynamicsModel(character, shared.gravity),
        posture=posture,
        period=shared.period,
        library=library,
        get_ups=get_ups,
        plans=PlannerParameters.of(values).planner != NO_PLANNER,
        terrain=_terrain(character, GroundSettings.of(values).terrain),
    )
    rest = np.array(character.rest_position)
    for made in (library, get_ups):
        if made is not None:  # a first search takes longer than others
            made.nearest(made.predicted(rest, np.zeros_like(rest)))
    return kit


def _terrain(character: Character, named: str) -> Terrain | None:
    """What a parameter `terrain` names; None for the plane z = 0."""
    if named == FELT:
        raise ConfigurationError(
            f"controller_node's 'terrain' is {FELT}; a behaviour that reacts to hits must know the "
            f"ground: {PLANE}, or sim_node's file"
        )
    if named != PLANE and character.placement.z != 0.0:
        raise ConfigurationError(
            "parameter 'placement' is not at z = 0, from where a behaviour that reacts to hits "
            "sees the heights of a 'terrain'"
        )
    shapes = ground_shapes(named)
    return Terrain(character, shapes) if shapes else None
