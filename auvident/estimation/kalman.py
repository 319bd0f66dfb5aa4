"""Linear algebra of the Kalman filters, compiled; it knows no vehicle.

The state is one vector of shared parameters followed by one block of states per record
("parallel processing"): x = [theta, x_1, ..., x_k]. With F the derivative of a step and H that of
a reading::

    predict   P = F P F' + Q
    update    S = H P H' + R,    K = P H' / S,    x = x + K (z - H x),
              P = (I - K H) P (I - K H)' + K R K'            (Joseph form)

Theta walks at random: its rows of F are those of the identity, hence only the rows of the blocks
are recomputed. Readings are scalars, taken one after the other, as their noises are independent.

The kernels take their work arrays, as making them anew would cost more than the arithmetic.
Innermost loops run along rows.
"""

import math
from typing import NamedTuple

import numpy as np

from auvident.jit import borrowing

LANES = 4  # numbers in a vector register


class ProcessNoise(NamedTuple):
    """Diagonal of Q: variance that a step adds.

    Attributes
    ----------
    theta : (n_theta,) array
        To each parameter: its random walk.
    x : (n_x,) array
        To each state of each block.
    """

    theta: np.ndarray
    x: np.ndarray


class ReadingRow(NamedTuple):
    """Row H of one reading, without its zeros.

    Attributes
    ----------
    first : int
        Index of the first state of the block that is read.
    by_block : (m,) array
        Derivatives by the states first .. first + m - 1.
    columns : (k,) int array
        Other states that the reading depends on.
    by_columns : (k,) array
        Derivatives by these.
    """

    first: int
    by_block: np.ndarray
    columns: np.ndarray
    by_columns: np.ndarray


class GainWork(NamedTuple):
    """Work arrays (>= n,) of an update: P H', the gain K, half the change of P over K."""

    PHt: np.ndarray
    K: np.ndarray
    half: np.ndarray


@borrowing
def whole_vectors(n, P):
    """Length n rounded up to whole vector registers, where the rows of P are longer.

    A loop over a row that ends inside a register goes through the rest number by number; it is
    faster to take along what stands there, which nothing else looks at.
    """
    return min(n + (-n) % LANES, P.shape[1])


@borrowing
def predict(P, F, Q, n_blocks, wide, FP):
    """Covariance after one step of the first blocks, in place.

    Parameters
    ----------
    P : (>= n, >= n) array
        Symmetric; n = n_theta + n_blocks * n_x.
    F : (>= n_blocks * n_x, n_x + n_theta) array
        For each state of each block the derivatives of its next value by its own block and by
        theta; the others are zero.
    Q : ProcessNoise
    n_blocks : int
    wide : int
        Columns of the work array to fill, n or `whole_vectors`.
    FP : (>= n_blocks * n_x, >= wide) array
        Work array.
    """
    q_theta, q_x = Q.theta, Q.x
    n_theta, n_x = q_theta.shape[0], q_x.shape[0]
    for j in range(n_blocks):
        for k in range(j * n_x, (j + 1) * n_x):
            _multiply_row(k, n_theta + j * n_x, F, P, n_theta, n_x, wide, FP)
    for j in range(n_blocks):
        for k in range(j * n_x, (j + 1) * n_x):
            for c in range(n_theta):
                P[n_theta + k, c] = FP[k, c]
                P[c, n_theta + k] = FP[k, c]
            for m in range(j + 1):
                block = n_theta + m * n_x
                for i in range(n_x):
                    total = 0.0
                    for l in range(n_x):  # noqa: E741
                        total += FP[k, block + l] * F[m * n_x + i, l]
                    for l in range(n_theta):  # noqa: E741
                        total += FP[k, l] * F[m * n_x + i, n_x + l]
                    P[n_theta + k, block + i] = total
                    P[block + i, n_theta + k] = total
            P[n_theta + k, n_theta + k] += q_x[k - j * n_x]
    for l in range(n_theta):  # noqa: E741
        P[l, l] += q_theta[l]


@borrowing
def _multiply_row(k, block, F, P, n_theta, n_x, wide, FP):
    """Row k of F P."""
    for c in range(wide):
        FP[k, c] = F[k, 0] * P[block, c]
    for l in range(1, n_x):  # noqa: E741
        slope = F[k, l]
        for c in range(wide):
            FP[k, c] += slope * P[block + l, c]
    for l in range(0, n_theta - 3, 4):  # noqa: E741 (four at once: a quarter of the stores)
        s0, s1, s2, s3 = F[k, n_x + l], F[k, n_x + l + 1], F[k, n_x + l + 2], F[k, n_x + l + 3]
        for c in range(wide):
            FP[k, c] += s0 * P[l, c] + s1 * P[l + 1, c] + s2 * P[l + 2, c] + s3 * P[l + 3, c]
    for l in range(n_theta - n_theta % 4, n_theta):  # noqa: E741
        slope = F[k, n_x + l]
        for c in range(wide):
            FP[k, c] += slope * P[l, c]


@borrowing
def update(x, P, n, wide, H, innovation, R, work):
    """Mean and covariance with one scalar reading, in Joseph form and in place.

    Parameters
    ----------
    x : (>= n,) array
    P : (>= n, >= wide) array
        Symmetric, and stays so to the last bit: it changes by K half' + half K'.
    n : int
        Length of the state in use.
    wide : int
        Columns of P to change, n or `whole_vectors`.
    H : ReadingRow
    innovation : float
        z - H x.
    R : float
        Variance of the reading.
    work : GainWork

    Returns
    -------
    float
        Innovation covariance S; negative when P is no longer positive definite, and then nothing
        is changed.
    """
    PHt, K, half = work
    HPHt = _project(P, wide, H, PHt)
    S = HPHt + R
    if not (S > 0.0 and math.isfinite(S)):
        return -1.0
    for i in range(wide):
        K[i] = PHt[i] / S
        # P + K half' + half K' is the Joseph form with
        # half = (K R - (I - K H) P H' - P H') / 2, where the first two are equal but for rounding
        rest = R * K[i] - (PHt[i] - K[i] * HPHt)
        half[i] = 0.5 * (rest - PHt[i])
    for i in range(n):
        x[i] += K[i] * innovation
    for i in range(n):
        k_i, half_i = K[i], half[i]
        for j in range(wide):
            P[i, j] += k_i * half[j] + half_i * K[j]
    return S


@borrowing
def _project(P, wide, H, PHt):
    """Fill P H'; returns H P H'."""
    first, by_block, columns, by_columns = H
    for i in range(wide):
        PHt[i] = 0.0
    for l in range(by_block.shape[0]):  # noqa: E741
        slope = by_block[l]
        for i in range(wide):
            PHt[i] += slope * P[first + l, i]
    for l in range(columns.shape[0]):  # noqa: E741
        slope, column = by_columns[l], columns[l]
        for i in range(wide):
            PHt[i] += slope * P[column, i]
    HPHt = 0.0
    for l in range(by_block.shape[0]):  # noqa: E741
        HPHt += by_block[l] * PHt[first + l]
    for l in range(columns.shape[0]):  # noqa: E741
        HPHt += by_columns[l] * PHt[columns[l]]
    return HPHt


@borrowing
def upper_cholesky(P, n, factor):
    """Upper factor U of the leading n x n block, P = U' U; below its diagonal nothing is touched.

    Returns
    -------
    int
        -1, or the index of the first pivot that is not positive.
    """
    for i in range(n):
        for j in range(i, n):
            factor[i, j] = P[i, j]
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
def unscented_weights(n, scaling):
    """Weights of the scaled unscented transform with sigma points at `scaling` std.

    In Merwe's parameters: alpha = scaling / sqrt(n), beta = 2, kappa = 0.

    Returns
    -------
    tuple of float
        Weight of the centre in the mean, in the covariance, and of every other point.
    """
    alpha2 = scaling * scaling / n
    centre = 1.0 - n / (scaling * scaling)
    return centre, centre + 1.0 - alpha2 + 2.0, 0.5 / (scaling * scaling)
