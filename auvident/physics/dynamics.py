"""The one right-hand side, its exact Jacobians and one step of it, compiled.

Simulation, EKF, UKF and residuals all call `derivative`. The structure of the equations comes
in as the arrays of `terms.Structure`, so that compiled code is cached once for every model.
States are (u, a, b, angle); a state that is not active is held at the value given, which is how
the surge system takes v and r from the measurements and the yaw-sway system takes u.
"""

import math

import numpy as np
from auvident.jit import kernel

N_STATES = 4
N_VELOCITIES = 3
N_VARIABLES = 8
N_POWERS = 5
SPEED_LIMIT = 1.0e3  # [m/s, rad/s] a velocity beyond this ran away, whatever the vehicle


@kernel
def _powers(x, inputs, value, slope):
    """Every power of every variable, and its derivative (`terms.POWERS`)."""
    variables = (x[0], x[1], x[2], math.sin(x[3]), math.cos(x[3]), inputs[0], inputs[1], inputs[2])
    for i in range(N_VARIABLES):
        y = variables[i]
        absolute = abs(y)
        sign = 1.0 if y > 0.0 else (-1.0 if y < 0.0 else 0.0)
        value[i, 0], slope[i, 0] = y, 1.0
        value[i, 1], slope[i, 1] = absolute, sign
        value[i, 2], slope[i, 2] = y * y, 2.0 * y
        value[i, 3], slope[i, 3] = y * absolute, 2.0 * absolute
        value[i, 4], slope[i, 4] = y * y * y, 3.0 * y * y


@kernel
def inverse_mass(p, mass, mass_weights, active, inverse):
    """Inverse of the 3x3 mass matrix with inactive rows and columns replaced by identity.

    Returns the determinant.
    """
    m = np.zeros((N_VELOCITIES, N_VELOCITIES))
    for k in range(mass.shape[0]):
        i, j = mass[k, 0], mass[k, 1]
        if active[i] and active[j]:
            m[i, j] += mass_weights[k] * p[mass[k, 2]]
    for i in range(N_VELOCITIES):
        if not active[i]:
            m[i, i] = 1.0
    for i in range(N_VELOCITIES):
        i1, i2 = (i + 1) % 3, (i + 2) % 3
        for j in range(N_VELOCITIES):
            j1, j2 = (j + 1) % 3, (j + 2) % 3
            inverse[j, i] = m[i1, j1] * m[i2, j2] - m[i1, j2] * m[i2, j1]
    determinant = m[0, 0] * inverse[0, 0] + m[0, 1] * inverse[1, 0] + m[0, 2] * inverse[2, 0]
    for i in range(N_VELOCITIES):
        for j in range(N_VELOCITIES):
            inverse[i, j] /= determinant
    return determinant


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
    value = np.empty((N_VARIABLES, N_POWERS))
    slope = np.empty((N_VARIABLES, N_POWERS))
    _powers(x, inputs, value, slope)
    force = np.zeros(N_VELOCITIES)
    for k in range(terms.shape[0]):
        if active[terms[k, 0]]:
            f = weights[k] * p[terms[k, 1]]
            for c in range(2, terms.shape[1], 2):
                if terms[k, c + 1] >= 0:
                    f *= value[terms[k, c], terms[k, c + 1]]
            force[terms[k, 0]] += f
    _accelerate(force, x, inverse, active, rate)


@kernel
def _accelerate(force, x, inverse, active, rate):
    for i in range(N_VELOCITIES):
        rate[i] = 0.0
        if active[i]:
            for j in range(N_VELOCITIES):
                rate[i] += inverse[i, j] * force[j]
    rate[3] = x[2] if active[3] else 0.0


@kernel
def derivative_and_jacobians(
    x, inputs, p, inverse, active, terms, weights, mass, mass_weights, column, rate, j_x, j_p
):
    """As `derivative`, with d rate/d x in `j_x` (4, 4) and d rate/d p in `j_p` (4, n_free).

    ``column[i]`` is the column of parameter i in `j_p`, or -1 when it is not free. Derivatives
    with respect to inactive states are left out (they are given, not estimated).
    """
    value = np.empty((N_VARIABLES, N_POWERS))
    slope = np.empty((N_VARIABLES, N_POWERS))
    _powers(x, inputs, value, slope)
    n_free = j_p.shape[1]
    force = np.zeros(N_VELOCITIES)
    f_x = np.zeros((N_VELOCITIES, N_STATES))
    f_p = np.zeros((N_VELOCITIES, n_free))
    for k in range(terms.shape[0]):
        i = terms[k, 0]
        if active[i]:
            _add_term(k, terms, weights, p, value, slope, x, column, force, f_x, f_p)
    _accelerate(force, x, inverse, active, rate)
    for k in range(mass.shape[0]):  # d(M rate)/dp moved to the right-hand side
        i, j, c = mass[k, 0], mass[k, 1], column[mass[k, 2]]
        if c >= 0 and active[i] and active[j]:
            f_p[i, c] -= mass_weights[k] * rate[j]
    for i in range(N_VELOCITIES):
        for j in range(N_STATES):
            total = 0.0
            if active[i] and active[j]:
                for l in range(N_VELOCITIES):  # noqa: E741
                    total += inverse[i, l] * f_x[l, j]
            j_x[i, j] = total
        for c in range(n_free):
            total = 0.0
            if active[i]:
                for l in range(N_VELOCITIES):  # noqa: E741
                    total += inverse[i, l] * f_p[l, c]
            j_p[i, c] = total
    for j in range(N_STATES):
        j_x[3, j] = 1.0 if (j == 2 and active[3] and active[2]) else 0.0
    j_p[3, :] = 0.0


@kernel
def _add_term(k, terms, weights, p, value, slope, x, column, force, f_x, f_p):
    """Add term k to the forces and to their derivatives."""
    i, parameter = terms[k, 0], terms[k, 1]
    product = 1.0
    for c in range(2, terms.shape[1], 2):
        if terms[k, c + 1] >= 0:
            product *= value[terms[k, c], terms[k, c + 1]]
    f = weights[k] * p[parameter]
    force[i] += f * product
    if column[parameter] >= 0:
        f_p[i, column[parameter]] += weights[k] * product
    for c in range(2, terms.shape[1], 2):
        variable, power = terms[k, c], terms[k, c + 1]
        if power < 0 or variable > 4:
            continue
        others = 1.0
        for d in range(2, terms.shape[1], 2):
            if d != c and terms[k, d + 1] >= 0:
                others *= value[terms[k, d], terms[k, d + 1]]
        part = f * slope[variable, power] * others
        if variable < 3:
            f_x[i, variable] += part
        elif variable == 3:
            f_x[i, 3] += part * math.cos(x[3])
        else:
            f_x[i, 3] -= part * math.sin(x[3])


@kernel
def _place_given(stage, given0, given1, fraction, active):
    """Set the inactive states to the given ones, linear between the ends of the step."""
    for i in range(N_STATES):
        if not active[i]:
            stage[i] = given0[i] + fraction * (given1[i] - given0[i])


@kernel
def step(x, inputs, given0, given1, dt, p, inverse, active, terms, weights, out):
    """One RK4 step of the active states; inputs are constant (step means) over the step."""
    stage = x.copy()
    total = np.zeros(N_STATES)
    rate = np.empty(N_STATES)
    for s in range(4):
        _place_given(stage, given0, given1, (0.0, 0.5, 0.5, 1.0)[s], active)
        derivative(stage, inputs, p, inverse, active, terms, weights, rate)
        share = (1.0, 2.0, 2.0, 1.0)[s]
        advance = (0.5, 0.5, 1.0, 0.0)[s] * dt
        for i in range(N_STATES):
            total[i] += share * rate[i]
            stage[i] = x[i] + advance * rate[i]
    for i in range(N_STATES):
        out[i] = x[i] + dt / 6.0 * total[i] if active[i] else given1[i]


@kernel
def step_with_sensitivities(
    x, inputs, given0, given1, dt, p, inverse, active, terms, weights, mass, mass_weights, column,
    s_x, out,
):  # fmt: skip
    """One RK4 step and the exact derivative of the step.

    `s_x` (4, 4 + n_free) comes in as d x/d(x_start, p_free) and leaves as the same after the
    step; with ``[I, 0]`` it returns the transition matrix and the parameter sensitivity.
    """
    n_free = s_x.shape[1] - N_STATES
    columns = s_x.shape[1]
    stage, rate = x.copy(), np.empty(N_STATES)
    j_x, j_p = np.empty((N_STATES, N_STATES)), np.empty((N_STATES, n_free))
    s_stage, s_rate = s_x.copy(), np.empty((N_STATES, columns))
    total, s_total = np.zeros(N_STATES), np.zeros((N_STATES, columns))
    for s in range(4):
        _place_given(stage, given0, given1, (0.0, 0.5, 0.5, 1.0)[s], active)
        derivative_and_jacobians(
            stage, inputs, p, inverse, active, terms, weights, mass, mass_weights, column,
            rate, j_x, j_p,
        )  # fmt: skip
        share = (1.0, 2.0, 2.0, 1.0)[s]
        advance = (0.5, 0.5, 1.0, 0.0)[s] * dt
        for i in range(N_STATES):
            total[i] += share * rate[i]
            for c in range(columns):
                value = j_p[i, c - N_STATES] if c >= N_STATES else 0.0
                for j in range(N_STATES):
                    value += j_x[i, j] * s_stage[j, c]
                s_rate[i, c] = value
        for i in range(N_STATES):
            stage[i] = x[i] + advance * rate[i]
            for c in range(columns):
                s_total[i, c] += share * s_rate[i, c]
                s_stage[i, c] = s_x[i, c] + advance * s_rate[i, c]
    for i in range(N_STATES):
        out[i] = x[i] + dt / 6.0 * total[i] if active[i] else given1[i]
        for c in range(columns):
            s_x[i, c] += dt / 6.0 * s_total[i, c]


@kernel
def simulate_states(x0, inputs, given, dt, p, active, terms, weights, mass, mass_weights):
    """States over a whole record from its initial state and inputs alone.

    Parameters
    ----------
    x0 : (4,) array
    inputs : (n, 3) array
    given : (n, 4) array
        Values of the inactive states (ignored for active ones).

    Returns
    -------
    (n, 4) array
        NaN from the row on at which the simulation ran away; all NaN when the mass matrix is
        not positive definite.
    """
    n = inputs.shape[0]
    states = np.full((n, N_STATES), np.nan)
    inverse = np.empty((N_VELOCITIES, N_VELOCITIES))
    if not inverse_mass(p, mass, mass_weights, active, inverse) > 0.0:
        return states
    states[0] = x0
    for k in range(n - 1):
        step(
            states[k], inputs[k], given[k], given[k + 1], dt, p, inverse, active, terms, weights,
            states[k + 1],
        )  # fmt: skip
        if _ran_away(states[k + 1]):
            states[k + 1, :] = np.nan
            break
    return states


@kernel
def _ran_away(x):
    """Whether a velocity is not finite or beyond any vehicle's."""
    for i in range(N_VELOCITIES):
        if not abs(x[i]) < SPEED_LIMIT:
            return True
    return False


@kernel
def output_error(
    x0, inputs, given, measured, sensor, sigma, channels, dt, p, active, terms, weights, mass,
    mass_weights, column, scale, gradient, curvature,
):  # fmt: skip
    """Half the sum of squared whitened output errors of one record, with gradient and curvature.

    Parameters
    ----------
    measured : (n, 4) array
        Readings; NaN where there is none.
    sensor : (4, 4) array
        Reading = sensor @ state.
    sigma : (4,) array
        Standard deviation of each channel.
    channels : (4,) bool array
        Channels that count.
    column : (n_parameters,) int array
        Column of each parameter in the gradient, or -1.
    scale : (n_free,) array
        Unit of each free parameter.
    gradient : (n_free,) array, added to
    curvature : (n_free, n_free) array, added to
        Gauss-Newton approximation.

    Returns
    -------
    float
        Infinite when the prediction ran away.
    """
    n, n_free = inputs.shape[0], scale.shape[0]
    x, out = x0.copy(), np.empty(N_STATES)
    s_x = np.zeros((N_STATES, N_STATES + n_free))
    for i in range(N_STATES):
        s_x[i, i] = 1.0
    inverse = np.empty((N_VELOCITIES, N_VELOCITIES))
    if not inverse_mass(p, mass, mass_weights, active, inverse) > 0.0:
        return np.inf
    half = 0.0
    slope = np.empty(n_free)
    for k in range(n):
        for c in range(N_STATES):
            if not channels[c] or math.isnan(measured[k, c]):
                continue
            error = -measured[k, c]
            slope[:] = 0.0
            for i in range(N_STATES):
                if sensor[c, i] != 0.0:
                    error += sensor[c, i] * x[i]
                    for l in range(n_free):  # noqa: E741
                        slope[l] += sensor[c, i] * s_x[i, N_STATES + l]
            error /= sigma[c]
            half += 0.5 * error * error
            for l in range(n_free):  # noqa: E741
                slope[l] *= scale[l] / sigma[c]
                gradient[l] += slope[l] * error
                for m in range(l + 1):
                    curvature[l, m] += slope[l] * slope[m]
        if k == n - 1:
            break
        step_with_sensitivities(
            x, inputs[k], given[k], given[k + 1], dt, p, inverse, active, terms, weights, mass,
            mass_weights, column, s_x, out,
        )  # fmt: skip
        x[:] = out
        if _ran_away(x):
            return np.inf
    return half
