"""One stage of a plan on the data: a filter pass or a fit of the free-running prediction.

A stage starts at the best coefficients so far, but its prior stays the one of the ASE: running
the same data through several stages and cycles does not count them several times.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import FILTER_START_STD, VehicleTime
from auvident.engines import compiled
from auvident.engines.constraints import by_constraint, in_units
from auvident.engines.free_run import OutputError, from_line, likelihood, well_started
from auvident.engines.map_fit import NoisePolicy, Prior, map_rounds
from auvident.engines.noise import Noise, coloured_noise, effective_noise, white
from auvident.engines.prediction import Free, at_effects, linear_about
from auvident.engines.problem import FilterProblem, FilterResult, Records
from auvident.engines.records import Record, stack
from auvident.engines.setup import Outcome, Setup, active_states, live_followers
from auvident.errors import NumericsError
from auvident.estimation.inequalities import nearest, prices
from auvident.estimation.innovations import most_likely
from auvident.estimation.posterior_mean import move_to_mean
from auvident.physics.dynamics import N_STATES
from auvident.schema.coefficients import ESTIMATED, expand
from auvident.schema.effects import BY_ID
from auvident.schema.plan import PlanStage

Array = npt.NDArray[Any]

# Tried for the most likely. A filter that follows its readings within less than a second lets
# the first maneuvers carry the coefficients away.
OBSERVER_TIMES_S: tuple[VehicleTime, ...] = (1.0, 3.0, 10.0, 30.0, 100.0)
NOISE_ROUNDS = 6  # rounds of fit and effective noise
NOISE_SETTLED = 0.03  # relative change of the noise below which another round changes nothing


@dataclass(frozen=True)
class Task:
    """What a stage of a plan asks of an identification.

    Attributes
    ----------
    setup : Setup
    output : OutputError
        Records of the stage, active states, and the noise of the sensors.
    free : Free
    factors, drifts : (n_free,) array
        Tuning of the plan, see `tuning_of`.
    """

    setup: Setup
    output: OutputError
    free: Free
    factors: Array
    drifts: Array

    @property
    def positions(self) -> npt.NDArray[np.int64]:
        """Positions of the free parameters."""
        return self.free.positions

    @property
    def information(self) -> Array:
        """That of the prior, in units of the prior standard deviations of the ASE."""
        return self.setup.prior_information(self.positions, self.factors)

    def prior_about(self, parameters: Array) -> Prior:
        """That of the ASE, its standard deviations times the factors of the plan."""
        origin, scale = parameters[self.positions], self.free.scale
        mean, (low, high) = self.setup.prior[self.positions], self.setup.bounds(self.positions)
        away, below, above = ((values - origin) / scale for values in (mean, low, high))
        return Prior(away, self.information, below, above, origin, self.setup.constraints)


def task_of(setup: Setup, stage: PlanStage, positions: npt.NDArray[np.int64] | None = None) -> Task:
    """What a stage asks, of the parameters that it frees or of others."""
    positions = free_positions(setup, stage) if positions is None else positions
    output = OutputError(
        setup.frame,
        tuple(stage_records(setup, stage)),
        active_states(stage.system, setup.structure.plane),
        white(setup.sensor_std),
    )
    return Task(setup, output, setup.free(positions), *tuning_of(setup, positions))


def free_positions(setup: Setup, stage: PlanStage) -> npt.NDArray[np.int64]:
    """Positions in the parameter vector that a stage estimates.

    Followers move with their leader; what has a standard deviation of zero is held.
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


def tuning_of(setup: Setup, positions: Array) -> tuple[Array, Array]:
    """Prior factor and drift of each free coefficient."""
    factors, drifts = np.ones(len(positions)), np.zeros(len(positions))
    for i, symbol in enumerate(setup.names(positions)):
        groups = (ESTIMATED[symbol].group,) if symbol in ESTIMATED else ()
        for name in ("all", *groups, symbol):
            if name in setup.plan.tuning:
                factors[i] = setup.plan.tuning[name].prior
                drifts[i] = setup.plan.tuning[name].drift
    return factors, drifts


def run_stage(setup: Setup, parameters: Array, stage: PlanStage) -> Outcome:
    """Estimate what a stage frees, from the maneuvers it uses.

    Raises
    ------
    NumericsError
        Nothing to estimate or to estimate it from; or the filter failed, with coordinates.
    """
    task = task_of(setup, stage)
    if not task.output.records:
        raise NumericsError(
            f"there is no maneuver of kind {', '.join(stage.maneuvers)} to identify from",
            f"stage {stage.name!r}",
            "Use a plan whose stages suit the trial, or hold out fewer maneuvers.",
        )
    if not len(task.positions):
        raise NumericsError(
            "the stage has no free coefficient", f"stage {stage.name!r}", "Check the priors."
        )
    noise = effective_noise(task.output, parameters, setup.sensor_std)
    if stage.method == "output_error":
        return _fitted(task, parameters, noise, stage.noise == "coloured")
    return _filtered(task, parameters, noise)


# --- filter --------------------------------------------------------------------------------


def _filtered(task: Task, parameters: Array, noise: Array) -> Outcome:
    """One pass with the plan's process noise, or with what makes the innovations most likely."""
    time_s = task.setup.plan.observer_time_s
    tried = OBSERVER_TIMES_S if time_s == "likely" else (time_s,)
    passes = [filter_pass(task, parameters, noise, t) for t in tried]
    return max(passes, key=_likelihood_with_best_noise) if len(passes) > 1 else passes[0]


def _likelihood_with_best_noise(outcome: Outcome) -> float:
    """Of the innovations, with noise as large as they are: what is compared is its colour."""
    assert outcome.passed is not None
    return most_likely(outcome.passed.whitened, outcome.passed.log_likelihood)


def filter_pass(task: Task, parameters: Array, noise: Array, observer_time_s: float) -> Outcome:
    """One pass of the filter over all records, and the mean of the prior put where it belongs.

    Parameters
    ----------
    task : Task
    parameters : (n_parameters,) array
        Where the pass starts.
    noise : (4,) array
        Effective standard deviation of each channel.
    observer_time_s : float
        The process noise is the noise times the root of a step over this time, per square root of
        a second: readings at every step are followed with a gain of the step over the time.
    """
    problem = _problem_of(task, parameters, noise, observer_time_s)
    passed = _engine(task.setup.engine)(problem, task.setup.filter)
    theta, cost = _kept(task, parameters, _about_the_prior(task, parameters, passed), passed)
    return Outcome(
        parameters=problem.parameters_at(theta),
        free=task.positions,
        colours=white(noise),
        log_likelihood=passed.log_likelihood,
        covariance=passed.theta_covariance,
        noise=noise,
        ids=problem.records.ids,
        samples=passed.samples,
        passed=passed,
        observer_time_s=observer_time_s,
        prices=by_constraint(task.setup.constraints, cost),
    )


def _problem_of(
    task: Task, parameters: Array, noise: Array, observer_time_s: float
) -> FilterProblem:
    """The pass of a filter: records side by side, linear about the parameters it starts from."""
    setup, active = task.setup, task.output.active
    acting = {r.id: at_effects(setup.frame, parameters, r) for r in task.output.records}
    stacked, starts = stack(list(acting.values()), setup.dt_s)
    in_order, length = [acting[i] for i in stacked.ids], stacked.inputs.shape[1]
    linear, sensor = linear_about(setup.frame, parameters, in_order, task.free, length)
    return FilterProblem(
        structure=setup.structure,
        records=stacked,
        parameters=parameters,
        free=task.positions,
        followers=live_followers(setup, task.positions),
        scale=task.free.scale,
        theta_covariance=setup.prior_covariance(task.positions, task.factors),
        theta_noise=task.drifts**2 * setup.dt_s,
        active=active,
        channels=active & _sensed(stacked),
        sensor=sensor,
        process_std=noise * np.sqrt(setup.dt_s) / observer_time_s,
        sensor_std=noise,
        start=starts,
        start_std=FILTER_START_STD * noise,
        linear=linear if setup.structure.effects else None,
    )


def _about_the_prior(task: Task, parameters: Array, passed: FilterResult) -> Array:
    """Deviations (n_free,) from where a pass started, the mean of the prior put back.

    The pass took its start for the mean of the prior. Exact for a linear problem without drift,
    which makes the filter forget the prior.
    """
    prior = task.prior_about(parameters)
    theta = (passed.parameters - parameters)[task.positions] / task.free.scale
    drifted = task.drifts**2 * task.setup.dt_s * len(passed.history)
    spread = np.sqrt(task.factors**2 + drifted)
    information = task.setup.prior_information(task.positions, spread)
    theta = theta + passed.theta_covariance @ (information @ prior.mean)
    return np.clip(theta, prior.low, prior.high)


def _kept(task: Task, parameters: Array, theta: Array, passed: FilterResult) -> tuple[Array, Array]:
    """The deviations that are most probable within what physics knows, and the cost of that.

    The next stage starts there; the covariance is that of the pass.
    """
    prior, information = task.prior_about(parameters), np.linalg.inv(passed.theta_covariance)
    inside = in_units(task.setup.constraints, task.free, parameters)
    found = nearest(inside, theta, information, prior.low, prior.high)
    pull = information @ (found - theta)
    return found, prices(inside, found, information, pull, prior.low, prior.high)


def _engine(name: str) -> Callable[[FilterProblem, str], FilterResult]:
    """The run of a filter by its engine; filterpy takes a second to import."""
    if name == "compiled":
        return compiled.run
    from auvident.engines import reference

    return reference.run


def _sensed(records: Records) -> npt.NDArray[np.bool_]:
    """Channels with at least one reading."""
    return np.array([np.isfinite(records.measured[:, :, c]).any() for c in range(N_STATES)])


# --- fit of the free-running prediction ----------------------------------------------------


def _fitted(task: Task, parameters: Array, noise: Array, coloured: bool) -> Outcome:
    """Fit, with the noise brought up to date until it no longer changes."""
    policy = NoisePolicy(_noise_update(task, coloured), NOISE_ROUNDS, NOISE_SETTLED)
    output = replace(task.output, colours=white(noise))
    start = _calm(output, parameters, task.setup.start)
    output = replace(output, colours=policy.update(output, start).colours)
    *_, last = map_rounds(output, task.free, task.prior_about, start, policy)
    if coloured:
        noise = effective_noise(output, last.parameters, task.setup.sensor_std)
    else:
        noise = np.array([colour.white for colour in last.noise.colours])
    return Outcome(
        parameters=last.parameters,
        free=task.positions,
        colours=last.noise.colours,
        log_likelihood=-last.fit.cost,
        covariance=last.fit.covariance,
        noise=noise,
        ids=tuple(record.id for record in output.records),
        samples=sum(_readings(record, output.active) for record in output.records),
        prices=by_constraint(task.setup.constraints, last.fit.prices),
    )


def _noise_update(task: Task, coloured: bool) -> Callable[[OutputError, Array], Noise]:
    """Coloured noise, or white noise as large as the residual counts for.

    From the line through the first readings, as what is held out is predicted; or from the starts
    of the fit, where the setup asks for that.
    """
    least = task.setup.sensor_std
    if coloured:
        return lambda output, p: Noise(coloured_noise(output, p, least))
    begun = (lambda output: output) if task.setup.own_starts else from_line
    return lambda output, p: Noise(white(effective_noise(begun(output), p, least)))


def _readings(record: Record, active: Array) -> int:
    """Number of readings of the active channels."""
    return int(np.isfinite(record.measured[:, active]).sum())


def _calm(output: OutputError, parameters: Array, other: Array) -> Array:
    """Where a fit can start: a filter may leave coefficients with which the motion runs away.

    The readings held its states; the prior is a vehicle's.
    """
    for start in (parameters, other):
        if np.isfinite(likelihood(output, start, output.no_parameter)[0]):
            return start
    return parameters


# --- about an outcome ----------------------------------------------------------------------


def task_about(setup: Setup, outcome: Outcome, stage: PlanStage) -> Task:
    """The task of a stage with what its outcome estimated, and with the noise of it."""
    task = task_of(setup, stage, outcome.free)
    output = replace(task.output, colours=outcome.colours)
    return replace(task, output=well_started(output, outcome.parameters))


def data_information(setup: Setup, outcome: Outcome, stage: PlanStage) -> Array:
    """Fisher information of the stage's maneuvers about its free coefficients.

    From the exact sensitivities of the free-running prediction, with the noise of the outcome.

    Returns
    -------
    (n_free, n_free) array
        In units of the prior standard deviations.
    """
    task = task_about(setup, outcome, stage)
    return likelihood(task.output, outcome.parameters, task.free)[2]


def at_mean(setup: Setup, outcome: Outcome, stage: PlanStage) -> Outcome:
    """The outcome with its coefficients moved from the most probable ones to their mean."""
    task = task_about(setup, outcome, stage)
    move = move_to_mean(
        lambda by: likelihood(task.output, task.free.moved(outcome.parameters, by), task.free),
        task.information,
        [k for k, name in enumerate(setup.names(outcome.free)) if name in ESTIMATED],
    )
    return kept_inside(
        setup, replace(outcome, parameters=task.free.moved(outcome.parameters, move))
    )


def kept_inside(setup: Setup, outcome: Outcome) -> Outcome:
    """The outcome within what physics knows: the most probable with its covariance."""
    free, p = setup.free(outcome.free), outcome.parameters
    inside = in_units(setup.constraints, free, p)
    low, high = ((bound - p[outcome.free]) / free.scale for bound in setup.bounds(outcome.free))
    here = np.zeros(len(outcome.free))
    found = nearest(inside, here, np.linalg.inv(outcome.covariance), low, high)
    return replace(outcome, parameters=free.moved(p, found)) if found.any() else outcome
