"""The pass of an extended Kalman filter over one record: its motion, and forces that walk.

The model is known; what is followed is what the readings say beside it.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.estimation.kalman import update_with
from auvident.jit import borrowing, kernel
from auvident.physics.actuation import FORCE
from auvident.physics.dynamics import SPEED_LIMIT
from auvident.physics.sensitivity import (
    N_PLACES,
    N_POINTS,
    N_SLOPES,
    linear_step,
    place_parameters,
)
from auvident.physics.term_tables import (
    LEAD,
    N_INPUTS,
    N_STATES,
    N_VELOCITIES,
    sort_masses,
    sort_slopes,
    used_variables,
)

Array = npt.NDArray[Any]
Passed = tuple[Array, Array, Array, Array, Array]


def motion_pass(
    start: Array,
    spread: Array,
    inputs: Array,
    given: Array,
    read: Array,
    sensor: Array,
    variance: Array,
    growth: Array,
    dt: float,
    p: Array,
    active: Array,
    terms: Array,
    weights: Array,
    mass: Array,
    mass_weights: Array,
) -> Passed | None:
    """What `estimation.smoother.smooth` takes; None where the motion could not be followed.

    Parameters
    ----------
    start : (m + k,) array
        Mean of the m active states, and of k forces on surge, sway and yaw [N, N, N m], at the
        first row.
    spread : (m + k, m + k) array
        Its covariance.
    inputs : (n, 9) or, without forces, (n, 3) array
        The first k forces are those that are followed.
    given : (n, 4) array
        States; those that are not active are taken from it.
    read : (n, 4) array
        Readings; NaN where there is none.
    sensor : (4, 4) array
        Readings by states.
    variance : (4,) array
        Of the readings.
    growth : (m + k,) array
        Variance that a step adds.
    dt : float
        [s]
    p, active, terms, weights, mass, mass_weights
        As `physics.dynamics.simulate_states` takes them.

    Returns
    -------
    tuple of (n, m + k), (n, m + k, m + k), the same two again, (n, m + k, m + k) array
        Means and covariances with the readings of a row, those before them, the derivative of
        the step that follows.
    """
    n, size = len(read), len(start)
    means, spreads = np.empty((2, n, size)), np.zeros((3, n, size, size))
    passed = means[0], spreads[0], means[1], spreads[1], spreads[2]
    followed = _follow(
        start.copy(),
        spread.copy(),
        inputs,
        given,
        read,
        sensor,
        variance,
        growth,
        dt,
        p,
        np.flatnonzero(active),
        active,
        terms,
        weights,
        mass,
        mass_weights,
        *passed,
    )
    return passed if followed else None


@kernel
def _follow(
    x,
    covariance,
    inputs,
    given,
    read,
    sensor,
    variance,
    growth,
    dt,
    p,
    index,
    active,
    terms,
    weights,
    mass,
    mass_weights,
    after,
    spread_after,
    before,
    spread_before,
    transition,
):
    """Fill what `motion_pass` returns; False where the motion is lost."""
    n, n_x, size = read.shape[0], index.shape[0], x.shape[0]
    n_forces, scale = size - n_x, np.ones(size - n_x)
    moving, by_force = np.zeros(N_INPUTS, np.bool_), np.zeros((N_INPUTS, n_forces))
    places = np.zeros(n_forces, np.int64)
    for c in range(n_forces):
        moving[FORCE + c], by_force[FORCE + c, c], places[c] = True, 1.0, LEAD + c
    column = np.full(p.shape[0], -1)
    table, sorted_weights, partials = sort_slopes(active, p, column, scale, moving, terms, weights)
    sorted_mass, sorted_mass_weights = sort_masses(active, column, scale, mass, mass_weights)
    used, coefficient = used_variables(active, terms), np.empty(table.shape[0])
    m, inverse = np.empty((10, 1)), np.empty((9, 1))
    if (
        not place_parameters(
            p,
            active,
            table,
            sorted_weights,
            sorted_mass,
            sorted_mass_weights,
            coefficient,
            m,
            inverse,
        )
        > 0.0
    ):
        return False
    value, f = np.ones(N_PLACES), np.zeros((N_VELOCITIES, 1))
    f_x = np.zeros((N_VELOCITIES, N_SLOPES))
    now, stage, rate = np.zeros((N_STATES, 1)), np.zeros((N_STATES, 1)), np.zeros((4, N_POINTS))
    reached, u = np.zeros((N_STATES, LEAD + n_forces)), np.empty(inputs.shape[1])
    work, rows = np.empty((3, size)), np.empty((size, size))
    gradient, nothing, no_slopes = np.empty(n_x), np.zeros(0, np.int64), np.zeros(0)
    for k in range(n):
        _keep(x, covariance, before[k], spread_before[k])
        _take_readings(
            k,
            x,
            covariance,
            index,
            active,
            given,
            read,
            sensor,
            variance,
            gradient,
            nothing,
            no_slopes,
            work,
        )
        _keep(x, covariance, after[k], spread_after[k])
        if k == n - 1:
            break
        for i in range(n_x):
            now[index[i], 0] = x[i]
        for i in range(inputs.shape[1]):
            u[i] = inputs[k, i]
        for c in range(n_forces):
            u[FORCE + c] = x[n_x + c]
        linear_step(
            now,
            u,
            given[k],
            given[k + 1],
            dt,
            active,
            used,
            table,
            sorted_weights,
            partials,
            sorted_mass,
            sorted_mass_weights,
            coefficient,
            inverse,
            by_force,
            places,
            value,
            f,
            f_x,
            stage,
            rate,
            reached,
        )
        if not _advance(reached, index, x, covariance, growth, transition[k], rows):
            return False
    return True


@borrowing
def _keep(x, covariance, mean, spread):
    """Copy mean and covariance."""
    for i in range(x.shape[0]):
        mean[i] = x[i]
        for c in range(x.shape[0]):
            spread[i, c] = covariance[i, c]


@borrowing
def _take_readings(
    k,
    x,
    covariance,
    index,
    active,
    given,
    read,
    sensor,
    variance,
    gradient,
    nothing,
    no_slopes,
    work,
):
    """Update with every reading of row k."""
    for c in range(N_STATES):
        innovation = read[k, c]
        if math.isnan(innovation):
            continue
        for i in range(N_STATES):
            if not active[i]:
                innovation -= sensor[c, i] * given[k, i]
        for i in range(index.shape[0]):
            gradient[i] = sensor[c, index[i]]
            innovation -= gradient[i] * x[i]
        update_with(
            x,
            covariance,
            x.shape[0],
            x.shape[0],
            0,
            gradient,
            nothing,
            no_slopes,
            innovation,
            variance[c],
            work[0],
            work[1],
            work[2],
        )


@borrowing
def _advance(reached, index, x, covariance, growth, transition, rows):
    """Mean and covariance after a step; False where a state ran away.

    `reached` is what `sensitivity.linear_step` fills; `transition`, zeros before, takes the
    derivative of the step.
    """
    n_x, size = index.shape[0], x.shape[0]
    for i in range(n_x):
        x[i] = reached[index[i], 0]
        if not abs(x[i]) < SPEED_LIMIT:
            return False
        for c in range(n_x):
            transition[i, c] = reached[index[i], 1 + index[c]]
        for c in range(n_x, size):
            transition[i, c] = reached[index[i], LEAD + c - n_x]
    for i in range(n_x, size):
        transition[i, i] = 1.0
    for i in range(size):
        for c in range(size):
            rows[i, c] = 0.0
            for l in range(size):  # noqa: E741
                rows[i, c] += transition[i, l] * covariance[l, c]
    for i in range(size):
        for c in range(i + 1):
            total = growth[i] if i == c else 0.0
            for l in range(size):  # noqa: E741
                total += rows[i, l] * transition[c, l]
            covariance[i, c] = total
            covariance[c, i] = total
    return True
