"""Simulates a corrected motion again, from a fresh world, as a run of its file does."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controller_node.dynamics import DynamicsModel
from experiment.loop import ticks_in_process
from experiment.metrics import Measurement
from experiment.plan import Plan
from experiment.samcon.problem import Problem, Windows
from experiment.samcon.tree import Node
from msgs_config import configuration
from msgs_config.arrays import FloatArray
from msgs_config.errors import SimulationError
from msgs_config.joint_layout import JointLayout, JointType


@dataclass(frozen=True)
class Figures:
    """How well a corrected motion follows its motion."""

    ticks: int
    fell: bool
    centre_error_mean_m: float
    joint_error_mean_rad: float
    root_error_mean_m: float
    least_root_height_m: float
    assist_force_mean_n: float
    saturated_fraction: float
    state_hash: str


def verified(problem: Problem, file: Path, best: Node) -> Figures:
    """Run a corrected motion's file from a fresh world, and measure it.

    Raises:
        SimulationError: the states are not those of the search, to the bit.
    """
    plan, motion = problem.plan(str(file)), problem.plan().reference
    windows = Windows(plan.ticks, plan.simulator.integer("rate"), problem.window)
    ends = dict(zip(windows.bounds[1:].tolist(), best.path, strict=False))
    centre, known = (
        _Centre(plan),
        configuration.parse(configuration.describe(plan.character, plan.simulator)),
    )
    measurement = Measurement(known)
    errors: list[float] = []
    positions: list[FloatArray] = []
    motions: list[FloatArray] = []
    lowest, size = np.inf, plan.character.layout.size
    for count, tick in enumerate(ticks_in_process(plan), start=1):
        if count == 1:
            measurement.add_state(tick.state)
        measurement.add_state(tick.following)
        measurement.add_tick(tick)
        state = tick.following
        if count in ends:
            found = np.concatenate((state.position, state.velocity))
            if found.tobytes() != ends[count].end[: 2 * size].tobytes():
                raise SimulationError(
                    f"the search's states are not repeated: at {windows.time(count):g} s "
                    f"{np.abs(found - ends[count].end[: 2 * size]).max():.3g} away"
                )
        desired = motion.sample(windows.time(count)).configuration.position
        positions.append(state.position)
        motions.append(desired)
        errors.append(float(np.linalg.norm(centre.of(state.position) - centre.of(desired))))
        lowest = min(lowest, float(state.position[2]))
    summary = measurement.summary(wall_time=0.0)
    return Figures(
        ticks=len(errors),
        fell=bool(summary["fell"]),
        centre_error_mean_m=float(np.mean(errors)),
        joint_error_mean_rad=joint_error(plan.character.layout, positions, motions),
        root_error_mean_m=_number(summary["root_error_mean_m"]),
        least_root_height_m=lowest,
        assist_force_mean_n=_number(summary["assist_force_mean_n"]),
        saturated_fraction=_number(summary["saturated_fraction"]),
        state_hash=measurement.state_hash,
    )


def joint_error(
    layout: JointLayout, positions: Sequence[FloatArray], motions: Sequence[FloatArray]
) -> float:
    """Mean angle in rad between the joints' rotations and the motion's, over states (n,) each."""
    rotates = [
        joint.type in (JointType.REVOLUTE, JointType.SPHERICAL)
        for joint in layout.joints
        for _ in joint.vectors
    ]
    difference = layout.difference(
        layout.configuration(np.array(motions)), layout.configuration(np.array(positions))
    )
    return float(layout.norms(difference)[:, rotates].mean())


class _Centre:
    """The centre of mass of a character in a position."""

    def __init__(self, plan: Plan) -> None:
        self._model = DynamicsModel(plan.character)
        self._still = np.zeros(plan.character.layout.size)

    def of(self, position: FloatArray) -> FloatArray:
        """The centre of mass (3,) in the world, m."""
        self._model.update(position, self._still)
        return self._model.centre_of_mass()


def _number(value: object) -> float:
    return float(value) if isinstance(value, (int, float)) else float("nan")
