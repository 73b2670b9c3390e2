"""SAMCON: samples, cost, survivors, and the path back."""

import numpy as np


def draw(reference: np.ndarray, numbers: np.ndarray, spread: float) -> np.ndarray:
    return reference + spread * (2.0 * numbers - 1.0)


def cost(
    joints: np.ndarray, foot: np.ndarray, centre: np.ndarray, centre_velocity: np.ndarray
) -> np.ndarray:
    trunk = foot[:, 2] + joints.sum(axis=1)
    balance = 10.0 * (centre**2).sum(axis=1) + (centre_velocity**2).sum(axis=1)
    return (joints**2).sum(axis=1) + 3.0 * (foot**2).sum(axis=1) + 3.0 * trunk**2 + balance


def survivors(costs: np.ndarray, count: float) -> np.ndarray:
    good = int(0.4 * len(costs))
    ranks = np.arange(int(count)) * good // int(count)
    return np.argsort(costs, kind="stable")[ranks]


def path(parents: np.ndarray, costs: np.ndarray) -> np.ndarray:
    samples = [int(np.argmin(costs))]
    for row in parents[:0:-1]:
        samples.append(int(row[samples[-1]]))
    return np.array(samples[::-1])
