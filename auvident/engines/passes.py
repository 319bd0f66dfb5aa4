"""EKF and UKF passes over all records of a stage in one augmented state, compiled.

The state is [theta, x_1, ..., x_k]; a record that ends drops out of it. At each time step the
readings are taken one scalar at a time (their noises are independent), so a missing sample of
one channel costs nothing; then every block is predicted one step.

In the parameters a pass is linear about where it starts: both filters carry the states as they
stand, but take the influence of theta from theta = 0. Linearised about an estimate that moves, a
filter gains information in directions that no reading shows, such as the common scale of an
equation, and in the end believes what it cannot know (Huang, Mourikis and Roumeliotis 2010, first-
estimates Jacobians). The next pass starts where this one ended.
"""

import math
from typing import NamedTuple

import numpy as np

from auvident.engines.sigma_points import (
    DIVERGED,
    NOT_POSITIVE,
    SINGULAR,
    lean_to_mean,
    recombine,
    spread_inputs,
    spread_row,
    stop,
)
from auvident.estimation.kalman import (
    LANES,
    predict_with,
    update_with,
    upper_cholesky,
    whole_vectors,
)
from auvident.jit import borrowing, kernel
from auvident.physics.batch import invert_masses, step_points
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
    N_POSITIONS,
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


class Case(NamedTuple):
    """What a pass runs on: `FilterProblem` and its structure as arrays, and what it fills.

    The fields are taken out once per call of a kernel, never inside a loop.
    """

    active_index: np.ndarray
    lengths: np.ndarray
    inputs: np.ndarray
    given: np.ndarray
    measured: np.ndarray
    dt: float
    base: np.ndarray  # parameters at theta = 0
    column: np.ndarray
    scale: np.ndarray
    active: np.ndarray
    channels: np.ndarray
    sensor: np.ndarray
    sensor_variance: np.ndarray
    input_slopes: np.ndarray
    input_columns: np.ndarray
    offset: np.ndarray
    reading_slopes: np.ndarray
    reading_columns: np.ndarray
    q_theta: np.ndarray
    q_x: np.ndarray
    whitened: np.ndarray
    states: np.ndarray
    history: np.ndarray
    history_std: np.ndarray
    fault: np.ndarray


@borrowing
def _take_readings(
    t,
    alive,
    mean,
    covariance,
    n_theta,
    index,
    given,
    measured,
    channels,
    sensor,
    sensor_variance,
    offset,
    reading_slopes,
    reading_columns,
    whitened,
    fault,
    x,
    gradient,
    by_theta,
    projected,
    gain,
    half,
):
    """Update with every reading at step t; returns log-likelihood and count."""
    n_x, n = index.shape[0], n_theta + alive * index.shape[0]
    wide, log_likelihood, count = whole_vectors(n, covariance), 0.0, 0
    for j in range(alive):
        first = n_theta + j * n_x
        for c in range(N_STATES):
            innovation = measured[j, t, c]
            if not channels[c] or math.isnan(innovation):
                continue
            for i in range(N_STATES):
                x[i] = given[j, t, i]
            for i in range(n_x):
                x[index[i]] = mean[first + i]
                gradient[i] = sensor[c, index[i]]
            for i in range(N_STATES):
                if sensor[c, i] != 0.0:
                    innovation -= sensor[c, i] * x[i]
            if offset.shape[1] > 0:
                innovation -= offset[j, t, c]
            for i in range(reading_columns.shape[0]):
                by_theta[i] = reading_slopes[j, t, c, i]
                innovation -= by_theta[i] * mean[reading_columns[i]]
            spread = update_with(
                mean,
                covariance,
                n,
                wide,
                first,
                gradient,
                reading_columns,
                by_theta,
                innovation,
                sensor_variance[c],
                projected,
                gain,
                half,
            )
            if spread <= 0.0:
                stop(fault, t, j, c, NOT_POSITIVE)
                return log_likelihood, count
            whitened[j, t, c] = innovation / math.sqrt(spread)
            log_likelihood -= 0.5 * (whitened[j, t, c] ** 2 + math.log(2.0 * math.pi * spread))
            count += 1
    return log_likelihood, count


@borrowing
def _store(t, alive, mean, covariance, n_theta, index, given, states, history, history_std):
    """Keep the means of all states and parameters at step t; of parameters also the std."""
    for l in range(n_theta):  # noqa: E741
        history[t, l] = mean[l]
        history_std[t, l] = math.sqrt(max(covariance[l, l], 0.0))
    for j in range(alive):
        for i in range(N_STATES):
            states[j, t, i] = given[j, t, i]
        for i in range(index.shape[0]):
            states[j, t, index[i]] = mean[n_theta + j * index.shape[0] + i]


@borrowing
def records_alive(lengths, t):
    """How many records reach step t; they are sorted, longest first."""
    alive = 0
    while alive < lengths.shape[0] and lengths[alive] > t:
        alive += 1
    return alive


@kernel
def _small(n_x):
    """Work arrays: a state, a gradient, given states at both ends of a step."""
    return np.empty(N_STATES), np.empty(n_x), np.empty(N_STATES), np.empty(N_STATES)


@borrowing
def _place_step(j, t, inputs, given, u, g0, g1):
    """Copy the inputs and given states of a step (a view of them would cost more)."""
    for i in range(u.shape[0]):
        u[i] = inputs[j, t, i]
    for i in range(N_STATES):
        g0[i], g1[i] = given[j, t, i], given[j, t + 1, i]


@borrowing
def _place_input_slopes(j, t, input_slopes, u_slopes):
    """Slopes of the inputs of a step (a view of them would cost more)."""
    for i in range(u_slopes.shape[0]):
        for k in range(u_slopes.shape[1]):
            u_slopes[i, k] = input_slopes[j, t, i, k]


@kernel
def ekf_pass(mean, final, case, terms, weights, mass, mass_weights):
    """Run the EKF over all records; returns log-likelihood and number of readings.

    Parameters
    ----------
    mean, final : (n,) and (n, n) arrays
        Mean and covariance of the whole state, before and after. The covariance is worked on in
        an array whose rows are whole vector registers.
    case : Case
    terms, weights, mass, mass_weights : arrays of `terms.Structure`
    """
    (
        index,
        lengths,
        inputs,
        given,
        measured,
        dt,
        base,
        column,
        scale,
        active,
        channels,
        sensor,
        sensor_variance,
        input_slopes,
        input_columns,
        offset,
        reading_slopes,
        reading_columns,
        q_theta,
        q_x,
        whitened,
        states,
        history,
        history_std,
        fault,
    ) = case
    n_x, n, n_theta = index.shape[0], mean.shape[0], scale.shape[0]
    moving, places = np.full(N_INPUTS, input_columns.shape[0] > 0), input_columns + LEAD
    u_slopes = np.zeros((N_INPUTS, places.shape[0]))
    table, sorted_weights, partials = sort_slopes(
        active, base, column, scale, moving, terms, weights
    )
    sorted_mass, sorted_mass_weights = sort_masses(active, column, scale, mass, mass_weights)
    used, coefficient = used_variables(active, terms), np.empty(table.shape[0])
    m, inverse = np.empty((10, 1)), np.empty((9, 1))
    value, f = np.ones(N_PLACES), np.zeros((N_VELOCITIES, 1))
    f_x = np.zeros((N_VELOCITIES, N_SLOPES))
    now, stage = np.zeros((N_STATES, 1)), np.zeros((N_STATES, 1))
    rate, reached = np.zeros((N_STATES, N_POINTS)), np.zeros((N_STATES, LEAD + n_theta))
    width = n + (-n) % LANES
    slopes, rows = np.empty((n - n_theta, n_x + n_theta)), np.empty((n - n_theta, width))
    covariance = np.zeros((n, width))
    for i in range(n):
        for c in range(n):
            covariance[i, c] = final[i, c]
    x, gradient, g0, g1 = _small(n_x)
    u, by_theta = np.empty(inputs.shape[2]), np.empty(reading_columns.shape[0])
    projected, gain, half = np.empty(width), np.empty(width), np.empty(width)
    log_likelihood, count = 0.0, 0
    if (
        not place_parameters(
            base,
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
        stop(fault, 0, 0, 0, SINGULAR)
        return log_likelihood, count
    for t in range(lengths[0]):
        alive = records_alive(lengths, t)
        gained, taken = _take_readings(
            t,
            alive,
            mean,
            covariance,
            n_theta,
            index,
            given,
            measured,
            channels,
            sensor,
            sensor_variance,
            offset,
            reading_slopes,
            reading_columns,
            whitened,
            fault,
            x,
            gradient,
            by_theta,
            projected,
            gain,
            half,
        )
        log_likelihood += gained
        count += taken
        _store(t, alive, mean, covariance, n_theta, index, given, states, history, history_std)
        alive = records_alive(lengths, t + 1)
        if fault[3] > 0 or alive == 0:
            break
        for j in range(alive):
            first = n_theta + j * n_x
            for i in range(n_x):
                now[index[i], 0] = mean[first + i]
            _place_step(j, t, inputs, given, u, g0, g1)
            _place_input_slopes(j, t, input_slopes, u_slopes)
            linear_step(
                now,
                u,
                g0,
                g1,
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
                u_slopes,
                places,
                value,
                f,
                f_x,
                stage,
                rate,
                reached,
            )
            for i in range(n_x):
                mean[first + i] = reached[index[i], 0]
                for c in range(n_x):
                    slopes[j * n_x + i, c] = reached[index[i], 1 + index[c]]
                for c in range(n_theta):
                    slopes[j * n_x + i, n_x + c] = reached[index[i], LEAD + c]
                    mean[first + i] += reached[index[i], LEAD + c] * mean[c]
                if not abs(mean[first + i]) < SPEED_LIMIT and fault[3] == 0:
                    stop(fault, t, j, index[i], DIVERGED)
        if fault[3] > 0:
            break
        wide = whole_vectors(n_theta + alive * n_x, covariance)
        predict_with(covariance, slopes, n_theta, n_x, alive, wide, q_theta, q_x, rows)
    for i in range(n):
        for c in range(n):
            final[i, c] = covariance[i, c]
    return log_likelihood, count


@kernel
def ukf_pass(mean, covariance, case, terms, weights, mass, mass_weights, spread):
    """Run the UKF over all records; returns log-likelihood and number of readings.

    Sigma points: the centre, which is the mean of the states at theta = 0, then a pair for each
    column of the factor of the covariance, `spread` standard deviations away. The parameter block
    does not move in the prediction and is left as it is. Arguments as those of `ekf_pass`.
    """
    (
        index,
        lengths,
        inputs,
        given,
        measured,
        dt,
        base,
        column,
        scale,
        active,
        channels,
        sensor,
        sensor_variance,
        input_slopes,
        input_columns,
        offset,
        reading_slopes,
        reading_columns,
        q_theta,
        q_x,
        whitened,
        states,
        history,
        history_std,
        fault,
    ) = case
    n_x, n, n_theta = index.shape[0], mean.shape[0], scale.shape[0]
    moves, size = column >= 0, 2 * n + 1
    moving, differ = np.flatnonzero(moves), 1 + 2 * n_theta
    used = used_variables(active, terms)
    moved_inputs = used[N_POSITIONS:].copy()
    if input_columns.shape[0] == 0:
        moved_inputs[:] = False
    table, sorted_weights = sort_terms(active, moves, moved_inputs, terms, weights)
    powers = needed_powers(active, moved_inputs, terms)
    scalars, rows = np.ones(P_SCALARS + base.shape[0]), np.zeros((P_ROWS + base.shape[0], size))
    for i in range(base.shape[0]):
        scalars[P_SCALARS + i] = base[i]
    m, inverse, force = np.empty((10, size)), np.empty((9, size)), np.empty((N_VELOCITIES, size))
    points, stage = np.empty((N_STATES, size)), np.empty((N_STATES, size))
    rate, total, fixed = np.empty((N_STATES, size)), np.empty((N_STATES, size)), np.empty(N_STATES)
    upper, moved = np.zeros((n, n)), np.zeros((n - n_theta, size))
    x, gradient, g0, g1 = _small(n_x)
    u, by_theta = np.empty(inputs.shape[2]), np.empty(reading_columns.shape[0])
    projected, gain, half = np.empty(n), np.empty(n), np.empty(n)
    log_likelihood, count = 0.0, 0
    for t in range(lengths[0]):
        alive = records_alive(lengths, t)
        gained, taken = _take_readings(
            t,
            alive,
            mean,
            covariance,
            n_theta,
            index,
            given,
            measured,
            channels,
            sensor,
            sensor_variance,
            offset,
            reading_slopes,
            reading_columns,
            whitened,
            fault,
            x,
            gradient,
            by_theta,
            projected,
            gain,
            half,
        )
        log_likelihood += gained
        count += taken
        _store(t, alive, mean, covariance, n_theta, index, given, states, history, history_std)
        alive = records_alive(lengths, t + 1)
        if fault[3] > 0 or alive == 0:
            break
        bad = upper_cholesky(covariance, n_theta + alive * n_x, upper)
        if bad >= 0:
            stop(fault, t, max(bad - n_theta, 0) // n_x, bad, NOT_POSITIVE)
            break
        lean_to_mean(mean, n_theta, n_theta + alive * n_x, upper, half)
        all_points = 1 + 2 * (n_theta + alive * n_x)
        for k in range(moving.shape[0]):
            i, c = moving[k], column[moving[k]]
            spread_row(base[i], scale[c], c, upper, spread, all_points, P_ROWS + i, rows)
        if (
            not invert_masses(differ, active, mass, mass_weights, moves, scalars, rows, m, inverse)
            > 0.0
        ):
            stop(fault, t, 0, 0, SINGULAR)
            break
        for i in range(9):
            for s in range(differ, all_points):
                inverse[i, s] = inverse[i, 0]
        for j in range(alive):
            at = n_theta + j * n_x
            reached = 1 + 2 * (at + n_x)  # the other points leave this record at its mean
            for i in range(n_x):
                spread_row(mean[at + i], 1.0, at + i, upper, spread, reached, index[i], points)
            _place_step(j, t, inputs, given, u, g0, g1)
            spread_inputs(
                j,
                t,
                reached,
                u,
                input_slopes,
                input_columns,
                upper,
                spread,
                moved_inputs,
                rows,
            )
            step_points(
                reached,
                u,
                g0,
                g1,
                dt,
                active,
                used,
                table,
                sorted_weights,
                powers,
                inverse,
                fixed,
                scalars,
                rows,
                force,
                points,
                stage,
                rate,
                total,
            )
            for i in range(n_x):
                for s in range(reached):
                    moved[j * n_x + i, s] = points[index[i], s]
        recombine(
            t,
            alive,
            mean,
            covariance,
            n_theta,
            index,
            spread,
            upper,
            half,
            moved,
            projected,
            gain,
            q_theta,
            q_x,
            fault,
        )
        if fault[3] > 0:
            break
    return log_likelihood, count
