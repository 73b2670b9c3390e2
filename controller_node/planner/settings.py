"""The parameters of the planner, checked."""

import os
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.errors import ConfigurationError
from msgs_config.parameters import Parameter, Values
from msgs_config.shared_parameters import COMMAND_DELAY, PLANE

NO_PLANNER = "none"
PREDICTIVE = "predictive"
RECORDED = "recorded"

PLANNING_DELAY = "planning_delay_ticks"

_WEIGHTS = {  # by name: default, unit, and the error that it weighs
    "root_rotation": (5.0, "1/rad", "the root's rotation"),
    "joints": (1.0, "1/rad", "the joints' rotations"),
    "root_spin": (0.3, "s/rad", "the root's angular velocity"),
    "joint_rates": (0.02, "s/rad", "the joints' velocities"),
    "centre_of_mass": (40.0, "1/m", "the centre of mass"),
    "centre_of_mass_velocity": (10.0, "s/m", "the velocity of the centre of mass"),
    "angular_momentum": (0.4, "1/(N m s)", "the angular momentum about the centre of mass"),
    "feet": (10.0, "1/m", "the links that the character stands on"),
    "hands": (2.0, "1/m", "the other links that carry no others"),
}

PLANNER_PARAMETERS = [
    Parameter(
        "planner",
        NO_PLANNER,
        "what keeps a floating base's motion by joint torques alone: nothing, planning ahead in a "
        "model of the world, or the plan that is in the clip's file (of `motion reconstruct`)",
        choices=(NO_PLANNER, PREDICTIVE, RECORDED),
    ),
    Parameter("plan.horizon", 0.8, "how far it looks", unit="s", minimum=0.05, maximum=5.0),
    Parameter("plan.period", 0.05, "from one plan to the next", unit="s", minimum=1e-3, maximum=1),
    Parameter(
        "plan.knots", 0.15, "from one knot of a plan to the next", unit="s", minimum=0.01, maximum=5
    ),
    Parameter(
        "plan.samples",
        16,
        "rollouts of a round in which a plan is sought",
        minimum=8,
        maximum=10_000,
    ),
    Parameter("plan.rounds", 8, "at most, for a plan", minimum=1, maximum=100),
    Parameter("plan.tolerance", 20.0, "cost a round so far at which a plan needs no further one"),
    Parameter(
        "plan.noise",
        0.15,
        "standard deviation of samples, as a share of the joints' sigma",
        minimum=1e-3,
        maximum=10.0,
    ),
    Parameter(
        "plan.gives_way",
        True,
        "the reference's place and heading follow a character that is pushed out of reach or "
        "stops beside them, and return; without, it is always held to its own place",
    ),
    Parameter("plan.seed", 0, "of the samples", maximum=2**53),
    Parameter("plan.friction", 0.38, "of contacts as foreseen; a margin against slips", maximum=10),
    Parameter(
        PLANNING_DELAY,
        0,
        "from the state that a plan is made from to the first tick in which it acts; meanwhile the "
        "plan before leads, and the world need not wait",
        maximum=1000,
        unit="ticks",
    ),
    Parameter("plan.workers", 0, "threads; 0: one for each processor", maximum=256),
    *(
        Parameter(f"plan.weight.{name}", default, f"of the error of {what}", unit=unit)
        for name, (default, unit, what) in _WEIGHTS.items()
    ),
]

_SIGMA_TURN = 0.4  # rad, of joints that the character's file says nothing of
_SIGMA_SLIDE = 0.05  # m, of sliders that the character's file says nothing of


@dataclass(frozen=True)
class PlannerSettings:
    """What plans depend on, times in ticks."""

    horizon: int
    period: int
    knots: int
    planning_delay: int  # from the state that a plan is sought from to when it acts
    delay: int  # from a state to when the command that answers it acts
    samples: int
    rounds: int
    tolerance: float
    noise: float
    gives_way: bool  # whether the reference gives way to what the character cannot undo
    seed: int
    friction: float
    workers: int
    weights: dict[str, float]
    sigma: FloatArray  # (n - 6,) rad or m

    @property
    def checks(self) -> int:
        """How often a rollout is compared with the reference."""
        return self.horizon // self.period


def check_planner(character: Character, values: Values) -> None:
    """Raise ConfigurationError if a planner cannot be had for a character, or with a behaviour."""
    planner, behaviour = values.text("planner"), values.text("behaviour")
    if not character.layout.has_floating_base or character.layout.size == 6:
        raise ConfigurationError(
            f"planner '{planner}' is for a floating base with joints; '{character.name}' is none"
        )
    if behaviour == "ragdoll" or (planner == RECORDED and behaviour != "tracking"):
        wanted = (
            "the behaviour tracking" if planner == RECORDED else "a behaviour that follows a motion"
        )
        raise ConfigurationError(f"planner '{planner}' is for {wanted}; 'behaviour' is {behaviour}")


def make_planner_settings(character: Character, values: Values) -> PlannerSettings:
    """The settings of planning ahead. Raises ConfigurationError if times contradict each other."""
    rate = values.integer("rate")
    period, knots = (_ticks(values, name, rate) for name in ("plan.period", "plan.knots"))
    horizon = _ticks(values, "plan.horizon", rate)
    if horizon < period:
        raise ConfigurationError(
            f"parameter 'plan.horizon' is {values.number('plan.horizon'):g}; it must be "
            f"plan.period, {values.number('plan.period'):g} s, or more"
        )
    planning_delay = values.integer(PLANNING_DELAY)
    most = min(period, horizon - horizon % period - period)  # until then the plan before lasts
    if planning_delay > most:
        raise ConfigurationError(
            f"parameter '{PLANNING_DELAY}' is {planning_delay}; it must be at most {most}: no more "
            f"than plan.period, {period} ticks, and than what plan.horizon leaves beside it"
        )
    delay = values.integer(COMMAND_DELAY.name)
    if delay >= horizon:
        raise ConfigurationError(
            f"parameter '{COMMAND_DELAY.name}' is {delay}; with planner 'predictive' it must be "
            f"less than plan.horizon, {horizon} ticks"
        )
    return PlannerSettings(
        horizon=horizon - horizon % period,
        period=period,
        knots=knots,
        planning_delay=planning_delay,
        delay=delay,
        samples=values.integer("plan.samples"),
        rounds=values.integer("plan.rounds"),
        tolerance=values.number("plan.tolerance"),
        noise=values.number("plan.noise"),
        gives_way=values.flag("plan.gives_way"),
        seed=values.integer("plan.seed"),
        friction=values.number("plan.friction"),
        workers=values.integer("plan.workers") or len(os.sched_getaffinity(0)),
        weights={name: values.number(f"plan.weight.{name}") for name in _WEIGHTS},
        sigma=_sigma(character),
    )


def check_world(values: Values, simulator: Mapping[str, object]) -> None:
    """Raise ConfigurationError if the model of the world is not of a simulator's parameters."""
    planner = values.text("planner")
    if planner == NO_PLANNER:
        return
    terrain = simulator.get("terrain", PLANE)
    if terrain != PLANE:
        raise ConfigurationError(
            f"planner '{planner}' knows the ground at z = 0 alone, but sim_node's 'terrain' is "
            f"{terrain}; it must be {PLANE}"
        )
    own = values.integer(COMMAND_DELAY.name)
    delay = simulator.get(COMMAND_DELAY.name, own)
    if delay != own:
        raise ConfigurationError(
            f"planner '{planner}' counts with '{COMMAND_DELAY.name}' {own}, but sim_node's is "
            f"{delay}; it must be the same"
        )


def _ticks(values: Values, name: str, rate: int) -> int:
    """A time as a whole number of ticks, the nearest, at least one."""
    return max(round(values.number(name) * rate), 1)


def _sigma(character: Character) -> FloatArray:
    """Sigma (n - 6,) of the actuated entries."""
    layout, sigma = character.layout, np.empty(character.layout.size)
    for joint in layout.joints:
        default = _SIGMA_SLIDE if joint.type is JointType.PRISMATIC else _SIGMA_TURN
        sigma[joint.entries] = character.planning.sigma.get(joint.name, default)
    return sigma[6:]
