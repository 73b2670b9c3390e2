"""A switch from one motion to another without a jump: the difference is kept, and dies away.

Source: Bollo 2018, "Inertialization: High-Performance Animation Transitions in 'Gears of War'".
There the difference of each rotation decays along one axis; here all three components of its
rotation vector do, so that the velocity is continuous whatever its direction.
"""

import numpy as np

from controller_node.references.base import ReferenceState
from msgs_config.arrays import FloatArray, IntArray
from msgs_config.character.layout import GeneralizedPosition, JointLayout
from msgs_config.geometry import fixed_order, rotations

# Coefficients of 1, u, ... u^5 of three quintics on 0 <= u <= 1 that end at rest at zero, a row
# each: the first one begins at 1, the second with the slope 1, the third with the second slope 1.
_DECAY = np.array(
    [
        [1.0, 0.0, 0.0, -10.0, 15.0, -6.0],
        [0.0, 1.0, 0.0, -6.0, 8.0, -3.0],
        [0.0, 0.0, 0.5, -1.5, 1.5, -0.5],
    ]
)


class InertializationOffset:
    """The difference of two motions at a time, which decays from there on.

    It is added to coordinates, and turns rotations in their child frames: `q exp(d(t))`. With
    R the turn by d and w the angular velocity of d, that moves at `R' v + w` for a v of q.
    """

    def __init__(
        self,
        layout: JointLayout,
        motion: ReferenceState,
        wanted: ReferenceState,
        start: float,
        duration: float,
    ) -> None:
        """Such that the motion, with the offset, begins at `start` as `wanted` moves there.

        Position, velocity and acceleration agree there; after `duration`, which is above zero, the
        offset is gone, and comes to that with no velocity and acceleration. Times in s.
        """
        self._entries = layout.rotation_entries
        self._start, self._duration = start, duration
        apart = layout.difference(motion.configuration, wanted.configuration)
        rate = wanted.velocity - motion.velocity
        second_rate = wanted.acceleration - motion.acceleration
        entries = self._entries
        if len(entries):
            turned = apart[entries]
            velocity, acceleration = _turned_back(turned, motion, entries)
            relative = wanted.velocity[entries] - velocity
            rate[entries], second_rate[entries] = rotations.rotation_vector_rates(
                turned,
                relative,
                wanted.acceleration[entries] - acceleration + fixed_order.cross(relative, velocity),
            )
        self._initial = np.array([apart, duration * rate, duration * duration * second_rate])

    def applied(self, motion: ReferenceState, time: float) -> ReferenceState:
        """The state of the motion at a time in s, not before the start, with the offset."""
        if time >= self._start + self._duration:
            return motion
        added, rate, second_rate = self._at(time)
        position = motion.configuration.position + added
        velocity, acceleration = motion.velocity + rate, motion.acceleration + second_rate
        orientations, entries = motion.configuration.orientations_xyzw, self._entries
        if len(entries):
            turned = added[entries]
            orientations = rotations.multiply(orientations, rotations.exp(turned))
            position[entries] = rotations.log(orientations)
            back, second_back = _turned_back(turned, motion, entries)
            spin, second_spin = rotations.angular_motion(
                turned, rate[entries], second_rate[entries]
            )
            velocity[entries] = back + spin
            acceleration[entries] = second_back + second_spin - fixed_order.cross(spin, back)
        return ReferenceState(GeneralizedPosition(position, orientations), velocity, acceleration)

    def _at(self, time: float) -> FloatArray:
        """The offset, its rate and its second rate, (3, n)."""
        per_second = 1.0 / self._duration
        u = max(time - self._start, 0.0) * per_second
        powers = fixed_order.powers(np.array(u), 6)
        first = np.arange(1.0, 6.0) * powers[:5]
        second = np.arange(2.0, 6.0) * np.arange(1.0, 5.0) * powers[:4]
        shares = np.array(
            [
                fixed_order.apply(_DECAY, powers),
                fixed_order.apply(_DECAY[:, 1:], first) * per_second,
                fixed_order.apply(_DECAY[:, 2:], second) * (per_second * per_second),
            ]
        )
        return fixed_order.product(shares, self._initial)


def _turned_back(
    turned: FloatArray, motion: ReferenceState, entries: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Angular velocities and accelerations (k, 3) of a motion in frames turned by (k, 3)."""
    back = rotations.exp(-turned)
    return (
        rotations.rotate(back, motion.velocity[entries]),
        rotations.rotate(back, motion.acceleration[entries]),
    )
