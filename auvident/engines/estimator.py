"""One stage of a plan on the data: a filter pass or a refinement of the prediction.

A stage starts at the best coefficients so far, but its prior stays the one of the ASE: running
the same data through several stages and cycles does not count them several times.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines import compiled
from auvident.engines.prediction import (
    Free,
    at_effects,
    linear_about,
    readings,
    readings_with_slopes,
    seen_rows,
    simulated,
)
from auvident.engines.problem import FilterProblem, FilterResult, Records
from auvident.engines.records import Record, stack
from auvident.engines.setup import Outcome, Setup, active_states, live_followers
from auvident.errors import NumericsError
from auvident.estimation.output_error import Likelihood, correlation_time, fit
from auvident.physics.dynamics import N_STATES
from auvident.schema.coefficients import BY_SYMBOL, expand
from auvident.schema.plan import PlanStage

Array = npt.NDArray[Any]

LONGEST_CORRELATION_S = 60.0  # lags beyond this are not looked at: longer than any transient
ESCAPED = 10.0  # [std of the channel] a prediction that ran away counts as this wrong
START_STD = 3.0  # starting state is known to this many (effective) sensor standard deviations
NOTHING = np.zeros(0, dtype=np.int64)
# effects that the surge equation alone can show
SURGE_EFFECTS = (
    "propeller_lag", "thrust_sag", "thrust_step", "turning_drag", "linear_drag", "weight_excess",
)  # fmt: skip
# In a fit the start is estimated along; the line through the readings that it begins from bends
# where the rudder is laid at once, hence so wide.
FITTED_START_STD = 30.0
NOISE_ROUNDS = 6  # rounds of fit and effective noise
NOISE_SETTLED = 0.03  # relative change of the noise below which another round changes nothing


def free_positions(setup: Setup, stage: PlanStage) -> npt.NDArray[np.int64]:
    """Positions in the parameter vector that a stage estimates.

    Followers move with their leader; a coefficient with a standard deviation of zero is held.
    """
    following = set(setup.followers[:, 0].tolist())
    positions = [setup.structure.index(s) for s in expand(stage.free, setup.structure.plane)]
    positions += effect_positions(setup, active_states(stage.system, setup.structure.plane))
    return np.array(
        [i for i in positions if i not in following and setup.prior_std[i] > 0.0],
        dtype=np.int64,
    )


def effect_positions(setup: Setup, active: Array) -> list[int]:
    """Positions of the effects' parameters that can be seen in the active states."""
    lateral = bool(active[1])
    return [
        i
        for i, name in enumerate(setup.structure.parameters)
        if "." in name and (lateral or name.split(".")[0] in SURGE_EFFECTS)
    ]


def stage_records(setup: Setup, stage: PlanStage) -> list[Record]:
    """Records of the maneuver kinds a stage uses."""
    return [record for kind, record in setup.records.values() if kind in stage.maneuvers]


def predicted(setup: Setup, parameters: Array, record: Record, active: Array) -> Array:
    """Readings (n, 4) predicted by free-running simulation of the active states."""
    acting = at_effects(setup.frame, parameters, record)
    states = simulated(setup.frame, parameters, acting, active)
    return readings(setup.frame, parameters, record, states)


def effective_noise(
    setup: Setup, parameters: Array, records: Sequence[Record], active: Array
) -> Array:
    """Standard deviation at which residuals of the current model count as independent.

    What a sensor's accuracy does not explain is the model's fault or the sea's: the rms of the
    residual takes the place of the sensor noise where it is larger. And a residual correlated
    over n samples says as little as one of n: times the square root of its correlation time.
    So a channel stirred by turbulence does not bend the coefficients to explain what is random,
    nor drown the prior, nor is it claimed as certainty afterwards.

    Returns
    -------
    (4,) array
        Effective standard deviation of each channel; the sensor's own where it is inactive.
    """
    longest = round(LONGEST_CORRELATION_S / setup.dt_s)
    power, times, count = np.zeros(N_STATES), np.zeros(N_STATES), np.zeros(N_STATES)
    for record in records:
        residual = record.measured - predicted(setup, parameters, record, active)
        for c in np.flatnonzero(active):
            seen = np.isfinite(record.measured[:, c])
            values = residual[seen, c]
            values = np.where(np.isfinite(values), values, _spread(record, int(c)))
            power[c] += float(values @ values)
            count[c] += values.size
            times[c] += values.size * correlation_time(values, longest)
    noise = setup.sensor_std.copy()
    used = count > 0
    rms = np.sqrt(power[used] / count[used])
    noise[used] = np.maximum(rms, noise[used]) * np.sqrt(times[used] / count[used])
    return noise


def _spread(record: Record, channel: int) -> float:
    """What a prediction that ran away counts as: far outside what was measured."""
    return ESCAPED * float(np.nanstd(record.measured[:, channel]))


def run_stage(setup: Setup, parameters: Array, stage: PlanStage) -> Outcome:
    """Estimate what a stage frees, from the maneuvers it uses.

    Raises
    ------
    NumericsError
        Nothing to estimate or to estimate it from; or the filter failed, with coordinates.
    """
    records, free = stage_records(setup, stage), free_positions(setup, stage)
    if not records:
        raise NumericsError(
            f"no maneuver of the kinds {', '.join(stage.maneuvers)} to identify from",
            f"stage {stage.name!r}",
            "Give a plan whose stages fit the trial, or hold out fewer maneuvers.",
        )
    if not len(free):
        raise NumericsError("nothing is free", f"stage {stage.name!r}", "Check the priors.")
    active = active_states(stage.system, setup.structure.plane)
    noise = effective_noise(setup, parameters, records, active)
    run = _refine if stage.method == "output_error" else filter_pass
    return run(setup, parameters, free, records, active, noise)


def tuning_of(setup: Setup, free: Array) -> tuple[Array, Array]:
    """Prior factor and drift of each free coefficient."""
    factors, drifts = np.ones(len(free)), np.zeros(len(free))
    for i, position in enumerate(free):
        symbol = setup.structure.parameters[position]
        groups = (BY_SYMBOL[symbol].group,) if symbol in BY_SYMBOL else ()
        for name in ("all", *groups, symbol):
            if name in setup.plan.tuning:
                factors[i] = setup.plan.tuning[name].prior
                drifts[i] = setup.plan.tuning[name].drift
    return factors, drifts


def filter_pass(
    setup: Setup, parameters: Array, free: Array, records: list[Record], active: Array,
    noise: Array,
) -> Outcome:  # fmt: skip
    """One pass of the filter over all records, and the mean of the prior put where it belongs.

    Parameters
    ----------
    setup : Setup
    parameters : (n_parameters,) array
        Where the pass starts.
    free : (n_free,) int array
    records : list of Record
    active : (4,) bool array
    noise : (4,) array
        Effective standard deviation of each channel.
    """
    acting = [at_effects(setup.frame, parameters, record) for record in records]
    stacked, starts = stack(acting, setup.dt_s)
    by_id = {record.id: record for record in acting}
    linear, sensor = linear_about(
        setup.frame, parameters, [by_id[i] for i in stacked.ids], setup.free(free),
        stacked.inputs.shape[1],
    )  # fmt: skip
    scale = setup.prior_std[free]
    factors, drifts = tuning_of(setup, free)
    problem = FilterProblem(
        structure=setup.structure,
        records=stacked,
        parameters=parameters,
        free=free,
        followers=live_followers(setup, free),
        scale=scale,
        theta_covariance=np.diag(factors**2),
        theta_noise=drifts**2 * setup.dt_s,
        active=active,
        channels=active & _sensed(stacked),
        sensor=sensor,
        process_std=noise * np.sqrt(setup.dt_s) / setup.plan.observer_time_s,
        sensor_std=noise,
        start=starts,
        start_std=START_STD * noise,
        linear=linear if setup.structure.effects else None,
    )
    passed = _engine(setup.engine)(problem, setup.filter)
    away = (setup.prior[free] - parameters[free]) / scale
    theta = (passed.parameters[free] - parameters[free]) / scale
    # the pass took its start for the mean of the prior; put the mean back where it belongs
    # (exact for a linear problem without drift, which makes the filter forget the prior)
    drifted = drifts**2 * setup.dt_s * len(passed.history)
    theta = theta + passed.theta_covariance @ (away / (factors**2 + drifted))
    return Outcome(
        problem.parameters_at(theta), free, passed.theta_covariance, noise, stacked.ids,
        passed.log_likelihood, passed.samples, passed,
    )  # fmt: skip


def _engine(name: str) -> Callable[[FilterProblem, str], FilterResult]:
    """The run of a filter by its engine; filterpy takes a second to import."""
    if name == "compiled":
        return compiled.run
    from auvident.engines import reference

    return reference.run


def _refine(
    setup: Setup, parameters: Array, free: Array, records: list[Record], active: Array,
    noise: Array,
) -> Outcome:  # fmt: skip
    """Fit, with the effective noise brought up to date until it no longer changes."""
    factors, _ = tuning_of(setup, free)
    scale = setup.prior_std[free]
    for _ in range(NOISE_ROUNDS):
        away = (setup.prior[free] - parameters[free]) / scale
        result = fit(
            likelihood_of(setup, parameters, free, records, active, noise),
            np.zeros(len(free)), away, np.diag(1.0 / factors**2),
        )  # fmt: skip
        parameters = _moved(setup, parameters, free, result.theta)
        records = [_with_fitted_start(setup, parameters, r, active, noise) for r in records]
        used, noise = noise, effective_noise(setup, parameters, records, active)
        if np.abs(noise / used - 1.0).max() < NOISE_SETTLED:
            break
    samples = sum(int(np.isfinite(r.measured[:, active]).sum()) for r in records)
    return Outcome(
        parameters, free, result.covariance, noise, tuple(r.id for r in records),
        -result.cost, samples,
    )  # fmt: skip


def _with_fitted_start(
    setup: Setup, parameters: Array, record: Record, active: Array, noise: Array
) -> Record:
    """The record with the start state that suits it best, so that its residual is one."""
    found = whitened(setup, parameters, record, active, noise, setup.free(NOTHING))
    if found is None:
        return record
    residual, slopes = found
    move = np.linalg.solve(
        slopes.T @ slopes + _start_information(active, noise), slopes.T @ residual
    )
    return moved_start(record, active, -move)


def moved_start(record: Record, active: Array, move: Array) -> Record:
    """The record with the active states of its start moved."""
    start = record.start.copy()
    start[active] += move
    return replace(record, start=start)


def _start_information(active: Array, noise: Array) -> Array:
    """What is known of the start before the fit, as an inverse covariance."""
    return np.diag((FITTED_START_STD * noise[active]) ** -2.0)


def whitened(
    setup: Setup, p: Array, record: Record, active: Array, noise: Array, free: Free,
    gain: Array | None = None,
) -> tuple[Array, Array] | None:  # fmt: skip
    """Output errors of a record over their noise, and their slopes.

    Returns
    -------
    tuple of (m,) and (m, n_active + n_free) array, or None
        Predicted minus measured, by the active states at the start and the free parameters; None
        where the simulation ran away.
    """
    found = readings_with_slopes(setup.frame, p, record, active, free, gain)
    if found is None:
        return None
    seen = seen_rows(setup.frame, p, record, active)
    kept = np.concatenate([np.flatnonzero(active), N_STATES + np.arange(len(free.positions))])
    weight = np.broadcast_to(1.0 / noise, seen.shape)[seen]
    error = (found.readings - record.measured)[seen] * weight
    return error, found.slopes[seen][:, kept] * weight[:, None]


def _moved(setup: Setup, parameters: Array, free: Array, theta: Array) -> Array:
    """Parameters moved by theta prior standard deviations; followers move along."""
    p = parameters.copy()
    p[free] += setup.prior_std[free] * theta
    for follower, leader in live_followers(setup, free):
        p[follower] += p[leader] - parameters[leader]
    return p


def data_information(setup: Setup, outcome: Outcome, stage: PlanStage) -> Array:
    """Fisher information of the stage's maneuvers about its free coefficients.

    From the exact sensitivities of the free-running prediction, with the effective noise.

    Returns
    -------
    (n_free, n_free) array
        In units of the prior standard deviations.
    """
    likelihood = likelihood_of(
        setup, outcome.parameters, outcome.free, stage_records(setup, stage),
        active_states(stage.system, setup.structure.plane), outcome.noise,
    )  # fmt: skip
    return likelihood(np.zeros(len(outcome.free)))[2]


def likelihood_of(
    setup: Setup, parameters: Array, free: Array, records: list[Record], active: Array,
    noise: Array,
) -> Likelihood:  # fmt: skip
    """Likelihood of the deviations from `parameters` for `estimation.output_error.fit`."""
    moving, k = setup.free(free), int(np.sum(active))
    held = _start_information(active, noise)

    def likelihood(theta: Array) -> tuple[float, Array, Array]:
        p = _moved(setup, parameters, free, theta)
        gradient, curvature = np.zeros(len(free)), np.zeros((len(free), len(free)))
        half = 0.0
        for record in records:
            found = whitened(setup, p, record, active, noise, moving)
            if found is None:
                return np.inf, gradient, curvature
            error, slopes = found
            g, h = slopes.T @ error, slopes.T @ slopes
            # the start is no coefficient: its best value is taken, its uncertainty counted
            start = np.linalg.solve(h[:k, :k] + held, np.column_stack([g[:k], h[:k, k:]]))
            half += 0.5 * float(error @ error) - 0.5 * float(g[:k] @ start[:, 0])
            gradient += g[k:] - h[k:, :k] @ start[:, 0]
            curvature += h[k:, k:] - h[k:, :k] @ start[:, 1:]
        return half, gradient, 0.5 * (curvature + curvature.T)

    return likelihood


def _sensed(records: Records) -> npt.NDArray[np.bool_]:
    """Channels with at least one reading."""
    return np.array([np.isfinite(records.measured[:, :, c]).any() for c in range(N_STATES)])
