"""The one right-hand side, one step of it and the exact derivative of the step, compiled.

Simulation, EKF, UKF and residuals all evaluate the arrays of `terms.Structure`, so that compiled
code is cached once for every model: `batch` the rates, at one point or many, and `sensitivity` a
step with its derivative. Here are both for one state at a time.
States are (u, a, b, angle); a state that is not active is held at the value given, which is how
the surge system takes v and r from the measurements and the yaw-sway system takes u.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.jit import borrowing, kernel
from auvident.physics.batch import invert_rows, place_inputs, rates, step_points
from auvident.physics.sensitivity import (
    N_PLACES,
    N_POINTS,
    N_SLOPES,
    place_parameters,
    step_linear,
)
from auvident.physics.term_tables import (
    LEAD,
    N_INPUTS,
    N_STATES,
    N_VELOCITIES,
    P_ROWS,
    P_SCALARS,
    needed_powers,
    sort_masses,
    sort_slopes,
    sort_terms,
    used_variables,
)

Array = npt.NDArray[Any]

SPEED_LIMIT = 1.0e3  # [m/s, rad/s] a velocity beyond this ran away, whatever the vehicle


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
def _still():
    """No input depends on a free parameter."""
    return np.zeros(N_INPUTS, np.bool_)


@kernel
def _scalars(p):
    """What all points share: powers (placed later), the factor 1, the parameters."""
    scalars = np.ones(P_SCALARS + p.shape[0])
    for i in range(p.shape[0]):
        scalars[P_SCALARS + i] = p[i]
    return scalars


@kernel
def derivative(x, inputs, p, inverse, active, terms, weights, rate):
    """Time derivative of the state.

    Parameters
    ----------
    x : (4,) array
        u, a [m/s], b [rad/s], angle [rad].
    inputs : (3,) array
        Own control angle, other control angle [rad], propeller rate [rev/s].
    p : (n_parameters,) array
    inverse : (3, 3) array
        Inverse mass matrix from `inverse_mass`.
    active : (4,) bool array
    terms, weights : arrays of `terms.Structure`
    rate : (4,) array, filled
    """
    table, sorted_weights = sort_terms(
        active, np.zeros(p.shape[0], np.bool_), _still(), terms, weights
    )
    used, scalars = used_variables(active, terms), _scalars(p)
    place_inputs(inputs, used, scalars)
    rate[:] = 0.0
    rates(
        1,
        0.0,
        x,
        x,
        active,
        used,
        table,
        sorted_weights,
        needed_powers(active, _still(), terms),
        inverse.reshape((9, 1)),
        np.empty(N_STATES),
        scalars,
        np.empty((P_ROWS, 1)),
        np.empty((N_VELOCITIES, 1)),
        x.reshape((N_STATES, 1)),
        rate.reshape((N_STATES, 1)),
    )


@kernel
def _coefficients(p, table, weights):
    """Weight times parameter of every term."""
    coefficient = np.empty(weights.shape[0])
    for k in range(weights.shape[0]):
        coefficient[k] = weights[k, 0] * p[table[k, 1]]
    return coefficient


@kernel
def step(x, inputs, given0, given1, dt, p, inverse, active, terms, weights, out):
    """One RK4 step of the active states; inputs are constant (step means) over the step."""
    table, sorted_weights = sort_terms(
        active, np.zeros(p.shape[0], np.bool_), _still(), terms, weights
    )
    work = np.empty((3, N_STATES, 1))
    for i in range(N_STATES):
        out[i] = x[i]
    step_points(
        1,
        inputs,
        given0,
        given1,
        dt,
        active,
        used_variables(active, terms),
        table,
        sorted_weights,
        needed_powers(active, _still(), terms),
        inverse.reshape((9, 1)),
        np.empty(N_STATES),
        _scalars(p),
        np.empty((P_ROWS, 1)),
        np.empty((N_VELOCITIES, 1)),
        out.reshape((N_STATES, 1)),
        work[0],
        work[1],
        work[2],
    )
    for i in range(N_STATES):
        if not active[i]:
            out[i] = given1[i]


@kernel
def step_with_sensitivities(
    x,
    inputs,
    given0,
    given1,
    dt,
    p,
    inverse,
    active,
    terms,
    weights,
    mass,
    mass_weights,
    column,
    input_slopes,
    input_columns,
    s_x,
    out,
):
    """One RK4 step and the exact derivative of the step.

    `input_slopes` (9, k) are the derivatives of the inputs by the free parameters
    `input_columns` (k,).

    `s_x` (4, 4 + n_free) comes in as d x/d(x_start, p_free) and leaves as the same after the
    step; with ``[I, 0]`` it returns the transition matrix and the parameter sensitivity.
    """
    scale, columns = np.ones(s_x.shape[1] - N_STATES), 1 + s_x.shape[1]
    moving = np.full(N_INPUTS, input_columns.shape[0] > 0)
    table, sorted_weights, partials = sort_slopes(active, p, column, scale, moving, terms, weights)
    sorted_mass, sorted_mass_weights = sort_masses(active, column, scale, mass, mass_weights)
    work, rate = np.zeros((3, N_STATES, columns)), np.zeros((N_STATES, N_POINTS))
    z = work[0]
    for i in range(N_STATES):
        z[i, 0] = x[i]
        if active[i]:
            for c in range(s_x.shape[1]):
                z[i, 1 + c] = s_x[i, c]
    step_linear(
        z,
        inputs,
        given0,
        given1,
        dt,
        active,
        used_variables(active, terms),
        table,
        sorted_weights,
        partials,
        sorted_mass,
        sorted_mass_weights,
        _coefficients(p, table, sorted_weights),
        inverse.reshape((9, 1)),
        input_slopes,
        input_columns + LEAD,
        np.ones(N_PLACES),
        np.zeros((N_VELOCITIES, 1)),
        np.zeros((N_VELOCITIES, N_SLOPES)),
        work[1],
        rate,
        work[2],
    )
    for i in range(N_STATES):
        out[i] = z[i, 0]
        if active[i]:
            for c in range(s_x.shape[1]):
                s_x[i, c] = z[i, 1 + c]


@kernel
def _ran_away(x):
    """Whether a velocity of x (4, >= 1) is not finite or beyond any vehicle's."""
    for i in range(N_VELOCITIES):  # noqa: SIM110 (compiled: no generator)
        if not abs(x[i, 0]) < SPEED_LIMIT:
            return True
    return False


@kernel
def _moving(input_slopes):
    """Inputs (9,) that have a slope anywhere."""
    moving = np.zeros(N_INPUTS, np.bool_)
    for i in range(N_INPUTS):
        for k in range(input_slopes.shape[0]):
            for c in range(input_slopes.shape[2]):
                if input_slopes[k, i, c] != 0.0:
                    moving[i] = True
                    break
            if moving[i]:
                break
    return moving


@kernel
def simulate_with_sensitivities(
    x0,
    inputs,
    input_slopes,
    input_columns,
    given,
    gain,
    dt,
    p,
    active,
    terms,
    weights,
    mass,
    mass_weights,
    column,
    scale,
    z,
):
    """States over a whole record with their derivatives by the start and the free parameters.

    Parameters
    ----------
    x0 : (4,) array
    inputs : (n, 9) or (n, 3) array
    input_slopes : (n, 9, k) array
        Derivatives of the inputs by the parameters in the columns `input_columns` (k,), counted
        among the free ones; in units of `scale`.
    given : (n, 4) array
        Values of the inactive states; of the active ones where the gain pulls them.
    gain : (4,) array
        Observer gain: share of the distance to `given` that each active state is moved by after
        every step. Zero runs free.
    column : (n_parameters,) int array
        Column of each parameter among the free ones, or -1.
    scale : (n_free,) array
        Unit of each free parameter.
    z : (n, 4, 1 + 4 + n_free) array, filled
        State, its derivatives by the start state, by the free parameters; not touched from the
        row on at which the simulation ran away.

    Returns
    -------
    bool
        False when the simulation ran away or the mass matrix is not positive definite.
    """
    n, columns = inputs.shape[0], z.shape[2]
    moving = _moving(input_slopes)
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
    work, rate = np.zeros((3, N_STATES, columns)), np.zeros((N_STATES, N_POINTS))
    now, stage, total = work[0], work[1], work[2]
    places = input_columns + LEAD
    for i in range(N_STATES):
        now[i, 0] = x0[i]
        if active[i]:
            now[i, 1 + i] = 1.0
    _keep(now, 0, z)
    for k in range(n - 1):
        step_linear(
            now,
            inputs[k],
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
            input_slopes[k],
            places,
            value,
            f,
            f_x,
            stage,
            rate,
            total,
        )
        if _ran_away(now):
            return False
        for i in range(N_STATES):
            if active[i] and gain[i] > 0.0:
                now[i, 0] += gain[i] * (given[k + 1, i] - now[i, 0])
                for c in range(1, columns):
                    now[i, c] *= 1.0 - gain[i]
        _keep(now, k + 1, z)
    return True


@borrowing
def _keep(now, k, z):
    """Copy the state and its derivatives to row k of z."""
    for i in range(now.shape[0]):
        for c in range(now.shape[1]):
            z[k, i, c] = now[i, c]


def simulate_states(
    x0: Array,
    inputs: Array,
    given: Array,
    dt: float,
    p: Array,
    active: Array,
    terms: Array,
    weights: Array,
    mass: Array,
    mass_weights: Array,
) -> Array:
    """States over a whole record from its initial state and inputs alone.

    Parameters
    ----------
    x0 : (4,) array
    inputs : (n, 9) or (n, 3) array
    given : (n, 4) array
        Values of the inactive states (ignored for active ones).

    Returns
    -------
    (n, 4) array
        NaN from the row on at which the simulation ran away; all NaN when the mass matrix is
        not positive definite.
    """
    z = np.full((len(inputs), N_STATES, LEAD), np.nan)
    simulate_with_sensitivities(
        x0,
        inputs,
        np.zeros((len(inputs), N_INPUTS, 0)),
        np.zeros(0, dtype=np.int64),
        given,
        np.zeros(N_STATES),
        dt,
        p,
        active,
        terms,
        weights,
        mass,
        mass_weights,
        np.full(len(p), -1),
        np.zeros(0),
        z,
    )
    states: Array = z[:, :, 0].copy()
    return states
