"""An engine step of `MujocoWorld` with one character in it, in one compiled call: the same bits.

The functions are those of `MujocoWorld.step`, `set_friction` and `sum_contacts`, which the tests
compare. All that a step leaves behind is read before the next one, so that one thread's memory
simulates one world after the other.
"""

from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from msgs_config.arrays import FloatArray, IntArray
from msgs_config.compiled import mujoco_functions as mj
from msgs_config.compiled.data_layout import DataFields, RawData, data_fields, raw_data
from msgs_config.compiled.decorator import Compiler
from msgs_config.compiled.friction import set_friction
from sim_node.physics import batch

compiled = Compiler(*Path(__file__).parent.glob("compiled_*.py"), Path(batch.__file__))
"""For all that simulates worlds in one call."""


class StepBuffers(NamedTuple):
    """MuJoCo's model and data by their addresses, and what of them is read and written."""

    model: int
    data: int
    position: FloatArray  # (q,)
    velocity: FloatArray  # (n,)
    applied: FloatArray  # (n,)
    smooth: FloatArray  # (n,) acceleration without constraints
    origins: FloatArray  # (bodies, 3) m
    axes: FloatArray  # (bodies, 9)
    centres: FloatArray  # (bodies, 3) m, centres of mass
    body_of_shape: IntArray  # (shapes,)
    period: float  # s, of a step
    speed_bound: float  # rad/s or m/s
    fields: DataFields
    raw: RawData
    before: FloatArray  # (q,) room
    wrench: FloatArray  # (6,) room
    point: FloatArray  # (3,) room


class Pushes(NamedTuple):
    """Pushes on links, those of each world one after the other."""

    starts: IntArray  # (worlds + 1,) where those of each world begin
    bodies: IntArray  # (m,) of MuJoCo
    wrenches: FloatArray  # (m, 6) N and N m, world axes
    points: FloatArray  # (m, 3) m, link frames
    first_ticks: IntArray  # (m,) of the states from which they act
    last_ticks: IntArray  # (m,) of the states from which they act no longer


def step_buffers(
    model: mujoco.MjModel, data: mujoco.MjData, speed_bound: float, period: float
) -> StepBuffers:
    """What a step reads and writes; model and data must outlive it."""
    return StepBuffers(
        model._address,
        data._address,
        data.qpos,
        data.qvel,
        data.qfrc_applied,
        data.qacc_smooth,
        data.xpos,
        data.xmat,
        data.xipos,
        model.geom_bodyid.astype(np.intp),
        period,
        speed_bound,
        data_fields(),
        raw_data(data),
        np.empty(model.nq),
        np.empty(6),
        np.empty(3),
    )


@compiled.inlined
def step(world: int, tick: int, pushes: Pushes, buffers: StepBuffers) -> bool:
    """Advance by one engine step, with the efforts in `applied`; whether all contacts had room.

    The pushes are those of a world that act in a tick. `applied` is zero afterwards.
    """
    model, data = buffers.model, buffers.data
    mj.find_position_terms(model, data)
    if not _has_room(buffers):
        return False
    mj.find_velocity_terms(model, data)
    for push in range(pushes.starts[world], pushes.starts[world + 1]):
        if pushes.first_ticks[push] <= tick < pushes.last_ticks[push]:
            _apply(push, pushes, buffers)
    mj.find_free_acceleration(model, data)
    set_friction(model, data, buffers.smooth, buffers.fields, buffers.raw)
    mj.solve_constraints(model, data)
    buffers.before[:] = buffers.position
    mj.advance_explicitly(model, data)
    _bound_speeds(buffers)
    buffers.applied[:] = 0.0
    return True


@compiled.inlined
def _has_room(buffers: StepBuffers) -> bool:
    """Whether there was room for all contacts; where there was not, the next step may have it."""
    has_room = True
    for warning in buffers.fields.full:
        has_room &= buffers.raw.numbers[warning] == 0
        buffers.raw.numbers[warning] = 0
    return has_room


@compiled.inlined
def _apply(push: int, pushes: Pushes, buffers: StepBuffers) -> None:
    body, point = pushes.bodies[push], pushes.points[push]
    axes = buffers.axes[body]
    for i in range(3):
        row = 3 * i
        turned = axes[row] * point[0] + axes[row + 1] * point[1] + axes[row + 2] * point[2]
        buffers.point[i] = buffers.origins[body, i] + turned
    buffers.wrench[:] = pushes.wrenches[push]
    force = buffers.wrench.ctypes.data
    torque, at = force + 24, buffers.point.ctypes.data  # after three doubles
    out = buffers.applied.ctypes.data
    mj.apply_wrench(buffers.model, buffers.data, force, torque, at, body, out)


@compiled.inlined
def _bound_speeds(buffers: StepBuffers) -> None:
    """Have the step gone with the speeds that are let be."""
    bound, is_faster = buffers.speed_bound, False
    for i in range(len(buffers.velocity)):
        is_faster |= abs(buffers.velocity[i]) > bound
    if is_faster:
        for i in range(len(buffers.velocity)):
            if abs(buffers.velocity[i]) > bound:
                buffers.velocity[i] = bound if buffers.velocity[i] > 0.0 else -bound
        buffers.position[:] = buffers.before
        start, velocity = buffers.position.ctypes.data, buffers.velocity.ctypes.data
        mj.move_position(buffers.model, start, velocity, buffers.period)


@compiled.inlined
def add_contacts(share: float, wrenches: FloatArray, buffers: StepBuffers) -> None:
    """Add a share of the net contact wrenches (links, 6) of the last step: see `sum_contacts`."""
    raw, fields = buffers.raw, buffers.fields
    start = (raw.words[fields.contact_pointer] - raw.arena_start) // 8
    net = np.zeros(wrenches.shape)
    for number in range(raw.numbers[fields.contacts]):
        first = start + number * fields.contact_words
        if raw.arena_numbers[2 * first + fields.constraint] < 0:
            continue  # apart, or between what cannot move
        mj.find_contact_force(buffers.model, buffers.data, number, buffers.wrench.ctypes.data)
        point, frame = raw.arena[first + fields.point :], raw.arena[first + fields.frame :]
        normal, along, across = buffers.wrench[0], buffers.wrench[1], buffers.wrench[2]
        # The rows of the frame are its axes; the first one leads from the first shape to the other,
        # on which the force acts.
        x = frame[0] * normal + frame[3] * along + frame[6] * across
        y = frame[1] * normal + frame[4] * along + frame[7] * across
        z = frame[2] * normal + frame[5] * along + frame[8] * across
        for side in range(2):
            shape = raw.arena_numbers[2 * first + fields.shapes + side]
            body = buffers.body_of_shape[shape]
            if body == 0:
                continue  # the ground
            sign, centre, row = 2.0 * side - 1.0, buffers.centres[body], net[body - 1]
            fx, fy, fz = sign * x, sign * y, sign * z
            rx, ry, rz = point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]
            row[0] += fx
            row[1] += fy
            row[2] += fz
            row[3] += ry * fz - rz * fy
            row[4] += rz * fx - rx * fz
            row[5] += rx * fy - ry * fx
    for link in range(len(net)):
        for i in range(6):
            wrenches[link, i] += share * net[link, i]
