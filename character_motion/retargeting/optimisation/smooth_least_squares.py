"""One step of Gauss-Newton for a whole motion: each frame has a system, accelerations join them."""

import numpy as np

from msgs_config.arrays import FloatArray


def solve_smooth(
    blocks: FloatArray, gradients: FloatArray, weights: FloatArray, accelerations: FloatArray
) -> FloatArray:
    """The steps (f, n) that minimise `sum_t d_t' B_t d_t / 2 - g_t' d_t + |W (a_t + D d)_t|^2 / 2`.

    `(D d)_t = d_(t-1) - 2 d_t + d_(t+1)` for all frames but the first and the last. The system is
    block pentadiagonal; in pairs of frames it is block tridiagonal, and is factored from the first
    pair to the last (Golub and Van Loan 2013, "Matrix Computations", section 4.5).

    Args:
        blocks: B (f, n, n), symmetric and positive definite.
        gradients: g (f, n).
        weights: The squares (n,) of W.
        accelerations: a (f - 2, n), second differences.
    """
    frames, size = gradients.shape
    rows = np.arange(frames - 2)
    bands = np.zeros((3, frames + 1))  # the diagonal of D' D, and those one and two beside it
    for offset, value in ((0, 1.0), (1, 4.0), (2, 1.0)):
        bands[0, rows + offset] += value
    for offset, value in ((0, -2.0), (1, -2.0)):
        bands[1, rows + offset] += value
    bands[2, rows] += 1.0
    gradients = gradients.copy()
    gradients[:-2] -= weights * accelerations
    gradients[1:-1] += 2.0 * weights * accelerations
    gradients[2:] -= weights * accelerations
    if frames % 2:
        blocks = np.concatenate((blocks, np.eye(size)[np.newaxis]))
        gradients = np.concatenate((gradients, np.zeros((1, size))))
    return _solve_pairs(blocks, gradients, weights, bands)[:frames]


def _solve_pairs(
    blocks: FloatArray, gradients: FloatArray, weights: FloatArray, bands: FloatArray
) -> FloatArray:
    pairs, size = len(blocks) // 2, gradients.shape[1]
    whole = np.zeros((pairs, 2 * size, 2 * size))
    first, second = slice(0, size), slice(size, 2 * size)
    diagonal = np.arange(size)
    whole[:, first, first], whole[:, second, second] = blocks[::2], blocks[1::2]
    even, odd = np.arange(0, 2 * pairs, 2), np.arange(1, 2 * pairs, 2)
    band = np.pad(bands, ((0, 0), (0, 2)))
    whole[:, diagonal, diagonal] += band[0, even, None] * weights
    whole[:, size + diagonal, size + diagonal] += band[0, odd, None] * weights
    whole[:, diagonal, size + diagonal] += band[1, even, None] * weights
    whole[:, size + diagonal, diagonal] += band[1, even, None] * weights
    beside = np.zeros((pairs, 2 * size, 2 * size))  # blocks that join a pair to the next one
    beside[:, diagonal, diagonal] = band[2, even, None] * weights
    beside[:, size + diagonal, diagonal] = band[1, odd, None] * weights
    beside[:, size + diagonal, size + diagonal] = band[2, odd, None] * weights
    right = gradients.reshape(pairs, 2 * size)
    onward = np.empty((pairs, 2 * size, 2 * size + 1))
    matrix, vector = whole[0], right[0]
    for pair in range(pairs):
        if pair:
            matrix = whole[pair] - beside[pair - 1].T @ onward[pair - 1, :, :-1]
            vector = right[pair] - beside[pair - 1].T @ onward[pair - 1, :, -1]
        columns = np.concatenate((beside[pair], vector[:, np.newaxis]), axis=1)
        onward[pair] = np.linalg.solve(matrix, columns)
    steps = np.empty((pairs, 2 * size))
    steps[-1] = onward[-1, :, -1]
    for pair in range(pairs - 2, -1, -1):
        steps[pair] = onward[pair, :, -1] - onward[pair, :, :-1] @ steps[pair + 1]
    return steps.reshape(2 * pairs, size)
