"""The compiled engine: one pass of the EKF or UKF (`passes`) on a filter problem."""

import numpy as np

from auvident.engines.passes import Case, ekf_pass, ukf_pass
from auvident.engines.problem import (
    FilterProblem,
    FilterResult,
    empty_states,
    no_effects,
    starting_covariance,
)
from auvident.engines.sigma_points import DIVERGED, NOT_POSITIVE, SINGULAR
from auvident.errors import NumericsError
from auvident.physics.terms import STATES

REASONS = {
    NOT_POSITIVE: "the covariance is no longer positive definite",
    DIVERGED: "the state diverged",
    SINGULAR: "the mass matrix is not positive definite",
}
SIGMA_POINT_SPREAD = 1.0  # sigma points at one standard deviation: within the range of the prior


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
    linear = problem.linear or no_effects(len(records.ids))
    case = Case(
        index,
        records.lengths,
        records.inputs,
        records.given,
        records.measured,
        records.dt_s,
        problem.parameters,
        problem.column,
        problem.scale,
        problem.active,
        problem.channels,
        problem.sensor,
        problem.sensor_std**2,
        linear.input_slopes,
        linear.input_columns,
        linear.offset,
        linear.reading_slopes,
        linear.reading_columns,
        problem.theta_noise,
        problem.process_std[index] ** 2 * records.dt_s,
        empty_states(problem),
        empty_states(problem),
        np.zeros((n_steps, n_theta)),
        np.zeros((n_steps, n_theta)),
        np.zeros(4, dtype=np.int64),
    )
    structure = problem.structure.arrays
    if kind == "ukf":
        log_likelihood, count = ukf_pass(mean, covariance, case, *structure, spread)
    else:
        log_likelihood, count = ekf_pass(mean, covariance, case, *structure)
    if case.fault[3] > 0:
        raise_fault(problem, case.fault)
    values = problem.parameters[problem.free]
    return FilterResult(
        problem.parameters_at(mean[:n_theta]),
        covariance[:n_theta, :n_theta].copy(),
        values + problem.scale * case.history,
        problem.scale * case.history_std,
        case.whitened,
        case.states,
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
        "Check this maneuver in the ingested log, narrow the prior, or hold the maneuver out.",
    )
