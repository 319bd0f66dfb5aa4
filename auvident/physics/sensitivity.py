"""The right-hand side of one state with its derivatives, and the derivative of a whole step.

Everything is linear in the parameters and a product of powers in the states, hence every
derivative is exact and comes from the same term table as the rates (`batch`, where the habits of
these kernels are explained).

A step of RK4 is x + dt/6 (k_0 + 2 k_1 + 2 k_2 + k_3), each rate k_s taken at a point that k_(s-1)
led to. First the four points are passed in order; powers, slopes and rates of each are kept. Then
every state goes back through them (`_weigh`) and finds the weight of each force at each point in
its own end value. A parameter changes a force at a point by its term's product, so the derivative
by it is a sum over the four points (`_add_parameters`): no column is carried from one to the next.
"""

import math
from collections.abc import Callable
from typing import Any

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
    place_powers,
    varies,
)

N_POINTS = 4  # of RK4
SLOPES = ONE + 1  # place of the first derivative of a power, after the powers and the 1
POINT_PLACES = SLOPES + N_VARIABLES * N_POWERS
N_PLACES = N_POINTS * POINT_PLACES
# at each point a force has a slope by each state and each input, and a weight in each state
WEIGHTS = N_STATES + N_INPUTS
POINT_SLOPES = WEIGHTS + N_STATES
N_SLOPES = N_POINTS * POINT_SLOPES
LEAD = 1 + N_STATES  # the derivative of a step: state reached, by the four before, by parameters


def borrowing(function: Callable[..., Any]) -> Any:
    """Kernel that only works in arrays of its caller: not counted, see `estimation.kalman`."""
    compiled: Any = kernel(function)
    compiled.targetoptions.update(_nrt=False, forceinline=True)
    return compiled


@kernel
def _in_order(rows, key):
    """Row numbers sorted by their key, in place; equal ones keep their order."""
    for k in range(1, rows.shape[0]):
        row, at = rows[k], k
        while at > 0 and key[rows[at - 1]] > key[row]:
            rows[at] = rows[at - 1]
            at -= 1
        rows[at] = row
    return rows


@kernel
def sort_slopes(active, p, column, scale, lead, moving, terms, weights):
    """Sort the terms of the active equations with their derivatives.

    Parameters
    ----------
    active : (4,) bool array
    p : (n_parameters,) array
        Terms of parameters that are zero and not free are left out.
    column, scale : (n_parameters,) int array, (n_free,) array
        Column of each parameter, or -1 when it is not free; unit of each column.
    lead : int
        Columns before those of the parameters (`LEAD`).
    moving : (9,) bool array
        Inputs that depend on free parameters.
    terms, weights : arrays of `terms.Structure`

    Returns
    -------
    sorted_terms : (m, 7) uint array
        Equation, parameter, column (one too many when the parameter is not free), places of
        the three factors, whether the equation is that of the row before.
    weights : (m, 2) array
        Weight, weight in units of the column (zero when it is not free).
    partials : (d, 7) uint array
        Term, equation, state (from 4 on: input), places of the slope and of the other two
        factors, whether equation and state are those of the row before.
    """
    at_work = (p[terms[:, 1]] != 0.0) | (column[terms[:, 1]] >= 0)
    chosen = _in_order(np.flatnonzero(active[terms[:, 0]] & at_work), terms[:, 0])
    spare, m, d = lead + scale.shape[0], chosen.shape[0], 0
    table, both = np.full((m, 7), ONE, np.uintp), np.zeros((m, 2))
    partials, place = np.full((3 * m, 7), ONE, np.uintp), np.zeros(3 * m, np.int64)
    for k in range(m):
        term, c = terms[chosen[k]], column[terms[chosen[k], 1]]
        both[k, 0] = weights[chosen[k]]
        table[k, 0], table[k, 1], table[k, 2] = term[0], term[1], spare
        table[k, 6] = k > 0 and terms[chosen[k - 1], 0] == term[0]
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
                place[d] = N_SLOPES * term[0] + partials[d, 2]
                d += 1
    order = _in_order(np.arange(d), place)
    partials = partials[order]
    for k in range(d):
        partials[k, 6] = k > 0 and place[order[k - 1]] == place[order[k]]
    return table, both, partials


@kernel
def sort_masses(active, column, scale, lead, mass, mass_weights):
    """Entries of the mass matrix among active states with their derivatives.

    Returns
    -------
    sorted_mass : (q, 5) uint array
        Row, column and place (row by row) in the matrix, parameter, column of its sensitivity.
    weights : (q, 2) array, as in `sort_slopes`
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


@borrowing
def place_parameters(p, active, table, weights, mass, mass_weights, coefficient, m, inverse):
    """Coefficient of every term and the inverse mass matrix; returns the determinant."""
    for k in range(weights.shape[0]):
        coefficient[k] = weights[k, 0] * p[table[k, 1]]
    for i in range(9):
        m[i, 0] = 1.0 if i % 4 == 0 and not active[i // 4] else 0.0
    for k in range(mass.shape[0]):
        m[mass[k, 2], 0] += mass_weights[k, 0] * p[mass[k, 3]]
    return invert_rows(1, m, inverse)


@borrowing
def _place_slopes(variable, y, inner, value):
    """Derivative of every power of the value y of a variable, times that of the variable."""
    at, absolute = SLOPES + variable * N_POWERS, abs(y)
    value[at] = inner
    value[at + 1] = inner if y > 0.0 else (-inner if y < 0.0 else 0.0)
    value[at + 2], value[at + 3] = 2.0 * y * inner, 2.0 * absolute * inner
    value[at + 4] = 3.0 * y * y * inner


@borrowing
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


@borrowing
def _place_inputs(inputs, used, moving, value):
    """Powers of the inputs, and their derivatives where inputs move: the same at every point."""
    for i in range(N_INPUTS):
        if used[N_POSITIONS + i]:
            for point in range(N_POINTS):
                here = value[point * POINT_PLACES :]
                place_powers(N_POSITIONS + i, inputs[i], here)
                if moving:
                    _place_slopes(N_POSITIONS + i, inputs[i], 1.0, here)


@borrowing
def _add_forces(table, partials, coefficient, value, f, slopes):
    """Forces by equation, and their slopes by states and inputs; both tables are sorted."""
    total = 0.0
    for k in range(coefficient.shape[0]):
        product = value[table[k, 3]] * value[table[k, 4]] * value[table[k, 5]]
        total = coefficient[k] * product + (total if table[k, 6] else 0.0)
        f[table[k, 0], 0] = total
    for k in range(partials.shape[0]):
        product = value[partials[k, 3]] * value[partials[k, 4]] * value[partials[k, 5]]
        total = coefficient[partials[k, 0]] * product + (total if partials[k, 6] else 0.0)
        slopes[partials[k, 1], partials[k, 2]] = total


@borrowing
def _pass_point(
    point, active, used, table, partials, coefficient, inverse, value, stage, f, f_x, rate
):  # fmt: skip
    """Rates of the state stage[:, 0], and the slopes of its forces."""
    here, slopes = value[point * POINT_PLACES :], f_x[:, point * POINT_SLOPES :]
    _place_states(stage, active, used, here)
    _add_forces(table, partials, coefficient, here, f, slopes)
    x, y, n = f[0, 0], f[1, 0], f[2, 0]
    for i in range(N_VELOCITIES):
        j = 3 * i
        rate[i, point] = inverse[j, 0] * x + inverse[j + 1, 0] * y + inverse[j + 2, 0] * n
    rate[3, point] = stage[2, 0] if active[3] else 0.0


@borrowing
def _weigh(i, active, dt, inverse, f_x, total):
    """Weight of every force in state i at the end of a step, and d x_i(end)/d x(start).

    From the last point to the first: w is d x_i(end)/d rate at the point, (x, y, n) = w M^-1 the
    weights of its forces, by = (x, y, n) df/d state what comes by its state. d angle/dt = b.
    """
    by_u = by_a = by_b = by_angle = 0.0
    for point in range(N_POINTS - 1, -1, -1):
        share = (1.0, 2.0, 2.0, 1.0)[point] * (dt / 6.0)  # of its rate in the step
        advance = (0.5, 0.5, 1.0, 0.0)[point] * dt  # of its rate in the point after it
        w_u = advance * by_u + (share if i == 0 else 0.0)
        w_a = advance * by_a + (share if i == 1 else 0.0)
        w_b = advance * by_b + (share if i == 2 else 0.0)
        w_angle = advance * by_angle + (share if i == 3 else 0.0)
        x = w_u * inverse[0, 0] + w_a * inverse[3, 0] + w_b * inverse[6, 0]
        y = w_u * inverse[1, 0] + w_a * inverse[4, 0] + w_b * inverse[7, 0]
        n = w_u * inverse[2, 0] + w_a * inverse[5, 0] + w_b * inverse[8, 0]
        at = point * POINT_SLOPES
        by_u = x * f_x[0, at] + y * f_x[1, at] + n * f_x[2, at]
        by_a = x * f_x[0, at + 1] + y * f_x[1, at + 1] + n * f_x[2, at + 1]
        by_b = x * f_x[0, at + 2] + y * f_x[1, at + 2] + n * f_x[2, at + 2]
        by_angle = x * f_x[0, at + 3] + y * f_x[1, at + 3] + n * f_x[2, at + 3]
        if active[2]:
            by_b += w_angle
        f_x[0, at + WEIGHTS + i], f_x[1, at + WEIGHTS + i], f_x[2, at + WEIGHTS + i] = x, y, n
        total[i, 1], total[i, 2] = total[i, 1] + by_u, total[i, 2] + by_a
        total[i, 3], total[i, 4] = total[i, 3] + by_b, total[i, 4] + by_angle


@borrowing
def _add_column(e, column, active, g0, g1, g2, g3, f_x, total):
    """Add what comes of a slope g of force e at the four points to one column."""
    for i in range(N_STATES):
        if active[i]:
            at = WEIGHTS + i
            total[i, column] += (
                f_x[e, at] * g0 + f_x[e, at + POINT_SLOPES] * g1
                + f_x[e, at + 2 * POINT_SLOPES] * g2 + f_x[e, at + 3 * POINT_SLOPES] * g3
            )  # fmt: skip


@borrowing
def _add_parameters(active, table, weights, mass, mass_weights, value, rate, f_x, total):
    """Derivatives by the parameters of the terms, and of the mass matrix: -d(M rate)/dp."""
    v0, v1 = value[:POINT_PLACES], value[POINT_PLACES:]
    v2, v3 = value[2 * POINT_PLACES :], value[3 * POINT_PLACES :]
    for k in range(weights.shape[0]):
        a, b, c, w = table[k, 3], table[k, 4], table[k, 5], weights[k, 1]
        if w != 0.0:
            g0, g1 = w * v0[a] * v0[b] * v0[c], w * v1[a] * v1[b] * v1[c]
            g2, g3 = w * v2[a] * v2[b] * v2[c], w * v3[a] * v3[b] * v3[c]
            _add_column(table[k, 0], table[k, 2], active, g0, g1, g2, g3, f_x, total)
    for k in range(mass.shape[0]):
        i, w = mass[k, 1], -mass_weights[k, 1]
        if w != 0.0:
            g0, g1, g2, g3 = w * rate[i, 0], w * rate[i, 1], w * rate[i, 2], w * rate[i, 3]
            _add_column(mass[k, 0], mass[k, 4], active, g0, g1, g2, g3, f_x, total)


@borrowing
def _add_inputs(active, used, input_slopes, input_columns, f_x, total):
    """Derivatives by the parameters that inputs depend on; inputs hold over the step."""
    for l in range(N_INPUTS):  # noqa: E741
        for e in range(N_VELOCITIES):
            if used[N_POSITIONS + l] and active[e]:
                by, step = f_x[e, N_STATES + l :], POINT_SLOPES
                for k in range(input_columns.shape[0]):
                    c, s = input_columns[k], input_slopes[l, k]
                    g0, g1, g2, g3 = s * by[0], s * by[step], s * by[2 * step], s * by[3 * step]
                    _add_column(e, c, active, g0, g1, g2, g3, f_x, total)


@borrowing
def linearise(
    stage, active, used, table, weights, partials, mass, mass_weights, coefficient, inverse,
    input_slopes, input_columns, value, f, f_x, rate,
):  # fmt: skip
    """Rates of the state stage[:, 0] in rate[:, 0], and their derivatives.

    rate (4, 5 + n_free) has the columns of `total` in `linear_step` and comes in as zeros, as do
    f and f_x; the powers of the inputs stand in `value` already. The forces act at one point.
    """
    _pass_point(0, active, used, table, partials, coefficient, inverse, value, stage, f, f_x, rate)
    for i in range(N_STATES):
        if active[i] and i < N_VELOCITIES:
            for e in range(N_VELOCITIES):
                f_x[e, WEIGHTS + i] = inverse[3 * i + e, 0]
                for l in range(N_STATES):  # noqa: E741
                    rate[i, 1 + l] += inverse[3 * i + e, 0] * f_x[e, l]
        elif active[i] and active[2]:
            rate[i, 3] = 1.0
    _add_parameters(active, table, weights, mass, mass_weights, value, rate, f_x, rate)
    _add_inputs(active, used, input_slopes, input_columns, f_x, rate)


@borrowing
def linear_step(
    x, inputs, given0, given1, dt, active, used, table, weights, partials, mass, mass_weights,
    coefficient, inverse, input_slopes, input_columns, value, f, f_x, stage, rate, total,
):  # fmt: skip
    """One RK4 step from the state x[:, 0] and its derivative.

    Parameters
    ----------
    coefficient, inverse : arrays from `place_parameters`
    input_slopes : (9, k) array
        Derivatives of the inputs by the parameters in the columns `input_columns` (k,).
    value, f, f_x, stage, rate : work arrays
        (N_PLACES,) of ones; (3, >= 1), (3, N_SLOPES), (4, >= 1) and (4, >= 4), made zero once.
    total : (4, 5 + n_free) array, filled
        Rows of active states: state reached, its derivatives by x and by the free parameters.
        Of inactive states only the value is set, to the one at the end of the step.
    """
    _place_inputs(inputs, used, input_columns.shape[0] > 0, value)
    for i in range(N_STATES):
        stage[i, 0] = x[i, 0] if active[i] else given0[i]
    for point in range(N_POINTS):
        _pass_point(
            point, active, used, table, partials, coefficient, inverse, value, stage, f, f_x, rate
        )
        fraction, advance = (0.5, 0.5, 1.0, 0.0)[point], (0.5, 0.5, 1.0, 0.0)[point] * dt
        for i in range(N_STATES):
            if active[i]:
                stage[i, 0] = x[i, 0] + advance * rate[i, point]
            else:
                stage[i, 0] = given0[i] + fraction * (given1[i] - given0[i])
    for i in range(N_STATES):
        total[i, 0] = given1[i]
        if active[i]:
            change = rate[i, 0] + 2.0 * rate[i, 1] + 2.0 * rate[i, 2] + rate[i, 3]
            total[i, 0] = x[i, 0] + dt / 6.0 * change
            for c in range(1, total.shape[1]):
                total[i, c] = 0.0
            total[i, 1 + i] = 1.0
            _weigh(i, active, dt, inverse, f_x, total)
    _add_parameters(active, table, weights, mass, mass_weights, value, rate, f_x, total)
    _add_inputs(active, used, input_slopes, input_columns, f_x, total)


@borrowing
def _chain(active, total, z, moved):
    """Derivatives z after a step from those of the step and those before it."""
    for i in range(N_STATES):
        if active[i]:
            u, a, b, angle = total[i, 1], total[i, 2], total[i, 3], total[i, 4]
            for c in range(1, z.shape[1]):
                moved[i, c] = u * z[0, c] + a * z[1, c] + b * z[2, c] + angle * z[3, c]
            for c in range(LEAD, z.shape[1]):
                moved[i, c] += total[i, c]
    for i in range(N_STATES):
        if active[i]:
            for c in range(1, z.shape[1]):
                z[i, c] = moved[i, c]


@borrowing
def step_linear(
    z, inputs, given0, given1, dt, active, used, table, weights, partials, mass, mass_weights,
    coefficient, inverse, input_slopes, input_columns, value, f, f_x, stage, rate, total,
):  # fmt: skip
    """One RK4 step of a state and its sensitivities z (4, 1 + C), C >= 4, in place.

    The last n_free columns are those by the free parameters. Work arrays as in `linear_step`,
    `stage` and `total` of the shape of z. Sensitivities of inactive states are zero throughout.
    """
    linear_step(
        z, inputs, given0, given1, dt, active, used, table, weights, partials, mass, mass_weights,
        coefficient, inverse, input_slopes, input_columns, value, f, f_x, stage, rate, total,
    )  # fmt: skip
    _chain(active, total, z, stage)
    for i in range(N_STATES):
        z[i, 0] = total[i, 0]
