"""The compiled engine: one pass of the EKF or UKF (`passes`) on a filter problem."""

from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.passes import (
    Logs,
    Parameters,
    PassInput,
    PassOutput,
    Sensors,
    ekf_pass,
    ekf_work,
    reading_work,
    row_work,
    ukf_pass,
)
from auvident.engines.problem import (
    FilterProblem,
    FilterResult,
    empty_states,
    initial_covariance,
    no_effects,
    singular_mass,
)
from auvident.engines.sigma_points import DIVERGED, NOT_POSITIVE, SINGULAR, sigma_work, stop
from auvident.errors import NumericsError
from auvident.estimation.kalman import LANES, ProcessNoise
from auvident.physics.batch import point_system, point_work
from auvident.physics.sensitivity import step_work, system_at
from auvident.physics.term_tables import N_INPUTS, N_POSITIONS, used_variables
from auvident.schema.planes import BY_PLANE

Array = npt.NDArray[Any]

REASONS = {
    NOT_POSITIVE: "the covariance is no longer positive definite",
    DIVERGED: "the state diverged",
}
COARSE_S = 0.2  # of a longer step the grid itself may be what ends a filter
SIGMA_POINT_SCALING = 1.0  # sigma points at one standard deviation: within the range of the prior


def run(problem: FilterProblem, kind: str, scaling: float = SIGMA_POINT_SCALING) -> FilterResult:
    """One pass of the EKF or UKF.

    Parameters
    ----------
    problem : FilterProblem
    kind : str
        ``ekf`` or ``ukf``.
    scaling : float
        Distance of the sigma points from the mean, in standard deviations.

    Raises
    ------
    NumericsError
        The covariance lost positive definiteness, a state diverged or the mass matrix became
        singular; names maneuver, time and channel, of the mass matrix its coefficients.
    """
    n_theta = len(problem.free)
    x = np.concatenate([np.zeros(n_theta), problem.start[:, problem.active_index].ravel()])
    P, data, output = initial_covariance(problem), _input_of(problem), _output_of(problem)
    if kind == "ukf":
        log_likelihood, count = _run_ukf(x, P, data, output, scaling)
    else:
        log_likelihood, count = _run_ekf(x, P, data, output)
    if output.fault[3] > 0:
        raise_fault(problem, output.fault)
    values = problem.parameters[problem.free]
    return FilterResult(
        problem.parameters_at(x[:n_theta]),
        P[:n_theta, :n_theta].copy(),
        values + problem.scale * output.history,
        problem.scale * output.history_std,
        output.whitened,
        output.states,
        float(log_likelihood),
        int(count),
    )


def _run_ekf(x: Array, P: Array, data: PassInput, output: PassOutput) -> tuple[float, int]:
    """`ekf_pass` with the covariance in rows of whole vector registers."""
    theta, n = data.parameters, len(x)
    moving = np.full(N_INPUTS, len(theta.input_columns) > 0)
    system, determinant = system_at(
        theta.p, data.active, theta.column, theta.scale, moving, theta.input_columns, data.equations
    )
    if not determinant > 0.0:
        stop(output.fault, 0, 0, 0, SINGULAR)
        return 0.0, 0
    wide = np.zeros((n, n + -n % LANES))
    wide[:, :n] = P
    work = reading_work(data, wide.shape[1]), row_work(data), step_work(1)
    found: tuple[float, int] = ekf_pass(
        x, wide, data, output, system, *work, ekf_work(data, wide.shape[1])
    )
    P[:] = wide[:, :n]
    return found


def _run_ukf(
    x: Array, P: Array, data: PassInput, output: PassOutput, scaling: float
) -> tuple[float, int]:
    """`ukf_pass` with its sigma points `scaling` standard deviations away."""
    theta, n = data.parameters, len(x)
    moving = np.zeros(N_INPUTS, dtype=np.bool_)
    if len(theta.input_columns):
        moving = used_variables(data.active, data.equations.terms)[N_POSITIONS:].copy()
    system = point_system(data.active, theta.column >= 0, moving, data.equations)
    work = reading_work(data, n), row_work(data), point_work(theta.p, 1 + 2 * n)
    found: tuple[float, int] = ukf_pass(
        x, P, data, output, system, *work, sigma_work(n, len(data.Q.theta), scaling)
    )
    return found


def _input_of(problem: FilterProblem) -> PassInput:
    records, index = problem.records, problem.active_index
    linear = problem.linear or no_effects(len(records.ids))
    return PassInput(
        problem.active,
        index,
        Logs(
            records.lengths,
            records.inputs,
            linear.input_slopes,
            records.given,
            records.measured,
            records.dt_s,
        ),
        Sensors(
            problem.channels,
            problem.sensor,
            problem.sensor_std**2,
            linear.offset,
            linear.reading_slopes,
            linear.reading_columns,
        ),
        Parameters(problem.parameters, problem.column, problem.scale, linear.input_columns),
        ProcessNoise(problem.theta_noise, problem.process_std[index] ** 2 * records.dt_s),
        problem.structure.equations,
    )


def _output_of(problem: FilterProblem) -> PassOutput:
    shape = problem.records.inputs.shape[1], len(problem.free)
    return PassOutput(
        empty_states(problem),
        empty_states(problem),
        np.zeros(shape),
        np.zeros(shape),
        np.zeros(4, dtype=np.int64),
    )


def raise_fault(problem: FilterProblem, fault: np.ndarray) -> None:
    """Turn the fault of a pass into an error with its coordinates."""
    step_number, record, state, reason = (int(i) for i in fault)
    if reason == SINGULAR:
        raise singular_mass(problem)
    time = step_number * problem.records.dt_s
    where = f"maneuver {problem.records.ids[record]}, {time:.1f} s after its start"
    if reason == DIVERGED:
        where += f", {BY_PLANE[problem.structure.plane].states[state].words}"
    advice = "Check this maneuver in the ingested log, narrow the prior, or hold the maneuver out"
    if problem.records.dt_s > COARSE_S:
        advice = f"Give ingest a faster --rate than {1.0 / problem.records.dt_s:g} Hz. {advice}"
    raise NumericsError(f"the filter stopped: {REASONS[reason]}", where, f"{advice}.")
