"""Linear algebra of the Kalman filters, compiled; it knows no vehicle.

The state is one vector of shared parameters followed by one block of states per record
("parallel processing"): theta (n_theta), x_1 (n_x), ..., x_k (n_x). Parameters do not move under
prediction, so only the rows of the blocks are recomputed.
"""

import math

import numpy as np

from auvident.jit import kernel


@kernel
def predict_covariance(covariance, transition, sensitivity, n_theta, n_x, n_blocks, q_theta, q_x):
    """Covariance after one prediction of every block, in place.

    Parameters
    ----------
    covariance : (n, n) array, n >= n_theta + n_blocks * n_x
    transition : (n_blocks, n_x, n_x) array
        d x_j(next)/d x_j.
    sensitivity : (n_blocks, n_x, n_theta) array
        d x_j(next)/d theta.
    q_theta : (n_theta,) array
        Variance added to each parameter.
    q_x : (n_x,) array
        Variance added to each state of each block.
    """
    n = n_theta + n_blocks * n_x
    rows = np.zeros((n_blocks * n_x, n))  # [sensitivity transition] P, block rows
    for j in range(n_blocks):
        for i in range(n_x):
            row = j * n_x + i
            for l in range(n_theta):  # noqa: E741
                g = sensitivity[j, i, l]
                if g != 0.0:
                    for c in range(n):
                        rows[row, c] += g * covariance[l, c]
            for l in range(n_x):  # noqa: E741
                f = transition[j, i, l]
                for c in range(n):
                    rows[row, c] += f * covariance[n_theta + j * n_x + l, c]
    for row in range(n_blocks * n_x):
        for c in range(n_theta):
            covariance[n_theta + row, c] = rows[row, c]
            covariance[c, n_theta + row] = rows[row, c]
    for row in range(n_blocks * n_x):
        for j in range(row // n_x + 1):
            for i in range(n_x):
                total = 0.0
                for l in range(n_theta):  # noqa: E741
                    total += rows[row, l] * sensitivity[j, i, l]
                for l in range(n_x):  # noqa: E741
                    total += rows[row, n_theta + j * n_x + l] * transition[j, i, l]
                column = n_theta + j * n_x + i
                covariance[n_theta + row, column] = total
                covariance[column, n_theta + row] = total
    for l in range(n_theta):  # noqa: E741
        covariance[l, l] += q_theta[l]
    for row in range(n_blocks * n_x):
        covariance[n_theta + row, n_theta + row] += q_x[row % n_x]


@kernel
def update_scalar(mean, covariance, n, first, gradient, innovation, variance):
    """Update with one scalar measurement in Joseph form, in place.

    Parameters
    ----------
    mean : (>= n,) array
    covariance : (>= n, >= n) array
    n : int
        Length of the state in use.
    first : int
        Index of the first state the measurement depends on.
    gradient : (m,) array
        d z/d state for the states first .. first + m - 1.
    innovation : float
        Measured minus predicted.
    variance : float
        Of the measurement noise.

    Returns
    -------
    float
        Innovation variance; not positive when the covariance is no longer positive definite,
        and then nothing is changed.
    """
    projected = np.zeros(n)  # P h
    for i in range(n):
        for l in range(gradient.shape[0]):  # noqa: E741
            projected[i] += covariance[i, first + l] * gradient[l]
    spread = variance
    for l in range(gradient.shape[0]):  # noqa: E741
        spread += gradient[l] * projected[first + l]
    if not (spread > 0.0 and math.isfinite(spread)):
        return -1.0
    gain = projected / spread
    for i in range(n):
        mean[i] += gain[i] * innovation
        for j in range(n):  # (I - K h') P
            covariance[i, j] -= gain[i] * projected[j]
    for i in range(n):  # ... (I - K h')' + K R K'
        along = 0.0
        for l in range(gradient.shape[0]):  # noqa: E741
            along += covariance[i, first + l] * gradient[l]
        for j in range(n):
            covariance[i, j] += (variance * gain[i] - along) * gain[j]
    for i in range(n):
        for j in range(i):
            even = 0.5 * (covariance[i, j] + covariance[j, i])
            covariance[i, j] = even
            covariance[j, i] = even
    return spread


@kernel
def cholesky(matrix, n, factor):
    """Lower Cholesky factor of the leading n x n block.

    Returns
    -------
    int
        -1, or the index of the first pivot that is not positive.
    """
    for j in range(n):
        pivot = matrix[j, j]
        for l in range(j):  # noqa: E741
            pivot -= factor[j, l] * factor[j, l]
        if not pivot > 0.0:
            return j
        factor[j, j] = math.sqrt(pivot)
        for i in range(j + 1, n):
            total = matrix[i, j]
            for l in range(j):  # noqa: E741
                total -= factor[i, l] * factor[j, l]
            factor[i, j] = total / factor[j, j]
        for i in range(j):
            factor[i, j] = 0.0
    return -1


@kernel
def unscented_weights(n, spread):
    """Weights of the scaled unscented transform with sigma points at `spread` std.

    In Merwe's parameters: alpha = spread / sqrt(n), beta = 2, kappa = 0.

    Returns
    -------
    tuple of float
        Weight of the centre in the mean, in the covariance, and of every other point.
    """
    alpha2 = spread * spread / n
    centre = 1.0 - n / (spread * spread)
    return centre, centre + 1.0 - alpha2 + 2.0, 0.5 / (spread * spread)
