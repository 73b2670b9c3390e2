"""How a character that was hit gives way: soft near the struck link, its gains by inertia."""

import numpy as np

from controller_node.control_laws import GainArrays, scale_limits
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.geometry import fixed_order

_REACH = 3.0  # joints, from the struck link to those that are as firm as before


class ComplianceProfile:
    """The gains of a character while it gives way."""

    def __init__(self, character: Character, mass_diagonal: FloatArray) -> None:
        """`mass_diagonal` (n,) is that of the mass matrix in the pose in which it was struck.

        For a joint that is the inertia about its axes of all that it moves.
        """
        layout = character.layout
        types = JointType.REVOLUTE, JointType.SPHERICAL
        turning = [joint for joint in layout.joints if joint.type in types]
        self._turning = layout.mask(joint.name for joint in turning)
        # one inertia a joint, so that a ball joint stays as firm in all directions
        self._inertias = np.ones(layout.size)
        for joint in turning:
            self._inertias[joint.entries] = float(fixed_order.mean(mass_diagonal[joint.entries]))
        self._heads = np.array([joint.start for joint in turning], dtype=np.intp)
        self._layout = layout

    def gains(
        self, gains: GainArrays, strengths: FloatArray, root_force: float, root_torque: float
    ) -> GainArrays:
        """Gains by inertia, times strengths (b,), with bounds of the root's force and torque.

        Stiffness and damping of the joints that turn are proportional to the inertia that they
        move, and so they all swing alike; their mean over the joints stays what it was. Those that
        have none get none, and do not count in the mean. The strengths come afterwards.

        Source: Zordan and Hodgins 2002, "Motion capture-driven simulations that hit and react".
        """
        entries = np.repeat(strengths, self._layout.vector_lengths)
        limits = scale_limits(gains.effort_limits, strengths)
        if self._layout.has_floating_base:
            limits[:2] = np.minimum(limits[:2], (root_force, root_torque))
        return GainArrays(
            entries * self._by_inertia(gains.stiffness),
            entries * self._by_inertia(gains.damping),
            entries * gains.integral,
            limits,
        )

    def _by_inertia(self, gains: FloatArray) -> FloatArray:
        heads = self._heads[gains[self._heads] > 0.0]
        if not len(heads):
            return gains
        shares = self._inertias / fixed_order.mean(self._inertias[heads])
        by_inertia = shares * fixed_order.mean(gains[heads])
        return np.where(self._turning & (gains > 0.0), by_inertia, gains)


def softened(character: Character, struck: int, softness: float) -> FloatArray:
    """Strengths (b,): `softness` of the joints at a link, rising to 1 a few joints away.

    `struck` is an index of `Character.links`. The root's are 1.
    """
    distances = _distances(character, struck)
    strengths: list[float] = []
    for link, distance in zip(character.links, distances.tolist(), strict=True):
        if link.joint.type is JointType.FLOATING:
            strengths += [1.0, 1.0]
        elif link.joint.type is not JointType.FIXED:
            near = min(distance, float(distances[max(link.parent, 0)]))
            strengths.append(softness + (1.0 - softness) * min(near / _REACH, 1.0))
    return np.array(strengths)


def _distances(character: Character, struck: int) -> FloatArray:
    """How many moving joints lie between a link and each of the links, (links,)."""
    distances = np.full(len(character.links), np.inf)
    distances[struck] = 0.0
    steps = [float(link.joint.type is not JointType.FIXED) for link in character.links]
    child = struck
    while (parent := character.links[child].parent) >= 0:  # up to the base
        distances[parent] = distances[child] + steps[child]
        child = parent
    for number, link in enumerate(character.links):  # and down again; parents come first
        if link.parent >= 0:
            distances[number] = min(distances[number], distances[link.parent] + steps[number])
    return distances
