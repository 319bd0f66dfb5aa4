"""One step of one state with its derivative.

Everything is linear in the parameters and a product of powers in the states, hence every
derivative is exact and comes from the same terms as the rates (`batch`, which says why there are
two), sorted by `term_tables.sort_slopes`.

With k = M^-1 F(x, p) the rate of a state (and d angle/dt = b), a step of RK4 is::

    x_0 = x,    x_1 = x + dt/2 k_0,    x_2 = x + dt/2 k_1,    x_3 = x + dt k_2
    x(end) = x + dt/6 (k_0 + 2 k_1 + 2 k_2 + k_3)

First the four points x_0 .. x_3 are passed in order; powers, slopes dF/dx and rates are kept, each
in a row of four numbers, one a point (`rows`). Then the chain rule goes through the points
backwards and leaves the weight that every force at every point has in the states at the end, four
states in a row (`_weigh_forces`). With these the derivative by a parameter is a sum over the four
points (`_add_parameters`)::

    dx_i(end)/dp = sum over s of  dx_i(end)/dF_s (dF_s/dp - dM/dp k_s)

Forwards, every column of dx/dp would have to be carried from point to point.
"""

import math
from typing import NamedTuple

import numpy as np

from auvident.jit import borrowing, kernel
from auvident.physics.batch import ADVANCE, N_POINTS, SHARE, inverse_mass
from auvident.physics.rows import (
    add_product,
    add_scaled,
    add_weighted,
    fill,
    place_product,
    place_scaled,
)
from auvident.physics.term_tables import (
    LEAD,
    N_INPUTS,
    N_PARTIALS,
    N_POSITIONS,
    N_POWERS,
    N_STATES,
    N_VARIABLES,
    N_VELOCITIES,
    ONE,
    SLOPES,
    first_terms,
    sort_masses,
    sort_slopes,
    standing_in,
)

RATES = SLOPES + N_VARIABLES * N_POWERS  # place of the first rate, after the derivatives of powers
N_PLACES = RATES + N_STATES  # values of a point: powers, 1, derivatives of the powers, rates


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
    first : (4,) uint array
        From `term_tables.first_terms`.
    mass, mass_weights : arrays from `term_tables.sort_masses`
    coefficient : (m,) array
        Weight times parameter of every term.
    inverse : (9, 1) array
        Inverse mass matrix, row by row.
    input_columns : (k,) int array
        Columns (after `LEAD` others) of the parameters that the inputs depend on.
    unit : (4, 4) array
        Derivatives of the active states by themselves.
    """

    active: np.ndarray
    used: np.ndarray
    moving: np.ndarray
    table: np.ndarray
    weights: np.ndarray
    partials: np.ndarray
    first: np.ndarray
    mass: np.ndarray
    mass_weights: np.ndarray
    coefficient: np.ndarray
    inverse: np.ndarray
    input_columns: np.ndarray
    unit: np.ndarray


class StepWork(NamedTuple):
    """Work arrays of a step. Places of what is not active or not used are never written.

    Attributes
    ----------
    value : (N_PLACES, 4) array
        Powers, 1, derivatives of the powers, and rates, by point.
    f : (3,) array
        Forces.
    f_x : (3 * 19, 4) array
        Slopes of the forces by point; that of force e by number i (states, then inputs) in row
        19 e + i.
    weight : (12, 4) array
        Weights of the forces in the states at the end; that of force e at point s in row 4 e + s.
    x_x, x_k : (4, 4) array
        Derivatives of the states at the end by the state at a point (rows), and by its rates.
    stage : (4, >= 1) array
        State at the point.
    """

    value: np.ndarray
    f: np.ndarray
    f_x: np.ndarray
    weight: np.ndarray
    x_x: np.ndarray
    x_k: np.ndarray
    stage: np.ndarray


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
    used, unit = standing_in(table), np.zeros((N_STATES, N_STATES))
    for i in range(N_STATES):
        unit[i, i] = 1.0 if active[i] else 0.0
    system = System(
        active,
        used,
        used[N_POSITIONS:] & moving,
        table,
        weights,
        partials,
        first_terms(table),
        mass,
        mass_weights,
        coefficient,
        inverse.reshape((9, 1)),
        input_columns + LEAD,
        unit,
    )
    return system, determinant


@kernel
def step_work(columns):
    """Work arrays for sensitivities of that many columns."""
    return StepWork(
        np.ones((N_PLACES, N_POINTS)),
        np.zeros(N_VELOCITIES),
        np.zeros((N_VELOCITIES * N_PARTIALS, N_POINTS)),
        np.zeros((N_VELOCITIES * N_POINTS, N_STATES)),
        np.zeros((N_STATES, N_STATES)),
        np.zeros((N_STATES, N_STATES)),
        np.zeros((N_STATES, columns)),
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
            _place_powers(N_POSITIONS + i, inputs[i], 0, value)
            _repeat((N_POSITIONS + i) * N_POWERS, value)
            if moving[i]:
                _place_slopes(N_POSITIONS + i, inputs[i], 1.0, 0, value)
                _repeat(SLOPES + (N_POSITIONS + i) * N_POWERS, value)


@borrowing
def _repeat(at, value):
    """What stands at the first point for each power of a variable, at all points."""
    for power in range(N_POWERS):
        fill(value, at + power, value[at + power, 0])


@borrowing
def _add_forces(first, table, coefficient, point, value, f):
    """Forces at a point; the table is sorted by equation."""
    for e in range(N_VELOCITIES):
        total = 0.0
        for k in range(first[e], first[e + 1]):
            a, b, c = table[k, 3], table[k, 4], table[k, 5]
            total += coefficient[k] * (value[a, point] * value[b, point] * value[c, point])
        f[e] = total


@borrowing
def _add_slopes(partials, coefficient, value, f_x):
    """Slopes of the forces at all points, by states and inputs; the table is sorted by both."""
    for k in range(partials.shape[0]):
        w, at = coefficient[partials[k, 0]], partials[k, 1]
        a, b, c = partials[k, 2], partials[k, 3], partials[k, 4]
        if partials[k, 5]:
            add_product(f_x, at, w, value, a, b, c)
        else:
            place_product(f_x, at, w, value, a, b, c)


@borrowing
def _evaluate_point(point, system, work):
    """Rates of the state stage[:, 0] at a point."""
    inverse, value, f, stage = system.inverse, work.value, work.f, work.stage
    _place_states(stage, system.active, system.used, point, value)
    _add_forces(system.first, system.table, system.coefficient, point, value, f)
    x, y, n = f[0], f[1], f[2]
    for i in range(N_VELOCITIES):
        j = 3 * i
        rate = inverse[j, 0] * x + inverse[j + 1, 0] * y + inverse[j + 2, 0] * n
        value[RATES + i, point] = rate
    value[RATES + 3, point] = stage[2, 0] if system.active[3] else 0.0


@borrowing
def _weigh_forces(dt, system, work, reached):
    """Weight of every force in the states at the end of a step, and d x(end)/d x.

    The chain rule from the last point s = 3 to the first, each of them by the states at the end::

        k_s = dx(end)/dk_s = dt SHARE_s/6 + dt ADVANCE_s x_(s+1),    x_4 = 0
        weight_s = dx(end)/dF_s = k_s M^-1
        x_s = dx(end)/dx_s = weight_s dF/dx(x_s),  by b also k_s of the angle
        dx(end)/dx = 1 + x_0 + x_1 + x_2 + x_3
    """
    inverse, unit, f_x, weight = system.inverse, system.unit, work.f_x, work.weight
    x, k = work.x_x, work.x_k
    for j in range(N_STATES):
        fill(x, j, 0.0)
        place_scaled(reached, 1 + j, 1.0, unit, j)
    for point in range(N_POINTS - 1, -1, -1):
        for j in range(N_STATES):
            place_scaled(k, j, ADVANCE[point] * dt, x, j)
            add_scaled(k, j, SHARE[point] * (dt / 6.0), unit, j)
        for e in range(N_VELOCITIES):
            place_scaled(weight, N_POINTS * e + point, inverse[e, 0], k, 0)
            add_scaled(weight, N_POINTS * e + point, inverse[3 + e, 0], k, 1)
            add_scaled(weight, N_POINTS * e + point, inverse[6 + e, 0], k, 2)
        for j in range(N_STATES):
            place_scaled(x, j, f_x[j, point], weight, point)
            add_scaled(x, j, f_x[N_PARTIALS + j, point], weight, N_POINTS + point)
            add_scaled(x, j, f_x[2 * N_PARTIALS + j, point], weight, 2 * N_POINTS + point)
        if system.active[2]:
            add_scaled(x, 2, 1.0, k, 3)
        for j in range(N_STATES):
            add_scaled(reached, 1 + j, 1.0, x, j)


@borrowing
def _add_parameters(system, work, reached):
    """Derivatives by the parameters of the terms, and of the mass matrix.

    A free mass acts like the force -dM/dp k: from M k = F follows M dk/dp = dF/dp - dM/dp k.
    """
    table, weights = system.table, system.weights
    mass, mass_weights = system.mass, system.mass_weights
    value, weight = work.value, work.weight
    for k in range(weights.shape[0]):
        w, first = weights[k, 1], N_POINTS * table[k, 0]
        if w != 0.0:
            a, b, c = table[k, 3], table[k, 4], table[k, 5]
            add_weighted(reached, table[k, 2], weight, first, w, value, a, b, c)
    for k in range(mass.shape[0]):
        w, first = -mass_weights[k, 1], N_POINTS * mass[k, 0]
        if w != 0.0:
            rate = RATES + mass[k, 1]
            add_weighted(reached, mass[k, 4], weight, first, w, value, rate, ONE, ONE)


@borrowing
def _add_inputs(system, input_slopes, work, reached):
    """Derivatives by the parameters that inputs depend on; inputs hold over the step."""
    moving, input_columns, by = system.moving, system.input_columns, work.x_k
    for l in range(N_INPUTS):  # noqa: E741
        if moving[l]:
            fill(by, 0, 0.0)  # of the states at the end by input l
            for e in range(N_VELOCITIES):
                for point in range(N_POINTS):
                    slope = work.f_x[N_PARTIALS * e + N_STATES + l, point]
                    add_scaled(by, 0, slope, work.weight, N_POINTS * e + point)
            for k in range(input_columns.shape[0]):
                add_scaled(reached, input_columns[k], input_slopes[l, k], by, 0)


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
    reached : (5 + n_free, 4) array, filled
        State reached, inactive ones at their value at the end of the step; its derivatives by x and
        by the free parameters, zero for inactive states.
    """
    active, stage, value = system.active, work.stage, work.value
    _place_inputs(inputs, system.used, system.moving, value)
    for i in range(N_STATES):
        stage[i, 0] = x[i, 0] if active[i] else inactive0[i]
    for point in range(N_POINTS):
        _evaluate_point(point, system, work)
        fraction, advance = ADVANCE[point], ADVANCE[point] * dt
        for i in range(N_STATES):
            if active[i]:
                stage[i, 0] = x[i, 0] + advance * value[RATES + i, point]
            else:
                stage[i, 0] = inactive0[i] + fraction * (inactive1[i] - inactive0[i])
    _add_slopes(system.partials, system.coefficient, value, work.f_x)
    for i in range(N_STATES):
        k = RATES + i
        change = value[k, 0] + 2.0 * value[k, 1] + 2.0 * value[k, 2] + value[k, 3]
        reached[0, i] = x[i, 0] + dt / 6.0 * change if active[i] else inactive1[i]
    _weigh_forces(dt, system, work, reached)
    for c in range(LEAD, reached.shape[0]):
        fill(reached, c, 0.0)
    _add_parameters(system, work, reached)
    _add_inputs(system, input_slopes, work, reached)


@borrowing
def _chain(active, reached, z, moved):
    """Derivatives z after a step: dx(end)/dx z, and dx(end)/dp on top of the last columns."""
    for i in range(N_STATES):
        if active[i]:
            u, a, b, angle = reached[1, i], reached[2, i], reached[3, i], reached[4, i]
            for c in range(1, z.shape[1]):
                moved[i, c] = u * z[0, c] + a * z[1, c] + b * z[2, c] + angle * z[3, c]
            for c in range(LEAD, z.shape[1]):
                moved[i, c] += reached[c, i]
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
    of the shape of z.
    """
    step_with_jacobian(z, inputs, inactive0, inactive1, dt, input_slopes, system, work, reached)
    _chain(system.active, reached, z, work.stage)
    for i in range(N_STATES):
        z[i, 0] = reached[0, i]
