"""Contacts of MuJoCo's last step, as each link feels them."""

import mujoco
import numpy as np

from msgs_config.arrays import BoolArray, FloatArray
from msgs_config.compiled.friction import ask_for_friction

_FORCE_NUMBERS = 6  # of one contact, in its own frame: a force and a torque


def set_friction(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Have contacts ask for friction as `ask_for_friction` says.

    To be called after `mj_fwdAcceleration`, and before `mj_fwdConstraint`.
    """
    if data.ncon:
        smooth, contact = np.empty(data.nefc), data.contact
        mujoco.mj_mulJacVec(model, data, smooth, data.qacc_smooth)
        ask_for_friction(data.efc_aref, smooth, contact.friction, contact.efc_address)


def sum_contacts(
    model: mujoco.MjModel, data: mujoco.MjData, centres: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Net contact wrench (bodies, 6) on each of MuJoCo's bodies; and which (bodies,) touched.

    Force in N and torque in N m about `centres` (bodies, 3), the centres of mass when the step
    began, world axes.
    """
    wrenches, touching = np.zeros((model.nbody, 6)), np.zeros(model.nbody, dtype=np.bool_)
    in_frame = np.zeros(_FORCE_NUMBERS)
    contact, bodies, middles = data.contact, model.geom_bodyid.tolist(), centres.tolist()
    shapes, points, axes = contact.geom.tolist(), contact.pos.tolist(), contact.frame.tolist()
    rows = contact.efc_address.tolist()
    for number, (pair, (px, py, pz), frame) in enumerate(zip(shapes, points, axes, strict=True)):
        if rows[number] < 0:
            continue  # apart, or between what cannot move
        mujoco.mj_contactForce(model, data, number, in_frame)
        normal, along, across = in_frame[:3].tolist()
        # The rows of the frame are its axes; the first one leads from the first shape to the other,
        # on which the force acts.
        x = frame[0] * normal + frame[3] * along + frame[6] * across
        y = frame[1] * normal + frame[4] * along + frame[7] * across
        z = frame[2] * normal + frame[5] * along + frame[8] * across
        for shape, sign in zip(pair, (-1.0, 1.0), strict=True):
            body = bodies[shape]
            cx, cy, cz = middles[body]
            fx, fy, fz, rx, ry, rz = sign * x, sign * y, sign * z, px - cx, py - cy, pz - cz
            torque = (ry * fz - rz * fy, rz * fx - rx * fz, rx * fy - ry * fx)
            wrenches[body] += (fx, fy, fz, *torque)
            touching[body] = True
    return wrenches, touching
