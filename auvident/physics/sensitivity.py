"""The right-hand side of one state with its derivatives, and the derivative of a whole step.

Everything is linear in the parameters and a product of powers in the states, hence every
derivative is exact and comes from the same term table as the rates (`batch`, where the habits of
these kernels are explained).

A state and its sensitivities stand side by side in one array z (4, 1 + C): column 0 is the state,
the others its derivatives by whatever they started from, the last n_free those by the free
parameters. Forces (3, 1 + C + 1) have the same columns and a spare one for what is not free.
"""

import math

import numpy as np

from auvident.jit import kernel
from auvident.physics.batch import (
    N_INPUTS,
    N_POSITIONS,
    N_POWERS,
    N_STATES,
    N_VARIABLES,
    N_VELOCITIES,
    ONE,
    invert_rows,
    place_inputs,
    place_powers,
    varies,
)

SLOPES = ONE + 1  # place of the first derivative of a power, after the powers and the 1
N_PLACES = SLOPES + N_VARIABLES * N_POWERS
N_SLOPES = N_STATES + N_INPUTS  # a force has a slope by each state and by each input


@kernel
def sort_slopes(active, p, column, scale, lead, moving, terms, weights):
    """Sort the terms of the active equations with their derivatives.

    Parameters
    ----------
    active : (4,) bool array
    p : (n_parameters,) array
        Terms of parameters that are zero and not free are left out.
    column : (n_parameters,) int array
        Column of each parameter, or -1 when it is not free.
    scale : (n_free,) array
        Unit of each column.
    lead : int
        Columns before those of the parameters, the state itself among them.
    moving : (9,) bool array
        Inputs that depend on free parameters.
    terms, weights : arrays of `terms.Structure`

    Returns
    -------
    sorted_terms : (m, 6) uint array
        Equation, parameter, column (the spare one when the parameter is not free), places of
        the three factors.
    weights : (m, 2) array
        Weight, weight in units of the column.
    partials : (d, 6) uint array
        Term, equation, state (from 4 on: input), places of the slope and of the other two factors.
    """
    at_work = (p[terms[:, 1]] != 0.0) | (column[terms[:, 1]] >= 0)
    chosen, spare = np.flatnonzero(active[terms[:, 0]] & at_work), lead + scale.shape[0]
    m, d = chosen.shape[0], 0
    table, both = np.full((m, 6), ONE, np.uintp), np.zeros((m, 2))
    partials = np.full((3 * m, 6), ONE, np.uintp)
    for k in range(m):
        term, c = terms[chosen[k]], column[terms[chosen[k], 1]]
        both[k, 0] = weights[chosen[k]]
        table[k, 0], table[k, 1], table[k, 2] = term[0], term[1], spare
        if c >= 0:
            table[k, 2], both[k, 1] = lead + c, weights[chosen[k]] * scale[c]
        for f in range(3):
            if term[3 + 2 * f] >= 0:
                table[k, 3 + f] = term[2 + 2 * f] * N_POWERS + term[3 + 2 * f]
        for f in range(3):
            variable, power = term[2 + 2 * f], term[3 + 2 * f]
            if power >= 0 and varies(variable, active, moving):
                partials[d, 0], partials[d, 1] = k, term[0]
                partials[d, 2] = min(variable, N_STATES - 1)
                if variable >= N_POSITIONS:
                    partials[d, 2] = N_STATES + variable - N_POSITIONS
                partials[d, 3] = SLOPES + variable * N_POWERS + power
                partials[d, 4] = table[k, 3 + (f + 1) % 3]
                partials[d, 5] = table[k, 3 + (f + 2) % 3]
                d += 1
    return table, both, partials[:d].copy()


@kernel
def sort_masses(active, column, scale, lead, mass, mass_weights):
    """Entries of the mass matrix among active states with their derivatives.

    Returns
    -------
    sorted_mass : (q, 5) uint array
        Row, column and place (row by row) in the matrix, parameter, column of its sensitivity.
    weights : (q, 2) array
        Weight, weight in units of the column.
    """
    chosen = np.flatnonzero(active[mass[:, 0]] & active[mass[:, 1]])
    table, both = np.zeros((chosen.shape[0], 5), np.uintp), np.zeros((chosen.shape[0], 2))
    for k in range(chosen.shape[0]):
        i, j, parameter = mass[chosen[k]]
        table[k, 0], table[k, 1], table[k, 2], table[k, 3] = i, j, 3 * i + j, parameter
        table[k, 4], both[k, 0] = lead + scale.shape[0], mass_weights[chosen[k]]
        if column[parameter] >= 0:
            table[k, 4] = lead + column[parameter]
            both[k, 1] = both[k, 0] * scale[column[parameter]]
    return table, both


@kernel
def place_parameters(p, active, table, weights, mass, mass_weights, coefficient, m, inverse):
    """Coefficient of every term and the inverse mass matrix; returns the determinant."""
    for k in range(weights.shape[0]):
        coefficient[k] = weights[k, 0] * p[table[k, 1]]
    for i in range(9):
        m[i, 0] = 1.0 if i % 4 == 0 and not active[i // 4] else 0.0
    for k in range(mass.shape[0]):
        m[mass[k, 2], 0] += mass_weights[k, 0] * p[mass[k, 3]]
    return invert_rows(1, m, inverse)


@kernel
def _place_slopes(variable, y, inner, value):
    """Derivative of every power of the value y of a variable, times that of the variable."""
    at, absolute = SLOPES + variable * N_POWERS, abs(y)
    value[at] = inner
    value[at + 1] = inner if y > 0.0 else (-inner if y < 0.0 else 0.0)
    value[at + 2], value[at + 3] = 2.0 * y * inner, 2.0 * absolute * inner
    value[at + 4] = 3.0 * y * y * inner


@kernel
def _place_states(stage, active, used, value):
    """Powers of the states, and their derivatives by the active ones."""
    for i in range(N_VELOCITIES):
        if used[i]:
            place_powers(i, stage[i, 0], value)
            if active[i]:
                _place_slopes(i, stage[i, 0], 1.0, value)
    if used[3] or used[4]:
        sine, cosine = math.sin(stage[3, 0]), math.cos(stage[3, 0])
        place_powers(3, sine, value)
        place_powers(4, cosine, value)
        _place_slopes(3, sine, cosine, value)
        _place_slopes(4, cosine, -sine, value)


@kernel
def _add_forces(active, table, weights, partials, coefficient, value, f, f_x):
    """Forces by equation, with their derivatives by parameters, and by states and inputs (f_x)."""
    for i in range(N_VELOCITIES):
        for l in range(N_SLOPES):  # noqa: E741
            f_x[i, l] = 0.0
        if active[i]:
            for c in range(f.shape[1]):
                f[i, c] = 0.0
    for k in range(weights.shape[0]):
        product = value[table[k, 3]] * value[table[k, 4]] * value[table[k, 5]]
        f[table[k, 0], 0] += coefficient[k] * product
        f[table[k, 0], table[k, 2]] += weights[k, 1] * product
    for k in range(partials.shape[0]):
        slope = value[partials[k, 3]] * value[partials[k, 4]] * value[partials[k, 5]]
        f_x[partials[k, 1], partials[k, 2]] += coefficient[partials[k, 0]] * slope


@kernel
def linearise(
    stage, active, used, table, weights, partials, mass, mass_weights, coefficient, inverse,
    input_slopes, input_columns, value, f, f_x, rate,
):  # fmt: skip
    """Rate (4, 1 + C) of a state and its sensitivities `stage` (4, 1 + C).

    `input_slopes` (9, k) are the derivatives of the inputs by the parameters in the columns
    `input_columns` (k,). Sensitivities of inactive states and forces of inactive equations are
    zero throughout; f (3, 2 + C) and f_x (3, 13) are work arrays.
    """
    _place_states(stage, active, used, value)
    _add_forces(active, table, weights, partials, coefficient, value, f, f_x)
    columns = stage.shape[1]
    for i in range(N_VELOCITIES):
        if active[i]:
            rate[i, 0] = 0.0
            for l in range(N_VELOCITIES):  # noqa: E741
                rate[i, 0] += inverse[3 * i + l, 0] * f[l, 0]
    for k in range(mass.shape[0]):  # d(M rate)/dp moved to the right-hand side
        f[mass[k, 0], mass[k, 4]] -= mass_weights[k, 1] * rate[mass[k, 1], 0]
    for i in range(N_VELOCITIES):
        if active[i]:
            f_u, f_a, f_b, f_angle = f_x[i, 0], f_x[i, 1], f_x[i, 2], f_x[i, 3]
            for c in range(1, columns):
                f[i, c] += (
                    f_u * stage[0, c] + f_a * stage[1, c] + f_b * stage[2, c]
                    + f_angle * stage[3, c]
                )  # fmt: skip
            for k in range(input_columns.shape[0]):
                for l in range(N_INPUTS):  # noqa: E741
                    f[i, input_columns[k]] += f_x[i, N_STATES + l] * input_slopes[l, k]
    for i in range(N_VELOCITIES):
        if active[i]:
            x, y, n = inverse[3 * i, 0], inverse[3 * i + 1, 0], inverse[3 * i + 2, 0]
            for c in range(1, columns):
                rate[i, c] = x * f[0, c] + y * f[1, c] + n * f[2, c]
    if active[3]:
        for c in range(columns):
            rate[3, c] = stage[2, c]


@kernel
def step_linear(
    z, inputs, given0, given1, dt, active, used, table, weights, partials, mass, mass_weights,
    coefficient, inverse, input_slopes, input_columns, value, f, f_x, stage, rate, total,
):  # fmt: skip
    """One RK4 step of a state and its sensitivities z (4, 1 + C), in place.

    Of inactive states only the value is set, to the one at the end of the step. `coefficient`
    and `inverse` come from `place_parameters`, input slopes are as in `linearise`; the arrays
    after them are work arrays, made zero once: `stage`, `rate` and `total` of the shape of z, f
    and f_x as in `linearise`.
    """
    columns = z.shape[1]
    place_inputs(inputs, used, value)
    if input_columns.shape[0] > 0:
        for i in range(N_INPUTS):
            if used[N_POSITIONS + i]:
                _place_slopes(N_POSITIONS + i, inputs[i], 1.0, value)
    for i in range(N_STATES):
        if active[i]:
            for c in range(columns):
                stage[i, c], total[i, c] = z[i, c], 0.0
    for number in range(4):
        fraction = (0.0, 0.5, 0.5, 1.0)[number]
        share = (1.0, 2.0, 2.0, 1.0)[number]
        advance = (0.5, 0.5, 1.0, 0.0)[number] * dt
        for i in range(N_STATES):
            if not active[i]:
                stage[i, 0] = given0[i] + fraction * (given1[i] - given0[i])
        linearise(
            stage, active, used, table, weights, partials, mass, mass_weights, coefficient,
            inverse, input_slopes, input_columns, value, f, f_x, rate,
        )  # fmt: skip
        for i in range(N_STATES):
            if active[i]:
                for c in range(columns):
                    total[i, c] += share * rate[i, c]
                    stage[i, c] = z[i, c] + advance * rate[i, c]
    for i in range(N_STATES):
        if active[i]:
            for c in range(columns):
                z[i, c] += dt / 6.0 * total[i, c]
        else:
            z[i, 0] = given1[i]
