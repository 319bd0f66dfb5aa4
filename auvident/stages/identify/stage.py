"""Identification: the stages of a plan, from the ASE to the identified model."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import USUAL_SPEED_MPS
from auvident.engines.carried import Carried, allowed
from auvident.engines.estimator import (
    at_mean,
    data_information,
    run_stage,
    stage_records,
    task_about,
)
from auvident.engines.jackknife import (
    information_by_maneuver,
    left_out_courses,
    scatter_of,
)
from auvident.engines.setup import Outcome, Setup
from auvident.errors import NumericsError
from auvident.estimation.identifiability import Direction, unseen_directions
from auvident.parallel import all_of
from auvident.schema.artifacts import (
    AseResult,
    Finding,
    IdentifiedModel,
    Maneuvers,
)
from auvident.schema.coefficients import ESTIMATED, Plane
from auvident.schema.plan import Plan, PlanStage
from auvident.schema.trial import Columns, Trial
from auvident.schema.vehicle import Vehicle
from auvident.stages.identify.held_out import overlap_findings, without_held_out
from auvident.stages.identify.left_out import course_findings, left_out_of
from auvident.stages.identify.prior_data import prior_against_data
from auvident.stages.identify.profiles import profiles_of
from auvident.stages.identify.residuals import ignored_channels, scatter_claimed
from auvident.stages.identify.result import (
    Step,
    history_of,
    model_of,
    scatter_matrix,
    states_of,
)
from auvident.stages.identify.setup import pitch_findings, prepare, unread_findings
from auvident.stages.identify.shared import Shared, with_both
from auvident.stages.identify.step_length import step_findings
from auvident.stages.identify.warm_up import compile_first

Array = npt.NDArray[Any]
Progress = Callable[[str, float | None], None]
# [microseconds per sample] that a pass takes, measured on the samples harbour, bay and kvlcc2; and
# how many times as long without the compiled EKF
PASS_COST = {"surge": 5.0, "lateral": 9.0, "coupled": 16.0, "output_error": 250.0}
SLOWER = {"ekf": 1.0, "ukf": 2.4}
WITH_FILTERPY = 100.0

OVERCLAIMED = 2.0  # variance that the readings allow over the one that is claimed
LEAST_SPEED_MPS = 0.1  # by which a time of the vehicle is told
STARTS_APART = 1.0  # [std] results of several starts further apart than this are named


@dataclass(frozen=True)
class Identification:
    """What `identify` returns: the model, the history of its coefficients, smoothed states."""

    model: IdentifiedModel
    history: Columns
    states: Columns


def speed_of(trials: Sequence[Trial]) -> float:
    """Median speed of the trials [m/s]; the usual one where none is logged."""
    speeds = [np.abs(t.columns["u_mps"]) for t in trials if "u_mps" in t.columns]
    logged = np.concatenate([*speeds, np.zeros(0)])
    logged = logged[np.isfinite(logged)]
    return max(float(np.median(logged)), LEAST_SPEED_MPS) if len(logged) else USUAL_SPEED_MPS


def _seen_speed(trials: Sequence[Trial], maneuvers: Maneuvers, plane: Plane) -> float:
    """Median speed [m/s] outside of what is held out, which chooses nothing."""
    return speed_of([without_held_out(trial, maneuvers, plane) for trial in trials])


def identify(
    trials: Sequence[Trial],
    maneuvers: Maneuvers,
    ase: AseResult,
    vehicle: Vehicle,
    noise: Mapping[str, float],
    *,
    plane: Plane = "horizontal",
    plan: Plan,
    filter: str = "ekf",
    engine: str = "compiled",
    carried: Carried | None = None,
    shared: Shared | None = None,
    progress: Progress | None = None,
) -> Identification:
    """Estimate the coefficients of one plane from the maneuvers that identify.

    Parameters
    ----------
    trials : sequence of Trial
    maneuvers : Maneuvers
        Those with role ``identify`` are used, the others not looked at.
    ase : AseResult
        Prior of every coefficient of the plane.
    vehicle : Vehicle
    noise : mapping
        Noise of each channel by column, from the quality report; the vehicle file goes before.
    plane : str
    plan : Plan
    filter : str
        ``ekf`` or ``ukf``.
    engine : str
        ``compiled`` or ``filterpy``.
    carried : Carried, optional
        Effects that are estimated along, or given; without it the nuisance parameters of the plan.
    shared : Shared, optional
        What the other plane has identified of the coefficients of both.
    progress : callable, optional
        Called with a text and the fraction done.

    Raises
    ------
    NumericsError
        Nothing to identify from, or a filter failed (with maneuver and time).
    """
    carried = carried or allowed(
        plan.nuisance, plane, ase.length_m, _seen_speed(trials, maneuvers, plane)
    )
    setup = prepare(
        trials,
        maneuvers,
        ase,
        vehicle,
        noise,
        plane=plane,
        plan=plan,
        filter=filter,
        engine=engine,
        carried=carried,
        shared=shared,
    )
    compile_first(setup)
    runs = [_run(setup, factor, progress) for factor in plan.start]
    if progress:
        progress("what the maneuvers show of each coefficient", None)
    end = _concluded(setup, runs)
    findings = overlap_findings(trials, maneuvers, plane)
    findings += unread_findings(trials, maneuvers, plane, setup)
    findings += pitch_findings(setup, ase)
    model, states = all_of(
        partial(_judged, setup, end, ase, vehicle, carried, [*findings, *end.findings]),
        partial(states_of, setup, end.outcome.parameters),
    )
    model = with_both(model, shared, ase) if shared else model
    history = history_of(setup, [step for steps, _ in runs for step in steps])
    return Identification(model, history, states)


@dataclass(frozen=True)
class _Concluded:
    """Where an estimation ended: the steps of the last start, the last with the final outcome."""

    steps: tuple[Step, ...]
    unseen: Sequence[Direction]
    findings: tuple[Finding, ...]

    @property
    def outcome(self) -> Outcome:
        return self.steps[-1].outcome

    @property
    def stage(self) -> PlanStage:
        return self.steps[-1].stage


def _concluded(setup: Setup, runs: Sequence[tuple[list[Step], list[Finding]]]) -> _Concluded:
    """The mean over the starts, with a covariance that the readings allow."""
    steps, _ = runs[-1]
    stage = steps[-1].stage
    means = [at_mean(setup, done[-1].outcome, done[-1].stage) for done, _ in runs]
    mean = _average(setup, means)
    information = data_information(setup, mean, stage)
    unseen = unseen_directions(information, _equations(setup, mean))
    posterior = information + task_about(setup, mean, stage).information
    final, overclaimed = _as_the_readings_tell(setup, mean, posterior)
    findings = (
        *dict.fromkeys(finding for _, told in runs for finding in told),
        *_disagreement(means, setup),
        *overclaimed,
        *step_findings(setup, final.parameters),
    )
    return _Concluded((*steps[:-1], replace(steps[-1], outcome=final)), unseen, findings)


def _judged(
    setup: Setup,
    end: _Concluded,
    ase: AseResult,
    vehicle: Vehicle,
    carried: Carried,
    findings: Sequence[Finding],
) -> IdentifiedModel:
    """The model with what single maneuvers, the prior and its likelihood say of it."""
    final, stage = end.outcome, end.stage
    by_maneuver = information_by_maneuver(setup, final, stage)
    (courses, pushes), (profiled, bent) = all_of(
        partial(left_out_courses, setup, final, stage, *by_maneuver, ase.length_m),
        partial(profiles_of, setup, final, stage, carried.effects),
    )
    left_out, moved = left_out_of(setup, courses, pushes)
    scatter = scatter_of(*by_maneuver)
    claim, disputed = scatter_claimed(*by_maneuver[:2])
    against, contradicted = prior_against_data(setup, final, *by_maneuver, ase)
    ignored = ignored_channels(setup, final, stage)
    unsteady = course_findings(setup.structure, final.parameters, ase.length_m)
    told = [*ignored, *contradicted, *findings, *moved, *disputed, *bent, *unsteady]
    model = model_of(setup, ase, vehicle, end.steps, end.unseen, scatter, told, carried)
    beside: dict[str, Any] = {
        "left_out": left_out,
        "covariance": model.covariance | scatter_matrix(setup, final, *by_maneuver),
        "prior_against_data": against,
        "noise_claim": claim,
        "profile": profiled,
    }
    return model.model_copy(update=beside)


def _as_the_readings_tell(
    setup: Setup, outcome: Outcome, posterior: Array
) -> tuple[Outcome, list[Finding]]:
    """The outcome with a covariance that its readings allow, and what was wrong with it.

    The states of a filter follow the readings. Where what the model lacks pulls these away from the
    prediction, the filter is linear about motions that the model does not make, and may claim
    more than the prediction with the same noise tells, of which `posterior` is the information.
    """
    exact = np.linalg.inv(posterior)
    ratio = np.diag(exact) / np.diag(outcome.covariance)
    if ratio.max() < OVERCLAIMED:
        return outcome, []
    finding = Finding(
        code="filter-overclaims",
        value=float(ratio.max()),
        threshold=OVERCLAIMED,
        where=setup.names(outcome.free)[int(ratio.argmax())],
        message="the filter is overconfident: its covariance is smaller than the information "
        "in the measurements allows. The standard deviations are corrected for that; "
        "the values may be off by more",
        remedy="Use the plan `refined`, which continues with output error where the filter ends.",
    )
    return replace(outcome, covariance=exact), [finding]


def _equations(setup: Setup, outcome: Outcome) -> list[list[int]]:
    """Free coefficients of the surge equation, and of the two lateral ones."""
    names = setup.names(outcome.free)
    surge = [n in ESTIMATED and ESTIMATED[n].equation == "X" for n in names]
    blocks = [[i for i, x in enumerate(surge) if x], [i for i, x in enumerate(surge) if not x]]
    return [block for block in blocks if block]


def _run(
    setup: Setup, factor: float, progress: Progress | None
) -> tuple[list[Step], list[Finding]]:
    """All stages of the plan from the prior values times a factor."""
    parameters = setup.start.copy()
    parameters[setup.prior_std > 0.0] *= factor
    rounds = setup.plan.rounds()
    done: list[Step] = []
    findings: list[Finding] = []
    costs = [_cost(setup, stage) for _, stage in rounds]
    for number, (cycle, stage) in enumerate(rounds):
        if progress:
            progress(f"cycle {cycle}, {stage.name}", sum(costs[:number]) / sum(costs))
        if not stage_records(setup, stage) and number + 1 < len(rounds):
            if cycle == 1:
                findings.append(_skipped(stage))
            continue
        try:
            outcome, told = _outcome(setup, parameters, stage)
        except NumericsError as error:
            if stage.method == "filter" or not done:
                raise
            findings.append(_not_refined(stage, error))
            continue
        parameters = outcome.parameters
        findings += told
        done.append(Step(cycle, factor, stage, outcome))
    return done, findings


def _cost(setup: Setup, stage: PlanStage) -> float:
    """About how long a pass takes, in any unit."""
    samples = 1.0 + sum(len(record.time_s) for record in stage_records(setup, stage))
    if stage.method == "output_error":
        return samples * PASS_COST["output_error"]
    slower = WITH_FILTERPY if setup.engine == "filterpy" else SLOWER[setup.filter]
    return samples * PASS_COST.get(stage.system, PASS_COST["coupled"]) * slower


def _outcome(setup: Setup, parameters: Array, stage: PlanStage) -> tuple[Outcome, list[Finding]]:
    """What a stage found; with the EKF where the UKF fails.

    Early in a plan the model may run away with the coefficients at hand. Sigma points that lie
    where it does reach no value; a derivative at the states that were measured exists.
    """
    try:
        return run_stage(setup, parameters, stage), []
    except NumericsError as error:
        if setup.filter == "ekf" or stage.method != "filter":
            raise
        outcome = run_stage(replace(setup, filter="ekf"), parameters, stage)
        return outcome, [_ekf_instead(stage, error)]


def _average(setup: Setup, outcomes: Sequence[Outcome]) -> Outcome:
    """Mean of the results of several starts; their scatter adds to the covariance."""
    if len(outcomes) == 1:
        return outcomes[0]
    last = outcomes[-1]
    values = np.array([o.parameters for o in outcomes])
    parameters = values.mean(axis=0)
    away = (values - parameters)[:, last.free] / setup.prior_std[last.free]
    covariance = last.covariance + away.T @ away / len(outcomes)
    return replace(last, parameters=parameters, covariance=covariance)


def _disagreement(outcomes: Sequence[Outcome], setup: Setup) -> list[Finding]:
    """Coefficients whose result depends on where the estimation started."""
    found = []
    last = outcomes[-1]
    spread = np.sqrt(np.diag(last.covariance)) * setup.prior_std[last.free]
    values = np.array([o.parameters[last.free] for o in outcomes])
    apart = np.ptp(values, axis=0) / spread
    for column in np.flatnonzero(apart > STARTS_APART):
        symbol = setup.names(last.free)[column]
        found.append(
            Finding(
                code="depends-on-start",
                where=symbol,
                value=float(apart[column]),
                threshold=STARTS_APART,
                message=f"{symbol} depends on its initial value",
                remedy="Use more cycles, or add a maneuver that shows it.",
            )
        )
    return found


def _not_refined(stage: PlanStage, error: NumericsError) -> Finding:
    return Finding(
        code="not-refined",
        message=f"{error.problem}; the result of the filter is kept",
        where=f"stage {stage.name!r}",
        remedy="Its prediction may diverge as well: run `auvident validate`, and hold out "
        "the maneuvers in which it does.",
    )


def _ekf_instead(stage: PlanStage, error: NumericsError) -> Finding:
    return Finding(
        code="ekf-instead",
        message=(
            f"{error.problem} ({error.where}); this stage was run with the EKF instead of the UKF"
        ),
        where=f"stage {stage.name!r}",
        remedy="Check whether `--filter ekf` ends at the same coefficients.",
    )


def _skipped(stage: PlanStage) -> Finding:
    return Finding(
        code="stage-skipped",
        message=f"there is no maneuver of kind {', '.join(stage.maneuvers)}",
        where=f"stage {stage.name!r}",
        remedy="Its coefficients are identified from the other maneuvers and the prior.",
    )
