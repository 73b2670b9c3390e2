"""Ticks of many worlds of one character each, without Python in between.

A tick is that of `controller_node.controller.Controller` with stable PD, and of
`sim_node.physics.simulation.Simulation` with this engine, in the same doubles.
"""

from typing import NamedTuple

import numpy as np

from msgs_config.arrays import BoolArray, FloatArray, IntArray
from msgs_config.compiled import dynamics
from msgs_config.compiled import mujoco_functions as mj
from msgs_config.compiled.borrowed import borrow
from msgs_config.compiled.dynamics import DynamicsParts
from msgs_config.compiled.law import LawGains, clip
from msgs_config.compiled.mass_matrix import MassMatrix
from msgs_config.compiled.message_form import Places, write_motion
from msgs_config.compiled.soft_limits import PassedBounds, SoftLimits, find_effort, find_passed
from sim_node.physics.batch import ActionKind
from sim_node.physics.mujoco.compiled_step import (
    Pushes,
    StepBuffers,
    add_contacts,
    compiled,
    step,
)

_OFFSET, _POSITION, _EFFORT = (int(kind) for kind in ActionKind)


class Worlds(NamedTuple):
    """All that the worlds are between two ticks."""

    positions: FloatArray  # (count, q) MuJoCo's
    motion: FloatArray  # (count, 2, n) position, message form, and velocity
    ticks: IntArray  # (count,) of the states' stamps
    rows: IntArray  # (count,) of the reference at the states
    delayed: FloatArray  # (count, d, n) efforts on their way
    failed: BoolArray  # (count,)
    contacts: FloatArray  # (count, links, 6), or (0, links, 6)
    history: FloatArray  # (count, ticks, 2, n) states on the way, or (count, 0, 2, n)


class Commands(NamedTuple):
    """What the worlds are told in all ticks of a call."""

    kind: int  # of the actions
    actions: FloatArray  # (count, n), or (0, n)
    aims: FloatArray  # (count, q) positions that actions say, as MuJoCo has them; or (0, q)
    first_row: int  # of those that are here
    targets: FloatArray  # (rows, q) of the reference, as MuJoCo has them
    target_velocities: FloatArray  # (rows, n)
    pushes: Pushes


class BatchModel(NamedTuple):
    """What the worlds have in common."""

    law: LawGains
    driven: BoolArray  # (n,) what law or action may drive
    effort_limits: FloatArray  # (b,) the character's own
    substeps: int
    step_s: float
    speed_limit: float  # rad/s or m/s, beyond which a state has diverged
    limits: SoftLimits
    places: Places
    base: int  # numbers of MuJoCo's position that are a floating base's


class Worker(NamedTuple):
    """What one thread simulates worlds with."""

    step: StepBuffers
    character: DynamicsParts  # of a model of the character
    bounds: PassedBounds
    motion: FloatArray  # (2, n) room
    effort: FloatArray  # (n,) room
    passive: FloatArray  # (n,) room
    error: FloatArray  # (n,) room
    bias: FloatArray  # (n,) room
    acceleration: FloatArray  # (n,) room


@compiled
def advance(
    first: int,
    last: int,
    ticks: int,
    worlds: Worlds,
    commands: Commands,
    model: BatchModel,
    worker: Worker,
) -> None:
    """Advance the worlds from one number to another; those that fail stay as they were before."""
    worlds, commands = borrow(worlds), borrow(commands)
    model, worker = borrow(model), borrow(worker)
    for world in range(first, last):
        for tick in range(ticks):
            if worlds.failed[world]:
                break
            worker.step.position[:] = worlds.positions[world]
            worker.step.velocity[:] = worlds.motion[world, 1]
            _find_effort(world, worlds, commands, model, worker)
            if not _advance_tick(world, worlds, commands, model, worker):
                worlds.failed[world] = True
                break
            worlds.positions[world] = worker.step.position
            worlds.motion[world] = worker.motion
            worlds.ticks[world] += 1
            worlds.rows[world] += 1
            if worlds.history.shape[1]:
                worlds.history[world, tick] = worker.motion


@compiled.inlined
def _find_effort(
    world: int, worlds: Worlds, commands: Commands, model: BatchModel, worker: Worker
) -> None:
    """Find the effort (n,) that acts in a tick."""
    effort, law = worker.effort, model.law
    if commands.kind == _EFFORT:
        effort[:] = 0.0
        if len(commands.actions):
            effort[:] = commands.actions[world]
    else:
        _answer(world, worlds, commands, law, model.base, worker)
        clip(effort, law.limits, law.vector_starts, law.vector_lengths)
    delay = worlds.delayed.shape[1]
    for i in range(len(effort)):
        # -0.0 becomes 0.0, as in the simulation
        effort[i] = effort[i] + 0.0 if model.driven[i] else 0.0
        if delay:
            place = worlds.ticks[world] % delay
            late = worlds.delayed[world, place, i]
            worlds.delayed[world, place, i] = effort[i]
            effort[i] = late
    clip(effort, model.effort_limits, law.vector_starts, law.vector_lengths)


@compiled.inlined
def _answer(
    world: int,
    worlds: Worlds,
    commands: Commands,
    law: LawGains,
    base: int,
    worker: Worker,
) -> None:
    """Find the law's effort (n,) for the worker's state."""
    view, row = worker.character, worlds.rows[world] + 1 - commands.first_row
    velocity = worlds.motion[world, 1]
    dynamics.enter_state(view, worlds.motion[world, 0], velocity)
    target = commands.targets[row]
    if commands.kind == _POSITION:
        target = commands.aims[world]
        target[:base] = commands.targets[row, :base]
    start, end = view.position.ctypes.data, target.ctypes.data
    mj.find_difference(view.model, worker.error.ctypes.data, 1.0, start, end)
    if commands.kind == _OFFSET and len(commands.actions):
        worker.error[:] += commands.actions[world]
    worker.effort[:] = 0.0
    dynamics.add_effort(
        worker.effort,
        view,
        worker.error,
        velocity,
        commands.target_velocities[row],
        law.stiffness,
        law.damping,
        law.period,
        worker.bias,
        worker.acceleration,
    )


@compiled.inlined
def _advance_tick(
    world: int, worlds: Worlds, commands: Commands, model: BatchModel, worker: Worker
) -> bool:
    """Let the effort act for a tick, to the state in the worker's room; whether that went well."""
    worker.motion[:] = worlds.motion[world]
    watches = len(worlds.contacts) > 0
    if watches:
        worlds.contacts[world] = 0.0
    for substep in range(model.substeps):
        knows_state = substep == 0 and commands.kind != _EFFORT
        _apply(knows_state, model, worker)
        if not step(world, worlds.ticks[world], commands.pushes, worker.step):
            return False
        if watches:
            add_contacts(1.0 / model.substeps, worlds.contacts[world], worker.step)
        write_motion(worker.motion, worker.step.position, worker.step.velocity, model.places)
    return _is_sound(model, worker)


@compiled.inlined
def _apply(knows_state: bool, model: BatchModel, worker: Worker) -> None:
    """Apply the effort and the soft limits for a step from the state in the worker's room.

    `knows_state` says that the worker's model has taken it over.
    """
    position, velocity = worker.motion[0], worker.motion[1]
    passed = 0
    if len(model.limits.positions):
        passed = find_passed(position, velocity, model.step_s, model.limits, worker.bounds)
    if passed:
        view = worker.character
        if not knows_state:
            dynamics.enter_state(view, position, velocity)
        mass = MassMatrix(view.model, view.data, view.mass)
        find_effort(worker.passive, passed, mass, worker.bounds)
    for i in range(len(worker.effort)):
        worker.step.applied[i] = worker.effort[i] + (worker.passive[i] if passed else 0.0)


@compiled.inlined
def _is_sound(model: BatchModel, worker: Worker) -> bool:
    """Whether a state is finite, and no faster than the limit."""
    sound = True
    for i in range(len(worker.effort)):
        sound &= np.isfinite(worker.motion[0, i]) and abs(worker.motion[1, i]) <= model.speed_limit
    return sound


@compiled
def place(
    numbers: IntArray,
    positions: FloatArray,
    velocities: FloatArray,
    worlds: Worlds,
    model: BatchModel,
) -> None:
    """Put worlds (k,) into states, with nothing left of what was.

    Positions (k, q) are as MuJoCo has them, velocities are (k, n).
    """
    for row in range(len(numbers)):
        world = numbers[row]
        worlds.positions[world] = positions[row]
        write_motion(worlds.motion[world], positions[row], velocities[row], model.places)
        worlds.delayed[world] = 0.0
        worlds.failed[world] = False
        if len(worlds.contacts):
            worlds.contacts[world] = 0.0
