"""The step of all frames together, against the same system written out."""

import numpy as np
import pytest

from character_motion.retargeting.optimisation.smooth_least_squares import solve_smooth


@pytest.mark.parametrize("frames", [3, 4, 7, 12])
def test_a_step_solves_the_system_that_is_written_out(frames: int) -> None:
    rng, size = np.random.default_rng(frames), 3
    roots = rng.normal(size=(frames, size, size))
    blocks = roots @ roots.swapaxes(-1, -2) + 0.1 * np.eye(size)
    gradients, weights = rng.normal(size=(frames, size)), rng.uniform(0.1, 5.0, size)
    accelerations = rng.normal(size=(frames - 2, size))

    step = solve_smooth(blocks, gradients, weights, accelerations)

    second = np.zeros((size * (frames - 2), size * frames))
    for row in range(frames - 2):
        for offset, value in enumerate((1.0, -2.0, 1.0)):
            rows = slice(size * row, size * (row + 1))
            columns = slice(size * (row + offset), size * (row + offset + 1))
            second[rows, columns] = value * np.eye(size)
    weight = np.tile(weights, frames - 2)
    matrix = second.T @ (weight[:, np.newaxis] * second)
    for row in range(frames):
        part = slice(size * row, size * (row + 1))
        matrix[part, part] += blocks[row]
    right = gradients.ravel() - second.T @ (weight * accelerations.ravel())
    np.testing.assert_allclose(step.ravel(), np.linalg.solve(matrix, right), atol=1e-9)


def test_two_frames_have_no_acceleration() -> None:
    blocks, gradients = np.tile(2.0 * np.eye(2), (2, 1, 1)), np.array([[1.0, 2.0], [3.0, 4.0]])

    step = solve_smooth(blocks, gradients, np.ones(2), np.zeros((0, 2)))

    np.testing.assert_allclose(step, 0.5 * gradients)
