"""One stage of a plan on the data: a filter pass or a refinement of the prediction.

A stage starts at the best coefficients so far, but its prior stays the one of the ASE: running
the same data through several stages and cycles does not count them several times.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines import compiled
from auvident.engines.free_run import (
    NOTHING,
    Colours,
    coloured_noise,
    effective_noise,
    likelihood_of,
    moved,
    white,
)
from auvident.engines.prediction import at_effects, linear_about
from auvident.engines.problem import FilterProblem, FilterResult, Records
from auvident.engines.records import Record, stack
from auvident.engines.setup import Outcome, Setup, active_states, live_followers
from auvident.errors import NumericsError
from auvident.estimation.innovations import most_likely
from auvident.estimation.output_error import Likelihood, fit
from auvident.estimation.posterior_mean import move_to_mean
from auvident.physics.dynamics import N_STATES
from auvident.schema.coefficients import BY_SYMBOL, expand
from auvident.schema.effects import BY_ID
from auvident.schema.plan import PlanStage

Array = npt.NDArray[Any]

START_STD = 3.0  # starting state is known to this many (effective) sensor standard deviations
# Tried for the most likely. A filter that follows its readings within less than a second lets
# the first maneuvers carry the coefficients away.
OBSERVER_TIMES_S = (1.0, 3.0, 10.0, 30.0, 100.0)
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
        if "." in name and (lateral or BY_ID[name.split(".")[0]].surge_alone)
    ]


def stage_records(setup: Setup, stage: PlanStage) -> list[Record]:
    """Records of the maneuver kinds a stage uses."""
    return [record for kind, record in setup.records.values() if kind in stage.maneuvers]


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
            f"there is no maneuver of kind {', '.join(stage.maneuvers)} to identify from",
            f"stage {stage.name!r}",
            "Use a plan whose stages suit the trial, or hold out fewer maneuvers.",
        )
    if not len(free):
        raise NumericsError(
            "the stage has no free coefficient", f"stage {stage.name!r}", "Check the priors."
        )
    active = active_states(stage.system, setup.structure.plane)
    noise = effective_noise(setup, parameters, records, active)
    if stage.method == "output_error":
        return _refine(setup, parameters, free, records, active, noise, stage.noise == "coloured")
    return _filter(setup, parameters, free, records, active, noise)


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


def _filter(
    setup: Setup,
    parameters: Array,
    free: Array,
    records: list[Record],
    active: Array,
    noise: Array,
) -> Outcome:
    """One pass with the plan's process noise, or with what makes the innovations most likely."""
    time_s = setup.plan.observer_time_s
    tried = OBSERVER_TIMES_S if time_s == "likely" else (time_s,)
    passes = [filter_pass(setup, parameters, free, records, active, noise, t) for t in tried]
    return max(passes, key=_likelihood_with_best_noise) if len(passes) > 1 else passes[0]


def _likelihood_with_best_noise(outcome: Outcome) -> float:
    """Of the innovations, with noise as large as they are: what is compared is its colour."""
    assert outcome.passed is not None
    return most_likely(outcome.passed.whitened, outcome.passed.log_likelihood)


def filter_pass(
    setup: Setup,
    parameters: Array,
    free: Array,
    records: list[Record],
    active: Array,
    noise: Array,
    observer_time_s: float,
) -> Outcome:
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
    observer_time_s : float
        Noise over this time is the process noise, per square root of a second.
    """
    acting = [at_effects(setup.frame, parameters, record) for record in records]
    stacked, starts = stack(acting, setup.dt_s)
    by_id = {record.id: record for record in acting}
    linear, sensor = linear_about(
        setup.frame,
        parameters,
        [by_id[i] for i in stacked.ids],
        setup.free(free),
        stacked.inputs.shape[1],
    )
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
        process_std=noise * np.sqrt(setup.dt_s) / observer_time_s,
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
    low, high = setup.bounds(free)
    theta = np.clip(theta, (low - parameters[free]) / scale, (high - parameters[free]) / scale)
    return Outcome(
        problem.parameters_at(theta),
        free,
        passed.theta_covariance,
        noise,
        white(noise),
        stacked.ids,
        passed.log_likelihood,
        passed.samples,
        passed,
        observer_time_s,
    )


def _engine(name: str) -> Callable[[FilterProblem, str], FilterResult]:
    """The run of a filter by its engine; filterpy takes a second to import."""
    if name == "compiled":
        return compiled.run
    from auvident.engines import reference

    return reference.run


def _refine(
    setup: Setup,
    parameters: Array,
    free: Array,
    records: list[Record],
    active: Array,
    noise: Array,
    coloured: bool,
) -> Outcome:
    """Fit, with the noise brought up to date until it no longer changes."""

    def noise_at(p: Array, before: Colours) -> Colours:
        if coloured:
            return coloured_noise(setup, p, records, active, before)
        return white(effective_noise(setup, p, records, active))

    factors, _ = tuning_of(setup, free)
    scale, (low, high) = setup.prior_std[free], setup.bounds(free)
    parameters = _calm(setup, parameters, records, active, noise)
    colours = noise_at(parameters, white(noise))
    for _ in range(NOISE_ROUNDS):
        away = (setup.prior[free] - parameters[free]) / scale
        result = fit(
            likelihood_of(setup, parameters, free, records, active, colours),
            np.zeros(len(free)),
            away,
            np.diag(1.0 / factors**2),
            ((low - parameters[free]) / scale, (high - parameters[free]) / scale),
        )
        parameters = moved(setup, parameters, free, result.theta)
        used, colours = colours, noise_at(parameters, colours)
        if _settled(used, colours):
            break
    samples = sum(int(np.isfinite(r.measured[:, active]).sum()) for r in records)
    return Outcome(
        parameters,
        free,
        result.covariance,
        effective_noise(setup, parameters, records, active),
        colours,
        tuple(r.id for r in records),
        -result.cost,
        samples,
    )


def _calm(
    setup: Setup, parameters: Array, records: list[Record], active: Array, noise: Array
) -> Array:
    """Where a fit can start: a filter may leave coefficients with which the motion runs away.

    The readings held its states; the prior is a vehicle's.
    """
    for start in (parameters, setup.start):
        at_start = likelihood_of(setup, start, NOTHING, records, active, white(noise))
        if np.isfinite(at_start(np.zeros(0))[0]):
            return start
    return parameters


def _settled(before: Colours, after: Colours) -> bool:
    """Whether the noise of every channel changed so little that another round changes nothing."""
    if any(a.time_s != b.time_s for a, b in zip(before, after, strict=True)):
        return False
    old, new = (np.array([(c.white, c.slow) for c in colours]) for colours in (before, after))
    return bool(np.allclose(new, old, rtol=NOISE_SETTLED, atol=0.0))


def data_information(setup: Setup, outcome: Outcome, stage: PlanStage) -> Array:
    """Fisher information of the stage's maneuvers about its free coefficients.

    From the exact sensitivities of the free-running prediction, with the noise of the outcome.

    Returns
    -------
    (n_free, n_free) array
        In units of the prior standard deviations.
    """
    return _likelihood_about(setup, outcome, stage)(np.zeros(len(outcome.free)))[2]


def at_mean(setup: Setup, outcome: Outcome, stage: PlanStage) -> Outcome:
    """The outcome with its coefficients moved from the most probable ones to their mean."""
    factors, _ = tuning_of(setup, outcome.free)
    names = [setup.structure.parameters[position] for position in outcome.free]
    move = move_to_mean(
        _likelihood_about(setup, outcome, stage),
        np.diag(1.0 / factors**2),
        [column for column, name in enumerate(names) if name in BY_SYMBOL],
    )
    return replace(outcome, parameters=moved(setup, outcome.parameters, outcome.free, move))


def _likelihood_about(setup: Setup, outcome: Outcome, stage: PlanStage) -> Likelihood:
    """Likelihood of deviations from an outcome, of all the maneuvers of its stage."""
    return likelihood_of(
        setup,
        outcome.parameters,
        outcome.free,
        stage_records(setup, stage),
        active_states(stage.system, setup.structure.plane),
        outcome.colours,
    )


def _sensed(records: Records) -> npt.NDArray[np.bool_]:
    """Channels with at least one reading."""
    return np.array([np.isfinite(records.measured[:, :, c]).any() for c in range(N_STATES)])
