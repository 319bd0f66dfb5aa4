"""Sigma points of the UKF: spread from the factor of the covariance, and put together again."""

from auvident.estimation.kalman import unscented_weights
from auvident.jit import borrowing, kernel
from auvident.physics.dynamics import SPEED_LIMIT
from auvident.physics.term_tables import N_INPUTS, N_POSITIONS, N_POWERS

# what a pass reports when it has to stop: (step, record, channel or state, reason)
NOT_POSITIVE, DIVERGED, SINGULAR = 1, 2, 3


@kernel
def stop(fault, t, record, where, reason):
    """Note where and why a pass has to stop."""
    fault[0], fault[1], fault[2], fault[3] = t, record, where, reason


@borrowing
def spread_row(centre, unit, component, upper, spread, count, row, rows):
    """One component of the sigma points: the centre, then a pair for each column of the factor.

    Filled are `count` places of rows[row], in `unit` of the component. `upper` is the transposed
    factor of the covariance; its column c is spread by `spread` standard deviations.
    """
    rows[row, 0] = centre
    for c in range(component + 1):
        away = unit * (spread * upper[c, component])
        rows[row, 1 + 2 * c], rows[row, 2 + 2 * c] = centre + away, centre - away
    for s in range(2 * component + 3, count):  # the factor is triangular: the others do not move it
        rows[row, s] = centre


@borrowing
def lean_to_mean(mean, n_theta, n, upper, lean):
    """How many of each column of the factor lead from the centre of the points to the mean.

    Solves L lean = (theta, 0), L being the transpose of `upper`.

    Parameters
    ----------
    lean : (>= n,) array, filled
    """
    for i in range(n):
        left = mean[i] if i < n_theta else 0.0
        for c in range(i):
            left -= upper[c, i] * lean[c]
        lean[i] = left / upper[i, i]


@borrowing
def recombine(
    t,
    alive,
    mean,
    covariance,
    n_theta,
    index,
    spread,
    upper,
    lean,
    moved,
    shift,
    pairs,
    q_theta,
    q_x,
    fault,
):
    """Mean and covariance of the propagated sigma points, in place.

    All from the differences d to the centre, which leave a small shift s of the mean instead of
    large weights of opposite sign::

        s = w sum d,    P = w sum d d' + (w_centre + 2 n w - 2) s s'

    The points lie about theta = 0; from there to the mean it is as far as the differences of a
    pair tell (statistical linearisation).

    Parameters
    ----------
    lean : (>= n,) array
        From `lean_to_mean`.
    moved : (alive * n_x, 1 + 2 n) array
        States of every point after the step; differences to the centre when this returns.
    shift, pairs : work arrays (>= n,)
    """
    n_x = index.shape[0]
    n = n_theta + alive * n_x
    _, w_centre, w = unscented_weights(n, spread)
    for k in range(alive * n_x):
        count = 1 + 2 * (n_theta + (k // n_x + 1) * n_x)
        centre, even, odd, onward = moved[k, 0], 0.0, 0.0, 0.0
        for s in range(count):
            moved[k, s] -= centre
        for s in range(1, count, 2):
            even += moved[k, s]
            odd += moved[k, s + 1]
            onward += (moved[k, s] - moved[k, s + 1]) * lean[s // 2]
        shift[k] = w * (even + odd)
        mean[n_theta + k] = centre + shift[k] + onward / (2.0 * spread)
        if not abs(mean[n_theta + k]) < SPEED_LIMIT:
            stop(fault, t, k // n_x, index[k % n_x], DIVERGED)
            return
        for l in range(n_theta):  # noqa: E741
            pairs[l] = 0.0
        for c in range(n_theta):
            difference = w * spread * (moved[k, 1 + 2 * c] - moved[k, 2 + 2 * c])
            for l in range(c, n_theta):  # noqa: E741
                pairs[l] += difference * upper[c, l]
        for l in range(n_theta):  # noqa: E741
            covariance[n_theta + k, l] = pairs[l]
            covariance[l, n_theta + k] = pairs[l]
    of_shift = w_centre + 2.0 * n * w - 2.0
    for k in range(alive * n_x):
        for i in range(k + 1):
            product = w * _dot(moved, k, i, 1 + 2 * (n_theta + (i // n_x + 1) * n_x))
            product += of_shift * shift[k] * shift[i]
            covariance[n_theta + k, n_theta + i] = product
            covariance[n_theta + i, n_theta + k] = product
        covariance[n_theta + k, n_theta + k] += q_x[k % n_x]
    for l in range(n_theta):  # noqa: E741
        covariance[l, l] += q_theta[l]


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


@borrowing
def spread_inputs(j, t, count, u, input_slopes, input_columns, upper, spread, moving, rows):
    """Inputs that move, at the first `count` sigma points, as the rows of their variables."""
    n_columns = input_columns.shape[0]
    for i in range(N_INPUTS):
        if not moving[i]:
            continue
        at = (N_POSITIONS + i) * N_POWERS
        for s in range(count):
            rows[at, s] = u[i]
        for k in range(n_columns):
            slope = spread * input_slopes[j, t, i, k]
            for c in range(input_columns[k] + 1):
                rows[at, 1 + 2 * c] += slope * upper[c, input_columns[k]]
                rows[at, 2 + 2 * c] -= slope * upper[c, input_columns[k]]
