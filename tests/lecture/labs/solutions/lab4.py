"""SIMBICON: the machine, the foot's place, and the stance hip's torque."""

import numpy as np


def stance_leg(state: float) -> int:
    return 1 if state < 2 else 0


def next_state(state: float, time: float, lift_time: float, swing_load: float) -> int:
    if state in (0, 2):
        return int(state) + (time >= lift_time)
    return (int(state) + (swing_load > 50.0)) % 4


def foot_placement(angle: float, c_d: float, c_v: float, distance: float, velocity: float) -> float:
    return angle + c_d * distance + c_v * velocity


def torso_torque(
    error: np.ndarray, angular_velocity: np.ndarray, stiffness: float, damping: float
) -> np.ndarray:
    return stiffness * error - damping * angular_velocity


def stance_hip_torque(torso: np.ndarray, swing: np.ndarray) -> np.ndarray:
    return -torso - swing
