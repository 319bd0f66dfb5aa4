"""Sigma points of the UKF: placed from the factor of the covariance, and put together again."""

from typing import NamedTuple

import numpy as np

from auvident.estimation.kalman import unscented_weights
from auvident.jit import borrowing, kernel
from auvident.physics.dynamics import SPEED_LIMIT
from auvident.physics.term_tables import N_INPUTS, N_POSITIONS, N_POWERS, N_STATES

# what a pass reports when it has to stop: (step, record, channel or state, reason)
NOT_POSITIVE, DIVERGED, SINGULAR = 1, 2, 3


class SigmaWork(NamedTuple):
    """The sigma points of one prediction.

    Attributes
    ----------
    scaling : float
        Their distance from the centre, in standard deviations.
    points : (4, 1 + 2 n) array
        States of one record at every point.
    upper : (n, n) array
        Transposed factor of the covariance; its column c makes the points 1 + 2 c and 2 + 2 c.
    lean : (n,) array
        From `lean_to_mean`.
    moved : (n - n_theta, 1 + 2 n) array
        States of every point after the step; differences to the centre after `recombine`.
    shift, pairs : (n,) arrays
        Work arrays.
    """

    scaling: float
    points: np.ndarray
    upper: np.ndarray
    lean: np.ndarray
    moved: np.ndarray
    shift: np.ndarray
    pairs: np.ndarray


def sigma_work(n, n_theta, scaling):
    """Work arrays for n states, n_theta of them parameters."""
    points, upper = np.empty((N_STATES, 1 + 2 * n)), np.zeros((n, n))
    moved = np.zeros((n - n_theta, 1 + 2 * n))
    return SigmaWork(scaling, points, upper, np.empty(n), moved, np.empty(n), np.empty(n))


@kernel
def stop(fault, t, record, where, reason):
    """Note where and why a pass has to stop."""
    fault[0], fault[1], fault[2], fault[3] = t, record, where, reason


@borrowing
def place_component(centre, unit, component, sigma, count, row, rows):
    """One component of the sigma points: the centre, then a pair for each column of the factor.

    Filled are `count` places of rows[row], in `unit` of the component.
    """
    upper, scaling = sigma.upper, sigma.scaling
    rows[row, 0] = centre
    for c in range(component + 1):
        away = unit * (scaling * upper[c, component])
        rows[row, 1 + 2 * c], rows[row, 2 + 2 * c] = centre + away, centre - away
    for s in range(2 * component + 3, count):  # the factor is triangular: the others do not move it
        rows[row, s] = centre


@borrowing
def place_inputs(count, u, slopes, columns, moving, sigma, rows):
    """Inputs that move, at the first `count` sigma points, as the rows of their variables.

    Parameters
    ----------
    u : (15,) array
        At theta = 0.
    slopes : (15, a) array
        du/dtheta, by the columns `columns` (a,).
    moving : (15,) bool array
    rows : (n_rows, >= count) array
    """
    upper, scaling = sigma.upper, sigma.scaling
    for i in range(N_INPUTS):
        if not moving[i]:
            continue
        at = (N_POSITIONS + i) * N_POWERS
        for s in range(count):
            rows[at, s] = u[i]
        for k in range(columns.shape[0]):
            slope = scaling * slopes[i, k]
            for c in range(columns[k] + 1):
                rows[at, 1 + 2 * c] += slope * upper[c, columns[k]]
                rows[at, 2 + 2 * c] -= slope * upper[c, columns[k]]


@borrowing
def lean_to_mean(x, n_theta, n, sigma):
    """How many of each column of the factor lead from the centre of the points to the mean.

    Fills `sigma.lean`, the solution of L lean = (theta, 0), L being the transpose of
    `sigma.upper`.
    """
    upper, lean = sigma.upper, sigma.lean
    for i in range(n):
        left = x[i] if i < n_theta else 0.0
        for c in range(i):
            left -= upper[c, i] * lean[c]
        lean[i] = left / upper[i, i]


@borrowing
def recombine(t, alive, x, P, index, Q, sigma, fault):
    """Mean and covariance of the propagated sigma points `sigma.moved`, in place.

    All from the differences d to the centre, which leave a small shift s of the mean instead of
    large weights of opposite sign::

        s = w sum d,    P = w sum d d' + (w_centre + 2 n w - 2) s s' + Q

    The points lie about theta = 0; from there to the mean it is as far as the differences of a
    pair tell (statistical linearisation).
    """
    q_theta, q_x = Q.theta, Q.x
    n_theta, n_x = q_theta.shape[0], q_x.shape[0]
    n = n_theta + alive * n_x
    _, w_centre, w = unscented_weights(n, sigma.scaling)
    for k in range(alive * n_x):
        count = 1 + 2 * (n_theta + (k // n_x + 1) * n_x)
        x[n_theta + k] = _mean_of(k, count, w, sigma)
        if not abs(x[n_theta + k]) < SPEED_LIMIT:
            stop(fault, t, k // n_x, index[k % n_x], DIVERGED)
            return
        _cross_covariance(k, n_theta, w, P, sigma)
    of_shift, moved, shift = w_centre + 2.0 * n * w - 2.0, sigma.moved, sigma.shift
    for k in range(alive * n_x):
        for i in range(k + 1):
            product = w * _dot(moved, k, i, 1 + 2 * (n_theta + (i // n_x + 1) * n_x))
            product += of_shift * shift[k] * shift[i]
            P[n_theta + k, n_theta + i] = product
            P[n_theta + i, n_theta + k] = product
        P[n_theta + k, n_theta + k] += q_x[k % n_x]
    for l in range(n_theta):  # noqa: E741
        P[l, l] += q_theta[l]


@borrowing
def _mean_of(k, count, w, sigma):
    """Mean of state k of the blocks; its points become differences to the centre."""
    moved, lean = sigma.moved, sigma.lean
    centre, even, odd, onward = moved[k, 0], 0.0, 0.0, 0.0
    for s in range(count):
        moved[k, s] -= centre
    for s in range(1, count, 2):
        even += moved[k, s]
        odd += moved[k, s + 1]
        onward += (moved[k, s] - moved[k, s + 1]) * lean[s // 2]
    sigma.shift[k] = w * (even + odd)
    return centre + sigma.shift[k] + onward / (2.0 * sigma.scaling)


@borrowing
def _cross_covariance(k, n_theta, w, P, sigma):
    """Covariance of state k of the blocks and theta, from the pairs that theta makes."""
    upper, moved, pairs, scaling = sigma.upper, sigma.moved, sigma.pairs, sigma.scaling
    for l in range(n_theta):  # noqa: E741
        pairs[l] = 0.0
    for c in range(n_theta):
        difference = w * scaling * (moved[k, 1 + 2 * c] - moved[k, 2 + 2 * c])
        for l in range(c, n_theta):  # noqa: E741
            pairs[l] += difference * upper[c, l]
    for l in range(n_theta):  # noqa: E741
        P[n_theta + k, l] = pairs[l]
        P[l, n_theta + k] = pairs[l]


@borrowing
def _dot(rows, a, b, n):
    """Scalar product of two rows, n odd, in four partial sums that do not wait for each other."""
    s0 = rows[a, 0] * rows[b, 0]
    s1 = s2 = s3 = 0.0
    last = n - (n - 1) % 4
    for k in range(1, last, 4):
        s0 += rows[a, k] * rows[b, k]
        s1 += rows[a, k + 1] * rows[b, k + 1]
        s2 += rows[a, k + 2] * rows[b, k + 2]
        s3 += rows[a, k + 3] * rows[b, k + 3]
    for k in range(last, n):
        s0 += rows[a, k] * rows[b, k]
    return (s0 + s1) + (s2 + s3)
