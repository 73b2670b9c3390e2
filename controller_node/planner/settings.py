"""The settings of the planner, checked."""

import os
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from controller_node.ground import FELT, TERRAIN, check_placement
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError
from msgs_config.parameters import Values
from msgs_config.settings import Settings, parameter, shared
from msgs_config.shared_parameters import COMMAND_DELAY, GRAVITY, NO_GROUND, PLANE, RATE

NO_PLANNER = "none"
PREDICTIVE = "predictive"
RECORDED = "recorded"
POLICY = "policy"
HYBRID = "hybrid"

OWN_CONTACTS = "own"
WORLD_CONTACTS = "world"

PLANNING_DELAY = "planning_delay_ticks"


class CostWeights(Settings, prefix="plan.weight."):
    """The weights of a rollout's deviations from the reference."""

    root_rotation: float = parameter(5.0, "of the error of the root's rotation", unit="1/rad")
    joints: float = parameter(1.0, "of the error of the joints' rotations", unit="1/rad")
    root_spin: float = parameter(0.3, "of the error of the root's angular velocity", unit="s/rad")
    joint_rates: float = parameter(0.02, "of the error of the joints' velocities", unit="s/rad")
    centre_of_mass: float = parameter(40.0, "of the error of the centre of mass", unit="1/m")
    centre_of_mass_velocity: float = parameter(
        10.0, "of the error of the velocity of the centre of mass", unit="s/m"
    )
    angular_momentum: float = parameter(
        0.4,
        "of the error of the angular momentum about the centre of mass",
        unit="1/(N m s)",
    )
    feet: float = parameter(
        10.0, "of the error of the links that the character stands on", unit="1/m"
    )
    hands: float = parameter(
        2.0, "of the error of the other links that carry no others", unit="1/m"
    )


class PlannerParameters(Settings, prefix="plan."):
    """What a planner is set to."""

    rate_hz: int = shared(RATE)
    gravity: float = shared(GRAVITY)
    delay: int = shared(COMMAND_DELAY)  # ticks
    terrain: str = shared(TERRAIN)
    planner: str = parameter(
        NO_PLANNER,
        "what keeps a floating base's motion by joint torques alone: nothing, planning ahead in a "
        "model of the world, the plan that is in the clip's file (of `motion reconstruct`), a "
        "trained policy, or a policy while it is calm and planning ahead while it is not",
        name="planner",
        choices=(NO_PLANNER, PREDICTIVE, RECORDED, POLICY, HYBRID),
    )
    policy: str = parameter(
        "",
        "of planners policy and hybrid: a shipped policy's name, or a file of `train`; empty: the "
        "one that is shipped for the clip",
        name="policy",
    )
    horizon: float = parameter(0.8, "how far it looks", unit="s", minimum=0.05, maximum=5.0)
    period: float = parameter(0.05, "from one plan to the next", unit="s", minimum=1e-3, maximum=1)
    knots: float = parameter(
        0.15, "from one knot of a plan to the next", unit="s", minimum=0.01, maximum=5
    )
    step: float = parameter(
        0.0,
        "longest step of the model that plans are tried in; a tick of the world at least: two of "
        "240 Hz (0.009) take half of the time, and foresee a bit less",
        unit="s",
        minimum=0.0,
        maximum=0.05,
    )
    samples: int = parameter(
        16, "rollouts of a round in which a plan is sought", minimum=8, maximum=10_000
    )
    rounds: int = parameter(8, "at most, for a plan", minimum=1, maximum=100)
    tolerance: float = parameter(20.0, "cost a round so far at which a plan needs no further one")
    noise: float = parameter(
        0.15,
        "standard deviation of samples, as a share of the joints' sigma",
        minimum=1e-3,
        maximum=10.0,
    )
    gives_way: bool = parameter(
        True,
        "the reference's place and heading follow a character that is pushed out of reach or "
        "stops beside them, and return; without, and on other ground than the plane, it is always "
        "held to its own place",
    )
    seed: int = parameter(0, "of the samples", maximum=2**53)
    friction: float = parameter(0.38, "of contacts as foreseen; a margin against slips", maximum=10)
    contact: str = parameter(
        OWN_CONTACTS,
        "contacts as foreseen: the planner's own, which are softer than any engine's, or those of "
        "engine mujoco's world",
        choices=(OWN_CONTACTS, WORLD_CONTACTS),
    )
    planning_delay: int = parameter(
        0,
        "from the state that a plan is made from to the first tick in which it acts; meanwhile the "
        "plan before leads, and the world need not wait",
        name=PLANNING_DELAY,
        maximum=1000,
        unit="ticks",
    )
    workers: int = parameter(0, "threads; 0: one for each processor", maximum=256)
    weights: CostWeights = CostWeights()

    @property
    def threads(self) -> int:
        """How many threads roll out plans."""
        return self.workers or len(os.sched_getaffinity(0))


_SIGMA_TURN = 0.4  # rad, of joints that the character's file says nothing of
_SIGMA_SLIDE = 0.05  # m, of sliders that the character's file says nothing of


@dataclass(frozen=True)
class PlannerSettings:
    """What plans depend on, times in ticks."""

    parameters: PlannerParameters
    horizon: int  # a whole number of periods
    period: int  # a whole number of steps
    step: int
    knots: int
    sigma: FloatArray  # (n - 6,) rad or m

    @property
    def checks(self) -> int:
        """How often a rollout is compared with the reference."""
        return self.horizon // self.period


def check_planner(character: Character, planner: str) -> None:
    """Raise ConfigurationError if a planner, by its name, cannot be had for a character."""
    if not character.layout.has_floating_base or character.layout.size == 6:
        raise ConfigurationError(
            f"planner '{planner}' is for a floating base with joints; '{character.name}' is none"
        )


def check_ground(character: Character, given: PlannerParameters) -> None:
    """Raise ConfigurationError if a planner cannot do with its ground."""
    if given.terrain != PLANE and given.planner != PREDICTIVE:
        raise ConfigurationError(
            f"controller_node's '{TERRAIN.name}' is {given.terrain}, and planner '{given.planner}' "
            f"knows the ground at z = 0 alone; it must be {PLANE}"
        )
    if given.terrain not in (PLANE, FELT):
        check_placement(character)
    wrong = {
        f"'{character.name}' has no feet in its file": not character.feet,
        f"'{COMMAND_DELAY.name}' is {given.delay}; it must be 0": given.delay > 0,
        f"'plan.contact' is {given.contact}; it must be {OWN_CONTACTS}": (
            given.contact != OWN_CONTACTS
        ),
    }
    if given.terrain == FELT:
        for sentence in (each for each, is_so in wrong.items() if is_so):
            raise ConfigurationError(f"'{TERRAIN.name}' is {FELT}, but {sentence}")


def make_planner_settings(character: Character, values: Values) -> PlannerSettings:
    """The settings of planning ahead. Raises ConfigurationError if times contradict each other."""
    given = PlannerParameters.of(values)
    horizon, period, knots = (
        max(round(time * given.rate_hz), 1) for time in (given.horizon, given.period, given.knots)
    )
    if horizon < period:
        raise ConfigurationError(
            f"parameter 'plan.horizon' is {given.horizon:g}; it must be "
            f"plan.period, {given.period:g} s, or more"
        )
    most = min(period, horizon - horizon % period - period)  # until then the plan before lasts
    if given.planning_delay > most:
        raise ConfigurationError(
            f"parameter '{PLANNING_DELAY}' is {given.planning_delay}; it must be at most {most}: "
            f"no more than plan.period, {period} ticks, and than what plan.horizon leaves beside it"
        )
    if given.delay >= horizon:
        raise ConfigurationError(
            f"parameter '{COMMAND_DELAY.name}' is {given.delay}; with planner 'predictive' it must "
            f"be less than plan.horizon, {horizon} ticks"
        )
    return PlannerSettings(
        parameters=given,
        horizon=horizon - horizon % period,
        period=period,
        step=_step(given, period),
        knots=knots,
        sigma=_sigma(character),
    )


def _step(given: PlannerParameters, period: int) -> int:
    """The ticks of a step: as many as divide a period, and are no longer than is said."""
    within = [
        ticks
        for ticks in range(1, period + 1)
        if period % ticks == 0 and ticks <= given.step * given.rate_hz
    ]
    return max(within, default=1)


def check_world(values: Values, simulator: Mapping[str, object]) -> None:
    """Raise ConfigurationError if the model of the world is not of a simulator's parameters."""
    own = PlannerParameters.of(values)
    if own.planner == NO_PLANNER:
        return
    _check_terrain(own, simulator.get(TERRAIN.name, own.terrain))
    delay = simulator.get(COMMAND_DELAY.name, own.delay)
    if delay != own.delay:
        raise ConfigurationError(
            f"planner '{own.planner}' counts with '{COMMAND_DELAY.name}' {own.delay}, but "
            f"sim_node's is {delay}; it must be the same"
        )


def _check_terrain(own: PlannerParameters, terrain: object) -> None:
    """Raise ConfigurationError if a planner does not know a simulator's terrain."""
    knows_more = own.planner == PREDICTIVE and terrain != NO_GROUND
    if terrain != PLANE and not knows_more:
        raise ConfigurationError(
            f"planner '{own.planner}' knows the ground at z = 0 alone, but sim_node's 'terrain' is "
            f"{terrain}; it must be {PLANE}"
        )
    if own.terrain != FELT and (own.terrain == PLANE) != (terrain == PLANE):
        raise ConfigurationError(
            f"controller_node's '{TERRAIN.name}' is {own.terrain}, but sim_node's is {terrain}; it "
            f"must be the same, or {FELT} for a planner that is to be blind to it"
        )


def _sigma(character: Character) -> FloatArray:
    """Sigma (n - 6,) of the actuated entries."""
    layout, sigma = character.layout, np.empty(character.layout.size)
    for joint in layout.joints:
        default = _SIGMA_SLIDE if joint.type is JointType.PRISMATIC else _SIGMA_TURN
        sigma[joint.entries] = character.planning.sigma.get(joint.name, default)
    return sigma[6:]
