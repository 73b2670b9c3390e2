"""A trial of a state machine: simulator and behaviour alone, in one process.

The states are those of a run, to the bit; what a run does beside them is left out.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from actuated_characters.metrics.falls import FallWatch, PostureReader
from actuated_characters.runs.plan import RunPlan, make_plan
from actuated_characters.runs.planned.velocities import plan_velocities
from actuated_characters.runs.planned.wrenches import parse_push, push_schedule
from controller_node.behaviours.base import Observation
from controller_node.behaviours.state_machine.description import Machine
from controller_node.behaviours.state_machine.factory import kit_of
from controller_node.behaviours.state_machine.machine import StateMachine
from controller_node.parameters import make_controller_settings
from controller_node.references.steering.reference import Course, SteeredReference
from msgs_config.arrays import FloatArray
from msgs_config.character.effort_limits import EffortLimits
from msgs_config.errors import SimulationError
from msgs_config.geometry.scalars import (
    Quaternion,
    about_x,
    conjugate,
    exp,
    multiply,
    yaw,
)
from msgs_config.messages.clock import TickClock
from sim_node.physics.simulation import Simulation
from sim_node.simulation_factory import make_character_setup, make_simulation_settings


@dataclass(frozen=True)
class Trial:
    """A machine, where it is told to go, and what pushes it."""

    seconds: float
    commands: str = "0,0,0@0"  # as of `run --cmd-vel`
    pushes: Sequence[str] = ()  # as of `run --push`
    rate: int = 240
    simulator: dict[str, object] = field(default_factory=dict)

    def plan(self, machine: Machine) -> RunPlan:
        """The run of the trial with a machine."""
        settings = {"rate": self.rate, **self.simulator}
        controller = {"behaviour": "state_machine", "machine": str(machine.file)}
        plan = make_plan("humanoid", self.seconds, {}, settings, controller)
        return plan_velocities(plan, self.commands)[0]


@dataclass(frozen=True, eq=False)
class Moment:
    """A tick of a trial."""

    time: float  # s
    position: FloatArray  # (n,)
    velocity: FloatArray  # (n,)
    effort: FloatArray  # (n,) N m
    course: Course
    state: str
    loads: tuple[float, float]  # N on right and left foot


def moments(trial: Trial, machine: Machine, plan: RunPlan | None = None) -> Iterator[Moment]:
    """The ticks of a trial until it ends or the character falls."""
    plan = plan or trial.plan(machine)
    reference = plan.reference
    assert isinstance(reference, SteeredReference)
    character, rate = plan.character, trial.rate
    kit = kit_of(machine, character, plan.simulation.world.gravity, 1.0 / rate)
    behaviour, clock = StateMachine(kit), TickClock(rate)
    gains = make_controller_settings(character, plan.controller).gains
    limits = EffortLimits(character.layout, gains.effort_limits)
    wrenches = push_schedule(plan, [parse_push(text, plan) for text in trial.pushes])
    still: Any = None  # where the reference's pose would be, which a machine does not look at
    none = np.zeros((len(character.links), 6))
    strengths = np.ones(len(gains.effort_limits))
    feet = [kit.legs[side].foot_link for side in ("right", "left")]
    setup = make_character_setup(character, plan.simulator)
    settings = make_simulation_settings(plan.simulator)
    fall = FallWatch(PostureReader(character, settings.world.terrain), rate)
    with Simulation([setup], settings) as simulation:
        simulation.watches_contacts = True
        (simulated,) = simulation.characters
        for tick in range(plan.ticks):
            state, touched = simulated.state, simulated.contacts
            contacts = none if touched is None else touched.wrenches
            time, course = clock.time_after(tick), reference.course(tick)
            output = behaviour.advance(
                Observation(
                    time, clock.time_after(tick + 1), state.position, state.velocity, contacts,
                    still, still, gains, gains, strengths, False, None, course,
                )
            )  # fmt: skip
            assert output.effort is not None
            effort = limits.clipped(output.effort)
            try:
                simulation.step([effort], [wrenches.take(simulation.tick)], ())
            except SimulationError:
                return
            loads = (float(contacts[feet[0], 2]), float(contacts[feet[1], 2]))
            name = str(output.phase.facts["state"])
            yield Moment(time, state.position, state.velocity, effort, course, name, loads)
            if fall.has_fallen(simulated.state.position):
                return


@dataclass(frozen=True)
class Walk:
    """The figures of a trial of walking."""

    lasted: float  # s
    fell: bool
    speed: float  # m/s, mean, ahead, of the time looked at
    wanted: float  # m/s
    drift: float  # m/s, mean, to the left, beside the commanded velocity
    heading_error: float  # rad, mean size, of the way that the root faces
    effort: float  # mean of squares of efforts over limits


def walked(
    trial: Trial,
    machine: Machine,
    since: float,
    watch: Callable[[Moment], object] | None = None,
    plan: RunPlan | None = None,
) -> Walk:
    """Walk a trial, and measure it from a time in s on."""
    count, ahead, aside, wanted, turned, effort, last = 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for moment in moments(trial, machine, plan):
        last = moment.time
        if watch is not None:
            watch(moment)
        if moment.time < since:
            continue
        count += 1
        cosine, sine = math.cos(moment.course.heading), math.sin(moment.course.heading)
        vx, vy = moment.velocity[:2].tolist()
        ahead += cosine * vx + sine * vy
        aside += cosine * vy - sine * vx - moment.course.left
        wanted += moment.course.forward
        turned += abs(_heading_error(moment))
        effort += float(np.sum(moment.effort[6:] ** 2)) / 1e4
    fell = last < trial.seconds - 2.0 / trial.rate
    mean = 1.0 / max(count, 1)
    return Walk(last, fell, ahead * mean, wanted * mean, aside * mean, turned * mean, effort * mean)


def _against_standing(position: FloatArray) -> Quaternion:
    """How the humanoid's root (n,) is turned against standing, facing along x."""
    x, y, z = position[3:6].tolist()
    return multiply(exp((x, y, z)), conjugate(about_x(0.5 * math.pi)))


def _heading_error(moment: Moment) -> float:
    facing = yaw(_against_standing(moment.position))
    return math.remainder(facing - moment.course.heading, math.tau)


def terrain_urdf(heights: Sequence[float], start: float, length: float) -> str:
    """A ground of steps across x: each `length` m from `start` on, of a height in m, as a URDF."""
    boxes, thickness = [], 1.0
    edges = [(-20.0, start, 0.0)]
    edges += [(start + k * length, start + (k + 1) * length, h) for k, h in enumerate(heights)]
    edges.append((edges[-1][1], edges[-1][1] + 20.0, heights[-1] if heights else 0.0))
    for low, high, height in edges:
        boxes.append(
            f'<collision><origin xyz="{0.5 * (low + high):.6f} 0 {height - 0.5 * thickness:.6f}"/>'
            f'<geometry><box size="{high - low:.6f} 20 {thickness}"/></geometry></collision>'
        )
    inertia = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
    shapes = "".join(boxes)
    return (
        '<robot name="steps"><link name="ground"><inertial><mass value="0"/>'
        f"{inertia}</inertial>{shapes}</link></robot>"
    )


def write_terrain(folder: Path, name: str, heights: Sequence[float], start: float) -> Path:
    """Write a ground of steps of 0.8 m."""
    path = folder / f"{name}.urdf"
    path.write_text(terrain_urdf(heights, start, 0.8))
    return path
