"""The same passes on filterpy's classes: the independent, slow engine.

Only the right-hand side is shared with the compiled engine; prediction, update, sigma points
and weights are filterpy's own. filterpy updates with all readings of a step at once, in Joseph
form; the sigma points of the UKF are drawn again after the prediction, so that the process
noise is in them (filterpy would otherwise leave it out of the innovation covariance).
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from filterpy.kalman import (
    ExtendedKalmanFilter,
    MerweScaledSigmaPoints,
    UnscentedKalmanFilter,
)

from auvident.engines.problem import (
    FilterProblem,
    FilterResult,
    empty_states,
    initial_covariance,
    no_effects,
    singular_mass,
)
from auvident.errors import NumericsError
from auvident.physics.batch import inverse_mass
from auvident.physics.dynamics import N_STATES, step, step_with_sensitivities
from auvident.physics.term_tables import N_INPUTS

Array = npt.NDArray[Any]

BETA = 2.0  # of the unscented transform: Gaussian


class _Model:
    """The augmented system [theta, x_1, ..., x_k] of a problem, as filterpy asks for it."""

    def __init__(self, problem: FilterProblem) -> None:
        self.problem = problem
        self.index = problem.active_index
        self.n_theta, self.n_x = len(problem.free), len(self.index)
        self.inverse = np.empty((3, 3))
        self.equations = problem.structure.equations
        self.linear = problem.linear or no_effects(len(problem.records.ids))

    def size(self, alive: int) -> int:
        return self.n_theta + alive * self.n_x

    def block(self, j: int) -> slice:
        return slice(self.n_theta + j * self.n_x, self.n_theta + (j + 1) * self.n_x)

    def full_state(self, chi: Array, j: int, t: int) -> Array:
        x = self.problem.records.given[j, t].copy()
        x[self.index] = chi[self.block(j)]
        return x

    def theta_of(self, chi: Array) -> Array:
        """The state without its motions: a pass is linear about theta = 0 (see `passes`)."""
        theta = chi.copy()
        theta[self.n_theta :] = 0.0
        return theta

    def inputs(self, chi: Array, j: int, t: int) -> Array:
        """Inputs of a record at the parameters of a state."""
        inputs: Array = self.problem.records.inputs[j, t]
        columns = self.linear.input_columns
        if len(columns):
            inputs = inputs + self.linear.input_slopes[j, t] @ chi[columns]
        return inputs

    def _input_slopes(self, j: int, t: int) -> Array:
        if not len(self.linear.input_columns):
            return np.zeros((N_INPUTS, 0))
        return np.ascontiguousarray(
            self.linear.input_slopes[j, t] / self.problem.scale[self.linear.input_columns]
        )

    def _arguments(self, chi: Array, j: int, t: int, p: Array) -> tuple:
        records = self.problem.records
        return (
            self.full_state(chi, j, t),
            self.inputs(chi, j, t),
            records.given[j, t],
            records.given[j, t + 1],
            records.dt_s,
            p,
        )

    def _prepare(self, chi: Array) -> Array:
        p = self.problem.parameters_at(chi[: self.n_theta])
        _, _, mass, weights = self.equations
        if not inverse_mass(p, mass, weights, self.problem.active, self.inverse) > 0.0:
            raise singular_mass(self.problem, "filterpy's filter")
        return p

    def advance(self, chi: Array, t: int) -> Array:
        """The whole state one step on."""
        p, moved, out = self._prepare(chi), chi.copy(), np.empty(N_STATES)
        active = self.problem.active
        for j in range((len(chi) - self.n_theta) // self.n_x):
            step(*self._arguments(chi, j, t, p), self.inverse, active, self.equations, out)
            moved[self.block(j)] = out[self.index]
        return moved

    def transition(self, chi: Array, t: int) -> tuple[Array, Array]:
        """The whole state one step on, and its derivative."""
        p, moved, out = self._prepare(chi), chi.copy(), np.empty(N_STATES)
        derivative = np.eye(len(chi))
        for j in range((len(chi) - self.n_theta) // self.n_x):
            s_x = np.hstack([np.eye(N_STATES), np.zeros((N_STATES, self.n_theta))])
            step_with_sensitivities(
                *self._arguments(chi, j, t, p),
                self.problem.active,
                self.equations,
                self.problem.column,
                self._input_slopes(j, t),
                self.linear.input_columns,
                s_x,
                out,
            )
            rows = self.block(j)
            moved[rows] = out[self.index]
            derivative[rows, : self.n_theta] = s_x[self.index, N_STATES:] * self.problem.scale
            derivative[rows, rows] = s_x[np.ix_(self.index, self.index)]
        return moved, derivative

    def readings(self, alive: int, t: int) -> list[tuple[int, int]]:
        """(record, channel) of every reading at a step."""
        measured = self.problem.records.measured
        return [
            (j, int(c))
            for j in range(alive)
            for c in np.flatnonzero(self.problem.channels)
            if not math.isnan(measured[j, t, c])
        ]

    def predicted(self, chi: Array, t: int, readings: list[tuple[int, int]]) -> Array:
        """What the sensors should read."""
        sensor = self.problem.sensor
        values = np.array(
            [
                np.dot(sensor[c], np.where(sensor[c] != 0.0, self.full_state(chi, j, t), 0.0))
                for j, c in readings
            ]
        )
        columns = self.linear.reading_columns
        for row, (j, c) in enumerate(readings):
            if self.linear.offset.shape[1]:
                values[row] += self.linear.offset[j, t, c]
            if len(columns):
                values[row] += self.linear.reading_slopes[j, t, c] @ chi[columns]
        return values

    def gradient(self, size: int, t: int, readings: list[tuple[int, int]]) -> Array:
        """Derivative of `predicted`."""
        h = np.zeros((len(readings), size))
        for row, (j, c) in enumerate(readings):
            h[row, self.block(j)] = self.problem.sensor[c, self.index]
            if len(self.linear.reading_columns):
                h[row, self.linear.reading_columns] = self.linear.reading_slopes[j, t, c]
        return h

    def noise(self, alive: int) -> Array:
        """Variance added per step, as a matrix."""
        per_block = self.problem.process_std[self.index] ** 2 * self.problem.records.dt_s
        return np.diag(np.concatenate([self.problem.theta_noise, np.tile(per_block, alive)]))


class _Ekf(ExtendedKalmanFilter):
    """filterpy's EKF with the non-linear prediction of `_Model`."""

    moved: Array

    def predict_x(self, u: object = 0) -> None:
        """Take the state that came with the transition matrix."""
        self.x = self.moved


class _Ukf(UnscentedKalmanFilter):
    """filterpy's UKF, which forgets its propagated sigma points when it draws them again."""

    moved: Array

    def compute_process_sigmas(self, dt: float, fx: object = None, **arguments: object) -> None:
        """Keep them."""
        super().compute_process_sigmas(dt, fx, **arguments)
        self.moved = self.sigmas_f.copy()


def run(problem: FilterProblem, kind: str, scaling: float = 1.0) -> FilterResult:
    """One pass of filterpy's EKF or UKF; parameters and errors as `compiled.run`."""
    model = _Model(problem)
    lengths = problem.records.lengths
    n_steps = int(lengths[0])
    chi = np.concatenate([np.zeros(model.n_theta), problem.start[:, model.index].ravel()])
    covariance = initial_covariance(problem)
    whitened, states = empty_states(problem), empty_states(problem)
    history = np.zeros((n_steps, model.n_theta))
    history_std = np.zeros((n_steps, model.n_theta))
    log_likelihood, count = 0.0, 0
    for t in range(n_steps):
        alive = int(np.sum(lengths > t))
        readings = model.readings(alive, t)
        if readings:
            chi, covariance, gained = _update(model, chi, covariance, t, readings, whitened)
            log_likelihood += gained
            count += len(readings)
        history[t] = chi[: model.n_theta]
        history_std[t] = np.sqrt(np.diag(covariance)[: model.n_theta])
        for j in range(alive):
            states[j, t] = model.full_state(chi, j, t)
        alive = int(np.sum(lengths > t + 1))
        if alive:
            size = model.size(alive)
            predict = _predict_ukf if kind == "ukf" else _predict_ekf
            try:
                chi, covariance = predict(model, chi[:size], covariance[:size, :size], t, scaling)
            except (np.linalg.LinAlgError, ValueError) as error:
                raise _failure(problem, t, str(error)) from None
            _refuse_divergence(problem, chi, covariance, t)
    return FilterResult(
        problem.parameters_at(chi[: model.n_theta]),
        covariance[: model.n_theta, : model.n_theta].copy(),
        problem.parameters[problem.free] + problem.scale * history,
        problem.scale * history_std,
        whitened,
        states,
        float(log_likelihood),
        count,
    )


def _update(
    model: _Model,
    chi: Array,
    covariance: Array,
    t: int,
    readings: list[tuple[int, int]],
    whitened: Array,
) -> tuple[Array, Array, float]:
    """filterpy's update with all readings of a step; the measurement is linear."""
    ekf = _Ekf(dim_x=len(chi), dim_z=len(readings))
    ekf.x, ekf.P = chi, covariance
    ekf.R = np.diag([model.problem.sensor_std[c] ** 2 for _, c in readings])
    z = np.array([model.problem.records.measured[j, t, c] for j, c in readings])
    ekf.update(
        z,
        HJacobian=lambda x: model.gradient(len(chi), t, readings),
        Hx=lambda x: model.predicted(x, t, readings),
    )
    factor = np.linalg.cholesky(ekf.S)
    white = np.linalg.solve(factor, ekf.y)
    for (j, c), value in zip(readings, white, strict=True):
        whitened[j, t, c] = value
    log_likelihood = -0.5 * float(white @ white) - float(np.log(np.diag(factor)).sum())
    return ekf.x, ekf.P, log_likelihood - 0.5 * len(z) * math.log(2.0 * math.pi)


def _predict_ekf(
    model: _Model, chi: Array, covariance: Array, t: int, scaling: float
) -> tuple[Array, Array]:
    ekf = _Ekf(dim_x=len(chi), dim_z=1)
    ekf.x, ekf.P, ekf.Q = chi, covariance, model.noise((len(chi) - model.n_theta) // model.n_x)
    theta = model.theta_of(chi)
    moved, ekf.F = model.transition(chi - theta, t)
    ekf.moved = moved + ekf.F @ theta
    ekf.predict()
    return ekf.x, ekf.P


def _predict_ukf(
    model: _Model, chi: Array, covariance: Array, t: int, scaling: float
) -> tuple[Array, Array]:
    n = len(chi)
    points = MerweScaledSigmaPoints(n, alpha=scaling / math.sqrt(n), beta=BETA, kappa=0.0)
    ukf = _Ukf(
        dim_x=n,
        dim_z=1,
        dt=model.problem.records.dt_s,
        hx=lambda x: x[:1],
        fx=lambda x, dt: model.advance(x, t),
        points=points,
    )
    theta = model.theta_of(chi)
    ukf.x, ukf.P = chi - theta, covariance
    ukf.Q = model.noise((n - model.n_theta) // model.n_x)
    pairs = points.Wm[1:, None] * (points.sigma_points(ukf.x, ukf.P)[1:] - ukf.x)
    ukf.predict()
    onward = ukf.moved[1:].T @ pairs @ np.linalg.solve(covariance, theta)
    return ukf.x + onward, ukf.P


def _refuse_divergence(problem: FilterProblem, chi: Array, covariance: Array, t: int) -> None:
    if np.isfinite(chi).all() and np.isfinite(covariance).all() and (np.diag(covariance) > 0).all():
        return
    raise _failure(problem, t, "it diverged")


def _failure(problem: FilterProblem, t: int, why: str) -> NumericsError:
    return NumericsError(
        f"filterpy's filter stopped: {why}",
        f"{t * problem.records.dt_s:.1f} s after the start of {', '.join(problem.records.ids)}",
        "Use the compiled engine, which names the maneuver, or narrow the prior.",
    )
