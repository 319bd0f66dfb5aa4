"""One step of one state with its derivative.

Everything is linear in the parameters and a product of powers in the states, hence every
derivative is exact and comes from the same terms as the rates (`batch`, which says why there are
two), sorted by `term_tables.sort_slopes`.

With k = M^-1 F(x, p) the rate of a state (and d angle/dt = b), a step of RK4 is::

    x_0 = x,    x_1 = x + dt/2 k_0,    x_2 = x + dt/2 k_1,    x_3 = x + dt k_2
    x(end) = x + dt/6 (k_0 + 2 k_1 + 2 k_2 + k_3)

First the four points x_0 .. x_3 are passed in order; powers, slopes dF/dx and rates of each are
kept. Then the chain rule goes through them backwards, once for each state at the end, and leaves
the weight of every force at every point in that state (`_weigh_forces`). With these the derivative
by a parameter is a sum over the four points (`_add_parameters`)::

    dx_i(end)/dp = sum over s of  dx_i(end)/dF_s (dF_s/dp - dM/dp k_s)

Forwards, every column of dx/dp would have to be carried from point to point.
"""

import math
from typing import NamedTuple

import numpy as np

from auvident.jit import borrowing, kernel
from auvident.physics.batch import ADVANCE, N_POINTS, SHARE, inverse_mass
from auvident.physics.term_tables import (
    LEAD,
    N_INPUTS,
    N_PARTIALS,
    N_POSITIONS,
    N_POWERS,
    N_STATES,
    N_VARIABLES,
    N_VELOCITIES,
    SLOPES,
    sort_masses,
    sort_slopes,
    standing_in,
)

N_PLACES = SLOPES + N_VARIABLES * N_POWERS  # values of a point: powers, 1, their derivatives
WEIGHTS = N_PARTIALS  # of a force at a point: after its slopes its weight in each state at the end
N_SLOPES = WEIGHTS + N_STATES


class System(NamedTuple):
    """The equations of the active states, sorted, at one value of the parameters.

    Attributes
    ----------
    active : (4,) bool array
    used : (20,) bool array
        From `term_tables.standing_in`.
    moving : (15,) bool array
        Inputs that stand in a term and depend on free parameters.
    table, weights, partials : arrays from `term_tables.sort_slopes`
    mass, mass_weights : arrays from `term_tables.sort_masses`
    coefficient : (m,) array
        Weight times parameter of every term.
    inverse : (9, 1) array
        Inverse mass matrix, row by row.
    input_columns : (k,) int array
        Columns (after `LEAD` others) of the parameters that the inputs depend on.
    """

    active: np.ndarray
    used: np.ndarray
    moving: np.ndarray
    table: np.ndarray
    weights: np.ndarray
    partials: np.ndarray
    mass: np.ndarray
    mass_weights: np.ndarray
    coefficient: np.ndarray
    inverse: np.ndarray
    input_columns: np.ndarray


class StepWork(NamedTuple):
    """Work arrays of a step. Places of what is not active or not used are never written.

    Attributes
    ----------
    value : (N_PLACES, 4) array
        Powers, 1 and derivatives of the powers, by point.
    f : (3,) array
        Forces.
    f_x : (3, N_SLOPES, 4) array
        Slopes of the forces and their weights, by point.
    stage : (4, >= 1) array
        State at the point.
    rate : (4, 4) array
        Rates by point.
    """

    value: np.ndarray
    f: np.ndarray
    f_x: np.ndarray
    stage: np.ndarray
    rate: np.ndarray


@kernel
def system_at(p, active, column, scale, moving, input_columns, equations):
    """Sort the equations and put in the parameters.

    Parameters
    ----------
    p : (n_parameters,) array
    active, column, scale, moving :
        As `term_tables.sort_slopes` takes them.
    input_columns : (k,) int array
        Columns, among the free parameters, of those that the inputs depend on.
    equations : terms.Equations

    Returns
    -------
    System
    float
        Determinant of the mass matrix, see `batch.inverse_mass`.
    """
    table, weights, partials = sort_slopes(
        active, p, column, scale, moving, equations.terms, equations.weights
    )
    mass, mass_weights = sort_masses(active, column, scale, equations.mass, equations.mass_weights)
    coefficient, inverse = np.empty(table.shape[0]), np.empty((3, 3))
    for k in range(table.shape[0]):
        coefficient[k] = weights[k, 0] * p[table[k, 1]]
    determinant = inverse_mass(p, equations.mass, equations.mass_weights, active, inverse)
    used = standing_in(table)
    system = System(
        active,
        used,
        used[N_POSITIONS:] & moving,
        table,
        weights,
        partials,
        mass,
        mass_weights,
        coefficient,
        inverse.reshape((9, 1)),
        input_columns + LEAD,
    )
    return system, determinant


@kernel
def step_work(columns):
    """Work arrays for sensitivities of that many columns."""
    return StepWork(
        np.ones((N_PLACES, N_POINTS)),
        np.zeros(N_VELOCITIES),
        np.zeros((N_VELOCITIES, N_SLOPES, N_POINTS)),
        np.zeros((N_STATES, columns)),
        np.zeros((N_STATES, N_POINTS)),
    )


@borrowing
def _place_powers(variable, y, point, value):
    """Every power (`terms.POWERS`) of the value y of a variable at a point."""
    at, absolute = variable * N_POWERS, abs(y)
    value[at, point], value[at + 1, point], value[at + 2, point] = y, absolute, y * y
    value[at + 3, point], value[at + 4, point] = y * absolute, y * y * y


@borrowing
def _place_slopes(variable, y, inner, point, value):
    """Derivative of every power of y at a point, times `inner`, the derivative of y."""
    at, absolute = SLOPES + variable * N_POWERS, abs(y)
    value[at, point] = inner
    value[at + 1, point] = inner if y > 0.0 else (-inner if y < 0.0 else 0.0)
    value[at + 2, point], value[at + 3, point] = 2.0 * y * inner, 2.0 * absolute * inner
    value[at + 4, point] = 3.0 * y * y * inner


@borrowing
def _place_states(stage, active, used, point, value):
    """Powers of the states, and their derivatives by the active ones."""
    for i in range(N_VELOCITIES):
        if used[i]:
            _place_powers(i, stage[i, 0], point, value)
            if active[i]:
                _place_slopes(i, stage[i, 0], 1.0, point, value)
    if used[3] or used[4]:
        sine, cosine = math.sin(stage[3, 0]), math.cos(stage[3, 0])
        _place_powers(3, sine, point, value)
        _place_powers(4, cosine, point, value)
        _place_slopes(3, sine, cosine, point, value)
        _place_slopes(4, cosine, -sine, point, value)


@borrowing
def _place_inputs(inputs, used, moving, value):
    """Powers of the inputs, and their derivatives where inputs move: the same at every point."""
    for i in range(N_INPUTS):
        if used[N_POSITIONS + i]:
            for point in range(N_POINTS):
                _place_powers(N_POSITIONS + i, inputs[i], point, value)
                if moving[i]:
                    _place_slopes(N_POSITIONS + i, inputs[i], 1.0, point, value)


@borrowing
def _add_forces(table, coefficient, point, value, f):
    """Forces at a point; the table is sorted by equation."""
    total = 0.0
    for k in range(coefficient.shape[0]):
        product = value[table[k, 3], point] * value[table[k, 4], point] * value[table[k, 5], point]
        total = coefficient[k] * product + (total if table[k, 6] else 0.0)
        f[table[k, 0]] = total


@borrowing
def _add_slopes(partials, coefficient, value, f_x):
    """Slopes of the forces at all points, by states and inputs; the table is sorted by both."""
    s0 = s1 = s2 = s3 = 0.0
    for k in range(partials.shape[0]):
        w, e, by = coefficient[partials[k, 0]], partials[k, 1], partials[k, 2]
        a, b, c = partials[k, 3], partials[k, 4], partials[k, 5]
        if not partials[k, 6]:
            s0 = s1 = s2 = s3 = 0.0
        s0 += w * (value[a, 0] * value[b, 0] * value[c, 0])
        s1 += w * (value[a, 1] * value[b, 1] * value[c, 1])
        s2 += w * (value[a, 2] * value[b, 2] * value[c, 2])
        s3 += w * (value[a, 3] * value[b, 3] * value[c, 3])
        f_x[e, by, 0], f_x[e, by, 1], f_x[e, by, 2], f_x[e, by, 3] = s0, s1, s2, s3


@borrowing
def _evaluate_point(point, system, work):
    """Rates of the state stage[:, 0] in rate[:, point]."""
    active, inverse, f, stage, rate = system.active, system.inverse, work.f, work.stage, work.rate
    _place_states(stage, active, system.used, point, work.value)
    _add_forces(system.table, system.coefficient, point, work.value, f)
    x, y, n = f[0], f[1], f[2]
    for i in range(N_VELOCITIES):
        j = 3 * i
        rate[i, point] = inverse[j, 0] * x + inverse[j + 1, 0] * y + inverse[j + 2, 0] * n
    rate[3, point] = stage[2, 0] if active[3] else 0.0


@borrowing
def _weigh_forces(i, active, dt, inverse, f_x, total):
    """Weight of every force in state i at the end of a step, and d x_i(end)/d x.

    The chain rule from the last point s = 3 to the first, all of them rows::

        w_s = dx_i(end)/dk_s = dt SHARE_s/6 e_i + dt ADVANCE_s by_(s+1),    by_4 = 0
        (x, y, n)_s = dx_i(end)/dF_s = w_s M^-1
        by_s = dx_i(end)/dx_s = (x, y, n)_s dF/dx(x_s),  by b also w_s of the angle
        dx_i(end)/dx = e_i + by_0 + by_1 + by_2 + by_3

    The weights x, y, n go behind the slopes of their point in f_x; the derivative is added to
    total[i, 1:5], where e_i stands.
    """
    by_u = by_a = by_b = by_angle = 0.0
    for point in range(N_POINTS - 1, -1, -1):
        share, advance = SHARE[point] * (dt / 6.0), ADVANCE[point] * dt
        w_u = advance * by_u + (share if i == 0 else 0.0)
        w_a = advance * by_a + (share if i == 1 else 0.0)
        w_b = advance * by_b + (share if i == 2 else 0.0)
        w_angle = advance * by_angle + (share if i == 3 else 0.0)
        x = w_u * inverse[0, 0] + w_a * inverse[3, 0] + w_b * inverse[6, 0]
        y = w_u * inverse[1, 0] + w_a * inverse[4, 0] + w_b * inverse[7, 0]
        n = w_u * inverse[2, 0] + w_a * inverse[5, 0] + w_b * inverse[8, 0]
        by_u = x * f_x[0, 0, point] + y * f_x[1, 0, point] + n * f_x[2, 0, point]
        by_a = x * f_x[0, 1, point] + y * f_x[1, 1, point] + n * f_x[2, 1, point]
        by_b = x * f_x[0, 2, point] + y * f_x[1, 2, point] + n * f_x[2, 2, point]
        by_angle = x * f_x[0, 3, point] + y * f_x[1, 3, point] + n * f_x[2, 3, point]
        if active[2]:
            by_b += w_angle
        at = WEIGHTS + i
        f_x[0, at, point], f_x[1, at, point], f_x[2, at, point] = x, y, n
        total[i, 1], total[i, 2] = total[i, 1] + by_u, total[i, 2] + by_a
        total[i, 3], total[i, 4] = total[i, 3] + by_b, total[i, 4] + by_angle


@borrowing
def _add_column(e, column, active, g0, g1, g2, g3, f_x, total):
    """Add to one column what comes of slopes g0 .. g3 of force e at the four points."""
    for i in range(N_STATES):
        if active[i]:
            at = WEIGHTS + i
            total[i, column] += (
                f_x[e, at, 0] * g0 + f_x[e, at, 1] * g1 + f_x[e, at, 2] * g2 + f_x[e, at, 3] * g3
            )


@borrowing
def _add_parameters(system, work, total):
    """Derivatives by the parameters of the terms, and of the mass matrix.

    A free mass acts like the force -dM/dp k: from M k = F follows M dk/dp = dF/dp - dM/dp k.
    """
    active, table, weights = system.active, system.table, system.weights
    mass, mass_weights = system.mass, system.mass_weights
    value, rate, f_x = work.value, work.rate, work.f_x
    for k in range(weights.shape[0]):
        a, b, c, w = table[k, 3], table[k, 4], table[k, 5], weights[k, 1]
        if w != 0.0:
            g0 = w * value[a, 0] * value[b, 0] * value[c, 0]
            g1 = w * value[a, 1] * value[b, 1] * value[c, 1]
            g2 = w * value[a, 2] * value[b, 2] * value[c, 2]
            g3 = w * value[a, 3] * value[b, 3] * value[c, 3]
            _add_column(table[k, 0], table[k, 2], active, g0, g1, g2, g3, f_x, total)
    for k in range(mass.shape[0]):
        i, w = mass[k, 1], -mass_weights[k, 1]
        if w != 0.0:
            g0, g1, g2, g3 = w * rate[i, 0], w * rate[i, 1], w * rate[i, 2], w * rate[i, 3]
            _add_column(mass[k, 0], mass[k, 4], active, g0, g1, g2, g3, f_x, total)


@borrowing
def _add_inputs(system, input_slopes, f_x, total):
    """Derivatives by the parameters that inputs depend on; inputs hold over the step."""
    active, moving, input_columns = system.active, system.moving, system.input_columns
    for l in range(N_INPUTS):  # noqa: E741
        if moving[l]:
            for i in range(N_STATES):
                if active[i]:
                    by = _by_input(l, i, active, f_x)
                    for k in range(input_columns.shape[0]):
                        total[i, input_columns[k]] += by * input_slopes[l, k]


@borrowing
def _by_input(l, i, active, f_x):  # noqa: E741
    """Derivative of state i at the end of a step by input l."""
    by = 0.0
    for e in range(N_VELOCITIES):
        if active[e]:
            for point in range(N_POINTS):
                by += f_x[e, WEIGHTS + i, point] * f_x[e, N_STATES + l, point]
    return by


@borrowing
def step_with_jacobian(x, inputs, inactive0, inactive1, dt, input_slopes, system, work, reached):
    """One RK4 step from the state x[:, 0], with its derivatives.

    Parameters
    ----------
    x : (4, >= 1) array
    inputs : (15,) or (3,) array
        Held over the step.
    inactive0, inactive1 : (4,) array
        Values of the inactive states at the beginning and the end of the step.
    dt : float
        [s]
    input_slopes : (15, k) array
        Derivatives of the inputs by the parameters in the columns `system.input_columns`.
    system : System
    work : StepWork
    reached : (4, 5 + n_free) array, filled
        Rows of active states: state reached, its derivatives by x and by the free parameters.
        Of inactive states only the value is set, to the one at the end of the step.
    """
    active, stage, rate = system.active, work.stage, work.rate
    _place_inputs(inputs, system.used, system.moving, work.value)
    for i in range(N_STATES):
        stage[i, 0] = x[i, 0] if active[i] else inactive0[i]
    for point in range(N_POINTS):
        _evaluate_point(point, system, work)
        fraction, advance = ADVANCE[point], ADVANCE[point] * dt
        for i in range(N_STATES):
            if active[i]:
                stage[i, 0] = x[i, 0] + advance * rate[i, point]
            else:
                stage[i, 0] = inactive0[i] + fraction * (inactive1[i] - inactive0[i])
    _add_slopes(system.partials, system.coefficient, work.value, work.f_x)
    for i in range(N_STATES):
        reached[i, 0] = inactive1[i]
        if active[i]:
            change = rate[i, 0] + 2.0 * rate[i, 1] + 2.0 * rate[i, 2] + rate[i, 3]
            reached[i, 0] = x[i, 0] + dt / 6.0 * change
            for c in range(1, reached.shape[1]):
                reached[i, c] = 0.0
            reached[i, 1 + i] = 1.0
            _weigh_forces(i, active, dt, system.inverse, work.f_x, reached)
    _add_parameters(system, work, reached)
    _add_inputs(system, input_slopes, work.f_x, reached)


@borrowing
def _chain(active, reached, z, moved):
    """Derivatives z after a step: dx(end)/dx z, and dx(end)/dp on top of the last columns."""
    for i in range(N_STATES):
        if active[i]:
            u, a, b, angle = reached[i, 1], reached[i, 2], reached[i, 3], reached[i, 4]
            for c in range(1, z.shape[1]):
                moved[i, c] = u * z[0, c] + a * z[1, c] + b * z[2, c] + angle * z[3, c]
            for c in range(LEAD, z.shape[1]):
                moved[i, c] += reached[i, c]
    for i in range(N_STATES):
        if active[i]:
            for c in range(1, z.shape[1]):
                z[i, c] = moved[i, c]


@borrowing
def propagate_sensitivities(
    z, inputs, inactive0, inactive1, dt, input_slopes, system, work, reached
):
    """One RK4 step of a state and its sensitivities z (4, 5 + n_free), in place.

    z is the state, its derivatives by any four numbers (the start, say) and by the free parameters;
    those of inactive states are zero throughout. Arguments as of `step_with_jacobian`, `work.stage`
    and `reached` of the shape of z.
    """
    step_with_jacobian(z, inputs, inactive0, inactive1, dt, input_slopes, system, work, reached)
    _chain(system.active, reached, z, work.stage)
    for i in range(N_STATES):
        z[i, 0] = reached[i, 0]
