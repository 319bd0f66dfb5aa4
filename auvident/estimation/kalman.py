"""Linear algebra of the Kalman filters, compiled; it knows no vehicle.

The state is one vector of shared parameters followed by one block of states per record
("parallel processing"): theta (n_theta), x_1 (n_x), ..., x_k (n_x). Parameters do not move under
prediction, so only the rows of the blocks are recomputed.

Every kernel has a form that takes its work arrays, for the loops of a pass, where making them
anew would cost more than the arithmetic. Innermost loops run along rows.
"""

import math

import numpy as np

from auvident.jit import borrowing, kernel

LANES = 4  # numbers in a vector register


@borrowing
def whole_vectors(n, covariance):
    """Length n rounded up to whole vector registers, where the rows of the covariance are longer.

    A loop over a row that ends inside a register goes through the rest number by number; it is
    faster to take along what stands there, which nothing else looks at.
    """
    return min(n + (-n) % LANES, covariance.shape[1])


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
    gradient = np.empty((n_blocks * n_x, n_x + n_theta))
    for j in range(n_blocks):
        for i in range(n_x):
            for c in range(n_x):
                gradient[j * n_x + i, c] = transition[j, i, c]
            for c in range(n_theta):
                gradient[j * n_x + i, n_x + c] = sensitivity[j, i, c]
    n = n_theta + n_blocks * n_x
    rows = np.empty((n_blocks * n_x, n))
    predict_with(covariance, gradient, n_theta, n_x, n_blocks, n, q_theta, q_x, rows)


@borrowing
def predict_with(covariance, gradient, n_theta, n_x, n_blocks, wide, q_theta, q_x, rows):
    """As `predict_covariance`.

    Parameters
    ----------
    gradient : (>= n_blocks * n_x, n_x + n_theta) array
        Transition and sensitivity of each state of each block, side by side.
    wide : int
        Columns of the work array to fill, n or `whole_vectors`.
    rows : (>= n_blocks * n_x, >= wide) array
        Work array: [sensitivity transition] P.
    """
    for j in range(n_blocks):
        for k in range(j * n_x, (j + 1) * n_x):
            _project(k, n_theta + j * n_x, gradient, covariance, n_theta, n_x, wide, rows)
    for j in range(n_blocks):
        for k in range(j * n_x, (j + 1) * n_x):
            for c in range(n_theta):
                covariance[n_theta + k, c] = rows[k, c]
                covariance[c, n_theta + k] = rows[k, c]
            for m in range(j + 1):
                block = n_theta + m * n_x
                for i in range(n_x):
                    total = 0.0
                    for l in range(n_x):  # noqa: E741
                        total += rows[k, block + l] * gradient[m * n_x + i, l]
                    for l in range(n_theta):  # noqa: E741
                        total += rows[k, l] * gradient[m * n_x + i, n_x + l]
                    covariance[n_theta + k, block + i] = total
                    covariance[block + i, n_theta + k] = total
            covariance[n_theta + k, n_theta + k] += q_x[k - j * n_x]
    for l in range(n_theta):  # noqa: E741
        covariance[l, l] += q_theta[l]


@borrowing
def _project(k, block, gradient, covariance, n_theta, n_x, wide, rows):
    """Row k of [sensitivity transition] P."""
    for c in range(wide):
        rows[k, c] = gradient[k, 0] * covariance[block, c]
    for l in range(1, n_x):  # noqa: E741
        slope = gradient[k, l]
        for c in range(wide):
            rows[k, c] += slope * covariance[block + l, c]
    for l in range(0, n_theta - 3, 4):  # noqa: E741 (four at once: a quarter of the stores)
        s0, s1 = gradient[k, n_x + l], gradient[k, n_x + l + 1]
        s2, s3 = gradient[k, n_x + l + 2], gradient[k, n_x + l + 3]
        for c in range(wide):
            rows[k, c] += (
                s0 * covariance[l, c]
                + s1 * covariance[l + 1, c]
                + s2 * covariance[l + 2, c]
                + s3 * covariance[l + 3, c]
            )
    for l in range(n_theta - n_theta % 4, n_theta):  # noqa: E741
        slope = gradient[k, n_x + l]
        for c in range(wide):
            rows[k, c] += slope * covariance[l, c]


@kernel
def update_scalar(mean, covariance, n, first, gradient, innovation, variance):
    """Update with one scalar measurement in Joseph form, in place.

    Parameters
    ----------
    mean : (>= n,) array
    covariance : (>= n, >= n) array
        Symmetric.
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
    projected, gain, half = np.empty(n), np.empty(n), np.empty(n)
    spread = update_with(
        mean,
        covariance,
        n,
        n,
        first,
        gradient,
        np.zeros(0, np.int64),
        np.zeros(0),
        innovation,
        variance,
        projected,
        gain,
        half,
    )
    for i in range(n):
        for j in range(i):
            even = 0.5 * (covariance[i, j] + covariance[j, i])
            covariance[i, j] = even
            covariance[j, i] = even
    return spread


@borrowing
def update_with(
    mean,
    covariance,
    n,
    wide,
    first,
    gradient,
    places,
    slopes,
    innovation,
    variance,
    projected,
    gain,
    half,
):
    """As `update_scalar`, with work arrays (>= wide,): P h, the gain, half the change over it.

    Of the first n rows of the covariance `wide` columns change: n or `whole_vectors`.

    The measurement may also depend on the states `places` (k,) with `slopes` (k,).

    A symmetric covariance stays symmetric to the last bit: it changes by gain half' + half gain'.
    """
    for i in range(wide):
        projected[i] = 0.0
    for l in range(gradient.shape[0]):  # noqa: E741
        slope = gradient[l]
        for i in range(wide):
            projected[i] += slope * covariance[first + l, i]
    for l in range(places.shape[0]):  # noqa: E741
        slope, place = slopes[l], places[l]
        for i in range(wide):
            projected[i] += slope * covariance[place, i]
    seen = 0.0  # h' P h
    for l in range(gradient.shape[0]):  # noqa: E741
        seen += gradient[l] * projected[first + l]
    for l in range(places.shape[0]):  # noqa: E741
        seen += slopes[l] * projected[places[l]]
    spread = seen + variance
    if not (spread > 0.0 and math.isfinite(spread)):
        return -1.0
    for i in range(wide):
        gain[i] = projected[i] / spread
        # Joseph: (I - K h') P (I - K h')' + K R K' = P + K half' + half K', where in
        # half = (K R - (I - K h') P h - P h) / 2 the first two are equal but for rounding
        rest = variance * gain[i] - (projected[i] - gain[i] * seen)
        half[i] = 0.5 * (rest - projected[i])
    for i in range(n):
        mean[i] += gain[i] * innovation
    for i in range(n):
        k_i, half_i = gain[i], half[i]
        for j in range(wide):
            covariance[i, j] += k_i * half[j] + half_i * gain[j]
    return spread


@kernel
def cholesky(matrix, n, factor):
    """Lower Cholesky factor of the leading n x n block.

    Returns
    -------
    int
        -1, or the index of the first pivot that is not positive.
    """
    bad = upper_cholesky(matrix, n, factor)
    for i in range(n):
        for j in range(i):
            factor[i, j] = factor[j, i]
            factor[j, i] = 0.0
    return bad


@borrowing
def upper_cholesky(matrix, n, factor):
    """As `cholesky`, transposed; what is left of the diagonal is not touched."""
    for i in range(n):
        for j in range(i, n):
            factor[i, j] = matrix[i, j]
        for l in range(i):  # noqa: E741
            share = factor[l, i]
            for j in range(i, n):
                factor[i, j] -= share * factor[l, j]
        if not factor[i, i] > 0.0:
            return i
        root = math.sqrt(factor[i, i])
        for j in range(i, n):
            factor[i, j] /= root
    return -1


@borrowing
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
