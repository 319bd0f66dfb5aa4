"""The pass of an extended Kalman filter over one record, with forces that walk at random."""

import numpy as np

from auvident.estimation.kalman import update_scalar
from auvident.jit import kernel
from auvident.physics.actuation import FORCE
from auvident.physics.dynamics import N_STATES, step_with_sensitivities
from auvident.physics.term_tables import N_INPUTS

N_MOTION = 3  # u, a, b: what is followed of the state
N_FORCES = 3  # on them
N_ALL = N_MOTION + N_FORCES


@kernel
def forced_step(x, inputs, given, dt, p, inverse, active, terms, weights, mass, mass_weights, out):
    """Derivative (6, 6) of a step of motion and forces, whose outcome is written to `out`.

    Parameters
    ----------
    x : (6,) array
        u, a, b, then the forces on them [N, N, N m], which stay.
    inputs : (9,) array
        At the start of the step; its forces are replaced by those of x.
    given : (2, 4) array
        States at both ends of the step; only their angle counts.
    dt : float
        [s]
    p, inverse, active, terms, weights, mass, mass_weights
        As `step_with_sensitivities` takes them.
    out : (6,) array, filled
    """
    start, acting, after = given[0].copy(), inputs.copy(), np.empty(N_STATES)
    start[:N_MOTION] = x[:N_MOTION]
    acting[FORCE : FORCE + N_FORCES] = x[N_MOTION:]
    slopes, by_force = np.eye(N_STATES, N_STATES + N_FORCES), np.zeros((N_INPUTS, N_FORCES))
    for i in range(N_FORCES):
        by_force[FORCE + i, i] = 1.0
    step_with_sensitivities(
        start, acting, given[0], given[1], dt, p, inverse, active, terms, weights, mass,
        mass_weights, np.full(p.shape[0], -1), by_force, np.arange(N_FORCES), slopes, after,
    )  # fmt: skip
    derivative = np.eye(N_ALL)
    derivative[:N_MOTION, :N_MOTION] = slopes[:N_MOTION, :N_MOTION]
    derivative[:N_MOTION, N_MOTION:] = slopes[:N_MOTION, N_STATES:]
    out[:] = x
    out[:N_MOTION] = after[:N_MOTION]
    return derivative


@kernel
def forced_pass(
    start, spread, inputs, given, read, sensor, variance, growth, limit, dt, p, inverse, active,
    terms, weights, mass, mass_weights,
):  # fmt: skip
    """What `estimation.smoother.smooth` takes, and whether the motion could be followed.

    Parameters
    ----------
    start : (6,) array
        Mean of motion and forces at the first row.
    spread : (6, 6) array
        Its covariance.
    inputs : (n, 9) array
    given : (n, 4) array
        States of a prediction; only their angle counts.
    read : (n, 3) array
        Readings; NaN where there is none.
    sensor : (3, 3) array
        Readings by motion.
    variance : (3,) array
        Of the readings.
    growth : (6,) array
        Variance that a step adds.
    limit : float
        Velocity [m/s, rad/s] beyond which the motion counts as lost.
    dt, p, inverse, active, terms, weights, mass, mass_weights
        As `forced_step` takes them.

    Returns
    -------
    tuple of (n, 6), (n, 6, 6), (n, 6), (n, 6, 6), (n, 6, 6) array and bool
        Means and covariances with the readings of a row, those before them, the derivative of
        the step that follows; False where it was lost.
    """
    n, x, covariance = read.shape[0], start.copy(), spread.copy()
    after, before = np.empty((n, N_ALL)), np.empty((n, N_ALL))
    spread_after, spread_before = np.empty((n, N_ALL, N_ALL)), np.empty((n, N_ALL, N_ALL))
    transition = np.empty((n, N_ALL, N_ALL))
    for k in range(n):
        before[k], spread_before[k] = x, covariance
        for c in range(N_MOTION):
            if np.isfinite(read[k, c]):
                innovation = read[k, c] - np.sum(sensor[c] * x[:N_MOTION])
                update_scalar(x, covariance, N_ALL, 0, sensor[c], innovation, variance[c])
        after[k], spread_after[k] = x, covariance
        if k == n - 1:
            break
        transition[k] = forced_step(
            after[k], inputs[k], given[k : k + 2], dt, p, inverse, active, terms, weights, mass,
            mass_weights, x,
        )  # fmt: skip
        if not np.abs(x[:N_MOTION]).max() < limit:
            return after, spread_after, before, spread_before, transition, False
        covariance = transition[k] @ covariance @ transition[k].T + np.diag(growth)
    return after, spread_after, before, spread_before, transition, True
