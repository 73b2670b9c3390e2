"""One rollout: the law and the model of the world, step after step, without Python in between."""

import math
from typing import NamedTuple

import numpy as np

from controller_node.planner.compiled.decorator import compiled
from controller_node.planner.compiled.features import Watched, write_features
from controller_node.planner.compiled.law import Joints, Room, add_errors, stable_pd
from controller_node.references.offsets import knot_before
from msgs_config.arrays import FloatArray
from msgs_config.compiled import mujoco_functions as mj
from msgs_config.compiled.borrowed import borrow
from msgs_config.compiled.data_layout import DataFields, RawData
from msgs_config.compiled.friction import set_friction
from msgs_config.compiled.law import LawGains
from msgs_config.compiled.mass_matrix import MassMatrix, Tree
from msgs_config.compiled.soft_limits import (
    PassedBounds,
    SoftLimits,
    add_soft_limits,
    room_for_bounds,
)

_knot_before = compiled(knot_before)
_room_for_bounds = compiled(room_for_bounds)

MOST_BOUNDS = 32  # of soft limits that are passed at once
_MAX_SPEED = 1e3  # rad/s or m/s; what is faster has diverged


class EngineBuffers(NamedTuple):
    """MuJoCo's model and data by their addresses, and what of the data is read and written."""

    model: int
    data: int
    position: FloatArray  # (q,) rotations as quaternions wxyz
    velocity: FloatArray  # (n,)
    warm_start: FloatArray  # (n,)
    applied: FloatArray  # (n,) forces
    bias: FloatArray  # (n,)
    mass: MassMatrix  # the mass matrix of the state
    law_mass: MassMatrix  # the mass matrix with the law's damping over a period
    points: FloatArray  # (bodies, 3) m, origins of the links
    centres: FloatArray  # (bodies, 3) m, centres of mass of what each body carries
    smooth: FloatArray  # (n,) acceleration without constraints
    fields: DataFields
    raw: RawData


class RolloutModel(NamedTuple):
    """What stays the same: the character and its law."""

    tree: Tree
    joints: Joints
    limits: SoftLimits
    law: LawGains
    watched: Watched
    has_own_contacts: bool  # else those of engine MuJoCo


class Desired(NamedTuple):
    """The reference over the horizon, and how the offsets are laid over it."""

    first_tick: int  # the horizon's first tick, since the episode began
    step_ticks: int  # ticks from one step of the model to the next
    knot_ticks: int  # ticks from one knot to the next
    first_knot: int  # number of the first knot that is given
    check_steps: int  # steps from one check to the next
    positions: FloatArray  # (steps + 1, q) as MuJoCo has them
    velocities: FloatArray  # (steps + 1, n)


@compiled
def roll_out(
    features: FloatArray,
    start_position: FloatArray,
    start_velocity: FloatArray,
    knots: FloatArray,
    desired: Desired,
    body: RolloutModel,
    engine: EngineBuffers,
) -> bool:
    """Simulate a horizon and write the features (checks, f) at its checks; whether that went well.

    Args:
        features: The result. Not all is written if the simulation diverges.
        start_position: MuJoCo's position (q,).
        start_velocity: Velocity (n,).
        knots: Offsets (k, n - 6) of the actuated joints, rad or m; linear in between.
        desired: The reference.
        body: The character.
        engine: What simulates it.
    """
    desired, body, engine = borrow(desired), borrow(body), borrow(engine)
    features, knots = borrow(features), borrow(knots)
    n = len(start_velocity)
    room = Room(np.empty(n), np.empty(n), np.empty(n), engine.law_mass)
    bounds = _room_for_bounds(MOST_BOUNDS, n)
    begin(start_position, start_velocity, engine)
    steps = len(desired.positions) - 1
    for step in range(steps + 1):
        mj.step_before_forces(engine.model, engine.data)
        check, since_check = divmod(step, desired.check_steps)
        if check and not since_check:
            write_check(features[check - 1], desired.positions[step], body, engine)
        if step < steps:
            tick = desired.first_tick + step * desired.step_ticks
            _set_offset(room.error, knots, tick, desired)
            target, target_velocity = desired.positions[step + 1], desired.velocities[step + 1]
            apply_law(target, target_velocity, body, engine, room, bounds)
            if not is_bounded(engine):
                return False  # before MuJoCo writes a warning
            step_with_forces(body, engine)
    return is_bounded(engine)


@compiled
def let_act(
    start_position: FloatArray,
    start_velocity: FloatArray,
    efforts: FloatArray,
    body: RolloutModel,
    engine: EngineBuffers,
) -> bool:
    """Simulate ticks in which given efforts (ticks, n) act; whether that went well.

    The engine's position and velocity are the result.
    """
    bounds = _room_for_bounds(MOST_BOUNDS, len(start_velocity))
    begin(start_position, start_velocity, engine)
    for tick in range(len(efforts)):
        mj.step_before_forces(engine.model, engine.data)
        engine.applied[:] = efforts[tick]
        _add_passive(body, engine, bounds)
        if not is_bounded(engine):
            return False  # before MuJoCo writes a warning
        step_with_forces(body, engine)
    return is_bounded(engine)


@compiled
def step_with_forces(body: RolloutModel, engine: EngineBuffers) -> None:
    """The rest of a tick, with the applied forces."""
    model, data = engine.model, engine.data
    if body.has_own_contacts:
        mj.step_after_forces(model, data)
    else:
        mj.find_free_acceleration(model, data)
        set_friction(model, data, engine.smooth, engine.fields, engine.raw)
        mj.solve_constraints(model, data)
        mj.advance_explicitly(model, data)


@compiled
def begin(position: FloatArray, velocity: FloatArray, engine: EngineBuffers) -> None:
    """Put it into a state, with nothing left of what it did before."""
    engine.position[:] = position
    engine.velocity[:] = velocity
    engine.warm_start[:] = 0.0


@compiled
def is_bounded(engine: EngineBuffers) -> bool:
    """Whether the state is one that goes on, and the forces are finite."""
    bounded = True
    for i in range(len(engine.velocity)):
        bounded &= abs(engine.velocity[i]) < _MAX_SPEED and abs(engine.applied[i]) < math.inf
    return bounded


@compiled
def _set_offset(error: FloatArray, knots: FloatArray, tick: int, desired: Desired) -> None:
    """Write the offset (n,) of a tick."""
    number, share = _knot_before(tick, desired.knot_ticks)
    knot = number - desired.first_knot
    error[:6] = 0.0
    for i in range(knots.shape[1]):
        before = knots[knot, i]
        error[6 + i] = before + share * (knots[knot + 1, i] - before)


@compiled
def apply_law(
    target: FloatArray,
    target_velocity: FloatArray,
    body: RolloutModel,
    engine: EngineBuffers,
    room: Room,
    bounds: PassedBounds,
) -> None:
    """Apply what the law, the passive damping and the soft limits do; `room` has the offset."""
    applied, velocity, mass = engine.applied, engine.velocity, engine.mass.entries
    add_errors(room.error, engine.position, target, body.joints)
    stable_pd(applied, velocity, target_velocity, engine.bias, mass, body.tree, body.law, room)
    _add_passive(body, engine, bounds)


@compiled
def _add_passive(body: RolloutModel, engine: EngineBuffers, bounds: PassedBounds) -> None:
    """Add what the passive damping and the soft limits do to the applied forces."""
    for i in range(len(engine.velocity)):
        engine.applied[i] -= body.law.passive_damping[i] * engine.velocity[i]
    add_soft_limits(
        engine.applied,
        engine.position,
        engine.velocity,
        body.law.period,
        body.limits,
        engine.mass,
        bounds,
    )


@compiled
def write_check(
    row: FloatArray, target: FloatArray, body: RolloutModel, engine: EngineBuffers
) -> None:
    """Write the features (f,) of the engine's state against a target position (q,)."""
    write_features(
        row,
        target,
        engine.position,
        engine.velocity,
        engine.mass.entries,
        engine.points,
        engine.centres[1],
        body.tree,
        body.joints,
        body.watched,
    )


@compiled
def features_of(
    row: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    body: RolloutModel,
    engine: EngineBuffers,
) -> None:
    """Write the features (f,) of a state against itself: those of a reference."""
    features_against(row, position, velocity, position, body, engine)


@compiled
def features_against(
    row: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    target: FloatArray,
    body: RolloutModel,
    engine: EngineBuffers,
) -> None:
    """Write the features (f,) of a state against a target position (q,)."""
    engine.position[:] = position
    engine.velocity[:] = velocity
    mj.step_before_forces(engine.model, engine.data)
    write_check(row, target, body, engine)
