"""The right-hand side at many points side by side: the sigma points of a filter, or just one.

The terms are sorted (`term_tables.sort_terms`) into what all points share (inputs, given states,
fixed parameters: a scalar in front of the term) and what differs from point to point (active
states, moving parameters: rows over the points). The loops over points are the innermost, so that
the table is read once for all of them and the compiler can use vector instructions.

The kernels take their arrays one by one and index them in place: a view or a field of a tuple
made inside a loop costs more (its references are counted) than the arithmetic here. They copy
number by number: to assign an array to a slice of another, numba would compile the text of the
error of unequal shapes as well, which takes seconds.
"""

import math

import numpy as np

from auvident.jit import kernel
from auvident.physics.term_tables import (
    N_INPUTS,
    N_POSITIONS,
    N_POWERS,
    N_STATES,
    N_VELOCITIES,
    P_ROWS,
    P_SCALARS,
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
def invert_masses(count, active, mass, mass_weights, moves, scalars, rows, m, inverse):
    """Inverse mass matrix of every point; returns the least determinant."""
    for i in range(9):
        unit = 1.0 if i % 4 == 0 and not active[i // 4] else 0.0
        for s in range(count):
            m[i, s] = unit
    for k in range(mass.shape[0]):
        i, j, parameter, weight = mass[k, 0], mass[k, 1], mass[k, 2], mass_weights[k]
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
    return invert_rows(count, m, inverse)


@kernel
def _place_given(given0, given1, fraction, active, used, fixed, scalars):
    """Inactive states, linear between the ends of the step, and their powers."""
    for i in range(N_STATES):
        fixed[i] = given0[i] + fraction * (given1[i] - given0[i])
    for i in range(N_VELOCITIES):
        if used[i] and not active[i]:
            place_powers(i, fixed[i], scalars)
    if not active[3] and used[3]:
        place_powers(3, math.sin(fixed[3]), scalars)
    if not active[3] and used[4]:
        place_powers(4, math.cos(fixed[3]), scalars)


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


@kernel
def rates(
    count,
    fraction,
    given0,
    given1,
    active,
    used,
    table,
    weights,
    powers,
    inverse,
    fixed,
    scalars,
    rows,
    force,
    stage,
    rate,
):
    """Rates (4, S) of the states `stage` (4, S); inputs and parameters are placed already."""
    _place_given(given0, given1, fraction, active, used, fixed, scalars)
    _place_rows(count, powers, stage, rows)
    _add_forces(count, table, weights, scalars, rows, force)
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
            rate[3, s] = stage[2, s] if active[2] else fixed[2]


@kernel
def step_points(
    count,
    inputs,
    given0,
    given1,
    dt,
    active,
    used,
    table,
    weights,
    powers,
    inverse,
    fixed,
    scalars,
    rows,
    force,
    x,
    stage,
    rate,
    total,
):
    """One RK4 step of the states x (4, S) of the first `count` points, in place.

    `inverse` (9, S) holds the inverse mass matrices; fixed (4,), scalars, rows, force (3, S),
    stage, rate and total (4, S) are work arrays, with the parameters already in scalars or rows.
    """
    place_inputs(inputs, used, scalars)
    for i in range(N_STATES):
        if active[i]:
            for s in range(count):
                stage[i, s], total[i, s] = x[i, s], 0.0
    for number in range(4):
        rates(
            count,
            (0.0, 0.5, 0.5, 1.0)[number],
            given0,
            given1,
            active,
            used,
            table,
            weights,
            powers,
            inverse,
            fixed,
            scalars,
            rows,
            force,
            stage,
            rate,
        )
        share = (1.0, 2.0, 2.0, 1.0)[number]
        advance = (0.5, 0.5, 1.0, 0.0)[number] * dt
        for i in range(N_STATES):
            if active[i]:
                for s in range(count):
                    total[i, s] += share * rate[i, s]
                    stage[i, s] = x[i, s] + advance * rate[i, s]
    for i in range(N_STATES):
        if active[i]:
            for s in range(count):
                x[i, s] += dt / 6.0 * total[i, s]
