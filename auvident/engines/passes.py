"""EKF and UKF passes over all records of a stage in one augmented state, compiled.

The system, for records j = 1 .. k side by side::

    theta(t+1) = theta(t) + w_theta                          random walk of the parameters
    x_j(t+1)   = f(x_j(t), theta(t), u_j(t)) + w_j           one step of the equations of motion
    z_j(t)     = H x_j(t) + offset_j(t) + slopes_j(t) theta(t) + v_j(t)
    w ~ N(0, Q),    v ~ N(0, R),    [theta, x_1 .. x_k](0) ~ N(x_0, P_0);    Q and R diagonal

The augmented state [theta, x_1, ..., x_k] is `x` in the kernels, P its covariance; a record that
ends drops out of it. At each time step the readings are taken one scalar at a time, so a missing
sample of one channel costs nothing; then every block is predicted one step.

In the parameters a pass is linear about where it starts: both filters carry the states as they
stand, but take the influence of theta from theta = 0. Linearised about an estimate that moves, a
filter gains information in directions that no reading shows, such as the common scale of an
equation, and in the end believes what it cannot know (Huang, Mourikis and Roumeliotis 2010, first-
estimates Jacobians). The next pass starts where this one ended.

Arrays come in bundles (`NamedTuple`). Where references are counted, each use of a bundle counts
all its arrays: a pass took 1.3 times as long. Hence the loops only borrow (`jit.loop`), and a
nested bundle is taken apart before them, which spares the compiler moving all its numbers.
"""

import math
from typing import NamedTuple

import numpy as np

from auvident.engines.sigma_points import (
    DIVERGED,
    NOT_POSITIVE,
    SINGULAR,
    lean_to_mean,
    place_component,
    place_inputs,
    recombine,
    stop,
)
from auvident.estimation.kalman import (
    GainWork,
    ProcessNoise,
    ReadingRow,
    predict,
    update,
    upper_cholesky,
    whole_vectors,
)
from auvident.jit import borrowing, inlined, loop
from auvident.physics.batch import invert_masses, step_points
from auvident.physics.dynamics import SPEED_LIMIT
from auvident.physics.sensitivity import step_with_jacobian
from auvident.physics.term_tables import LEAD, N_INPUTS, N_STATES, P_ROWS
from auvident.physics.terms import Equations


class Logs(NamedTuple):
    """The records side by side, longest first; see `problem.Records` and `problem.Linear`.

    Attributes
    ----------
    lengths : (k,) int array
    inputs : (k, n, 15) or (k, n, 3) array
        u, at theta = 0.
    input_slopes : (k, n, 15, a) array
        du/dtheta, by the columns `Parameters.input_columns`.
    measured_states : (k, n, 4) array
        Values of the inactive states.
    z : (k, n, 4) array
        Readings; NaN where there is none.
    dt : float
        [s]
    """

    lengths: np.ndarray
    inputs: np.ndarray
    input_slopes: np.ndarray
    measured_states: np.ndarray
    z: np.ndarray
    dt: float


class Sensors(NamedTuple):
    """How the readings depend on the state.

    Attributes
    ----------
    channels : (4,) bool array
        Those that are used.
    H : (4, 4) array
        Readings by the states u, a, b, angle.
    R : (4,) array
        Variances.
    offset : (k, n, 4) or (k, 0, 4) array
    slopes : (k, n, 4, b) array
        Readings by theta, in the columns `columns`.
    columns : (b,) int array
    """

    channels: np.ndarray
    H: np.ndarray
    R: np.ndarray
    offset: np.ndarray
    slopes: np.ndarray
    columns: np.ndarray


class Parameters(NamedTuple):
    """Which parameters theta is, and in which units.

    Attributes
    ----------
    p : (n_parameters,) array
        At theta = 0.
    column : (n_parameters,) int array
        Column of each in theta, or -1.
    scale : (n_theta,) array
        Unit of each column.
    input_columns : (a,) int array
        Columns that the inputs depend on.
    """

    p: np.ndarray
    column: np.ndarray
    scale: np.ndarray
    input_columns: np.ndarray


class PassInput(NamedTuple):
    """What a pass runs on: `FilterProblem` and its structure as arrays.

    Attributes
    ----------
    active : (4,) bool array
    active_index : (n_x,) int array
        The active states.
    """

    active: np.ndarray
    active_index: np.ndarray
    logs: Logs
    sensors: Sensors
    parameters: Parameters
    Q: ProcessNoise
    equations: Equations


class PassOutput(NamedTuple):
    """What a pass fills, see `problem.FilterResult`.

    Attributes
    ----------
    whitened, states : (k, n, 4) arrays
    history, history_std : (n, n_theta) arrays
        Of theta.
    fault : (4,) int array
        From `sigma_points.stop`; zeros where nothing is wrong.
    """

    whitened: np.ndarray
    states: np.ndarray
    history: np.ndarray
    history_std: np.ndarray
    fault: np.ndarray


class ReadingWork(NamedTuple):
    """Work arrays of a reading: a whole state (4,), the row of H by block and theta, the gain."""

    state: np.ndarray
    by_block: np.ndarray
    by_theta: np.ndarray
    gain: GainWork


class RowWork(NamedTuple):
    """Copies of one row of the logs: inputs, their slopes, inactive states at both its ends."""

    u: np.ndarray
    slopes: np.ndarray
    inactive0: np.ndarray
    inactive1: np.ndarray


class EkfWork(NamedTuple):
    """Work arrays of the EKF's prediction.

    Attributes
    ----------
    now : (4, 1) array
        State of a record.
    reached : (5 + n_theta, 4) array
        State after the step and its derivatives.
    F : (k * n_x, n_x + n_theta) array
        As `kalman.predict` takes it.
    FP : (k * n_x, >= n) array
    theta0 : (n_theta,) array
        Where the prediction is linear about.
    """

    now: np.ndarray
    reached: np.ndarray
    F: np.ndarray
    FP: np.ndarray
    theta0: np.ndarray


def reading_work(data: PassInput, n: int) -> ReadingWork:
    """Work arrays of readings, for a state of length n."""
    gain, n_columns = GainWork(*np.empty((3, n))), len(data.sensors.columns)
    return ReadingWork(
        np.empty(N_STATES), np.empty(len(data.active_index)), np.empty(n_columns), gain
    )


def row_work(data: PassInput) -> RowWork:
    """Work arrays of a row."""
    slopes = np.zeros((N_INPUTS, len(data.parameters.input_columns)))
    return RowWork(np.empty(data.logs.inputs.shape[2]), slopes, *np.empty((2, N_STATES)))


def ekf_work(data: PassInput, width: int) -> EkfWork:
    """Work arrays of predictions about theta = 0, for a covariance with rows of some width."""
    n_x, n_theta = len(data.active_index), len(data.Q.theta)
    n_rows, reached = len(data.logs.lengths) * n_x, np.zeros((LEAD + n_theta, N_STATES))
    F, FP = np.empty((n_rows, n_x + n_theta)), np.empty((n_rows, width))
    return EkfWork(np.zeros((N_STATES, 1)), reached, F, FP, np.zeros(n_theta))


@borrowing
def records_alive(lengths, t):
    """How many records reach step t; they are sorted, longest first."""
    alive = 0
    while alive < lengths.shape[0] and lengths[alive] > t:
        alive += 1
    return alive


# --- readings ------------------------------------------------------------------------------


@inlined
def take_readings(t, first, n, j, x, P, index, logs, sensors, whitened, fault, work):
    """Update with every reading of record j at step t.

    Parameters
    ----------
    first, n : int
        Where the states of the record begin in x; length of x in use.

    Returns
    -------
    float, int
        Log-likelihood and number of the readings.
    """
    z, channels, variances, columns = logs.z, sensors.channels, sensors.R, sensors.columns
    state, by_block, by_theta, gain = work
    wide, log_likelihood, count = whole_vectors(n, P), 0.0, 0
    for c in range(N_STATES):
        if not channels[c] or math.isnan(z[j, t, c]):
            continue
        innovation = _innovation(c, t, first, j, x, index, logs, sensors, state, by_block, by_theta)
        H, R = ReadingRow(first, by_block, columns, by_theta), variances[c]
        S = update(x, P, n, wide, H, innovation, R, gain)
        if S <= 0.0:
            stop(fault, t, j, c, NOT_POSITIVE)
            break
        whitened[j, t, c] = innovation / math.sqrt(S)
        log_likelihood -= 0.5 * (whitened[j, t, c] ** 2 + math.log(2.0 * math.pi * S))
        count += 1
    return log_likelihood, count


@inlined
def _innovation(c, t, first, j, x, index, logs, sensors, state, by_block, by_theta):
    """z - H x of channel c of record j; fills the row of H."""
    measured_states, innovation = logs.measured_states, logs.z[j, t, c]
    _, H, _, offset, slopes, columns = sensors
    for i in range(N_STATES):
        state[i] = measured_states[j, t, i]
    for i in range(index.shape[0]):
        state[index[i]] = x[first + i]
        by_block[i] = H[c, index[i]]
    for i in range(N_STATES):
        if H[c, i] != 0.0:
            innovation -= H[c, i] * state[i]
    if offset.shape[1] > 0:
        innovation -= offset[j, t, c]
    for i in range(columns.shape[0]):
        by_theta[i] = slopes[j, t, c, i]
        innovation -= by_theta[i] * x[columns[i]]
    return innovation


@inlined
def _update(t, x, P, n_theta, index, logs, sensors, output, work):
    """Take every reading of step t and keep what is known then; log-likelihood and number."""
    whitened, states, history, history_std, fault = output
    measured_states, log_likelihood, count = logs.measured_states, 0.0, 0
    n_x, alive = index.shape[0], records_alive(logs.lengths, t)
    for j in range(alive):
        first, n = n_theta + j * n_x, n_theta + alive * n_x
        gained, taken = take_readings(
            t, first, n, j, x, P, index, logs, sensors, whitened, fault, work
        )
        log_likelihood += gained
        count += taken
        if fault[3] > 0:
            break
    for l in range(n_theta):  # noqa: E741
        history[t, l] = x[l]
        history_std[t, l] = math.sqrt(max(P[l, l], 0.0))
    for j in range(alive):
        for i in range(N_STATES):
            states[j, t, i] = measured_states[j, t, i]
        for i in range(n_x):
            states[j, t, index[i]] = x[n_theta + j * n_x + i]
    return log_likelihood, count


@borrowing
def _place_row(j, t, logs, row):
    """Copy a row of the logs (views of it would cost more)."""
    _, inputs, input_slopes, measured_states, _, _ = logs
    u, slopes, inactive0, inactive1 = row
    for i in range(u.shape[0]):
        u[i] = inputs[j, t, i]
    for i in range(slopes.shape[0]):
        for k in range(slopes.shape[1]):
            slopes[i, k] = input_slopes[j, t, i, k]
    for i in range(N_STATES):
        inactive0[i] = measured_states[j, t, i]
        inactive1[i] = measured_states[j, t + 1, i]


# --- extended Kalman filter ----------------------------------------------------------------


@loop
def ekf_pass(x, P, data, output, system, reading, row, step, work):
    """Run the EKF over all records; returns log-likelihood and number of readings.

    Parameters
    ----------
    x, P : (n,) and (n, >= n) arrays
        Mean and covariance of the whole state, before and after.
    data : PassInput
    output : PassOutput
    system : sensitivity.System
    reading, row, step, work : ReadingWork, RowWork, sensitivity.StepWork, EkfWork
    """
    _, index, logs, sensors, _, Q, _ = data
    n_theta, lengths, fault = Q.theta.shape[0], logs.lengths, output.fault
    log_likelihood, count = 0.0, 0
    for t in range(lengths[0]):
        gained, taken = _update(t, x, P, n_theta, index, logs, sensors, output, reading)
        log_likelihood += gained
        count += taken
        alive = records_alive(lengths, t + 1)
        if fault[3] > 0 or alive == 0:
            break
        predict_ekf(t, alive, x, P, index, logs, Q, system, row, step, work, fault)
        if fault[3] > 0:
            break
    return log_likelihood, count


@inlined
def predict_ekf(t, alive, x, P, index, logs, Q, system, row, step, work, fault):
    """Mean and covariance of the first records one step on.

    With F and G the derivatives of f(x_j, theta0, u_j) by x_j and by theta, side by side in a row
    of the work array for each state::

        x_j = f(x_j, theta0, u_j) + G (theta - theta0)
    """
    now, reached, F, FP, theta0 = work
    u, slopes, inactive0, inactive1 = row
    n_x, n_theta, dt = index.shape[0], theta0.shape[0], logs.dt
    for j in range(alive):
        first = n_theta + j * n_x
        for i in range(n_x):
            now[index[i], 0] = x[first + i]
        _place_row(j, t, logs, row)
        step_with_jacobian(now, u, inactive0, inactive1, dt, slopes, system, step, reached)
        for i in range(n_x):
            x[first + i] = reached[0, index[i]]
            for c in range(n_x):
                F[j * n_x + i, c] = reached[1 + index[c], index[i]]
            for c in range(n_theta):
                F[j * n_x + i, n_x + c] = reached[LEAD + c, index[i]]
                x[first + i] += reached[LEAD + c, index[i]] * (x[c] - theta0[c])
            if not abs(x[first + i]) < SPEED_LIMIT and fault[3] == 0:
                stop(fault, t, j, index[i], DIVERGED)
    if fault[3] == 0:
        predict(P, F, Q, alive, whole_vectors(n_theta + alive * n_x, P), FP)


# --- unscented Kalman filter ---------------------------------------------------------------


@loop
def ukf_pass(x, P, data, output, system, reading, row, step, sigma):
    """Run the UKF over all records; returns log-likelihood and number of readings.

    Sigma points: the centre, which is the mean of the states at theta = 0, then a pair for each
    column of the factor of the covariance. The parameter block does not move in the prediction
    and is left as it is. Arguments as those of `ekf_pass`, but of `batch` in place of
    `sensitivity`.
    """
    _, index, logs, sensors, parameters, Q, _ = data
    n_theta, n_x, lengths, fault = Q.theta.shape[0], index.shape[0], logs.lengths, output.fault
    log_likelihood, count = 0.0, 0
    for t in range(lengths[0]):
        gained, taken = _update(t, x, P, n_theta, index, logs, sensors, output, reading)
        log_likelihood += gained
        count += taken
        alive = records_alive(lengths, t + 1)
        if fault[3] > 0 or alive == 0:
            break
        _place_points(t, n_theta + alive * n_x, x, P, n_x, parameters, system, step, sigma, fault)
        if fault[3] > 0:
            break
        for j in range(alive):
            first = n_theta + j * n_x
            _place_row(j, t, logs, row)
            _step_record(j, first, x, index, parameters, logs.dt, system, row, step, sigma)
        recombine(t, alive, x, P, index, Q, sigma, fault)
        if fault[3] > 0:
            break
    return log_likelihood, count


@inlined
def _place_points(t, n, x, P, n_x, parameters, system, step, sigma, fault):
    """Factor of the covariance; parameters and inverse mass matrix of every sigma point."""
    p, column, scale, _ = parameters
    rows, inverse, n_theta = step.rows, step.inverse, scale.shape[0]
    bad = upper_cholesky(P, n, sigma.upper)
    if bad >= 0:
        stop(fault, t, max(bad - n_theta, 0) // n_x, bad, NOT_POSITIVE)
    else:
        lean_to_mean(x, n_theta, n, sigma)
        for i in range(p.shape[0]):
            if column[i] >= 0:
                c = column[i]
                place_component(p[i], scale[c], c, sigma, 1 + 2 * n, P_ROWS + i, rows)
        differ = 1 + 2 * n_theta  # from there on the points have the same parameters
        if not invert_masses(differ, system, step) > 0.0:
            stop(fault, t, 0, 0, SINGULAR)
        for i in range(9):
            for s in range(differ, 1 + 2 * n):
                inverse[i, s] = inverse[i, 0]


@inlined
def _step_record(j, first, x, index, parameters, dt, system, row, step, sigma):
    """Sigma points of record j one step on, kept in `sigma.moved`."""
    u, slopes, inactive0, inactive1 = row
    points, moved, n_x = sigma.points, sigma.moved, index.shape[0]
    count = 1 + 2 * (first + n_x)  # the other points leave this record at its mean
    for i in range(n_x):
        place_component(x[first + i], 1.0, first + i, sigma, count, index[i], points)
    place_inputs(count, u, slopes, parameters.input_columns, system.moving, sigma, step.rows)
    step_points(count, u, inactive0, inactive1, dt, system, step, points)
    for i in range(n_x):
        for s in range(count):
            moved[j * n_x + i, s] = points[index[i], s]
