"""The gains of a character that was hit: soft near the struck link, and by inertia."""

from dataclasses import replace
from math import sqrt

import numpy as np

from controller_node.behaviours.asked import Ask
from controller_node.behaviours.base import Observation
from controller_node.behaviours.settings import ReactionSettings
from controller_node.control_laws import GainArrays, scale_gains, scale_limits
from msgs_config.arrays import FloatArray
from msgs_config.character.layout import JointType
from msgs_config.character.model import Character
from msgs_config.geometry import fixed_order

_FIRM_AGAIN = 0.2  # s, after which the joints are as firm as before a hit
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


class ReactionGains:
    """The gains in each phase of a reaction; `elapsed` is the time in s since the phase began."""

    def __init__(
        self, character: Character, settings: ReactionSettings, weight: float, plans: bool
    ) -> None:
        """`weight` is the character's, N; with `plans` a planner counts on the gains in force."""
        self._character, self._settings = character, settings
        self._root_force = settings.assistance * weight
        self._plans = plans
        layout = character.layout
        self._driven = layout.mask(layout.actuated_joint_names)

    def give_way(self, struck: int, mass_diagonal: FloatArray) -> None:
        """Be soft near a struck link, an index of `Character.links`, in the present pose."""
        self._profile = ComplianceProfile(self._character, mass_diagonal)
        self._softness = softened(self._character, struck, self._settings.softness)

    def firm(self, seen: Observation, elapsed: float) -> GainArrays:
        """The gains in force, braced if asked; an active ragdoll's root torque is bounded."""
        gains = self._braced(seen.gains) if seen.asked.ask is Ask.BRACE else seen.gains
        if self._settings.searches:
            return gains
        limits = gains.effort_limits.copy()
        limits[1] = min(limits[1], self._settings.upright_torque)
        return replace(gains, effort_limits=limits)

    def _braced(self, gains: GainArrays) -> GainArrays:
        """Stiffer joints with the same damping ratio; the root's gains and all limits stay."""
        times = self._settings.brace_stiffness
        return replace(
            gains,
            stiffness=np.where(self._driven, times, 1.0) * gains.stiffness,
            damping=np.where(self._driven, sqrt(times), 1.0) * gains.damping,
        )

    def soft(self, seen: Observation, elapsed: float) -> GainArrays:
        """Soft near the struck link, with a bounded force on the root."""
        force = self._root_force
        arm = float(seen.now.configuration.position[2])  # lever of the root's force about the feet
        strengths = self._softness * seen.strengths
        return self._profile.gains(seen.whole_gains, strengths, force, force * abs(arm))

    def firmer(self, seen: Observation, elapsed: float) -> GainArrays:
        """From the soft gains to those in force; the root's limits are lifted at once."""
        share = min(elapsed / _FIRM_AGAIN, 1.0)
        firm = self.firm(seen, elapsed)
        if share >= 1.0:
            return firm
        soft = self.soft(seen, elapsed)
        return replace(
            firm,
            stiffness=soft.stiffness + share * (firm.stiffness - soft.stiffness),
            damping=soft.damping + share * (firm.damping - soft.damping),
        )

    def limp(self, seen: Observation, elapsed: float) -> GainArrays:
        """No gains, and effort limits of zero."""
        return self._weak(seen, 0.0)

    def rising(self, seen: Observation, elapsed: float) -> GainArrays:
        """Rising from none to those in force, unless a planner counts on them."""
        if self._plans:
            return self.firm(seen, elapsed)
        return self._weak(seen, min(elapsed / self._settings.recovery_duration, 1.0))

    def _weak(self, seen: Observation, strength: float) -> GainArrays:
        layout = self._character.layout
        strengths = np.full(len(layout.vector_starts), strength)
        return scale_gains(layout, self.firm(seen, 0.0), strengths)


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
    for number, link in enumerate(character.links):  # down to all links; parents come first
        if link.parent >= 0:
            distances[number] = min(distances[number], distances[link.parent] + steps[number])
    return distances
