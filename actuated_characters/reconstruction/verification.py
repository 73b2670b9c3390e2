"""Simulates a reconstruction again, from a fresh world, as a run of its file does."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from actuated_characters.metrics.error_measures import centre_path, joint_errors
from actuated_characters.metrics.falls import reader_for
from actuated_characters.metrics.run_metrics import Measurement
from actuated_characters.reconstruction.problem import Problem
from actuated_characters.reconstruction.tree import Node
from actuated_characters.runs.bare_loop import ticks_in_process
from msgs_config.arrays import FloatArray
from msgs_config.errors import SimulationError
from msgs_config.messages import configuration
from msgs_config.messages.clock import TickClock
from msgs_config.messages.state import StampedState
from sim_node.simulation_factory import make_simulation_settings


@dataclass(frozen=True)
class ReconstructionMetrics:
    """How well a reconstruction follows its motion."""

    ticks: int
    fell: bool
    centre_error_mean_m: float
    joint_error_mean_rad: float
    least_root_height_m: float
    state_hash: str


@dataclass(frozen=True, eq=False)
class Verified:
    """A reconstruction that was simulated again."""

    metrics: ReconstructionMetrics
    positions: FloatArray  # (t, n) after each tick
    desired: FloatArray  # (t, n) the motion's own


def verified(problem: Problem, file: Path, best: Node) -> Verified:
    """Run a reconstruction's file from a fresh world, and measure it.

    Raises:
        SimulationError: the states are not those of the search, to the bit.
    """
    plan, motion = problem.plan_of(file), problem.plan().reference
    clock = TickClock(plan.simulation.rate_hz)
    ends = {node.tick: node for node in best.path}
    known = configuration.parse(configuration.describe(plan.character, plan.simulator))
    terrain = make_simulation_settings(plan.simulator).world.terrain
    measurement = Measurement(known, reader_for(plan.character, terrain))
    positions: list[FloatArray] = []
    motions: list[FloatArray] = []
    for count, tick in enumerate(ticks_in_process(plan, problem.planned_pushes(plan)), start=1):
        measurement.add(tick)
        time = clock.time_after(count)
        positions.append(tick.following.position)
        motions.append(motion.sample(time).configuration.position)
        if count in ends:
            _check_equal(tick.following, ends[count], time)
        if count == best.tick:
            break
    summary = measurement.summary(wall_time=0.0)
    path, desired = np.array(positions), np.array(motions)
    apart = centre_path(plan.character, path) - centre_path(plan.character, desired)
    metrics = ReconstructionMetrics(
        ticks=len(positions),
        fell=bool(summary["fell"]),
        centre_error_mean_m=float(np.linalg.norm(apart, axis=1).mean()),
        joint_error_mean_rad=float(joint_errors(plan.character.layout, path, desired).mean()),
        least_root_height_m=float(path[:, 2].min()),
        state_hash=measurement.state_hash,
    )
    return Verified(metrics, path, desired)


def _check_equal(state: StampedState, node: Node, time: float) -> None:
    found = np.concatenate((state.position, state.velocity))
    if found.tobytes() != node.end.tobytes():
        raise SimulationError(
            f"the search's states are not repeated: at {time:g} s "
            f"{np.abs(found - node.end).max():.3g} away"
        )
