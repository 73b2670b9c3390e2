"""How good a policy is in runs as users make them, which its training did not see."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actuated_characters.metrics.error_measures import is_lost, joint_errors
from actuated_characters.runs.bare_loop import ticks_in_process
from actuated_characters.runs.planned.wrenches import plan_push
from actuated_characters.training.exercises import Exercise
from msgs_config.character.dynamics import DynamicsModel
from msgs_config.errors import SimulationError

_JOLT_NS = 5.0  # N s, from another side in each run, so that they differ
_JOLT_AT, _JOLT_LASTS = 0.3, 0.2  # s
_OTHER_DRIVES = 1_000_000  # seeds from which on no training has drives
_LOOK = 8  # ticks from one look at the errors to the next


@dataclass(frozen=True)
class Trial:
    """What became of a run."""

    lasted_s: float  # until it lost its reference, or to the end
    to_the_end: bool
    centre_error_m: float  # mean, against the reference at its own place
    joint_error_rad: float  # mean


def attempt(
    exercise: Exercise, given: Mapping[str, object], policy: Path, engine: str, seed: int
) -> Trial:
    """Run a policy with a jolt from a side that the seed says; `given` are controller_node's.

    Raises:
        ActuatedCharactersError: a name or a value is wrong.
    """
    seconds, simulator = exercise.tried_s, {"engine": engine, "wrench_duration": _JOLT_LASTS}
    controller = {"planner": "policy", **given, "policy": str(policy)}
    plan, _ = exercise.plan(seconds, simulator, controller, _OTHER_DRIVES + seed)
    side = np.random.default_rng(seed).uniform(-math.pi, math.pi)
    force = _JOLT_NS / _JOLT_LASTS
    root = plan.character.links[0].name
    push = (force * math.cos(side), force * math.sin(side), 0.0)
    pushes = [plan_push(plan, root, push, _JOLT_AT)] if seconds > _JOLT_AT else []
    centre_at = DynamicsModel(plan.character).centre_of_mass_at
    offs, turns, ticks, lost = list[float](), list[float](), 0, False
    try:
        for tick in ticks_in_process(plan, pushes):
            assert tick.reference is not None
            here, wanted = tick.state.position, tick.reference.position
            if ticks % _LOOK == 0:
                centre, place = centre_at(here), centre_at(wanted)
                offs.append(float(np.linalg.norm(centre - place)))
                rows = here[np.newaxis], wanted[np.newaxis]
                turns.append(float(joint_errors(plan.character.layout, *rows).mean()))
                lost = is_lost(centre, place)
            if lost:
                break
            ticks += 1
    except SimulationError:
        lost = True
    lasted = ticks / plan.simulation.rate_hz
    return Trial(lasted, not lost, float(np.mean(offs)), float(np.mean(turns)))


def figures(trials: Mapping[str, Sequence[Trial]]) -> dict[str, dict[str, object]]:
    """What is told of trials, by what they are of."""
    return {
        name: {
            "to the end": f"{sum(each.to_the_end for each in found)} of {len(found)}",
            "centre of mass, m": round(float(np.median([e.centre_error_m for e in found])), 4),
            "joints, rad": round(float(np.median([e.joint_error_rad for e in found])), 4),
        }
        for name, found in trials.items()
    }
