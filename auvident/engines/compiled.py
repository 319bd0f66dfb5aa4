"""EKF and UKF passes over all records of a stage in one augmented state, compiled.

The state is [theta, x_1, ..., x_k]; a record that ends drops out of it. At each time step the
readings are taken one scalar at a time (their noises are independent), so a missing sample of
one channel costs nothing; then every block is predicted one step.
"""

import math

import numpy as np

from auvident.engines.problem import (
    FilterProblem,
    FilterResult,
    empty_states,
    starting_covariance,
)
from auvident.errors import NumericsError
from auvident.estimation.kalman import (
    cholesky,
    predict_covariance,
    unscented_weights,
    update_scalar,
)
from auvident.jit import kernel
from auvident.physics.dynamics import (
    N_STATES,
    N_VELOCITIES,
    SPEED_LIMIT,
    inverse_mass,
    step,
    step_with_sensitivities,
)
from auvident.physics.terms import STATES

# what a pass reports when it has to stop: (step, record, channel or state, reason)
NOT_POSITIVE, DIVERGED, SINGULAR = 1, 2, 3
REASONS = {
    NOT_POSITIVE: "the covariance is no longer positive definite",
    DIVERGED: "the state diverged",
    SINGULAR: "the mass matrix is not positive definite",
}
SIGMA_POINT_SPREAD = 1.0  # sigma points at one standard deviation: within the range of the prior


@kernel
def _parameters_at(base, column, scale, theta, p):
    """Parameter vector at the deviations theta."""
    for i in range(base.shape[0]):
        p[i] = base[i]
        if column[i] >= 0:
            p[i] += scale[column[i]] * theta[column[i]]


@kernel
def _take_readings(
    t, alive, mean, covariance, n, n_theta, index, lengths, measured, given, channels, sensor,
    sensor_variance, x, whitened, fault,
):  # fmt: skip
    """Update with every reading at step t; returns log-likelihood and count."""
    n_x = index.shape[0]
    log_likelihood, count = 0.0, 0
    gradient = np.empty(n_x)
    for j in range(alive):
        first = n_theta + j * n_x
        for c in range(N_STATES):
            if not channels[c] or math.isnan(measured[j, t, c]):
                continue
            predicted = 0.0
            for i in range(N_STATES):
                x[i] = given[j, t, i]
            for i in range(n_x):
                x[index[i]] = mean[first + i]
                gradient[i] = sensor[c, index[i]]
            for i in range(N_STATES):
                if sensor[c, i] != 0.0:
                    predicted += sensor[c, i] * x[i]
            innovation = measured[j, t, c] - predicted
            spread = update_scalar(
                mean, covariance, n, first, gradient, innovation, sensor_variance[c]
            )
            if spread <= 0.0:
                fault[0], fault[1], fault[2], fault[3] = t, j, c, NOT_POSITIVE
                return log_likelihood, count
            whitened[j, t, c] = innovation / math.sqrt(spread)
            log_likelihood -= 0.5 * (whitened[j, t, c] ** 2 + math.log(2.0 * math.pi * spread))
            count += 1
    return log_likelihood, count


@kernel
def _store(t, alive, mean, covariance, n_theta, index, states, history, history_std, given):
    for l in range(n_theta):  # noqa: E741
        history[t, l] = mean[l]
        history_std[t, l] = math.sqrt(max(covariance[l, l], 0.0))
    for j in range(alive):
        for i in range(N_STATES):
            states[j, t, i] = given[j, t, i]
        for i in range(index.shape[0]):
            states[j, t, index[i]] = mean[n_theta + j * index.shape[0] + i]


@kernel
def _ekf_predict(
    t, alive, mean, covariance, n_theta, index, base, column, scale, inputs, given, dt, active,
    terms, weights, mass, mass_weights, q_theta, q_x, fault,
):  # fmt: skip
    """Predict mean and covariance of every record alive by one step."""
    n_x = index.shape[0]
    p, x, out = np.empty(base.shape[0]), np.empty(N_STATES), np.empty(N_STATES)
    inverse = np.empty((N_VELOCITIES, N_VELOCITIES))
    transition = np.empty((alive, n_x, n_x))
    sensitivity = np.empty((alive, n_x, n_theta))
    s_x = np.empty((N_STATES, N_STATES + n_theta))
    _parameters_at(base, column, scale, mean, p)
    if not inverse_mass(p, mass, mass_weights, active, inverse) > 0.0:
        fault[0], fault[1], fault[2], fault[3] = t, 0, 0, SINGULAR
        return
    for j in range(alive):
        first = n_theta + j * n_x
        for i in range(N_STATES):
            x[i] = given[j, t, i]
        for i in range(n_x):
            x[index[i]] = mean[first + i]
        s_x[:, :] = 0.0
        for i in range(N_STATES):
            s_x[i, i] = 1.0
        step_with_sensitivities(
            x, inputs[j, t], given[j, t], given[j, t + 1], dt, p, inverse, active, terms, weights,
            mass, mass_weights, column, s_x, out,
        )  # fmt: skip
        for i in range(n_x):
            mean[first + i] = out[index[i]]
            if not abs(out[index[i]]) < SPEED_LIMIT:
                fault[0], fault[1], fault[2], fault[3] = t, j, index[i], DIVERGED
                return
            for l in range(n_x):  # noqa: E741
                transition[j, i, l] = s_x[index[i], index[l]]
            for l in range(n_theta):  # noqa: E741
                sensitivity[j, i, l] = s_x[index[i], N_STATES + l] * scale[l]
    predict_covariance(covariance, transition, sensitivity, n_theta, n_x, alive, q_theta, q_x)


@kernel
def _ukf_predict(
    t, alive, mean, covariance, n_theta, index, base, column, scale, inputs, given, dt, active,
    terms, weights, mass, mass_weights, q_theta, q_x, fault, spread, factor,
):  # fmt: skip
    """Predict with sigma points; the parameter block stays as it is."""
    n_x = index.shape[0]
    n = n_theta + alive * n_x
    bad = cholesky(covariance, n, factor)
    if bad >= 0:
        fault[0], fault[1], fault[2], fault[3] = t, max(bad - n_theta, 0) // n_x, bad, NOT_POSITIVE
        return
    w_mean, w_centre, w = unscented_weights(n, spread)
    moved = np.empty((2 * n + 1, alive * n_x))
    p, x, out = np.empty(base.shape[0]), np.empty(N_STATES), np.empty(N_STATES)
    inverse = np.empty((N_VELOCITIES, N_VELOCITIES))
    theta = np.empty(n_theta)
    for s in range(2 * n + 1):
        sign = 0.0 if s == 0 else (spread if s <= n else -spread)
        c = 0 if s == 0 else (s - 1) % n
        for l in range(n_theta):  # noqa: E741
            theta[l] = mean[l] + sign * factor[l, c]
        if s == 0 or c < n_theta or s == n + 1 + n_theta or s == 1 + n_theta:
            _parameters_at(base, column, scale, theta, p)
            if not inverse_mass(p, mass, mass_weights, active, inverse) > 0.0:
                fault[0], fault[1], fault[2], fault[3] = t, 0, 0, SINGULAR
                return
        for j in range(alive):
            at = j * n_x
            if c >= n_theta + at + n_x:  # lower triangular: this block is at its mean
                for i in range(n_x):
                    moved[s, at + i] = moved[0, at + i]
                continue
            for i in range(N_STATES):
                x[i] = given[j, t, i]
            for i in range(n_x):
                x[index[i]] = mean[n_theta + at + i] + sign * factor[n_theta + at + i, c]
            step(
                x, inputs[j, t], given[j, t], given[j, t + 1], dt, p, inverse, active, terms,
                weights, out,
            )  # fmt: skip
            for i in range(n_x):
                moved[s, at + i] = out[index[i]]
    _recombine(
        t, alive, mean, covariance, n_theta, n_x, n, moved, factor, spread, w_mean, w_centre, w,
        q_theta, q_x, fault,
    )  # fmt: skip


@kernel
def _recombine(
    t, alive, mean, covariance, n_theta, n_x, n, moved, factor, spread, w_mean, w_centre, w,
    q_theta, q_x, fault,
):  # fmt: skip
    """Mean and covariance of the propagated sigma points."""
    n_blocks = alive * n_x
    for i in range(n_blocks):
        total = w_mean * moved[0, i]
        for s in range(1, 2 * n + 1):
            total += w * moved[s, i]
        mean[n_theta + i] = total
        if not abs(total) < SPEED_LIMIT:
            fault[0], fault[1], fault[2], fault[3] = t, i // n_x, i % n_x, DIVERGED
            return
        for s in range(2 * n + 1):
            moved[s, i] -= total
    for i in range(n_blocks):
        for l in range(n_theta):  # noqa: E741
            total = 0.0
            for c in range(l + 1):
                total += factor[l, c] * (moved[1 + c, i] - moved[1 + n + c, i])
            covariance[n_theta + i, l] = w * spread * total
            covariance[l, n_theta + i] = covariance[n_theta + i, l]
    products = moved.T @ (moved * w)
    for i in range(n_blocks):
        for j in range(n_blocks):
            covariance[n_theta + i, n_theta + j] = (
                products[i, j] + (w_centre - w) * moved[0, i] * moved[0, j]
            )
        covariance[n_theta + i, n_theta + i] += q_x[i % n_x]
    for l in range(n_theta):  # noqa: E741
        covariance[l, l] += q_theta[l]


@kernel
def _pass(
    unscented, spread, mean, covariance, n_theta, index, lengths, inputs, given, measured, dt,
    base, column, scale, active, channels, sensor, sensor_variance, q_theta, q_x, terms, weights,
    mass, mass_weights, whitened, states, history, history_std, fault,
):  # fmt: skip
    """Run one filter over all records; returns log-likelihood and number of readings."""
    n_x = index.shape[0]
    x = np.empty(N_STATES)
    factor = np.zeros((mean.shape[0], mean.shape[0]))
    log_likelihood, count = 0.0, 0
    for t in range(lengths[0]):
        alive = 0
        while alive < lengths.shape[0] and lengths[alive] > t:
            alive += 1
        gained, taken = _take_readings(
            t, alive, mean, covariance, n_theta + alive * n_x, n_theta, index, lengths, measured,
            given, channels, sensor, sensor_variance, x, whitened, fault,
        )  # fmt: skip
        log_likelihood += gained
        count += taken
        _store(t, alive, mean, covariance, n_theta, index, states, history, history_std, given)
        while alive > 0 and lengths[alive - 1] <= t + 1:
            alive -= 1
        if fault[3] > 0 or alive == 0:
            break
        if unscented:
            _ukf_predict(
                t, alive, mean, covariance, n_theta, index, base, column, scale, inputs, given,
                dt, active, terms, weights, mass, mass_weights, q_theta, q_x, fault, spread,
                factor,
            )  # fmt: skip
        else:
            _ekf_predict(
                t, alive, mean, covariance, n_theta, index, base, column, scale, inputs, given,
                dt, active, terms, weights, mass, mass_weights, q_theta, q_x, fault,
            )  # fmt: skip
        if fault[3] > 0:
            break
    return log_likelihood, count


def run(problem: FilterProblem, kind: str, spread: float = SIGMA_POINT_SPREAD) -> FilterResult:
    """One pass of the EKF or UKF.

    Parameters
    ----------
    problem : FilterProblem
    kind : str
        ``ekf`` or ``ukf``.
    spread : float
        Distance of the sigma points from the mean, in standard deviations.

    Raises
    ------
    NumericsError
        The covariance lost positive definiteness, a state diverged or the mass matrix became
        singular; names maneuver, time and channel.
    """
    records, index = problem.records, problem.active_index
    n_theta, n_steps = len(problem.free), records.inputs.shape[1]
    mean = np.concatenate([np.zeros(n_theta), problem.start[:, index].ravel()])
    covariance = starting_covariance(problem)
    whitened, states = empty_states(problem), empty_states(problem)
    history, history_std = np.zeros((n_steps, n_theta)), np.zeros((n_steps, n_theta))
    fault = np.zeros(4, dtype=np.int64)
    log_likelihood, count = _pass(
        kind == "ukf", spread, mean, covariance, n_theta, index, records.lengths, records.inputs,
        records.given, records.measured, records.dt_s, problem.parameters, problem.column,
        problem.scale, problem.active, problem.channels, problem.sensor, problem.sensor_std**2,
        problem.theta_noise, problem.process_std[index] ** 2 * records.dt_s,
        *problem.structure.arrays, whitened, states, history, history_std, fault,
    )  # fmt: skip
    if fault[3] > 0:
        raise_fault(problem, fault)
    values = problem.parameters[problem.free]
    return FilterResult(
        problem.parameters_at(mean[:n_theta]),
        covariance[:n_theta, :n_theta].copy(),
        values + problem.scale * history,
        problem.scale * history_std,
        whitened,
        states,
        float(log_likelihood),
        int(count),
    )


def raise_fault(problem: FilterProblem, fault: np.ndarray) -> None:
    """Turn the fault of a pass into an error with its coordinates."""
    step_number, record, state, reason = (int(i) for i in fault)
    time = step_number * problem.records.dt_s
    where = f"maneuver {problem.records.ids[record]}, {time:.1f} s after its start"
    if reason == DIVERGED:
        where += f", state {STATES[state]}"
    raise NumericsError(
        f"the filter stopped: {REASONS[reason]}",
        where,
        "Look at this maneuver in the ingested log, narrow the prior, or hold it out.",
    )
