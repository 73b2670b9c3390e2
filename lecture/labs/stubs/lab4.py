"""Lab 4: a walk by SIMBICON (slide 69; Yin, Loken and van de Panne 2007).

A humanoid walks by a state machine of poses. In state 0 the right foot is lifted, for a time; in
state 1 it is put down, until it bears a load. States 2 and 3 are the same with the left foot. Poses
alone fall: the swing foot must go where it catches the body, and the torso must stay upright. We
have the poses, stable PD of the joints, and a rail that keeps the pelvis from falling sideways.

Axes of the world: x forward, y to the left, z up. Fill in the functions. Then:
actuated_characters grade lab4 THIS_FILE
"""

import numpy as np


def stance_leg(state: float) -> int:
    """Which leg stands in a state, 0 to 3: the right one (0) or the left one (1)."""
    return 0


def next_state(state: float, time: float, lift_time: float, swing_load: float) -> int:
    """The state, 0 to 3, that follows: the same one, or the next.

    time: s since the state began
    lift_time: s, how long a foot is lifted
    swing_load: N, by which the swing foot presses on the ground; 50 N mean that it has landed
    """
    return int(state)


def foot_placement(angle: float, c_d: float, c_v: float, distance: float, velocity: float) -> float:
    """The angle of the swing thigh against the vertical, rad, forwards.

    angle: that of the pose, rad
    c_d, c_v: gains, 1/m and s/m
    distance: m, of the centre of mass in front of the stance foot
    velocity: m/s, of the centre of mass, forwards
    """
    return angle


def torso_torque(
    error: np.ndarray, angular_velocity: np.ndarray, stiffness: float, damping: float
) -> np.ndarray:
    """The torque (3,), N m, that shall act on the pelvis: PD in the world.

    error: (3,) rotation vector, rad, from how the pelvis is to how it shall be
    angular_velocity: (3,), rad/s
    """
    return np.zeros(3)


def stance_hip_torque(torso: np.ndarray, swing: np.ndarray) -> np.ndarray:
    """The torque (3,), N m, of the stance hip on its thigh.

    torso: (3,), N m, that shall act on the pelvis in all
    swing: (3,), N m, of the swing hip on its thigh

    A joint torque on the thigh acts on the pelvis with the opposite sign.
    """
    return np.zeros(3)
