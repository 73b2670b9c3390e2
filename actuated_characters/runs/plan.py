"""The plan of a run: character, reference and parameters, checked before anything starts."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace

from controller_node import parameters as controller_parameters
from controller_node.behaviours.factory import (
    BehaviourSettings,
    behaviour_clips,
    choose_behaviour,
    make_motion,
)
from controller_node.behaviours.onnx_policy.factory import ONNX, policy_path
from controller_node.behaviours.settings import REACTIONS
from controller_node.behaviours.state_machine.factory import STATE_MACHINE, MachineSettings
from controller_node.ground import TERRAIN, GroundSettings, check_pieces, known_terrain
from controller_node.model_check import check_agreement
from controller_node.planner.factory import check_planning
from controller_node.planner.settings import NO_PLANNER, PREDICTIVE, RECORDED, PlannerParameters
from controller_node.references.base import Motion, Reference
from controller_node.references.clip import ClipSettings
from controller_node.references.factory import MotionSettings
from controller_node.references.keyframes import KeyframesSettings
from controller_node.references.timeline.motion import TimelineSettings
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.character.layout import ROOT
from msgs_config.character.loading import load_character
from msgs_config.character.meshes.resolving import collision_meshes
from msgs_config.character.model import Character
from msgs_config.character.terrain import pieces_of
from msgs_config.errors import ConfigurationError
from msgs_config.mappings import show_value
from msgs_config.parameters import Values
from msgs_config.plain_values import as_plain, plain_parameters
from msgs_config.shared_parameters import (
    KEYFRAME_BUDGET,
    KEYFRAME_PERIOD,
    NO_GROUND,
    PLANE,
    RESUME_FROM,
    collides,
    placed,
)
from sim_node import parameters as simulator_parameters
from sim_node.initial_state import INITIAL_STATE, CharacterSettings, as_values, describe_start
from sim_node.node_settings import NodeSettings
from sim_node.physics.engine import describe_default_engine
from sim_node.physics.probe import measure_probe
from sim_node.physics.settings import STEADY_CONTACTS, SimulationSettings, WorldSettings
from sim_node.physics.short_links import describe_speed_bound
from sim_node.simulation_factory import make_simulation_settings

SHARED = (
    *("rate", "gravity", "placement", "collision", "command_delay_ticks"),
    *(KEYFRAME_PERIOD.name, KEYFRAME_BUDGET.name),
)
"""The same on both sides; set on one, they count on both."""
_LARGEST_DURATION = 1e9  # s
_SET_BY_RUN = {
    "character": "--character, for both nodes",
    "characters": "no run, which has one character; start sim_node itself for several",
    INITIAL_STATE: "the run itself: where the reference begins, unless initial_position says it",
    RESUME_FROM.name: "`fork`, whose run goes on from there",
    "max_ticks": "--duration",
    "session": "the run itself, which makes one for all its nodes",
    "wait_for_subscribers": "the run itself: all of them, so that nothing goes unrecorded",
}
RUN_DEFAULTS = {"on_fault": "abort", "lockstep_timeout": 60.0}
"""The simulator ends with an error rather than pause, or wait forever; an answer may take so many
seconds, on a machine that may be busy."""


@dataclass(frozen=True)
class RunPlan:
    """A run's character, reference and parameters; both sides agree with each other."""

    character: Character
    reference: Reference
    simulator: Values
    controller: Values
    warnings: tuple[str, ...]  # the user should read them

    @property
    def ticks(self) -> int:
        """Length of the run in ticks."""
        return NodeSettings.of(self.simulator).max_ticks

    @property
    def motion_name(self) -> str:
        """The name of the motion that is tracked."""
        if BehaviourSettings.of(self.controller).behaviour == STATE_MACHINE:
            return MachineSettings.of(self.controller).machine
        if BehaviourSettings.of(self.controller).behaviour == ONNX:
            return policy_path(self.controller).stem
        kind = MotionSettings.of(self.controller).reference
        if kind == "keyframes":
            return KeyframesSettings.of(self.controller).keyframes
        if kind == "timeline":
            return TimelineSettings.of(self.controller).timeline
        return ClipSettings.of(self.controller).clip if kind == "clip" else kind

    def lasting(self, ticks: int) -> "RunPlan":
        """The same with another number of ticks."""
        return replace(self, simulator=Values({**self.simulator, "max_ticks": ticks}))

    @property
    def simulation(self) -> SimulationSettings:
        """What the simulation is set to."""
        return SimulationSettings.of(self.simulator)


def make_plan(
    character_name: str | os.PathLike[str],
    duration: float,
    reference: Mapping[str, object],
    simulator_settings: Mapping[str, object],
    controller_settings: Mapping[str, object],
    *,
    loaded: Character | None = None,
) -> RunPlan:
    """Resolve all parameters of both sides, and the initial state that the reference begins with.

    Args:
        character_name: A shipped character, or the path of a YAML file.
        duration: Length of the run in s.
        reference: The controller's parameters of what is tracked.
        simulator_settings: Parameters of `sim_node` that the user set, by name.
        controller_settings: Parameters of `controller_node` that the user set, by name.
        loaded: The character of that name, where it is loaded already.

    Raises:
        ActuatedCharactersError: a name or value is wrong; names it and the valid ones.
    """
    simulator_given, controller_given = _shared(
        plain_parameters(simulator_settings), plain_parameters(controller_settings)
    )
    simulator_given["character"] = as_plain(character_name)
    controller_given = _with_reference(plain_parameters(reference), controller_given)
    controller_given["character"] = simulator_given["character"]
    _show_terrain(simulator_given, controller_given)
    character = loaded or load_character(character_name, collides(simulator_given))
    character = placed(character, simulator_given)
    _keep_assistance_in_step(character, simulator_given, controller_given)
    controller, motion = _controller_values(character, controller_given)
    commanded = controller_parameters.commanded_joints(character, controller)
    defaults = {"commanded_joints": commanded, **as_values(motion.first_state())}
    stands_by_itself = PlannerParameters.of(controller).planner not in (NO_PLANNER, RECORDED)
    if stands_by_itself or BehaviourSettings.of(controller).behaviour in (STATE_MACHINE, ONNX):
        defaults |= STEADY_CONTACTS
    simulator = _simulator_values(character, {**defaults, **simulator_given}, duration)
    controller_parameters.check_world(controller, simulator)
    settings = SimulationSettings.of(simulator)
    _check_engines(character, settings.world)
    _check_terrain(simulator, controller)
    _check_commanded(simulator, commanded)
    warnings = character.warnings + motion.warnings
    warnings += controller_parameters.describe_planner(character, controller)
    warnings += describe_start(character, simulator) + describe_speed_bound(character, settings)
    warnings += describe_default_engine(settings.world.engine)
    return RunPlan(character, motion.reference, simulator, controller, warnings)


def _with_reference(
    reference: Mapping[str, object], controller: Mapping[str, object]
) -> dict[str, object]:
    """The controller's parameters and those of the reference, which must not contradict them."""
    for name in set(reference) & set(controller):
        if reference[name] != controller[name]:
            raise ConfigurationError(
                f"'{name}' is {reference[name]} as the run's reference and {controller[name]} "
                "among controller_node's parameters; give one of them"
            )
    given = {**reference, **controller}
    return {**choose_reference(given), **given}


def choose_reference(given: Mapping[str, object]) -> dict[str, object]:
    """The parameter `reference` that a clip, keyframes, a timeline or a machine mean.

    Raises:
        ConfigurationError: two of them are given, or one beside another reference.
    """
    kinds = [name for name in ("clip", "keyframes", "timeline") if given.get(name)]
    chosen = given.get("reference")
    if not kinds:
        steered = given.get("behaviour") == STATE_MACHINE and chosen is None
        return {"reference": "steered"} if steered else {}
    if len(kinds) > 1 and chosen not in kinds:
        raise ConfigurationError(f"'{kinds[0]}' and '{kinds[1]}' are given; give one of them")
    if chosen is not None and chosen not in kinds:
        raise ConfigurationError(
            f"'{kinds[0]}' is given, but parameter 'reference' is {chosen}; leave out one of them"
        )
    return {} if chosen is not None else {"reference": kinds[0]}


def _controller_values(character: Character, given: Mapping[str, object]) -> tuple[Values, Motion]:
    values = controller_parameters.resolve_for(character, given)
    motion = make_motion(character, values)
    choose_behaviour(character, values)
    check_planning(character, values, behaviour_clips(character, values))
    return values, motion


def _simulator_values(character: Character, given: Mapping[str, object], duration: float) -> Values:
    values = simulator_parameters.resolve_alone(character, {**RUN_DEFAULTS, **given})
    values["max_ticks"] = count_ticks(duration, SimulationSettings.of(values).rate_hz)
    character.check_driven(CharacterSettings.of(values).commanded_joints)
    return values


def _check_engines(character: Character, world: WorldSettings) -> None:
    probe = measure_probe(character, world.gravity, world.engine)
    check_agreement(DynamicsModel(character, world.gravity), character.layout, probe)


def _shared(
    simulator: Mapping[str, object], controller: Mapping[str, object]
) -> tuple[dict[str, object], dict[str, object]]:
    """Both sides' settings, with those that are the same on both sides; none that the run sets."""
    for name, option in _SET_BY_RUN.items():
        if name in simulator or name in controller:
            raise ConfigurationError(f"parameter '{name}' is set by {option}")
    return with_shared(simulator, controller)


def with_shared(
    simulator: Mapping[str, object], controller: Mapping[str, object]
) -> tuple[dict[str, object], dict[str, object]]:
    """Both sides' parameters, with those that are the same on both sides.

    Raises:
        ConfigurationError: one of these is given with two values.
    """
    both = {name: side[name] for side in (controller, simulator) for name in SHARED if name in side}
    for name, value in both.items():
        for side in (simulator, controller):
            if side.get(name, value) != value:
                raise ConfigurationError(
                    f"parameter '{name}' is {simulator[name]} for sim_node and {controller[name]} "
                    "for controller_node; it must be the same"
                )
    return {**both, **simulator}, {**both, **controller}


def _show_terrain(simulator: Mapping[str, object], controller: dict[str, object]) -> None:
    """Who looks ahead, or tells hits, knows the terrain, unless told what to take for it."""
    terrain = simulator.get(TERRAIN.name, PLANE)
    planner = controller.get("planner", NO_PLANNER)
    reacts = controller.get("behaviour") in REACTIONS and planner == NO_PLANNER
    if (reacts or planner == PREDICTIVE) and terrain not in (PLANE, NO_GROUND):
        controller.setdefault(TERRAIN.name, terrain)


def _keep_assistance_in_step(
    character: Character, simulator: dict[str, object], controller: dict[str, object]
) -> None:
    """Without `root` among the commanded joints there can be no root assistance."""
    commanded = simulator.get("commanded_joints")
    if isinstance(commanded, list) and character.layout.has_floating_base:
        controller.setdefault("root_assistance", ROOT in commanded)


def _check_terrain(simulator: Values, controller: Values) -> None:
    """The simulator's must be readable, and a controller that knows one must know the same."""
    terrain = make_simulation_settings(simulator).world.terrain
    known = known_terrain(GroundSettings.of(controller).terrain)
    if terrain is not None and known:
        pieces = pieces_of(terrain, collision_meshes(terrain))
        check_pieces(controller, known, simulator, pieces)


def _check_commanded(simulator: Values, commanded: list[str]) -> None:
    """Both sides must mean the same joints, or the simulator would wait forever."""
    required = set(CharacterSettings.of(simulator).commanded_joints)
    if required != set(commanded):
        raise ConfigurationError(
            f"sim_node's commanded_joints are {_listed(required)}; controller_node commands "
            f"{_listed(set(commanded))} (its root_assistance decides on 'root')"
        )


def _listed(names: set[str]) -> str:
    return ", ".join(sorted(names)) or "none"


def count_ticks(duration: float, rate_hz: int) -> int:
    """The ticks of a duration in s; raises ConfigurationError if it is less than one, or huge."""
    seconds, least = as_plain(duration), 1.0 / rate_hz
    if (
        not isinstance(seconds, (int, float))
        or isinstance(seconds, bool)
        or not least <= seconds <= _LARGEST_DURATION
    ):
        raise ConfigurationError(
            f"duration is {show_value(seconds)} s; it must be {least:g} s (one tick) to "
            f"{_LARGEST_DURATION:g} s"
        )
    return round(seconds * rate_hz)
