"""The right-hand side at many points side by side: the sigma points of a filter, or just one.

The terms are sorted (`term_tables.sort_terms`) into what all points share (inputs, given states,
fixed parameters: a scalar in front of the term) and what differs from point to point (active
states, moving parameters: rows over the points). The loops over points are the innermost, so that
the table is read once for all of them and the compiler can use vector instructions.

`sensitivity` steps one state with its derivative. The two are apart because of what they cost: a
step of 49 points takes 4.7 times as long point by point as there, and one point takes 3.0 times as
long here, where rows of length one are gone through.

The kernels copy number by number: to assign an array to a slice of another, numba would compile
the text of the error of unequal shapes as well, which takes seconds.
"""

import math
from typing import NamedTuple

import numpy as np

from auvident.jit import borrowing, kernel
from auvident.physics.term_tables import (
    N_INPUTS,
    N_POSITIONS,
    N_POWERS,
    N_STATES,
    N_VELOCITIES,
    P_ROWS,
    P_SCALARS,
    needed_powers,
    sort_terms,
    used_variables,
)

N_POINTS = 4  # at which RK4 evaluates the rates
FRACTION = (0.0, 0.5, 0.5, 1.0)  # of the step that has gone by at each
ADVANCE = (0.5, 0.5, 1.0, 0.0)  # with the rate of each to the next, in steps
SHARE = (1.0, 2.0, 2.0, 1.0)  # of the rate of each in the whole step, in sixths


class PointSystem(NamedTuple):
    """The equations of the active states, sorted for many points.

    Attributes
    ----------
    active : (4,) bool array
    moves : (n_parameters,) bool array
        Parameters that differ from point to point.
    moving : (15,) bool array
        Inputs that do.
    used : (20,) bool array
        From `term_tables.used_variables`.
    table, weights : arrays from `term_tables.sort_terms`
    powers : array from `term_tables.needed_powers`
    mass, mass_weights : arrays of `terms.Structure`
    """

    active: np.ndarray
    moves: np.ndarray
    moving: np.ndarray
    used: np.ndarray
    table: np.ndarray
    weights: np.ndarray
    powers: np.ndarray
    mass: np.ndarray
    mass_weights: np.ndarray


class PointWork(NamedTuple):
    """Work arrays of a step of S points.

    Attributes
    ----------
    scalars : (n_scalars,) array
        What the points share: powers, the factor 1, the parameters.
    rows : (n_rows, S) array
        What differs: powers of the states and moving inputs, moving parameters.
    m : (10, S) array
        Mass matrices and their determinants.
    inverse : (9, S) array
        Inverse mass matrices.
    inactive : (4,) array
        Inactive states at this part of the step.
    force : (3, S) array
    stage, rate, total : (4, S) arrays
        States, their rates, and the sum of these over the step.
    """

    scalars: np.ndarray
    rows: np.ndarray
    m: np.ndarray
    inverse: np.ndarray
    inactive: np.ndarray
    force: np.ndarray
    stage: np.ndarray
    rate: np.ndarray
    total: np.ndarray


@kernel
def point_system(active, moves, moving, equations):
    """Sort the equations for many points, see `term_tables.sort_terms`."""
    terms = equations.terms
    table, weights = sort_terms(active, moves, moving, terms, equations.weights)
    used, powers = used_variables(active, terms), needed_powers(active, moving, terms)
    return PointSystem(
        active,
        moves,
        moving,
        used,
        table,
        weights,
        powers,
        equations.mass,
        equations.mass_weights,
    )


@kernel
def point_work(p, size):
    """Work arrays of a step, the parameters (n_parameters,) among the scalars."""
    scalars = np.ones(P_SCALARS + p.shape[0])
    for i in range(p.shape[0]):
        scalars[P_SCALARS + i] = p[i]
    return PointWork(
        scalars,
        np.zeros((P_ROWS + p.shape[0], size)),
        np.empty((10, size)),
        np.empty((9, size)),
        np.empty(N_STATES),
        np.empty((N_VELOCITIES, size)),
        np.empty((N_STATES, size)),
        np.empty((N_STATES, size)),
        np.empty((N_STATES, size)),
    )


@kernel
def place_powers(variable, y, value):
    """Every power (`terms.POWERS`) of the value y of a variable."""
    at, absolute = variable * N_POWERS, abs(y)
    value[at], value[at + 1], value[at + 2] = y, absolute, y * y
    value[at + 3], value[at + 4] = y * absolute, y * y * y


@kernel
def place_inputs(inputs, used, value):
    """Powers of the inputs that stand in a term."""
    for i in range(N_INPUTS):
        if used[N_POSITIONS + i]:
            place_powers(N_POSITIONS + i, inputs[i], value)


@kernel
def invert_rows(count, m, inverse):
    """Inverse (9, S) of the 3x3 matrices in m (10, S), both row by row.

    The last row of m takes the determinants. Returns the least of them; not positive when a
    matrix is not positive definite.
    """
    for i in range(N_VELOCITIES):
        for j in range(N_VELOCITIES):
            i1, i2, j1, j2 = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
            a, b, c, d = 3 * i1 + j1, 3 * i2 + j2, 3 * i1 + j2, 3 * i2 + j1
            target = 3 * j + i
            for s in range(count):
                inverse[target, s] = m[a, s] * m[b, s] - m[c, s] * m[d, s]
    for s in range(count):
        m[9, s] = m[0, s] * inverse[0, s] + m[1, s] * inverse[3, s] + m[2, s] * inverse[6, s]
    least = np.inf
    for s in range(count):  # all leading minors have to be positive; the third is the determinant
        bound = m[9, s]
        if not (m[0, s] > 0.0 and inverse[8, s] > 0.0):
            bound = -abs(bound)
        if not bound >= least:  # a NaN counts as least
            least = bound
    for i in range(9):
        for s in range(count):
            inverse[i, s] /= m[9, s]
    return least


@kernel
def inverse_mass(p, mass, mass_weights, active, inverse):
    """Inverse of the 3x3 mass matrix with inactive rows and columns replaced by identity.

    Returns the determinant; with a minus when the matrix is not positive definite.
    """
    m = np.zeros((10, 1))
    for k in range(mass.shape[0]):
        i, j = mass[k, 0], mass[k, 1]
        if active[i] and active[j]:
            m[3 * i + j, 0] += mass_weights[k] * p[mass[k, 2]]
    for i in range(N_VELOCITIES):
        if not active[i]:
            m[4 * i, 0] = 1.0
    return invert_rows(1, m, inverse.reshape((9, 1)))


@kernel
def invert_masses(count, system, work):
    """Inverse mass matrix of every point; returns the least determinant."""
    active, moves, mass, weights = system.active, system.moves, system.mass, system.mass_weights
    m, rows, scalars = work.m, work.rows, work.scalars
    for i in range(9):
        unit = 1.0 if i % 4 == 0 and not active[i // 4] else 0.0
        for s in range(count):
            m[i, s] = unit
    for k in range(mass.shape[0]):
        i, j, parameter, weight = mass[k, 0], mass[k, 1], mass[k, 2], weights[k]
        target = 3 * i + j
        if not (active[i] and active[j]):
            continue
        if moves[parameter]:
            for s in range(count):
                m[target, s] += weight * rows[P_ROWS + parameter, s]
        else:
            shared = weight * scalars[P_SCALARS + parameter]
            for s in range(count):
                m[target, s] += shared
    return invert_rows(count, m, work.inverse)


@borrowing
def _place_inactive(inactive0, inactive1, fraction, system, work):
    """Inactive states, linear between the ends of the step, and their powers."""
    active, used, inactive, scalars = system.active, system.used, work.inactive, work.scalars
    for i in range(N_STATES):
        inactive[i] = inactive0[i] + fraction * (inactive1[i] - inactive0[i])
    for i in range(N_VELOCITIES):
        if used[i] and not active[i]:
            place_powers(i, inactive[i], scalars)
    if not active[3] and used[3]:
        place_powers(3, math.sin(inactive[3]), scalars)
    if not active[3] and used[4]:
        place_powers(4, math.cos(inactive[3]), scalars)


@kernel
def _place_rows(count, powers, stage, rows):
    """Powers of the active states of every point; moving inputs stand in their rows already."""
    for k in range(powers.shape[0]):
        variable, power = powers[k, 0], powers[k, 1]
        base = variable * N_POWERS
        at = base + power
        if power == 0:
            if variable < N_VELOCITIES:
                for s in range(count):
                    rows[at, s] = stage[variable, s]
            elif variable == N_VELOCITIES:
                for s in range(count):
                    rows[at, s] = math.sin(stage[3, s])
            elif variable < N_POSITIONS:
                for s in range(count):
                    rows[at, s] = math.cos(stage[3, s])
        elif power == 1:
            for s in range(count):
                rows[at, s] = abs(rows[base, s])
        elif power == 2:
            for s in range(count):
                rows[at, s] = rows[base, s] * rows[base, s]
        elif power == 3:
            for s in range(count):
                rows[at, s] = rows[base, s] * abs(rows[base, s])
        else:
            for s in range(count):
                rows[at, s] = rows[base, s] * rows[base, s] * rows[base, s]


@kernel
def _add_forces(count, table, weights, scalars, rows, force):
    """Sum of the terms of every point, by equation."""
    for i in range(N_VELOCITIES):
        for s in range(count):
            force[i, s] = 0.0
    for k in range(weights.shape[0]):
        f = weights[k] * scalars[table[k, 5]] * scalars[table[k, 2]]
        f *= scalars[table[k, 3]] * scalars[table[k, 4]]
        i, n = table[k, 0], table[k, 1]
        a, b, c, d = table[k, 6], table[k, 7], table[k, 8], table[k, 9]
        if n == 0:
            for s in range(count):
                force[i, s] += f
        elif n == 1:
            for s in range(count):
                force[i, s] += f * rows[a, s]
        elif n == 2:
            for s in range(count):
                force[i, s] += f * rows[a, s] * rows[b, s]
        elif n == 3:
            for s in range(count):
                force[i, s] += f * rows[a, s] * rows[b, s] * rows[c, s]
        else:
            for s in range(count):
                force[i, s] += f * rows[a, s] * rows[b, s] * rows[c, s] * rows[d, s]


@borrowing
def rates(count, fraction, inactive0, inactive1, system, work):
    """Rates of the states `work.stage`; inputs and parameters are placed already."""
    active, inverse, force, rate = system.active, work.inverse, work.force, work.rate
    _place_inactive(inactive0, inactive1, fraction, system, work)
    _place_rows(count, system.powers, work.stage, work.rows)
    _add_forces(count, system.table, system.weights, work.scalars, work.rows, force)
    for i in range(N_VELOCITIES):
        if not active[i]:
            continue
        for s in range(count):
            rate[i, s] = 0.0
        for j in range(N_VELOCITIES):
            if active[j]:
                for s in range(count):
                    rate[i, s] += inverse[3 * i + j, s] * force[j, s]
    if active[3]:
        for s in range(count):
            rate[3, s] = work.stage[2, s] if active[2] else work.inactive[2]


@borrowing
def step_points(count, inputs, inactive0, inactive1, dt, system, work, x):
    """One RK4 step of the states x (4, S) of the first `count` points, in place.

    Parameters
    ----------
    count : int
    inputs : (15,) or (3,) array
        Held over the step; those that differ from point to point stand in `work.rows` already.
    inactive0, inactive1 : (4,) array
        Values of the inactive states at the beginning and the end of the step.
    dt : float
        [s]
    system : PointSystem
    work : PointWork
        With the parameters in their places and the inverse mass matrices.
    x : (4, S) array
    """
    active, stage, rate, total = system.active, work.stage, work.rate, work.total
    place_inputs(inputs, system.used, work.scalars)
    for i in range(N_STATES):
        if active[i]:
            for s in range(count):
                stage[i, s], total[i, s] = x[i, s], 0.0
    for point in range(N_POINTS):
        rates(count, FRACTION[point], inactive0, inactive1, system, work)
        share, advance = SHARE[point], ADVANCE[point] * dt
        for i in range(N_STATES):
            if active[i]:
                for s in range(count):
                    total[i, s] += share * rate[i, s]
                    stage[i, s] = x[i, s] + advance * rate[i, s]
    for i in range(N_STATES):
        if active[i]:
            for s in range(count):
                x[i, s] += dt / 6.0 * total[i, s]
