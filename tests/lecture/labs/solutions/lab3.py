"""The virtual force, its moment, and the Jacobians' transposes."""

import numpy as np


def virtual_force(offset: np.ndarray, velocity: np.ndarray, weight: float) -> np.ndarray:
    force = 1000.0 * offset - 600.0 * velocity
    force[2] = weight - 600.0 * velocity[2]
    return force


def moment(arm: np.ndarray, force: np.ndarray) -> np.ndarray:
    return np.cross(arm, force)


def joint_efforts(bias: np.ndarray, wrenches: np.ndarray, jacobians: np.ndarray) -> np.ndarray:
    return bias - jacobians[0].T @ wrenches[0] - jacobians[1].T @ wrenches[1]
