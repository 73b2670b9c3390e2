"""The cost of states against the motion: rows of features in, one number a row out.

The terms are those of Liu et al. 2010, "Sampling-based Contact-rich Motion Control", section 4.2,
and ours: of the centre of mass's place and velocity, without which the motion drifts, and of the
angular momentum, which a jump keeps until it lands.
"""

from dataclasses import dataclass

import numpy as np

from experiment.samcon.settings import Bounds, Weights
from msgs_config.arrays import FloatArray
from msgs_config.joint_layout import JointLayout, JointType

_ANGULAR_VELOCITY = 0.1  # s, of the root's; as Liu et al. 2010 weigh it against its orientation
_AHEAD = 0.3  # s, about how long a walker needs to bring a foot elsewhere
_FALLEN = 0.5  # of the motion's root height, as a run's figures have it
_STANDS = 0.5  # m of root height; below a motion lies of its own will


@dataclass(frozen=True)
class Terms:
    """The differences of states from the motion, (s,) each."""

    pose: FloatArray  # rad, mean of the joints
    root: FloatArray  # rad, and 0.1 of rad/s
    end_effectors: FloatArray  # m, mean of their heights
    balance: FloatArray  # heights of the character
    centre: FloatArray  # m
    ahead: FloatArray  # m, of the centre of mass a moment later, if it went on as it moves
    momentum: FloatArray  # kg m^2/s, of the angular momentum about the centre of mass
    lost: FloatArray  # 1 where a bound is crossed, else 0

    def cost(self, weights: Weights) -> FloatArray:
        """The cost (s,), infinite of what is lost."""
        total = (
            weights.pose * self.pose
            + weights.root * self.root
            + weights.end_effectors * self.end_effectors
            + weights.balance * self.balance
            + weights.centre * self.centre
            + weights.ahead * self.ahead
            + weights.momentum * self.momentum
        )
        return np.where(self.lost == 0.0, total, np.inf)


def terms(
    layout: JointLayout, height: float, states: FloatArray, desired: FloatArray, bounds: Bounds
) -> Terms:
    """The terms of states (s, f) against one desired state (f,), rows of `Features`.

    `height` is the character's in m; what is not finite is lost.
    """
    size = layout.size
    difference = layout.difference(
        layout.configuration(desired[:size]), layout.configuration(states[:, :size])
    )
    turned = layout.norms(difference)
    owners = [joint.type for joint in layout.joints for _ in joint.vectors]
    joints = np.array([owner is not JointType.FLOATING for owner in owners])
    velocities = states[:, size : 2 * size] - desired[size : 2 * size]
    centre, centre_velocity, points = _parts(size, states)
    right_centre, right_velocity, right_points = _parts(size, desired[np.newaxis])
    arms = centre[:, np.newaxis, :2] - points[..., :2]
    right_arms = right_centre[:, np.newaxis, :2] - right_points[..., :2]
    off = np.linalg.norm(centre - right_centre, axis=1)
    momenta = states[:, 2 * size + 6 : 2 * size + 9] - desired[2 * size + 6 : 2 * size + 9]
    spin = np.zeros(len(states))
    tilt = np.zeros(len(states))
    fallen = np.zeros(len(states), dtype=np.bool_)
    if layout.has_floating_base:
        tilt, spin = turned[:, 1], np.linalg.norm(velocities[:, 3:6], axis=1)
        fallen = (states[:, 2] < _FALLEN * desired[2]) & (desired[2] > _STANDS)
    sound = np.isfinite(states).all(axis=1) & (off <= bounds.centre) & (tilt <= bounds.root)
    return Terms(
        pose=turned[:, joints].mean(axis=1),
        root=tilt + _ANGULAR_VELOCITY * spin,
        end_effectors=np.abs(points[..., 2] - right_points[..., 2]).mean(axis=1),
        balance=np.linalg.norm(arms - right_arms, axis=2).mean(axis=1) / height,
        centre=off,
        ahead=np.linalg.norm(
            centre - right_centre + _AHEAD * (centre_velocity - right_velocity), axis=1
        ),
        momentum=np.linalg.norm(momenta, axis=1),
        lost=np.where(sound & ~fallen, 0.0, 1.0),
    )


def _parts(size: int, rows: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centre of mass (s, 3), its velocity (s, 3), and the end effectors (s, e, 3)."""
    start = 2 * size
    points = rows[:, start + 9 :].reshape(len(rows), -1, 3)
    return rows[:, start : start + 3], rows[:, start + 3 : start + 6], points
