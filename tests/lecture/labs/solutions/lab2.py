"""Stable PD by numpy's own solver."""

import numpy as np


def stable_pd(
    error: np.ndarray,
    velocity: np.ndarray,
    reference_velocity: np.ndarray,
    mass_matrix: np.ndarray,
    bias: np.ndarray,
    stiffness: np.ndarray,
    damping: np.ndarray,
    period: float,
) -> np.ndarray:
    known = stiffness * (error - period * velocity) + damping * (reference_velocity - velocity)
    acceleration = np.linalg.solve(mass_matrix + period * np.diag(damping), known - bias)
    return known - period * damping * acceleration
