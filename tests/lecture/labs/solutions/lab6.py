"""Model predictive path integral control of a pendulum."""

import numpy as np


def propose(plan: np.ndarray, noise: np.ndarray, sigma: float) -> np.ndarray:
    return np.clip(plan + sigma * noise, -1.0, 1.0)


def cost(angles: np.ndarray, velocities: np.ndarray, torques: np.ndarray) -> np.ndarray:
    lack = 1.0 + np.cos(angles)
    return (4.0 * lack + 0.1 * velocities**2 * (lack < 0.3) + 0.01 * torques**2).mean(axis=1)


def combine(plans: np.ndarray, costs: np.ndarray, temperature: float) -> np.ndarray:
    weights = np.exp(-(costs - costs.min()) / temperature)
    return weights @ plans / weights.sum()


def shift(plan: np.ndarray) -> np.ndarray:
    return np.append(plan[1:], plan[-1])
