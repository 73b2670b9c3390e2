"""Pinocchio's mass matrix and bias force of a URDF's text, in the coordinates of our layout.

It reads the text with urdfdom and computes with Featherstone's algorithms: nothing of it goes
through Bullet or MuJoCo. Install it by `pip install pin` (BSD-2, 380 MB with what it needs).
"""

import numpy as np
import pinocchio

from msgs_config.arrays import FloatArray
from msgs_config.character.layout import ROOT, JointLayout
from msgs_config.geometry import rotations

_ROOT = 6  # entries of a floating base


class PinocchioModel:
    """Pinocchio's model of a URDF without ball joints, fixed or floating, under 9.81 m/s^2."""

    def __init__(self, urdf_text: str, layout: JointLayout) -> None:
        self._layout, self._floating = layout, layout.has_floating_base
        base = (pinocchio.JointModelFreeFlyer(),) if self._floating else ()
        self._model = pinocchio.buildModelFromXML(urdf_text, *base)
        self._data = self._model.createData()
        # our entry of each of Pinocchio's velocities; a floating base is first in both
        self._entries = np.arange(layout.size)
        for joint in layout.joints:
            if joint.name != ROOT:
                found = self._model.joints[self._model.getJointId(joint.name)]
                self._entries[found.idx_v] = joint.start

    def configuration(self, position: FloatArray) -> FloatArray:
        """Pinocchio's configuration of a position (n,) in message form."""
        configuration = pinocchio.neutral(self._model)
        if self._floating:
            configuration[:3], configuration[3:7] = position[:3], rotations.exp(position[3:6])
        for joint in self._layout.joints:
            if joint.name == ROOT:
                continue
            found, angle = (
                self._model.joints[self._model.getJointId(joint.name)],
                position[joint.start],
            )
            if found.nq == 2:  # unbounded: cosine and sine
                configuration[found.idx_q : found.idx_q + 2] = np.cos(angle), np.sin(angle)
            else:
                configuration[found.idx_q] = angle
        return configuration

    def dynamics(
        self, position: FloatArray, velocity: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Mass matrix (n, n), bias force (n,) and its part that is gravity's (n,).

        Pinocchio has a base's velocity along the base's axes, the layout its linear part along the
        world's: `v_own = T v`, and so `M = T' M_own T`, `C = T' (C_own + M_own dT/dt v)`.
        """
        turn, turn_rate = np.eye(self._layout.size), np.zeros((self._layout.size,) * 2)
        if self._floating:
            axes = pinocchio.exp3(position[3:6])
            turn[:3, :3] = axes.T
            turn_rate[:3, :3] = -pinocchio.skew(velocity[3:6]) @ axes.T
        turn, turn_rate = turn[self._entries], turn_rate[self._entries]
        q, v = self.configuration(position), turn @ velocity
        upper = np.triu(pinocchio.crba(self._model, self._data, q))
        mass = upper + np.triu(upper, 1).T
        bias = pinocchio.rnea(self._model, self._data, q, v, np.zeros(len(v)))
        gravity = pinocchio.computeGeneralizedGravity(self._model, self._data, q)
        return (
            turn.T @ mass @ turn,
            turn.T @ (bias + mass @ turn_rate @ velocity),
            turn.T @ gravity,
        )
