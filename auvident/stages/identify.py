"""Identification: the stages of a plan, from the ASE to the identified model."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pandas as pd

from auvident.engines.estimator import (
    Outcome,
    Setup,
    data_information,
    run_stage,
    stage_records,
)
from auvident.engines.records import STATE_COLUMNS, record_of, sensor_matrix
from auvident.errors import NumericsError
from auvident.estimation.identifiability import (
    Direction,
    correlations,
    data_shares,
    unseen_directions,
)
from auvident.physics.terms import Structure, parameter_vector, structure_of, symbol_in
from auvident.schema.artifacts import (
    AseResult,
    Combination,
    Finding,
    IdentifiedModel,
    Maneuver,
    Maneuvers,
    ModelCoefficient,
    Origin,
    RigidBody,
    Sensing,
    StageRecord,
)
from auvident.schema.channels import BY_COLUMN
from auvident.schema.coefficients import BY_SYMBOL, Plane, prime_unit, symbols_of
from auvident.schema.plan import Plan, PlanStage
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle

Array = npt.NDArray[np.float64]
Progress = Callable[[str, float], None]

GRAVITY_MPS2 = 9.80665
# Accuracy of a channel when neither the vehicle file nor the log tells: a common DVL, a
# fibre-optic or MEMS rate gyro, a compass.
DEFAULT_STD = {"m/s": 5.0e-3, "rad/s": 1.0e-3, "rad": 5.0e-3}
ANGLE_STD_RAD = 5.0e-3
HISTORY_PERIOD_S = 0.5  # the history of the coefficients is stored this often
NOT_MOVED = 0.05  # data share below which a coefficient stayed where the prior put it
CORRELATED = 0.95
STARTS_APART = 1.0  # [std] results of several starts further apart than this are named


@dataclass(frozen=True)
class Identification:
    """What `identify` returns: the model and the history of its coefficients."""

    model: IdentifiedModel
    history: pd.DataFrame


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
    progress : callable, optional
        Called with a text and the fraction done.

    Raises
    ------
    NumericsError
        Nothing to identify from, or a filter failed (with maneuver and time).
    """
    setup, sensing = prepare(
        trials, maneuvers, ase, vehicle, noise, plane=plane, plan=plan, filter=filter,
        engine=engine,
    )  # fmt: skip
    runs = [_run(setup, factor, progress) for factor in plan.start]
    done, skipped = runs[-1]
    findings = [*skipped, *_disagreement([run[0][-1].outcome for run in runs], setup)]
    final = _average(setup, [run[0][-1].outcome for run in runs])
    unseen = unseen_directions(data_information(setup, final, done[-1].stage))
    done = [*done[:-1], replace(done[-1], outcome=final)]
    model = _model(setup, sensing, ase, vehicle, done, unseen, findings)
    return Identification(model, _history(setup, [step for run in runs for step in run[0]]))


@dataclass(frozen=True)
class Step:
    """A stage that was run: in which cycle, from which start, and what it left."""

    cycle: int
    start: float
    stage: PlanStage
    outcome: Outcome


def _run(
    setup: Setup, factor: float, progress: Progress | None
) -> tuple[list[Step], list[Finding]]:
    """All stages of the plan from the prior values times a factor."""
    parameters = setup.prior.copy()
    parameters[: len(symbols_of(setup.structure.plane))] *= factor
    rounds = setup.plan.rounds()
    done: list[Step] = []
    skipped = []
    for number, (cycle, stage) in enumerate(rounds):
        if progress:
            progress(f"cycle {cycle}: {stage.name}", number / len(rounds))
        if not stage_records(setup, stage) and number + 1 < len(rounds):
            if cycle == 1:
                skipped.append(_skipped(stage))
            continue
        outcome = run_stage(setup, parameters, stage)
        parameters = outcome.parameters
        done.append(Step(cycle, factor, stage, outcome))
    return done, skipped


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
        symbol = setup.structure.parameters[last.free[column]]
        found.append(Finding(
            code="depends-on-start", where=symbol, value=float(apart[column]),
            threshold=STARTS_APART,
            message=f"{symbol} depends on the value the estimation starts from",
            remedy="More cycles, or another maneuver that shows it.",
        ))  # fmt: skip
    return found


def prepare(
    trials: Sequence[Trial],
    maneuvers: Maneuvers,
    ase: AseResult,
    vehicle: Vehicle,
    noise: Mapping[str, float],
    *,
    plane: Plane,
    plan: Plan,
    filter: str,
    engine: str,
) -> tuple[Setup, Sensing]:
    """Arrays of the identification; see `identify` for the parameters."""
    structure = structure_of(plane)
    sensing = sensing_of(vehicle, noise, plane)
    sensor = sensor_matrix(plane, sensing)
    by_name = {trial.name: trial for trial in trials}
    chosen = [m for m in maneuvers.maneuvers if m.role == "identify" and plane_of(m) == plane]
    if not chosen:
        raise NumericsError(
            f"no maneuver of the {plane} plane identifies",
            remedy="Hold out fewer maneuvers, or add a trial with maneuvers of this plane.",
        )
    records = {m.id: (m.kind, record_of(m, by_name[m.trial], plane, sensor)) for m in chosen}
    values, stds = priors(ase, plane)
    prior = parameter_vector(plane, values, rigid_body(vehicle, plane))
    prior_std = np.array([stds.get(name, 0.0) for name in structure.parameters])
    followers = np.array(
        [[structure.index(symbol_in(plane, "B_adot")), structure.index(symbol_in(plane, "A_bdot"))]]
    )
    rate_hz = by_name[chosen[0].trial].rate_hz
    return (
        Setup(
            structure, plan, records, 1.0 / rate_hz, sensor,
            np.array([sensing.noise_std[c] for c in STATE_COLUMNS[plane]]), prior, prior_std,
            followers, filter, engine,
        ),
        sensing,
    )  # fmt: skip


def plane_of(maneuver: Maneuver) -> str:
    """Plane of motion a maneuver belongs to."""
    return str(maneuver.features.get("plane", "horizontal"))


def priors(ase: AseResult, plane: Plane) -> tuple[dict[str, float], dict[str, float]]:
    """Value and standard deviation of each coefficient of a plane before the data."""
    wanted = set(symbols_of(plane))
    rows = [c for c in ase.coefficients if c.symbol in wanted]
    return {c.symbol: c.value for c in rows}, {c.symbol: c.std for c in rows}


def rigid_body(vehicle: Vehicle, plane: Plane) -> RigidBody:
    """Mass properties in the equations of a plane."""
    body = vehicle.body
    weight = body.mass_kg * GRAVITY_MPS2
    inertia = body.izz_kgm2 if plane == "horizontal" else (body.iyy_kgm2 or body.izz_kgm2)
    return RigidBody(
        mass_kg=body.mass_kg,
        x_g_m=body.x_g_m,
        z_g_m=body.z_g_m,
        inertia_kgm2=inertia,
        weight_n=weight,
        buoyancy_n=body.buoyancy_n or weight,
    )


def sensing_of(vehicle: Vehicle, noise: Mapping[str, float], plane: Plane) -> Sensing:
    """Sensor positions and accuracies: the vehicle file, else the log, else a common sensor."""
    stated = {"dvl": vehicle.dvl.std_mps, "gyro": vehicle.gyro.std_radps}
    stds = {}
    for column in STATE_COLUMNS[plane]:
        channel = BY_COLUMN[column]
        stds[column] = stated.get(channel.sensor) or noise.get(column) or DEFAULT_STD[channel.unit]
    return Sensing(
        dvl_x_m=vehicle.dvl.x_m,
        dvl_y_m=vehicle.dvl.y_m,
        dvl_z_m=vehicle.dvl.z_m,
        dvl_mounting_yaw_rad=math.radians(vehicle.dvl.mounting_yaw_deg),
        noise_std=stds,
        process_noise_std={},
    )


def _skipped(stage: PlanStage) -> Finding:
    return Finding(
        code="stage-skipped",
        message=f"there is no maneuver of the kinds {', '.join(stage.maneuvers)}",
        where=f"stage {stage.name!r}",
        remedy="Its coefficients rest on the other maneuvers and on the prior.",
    )


def _model(
    setup: Setup, sensing: Sensing, ase: AseResult, vehicle: Vehicle,
    done: Sequence[Step], unseen: Sequence[Direction],
    findings: Sequence[Finding],
) -> IdentifiedModel:  # fmt: skip
    """Assemble the artifact from the last stage that estimated each coefficient."""
    final = done[-1].outcome
    structure, plane = setup.structure, setup.structure.plane
    last: dict[int, tuple[Outcome, int]] = {}
    for step in done:
        for column, position in enumerate(step.outcome.free):
            last[int(position)] = (step.outcome, column)
    rows = tuple(
        _row(setup, ase, final.parameters, last, structure.index(symbol))
        for symbol in symbols_of(plane)
    )
    symbols = [structure.parameters[i] for i in final.free]
    return IdentifiedModel(
        vehicle=vehicle.body.name,
        plane=plane,
        filter=setup.filter,  # type: ignore[arg-type]
        engine=setup.engine,  # type: ignore[arg-type]
        plan=setup.plan.name,
        length_m=ase.length_m,
        density_kgpm3=ase.density_kgpm3,
        rigid_body=rigid_body(vehicle, plane),
        sensing=sensing,
        coefficients=rows,
        covariance=_covariance(setup, final, symbols),
        correlations=correlations(final.covariance, symbols),
        unidentifiable=tuple(_combination(direction, symbols) for direction in unseen),
        stages=tuple(_stage_record(structure, step) for step in done),
        findings=(*findings, *_findings(rows, final, symbols)),
    )


def _combination(direction: Direction, symbols: Sequence[str]) -> Combination:
    """A direction the data cannot see, in words."""
    named = direction.named(symbols)
    equations = {BY_SYMBOL[symbol].equation for symbol, _ in named}
    if not direction.structural:
        meaning = "these maneuvers hardly show this combination; the prior holds it"
    elif equations == {"X"}:
        meaning = (
            "common scale of the surge equation: only ratios to the inertia can be seen, "
            "whatever the data; the prior holds it"
        )
    else:
        meaning = (
            "mixing of the two lateral equations (the mass matrix times any matrix): no data "
            "can see it; the prior holds it"
        )
    return Combination(
        symbols=tuple(symbol for symbol, _ in named),
        weights=tuple(weight for _, weight in named),
        information=direction.information,
        structural=direction.structural,
        meaning=meaning,
    )


def _covariance(setup: Setup, final: Outcome, symbols: Sequence[str]) -> dict:
    """Posterior covariance of the coefficients, dimensional."""
    scale = setup.prior_std[final.free]
    matrix = final.covariance * np.outer(scale, scale)
    return {"symbols": list(symbols), "matrix": matrix.tolist()}


def _row(
    setup: Setup, ase: AseResult, parameters: Array, last: dict[int, tuple[Outcome, int]],
    position: int,
) -> ModelCoefficient:  # fmt: skip
    symbol = setup.structure.parameters[position]
    leaders = dict(setup.followers.tolist())
    unit = prime_unit(symbol, ase.density_kgpm3, ase.length_m)
    prior_std = float(setup.prior_std[position])
    source = last.get(leaders.get(position, position))
    origin: Origin = "kinematic" if position in leaders else "identified"
    std, share = prior_std, 0.0
    if source is None:
        origin = next(c.origin for c in ase.coefficients if c.symbol == symbol)
    else:
        outcome, column = source
        leader = int(outcome.free[column])
        std = float(np.sqrt(outcome.covariance[column, column]) * setup.prior_std[leader])
        share = float(data_shares(outcome.covariance)[column])
    return ModelCoefficient(
        symbol=symbol,
        value=float(parameters[position]),
        std=std,
        unit=BY_SYMBOL[symbol].unit,
        prime=float(parameters[position]) / unit,
        prior=float(setup.prior[position]),
        prior_std=prior_std,
        origin=origin,
        data_share=share,
    )


def _stage_record(structure: Structure, step: Step) -> StageRecord:
    outcome, passed = step.outcome, step.outcome.passed
    nis = {}
    if passed is not None:
        for c, column in enumerate(STATE_COLUMNS[structure.plane]):
            values = passed.whitened[:, :, c]
            if np.isfinite(values).any():
                nis[column] = float(np.nanmean(values**2))
    return StageRecord(
        stage=step.stage.name,
        cycle=step.cycle,
        system=step.stage.system,
        free=tuple(structure.parameters[i] for i in outcome.free),
        maneuvers=outcome.ids,
        samples=outcome.samples,
        log_likelihood=outcome.log_likelihood,
        noise_std={
            column: float(outcome.noise[c])
            for c, column in enumerate(STATE_COLUMNS[structure.plane])
        },
        nis_mean=nis,
    )


def _findings(
    rows: Sequence[ModelCoefficient], final: Outcome, symbols: Sequence[str]
) -> list[Finding]:
    """Warnings about coefficients, each with its evidence."""
    found = []
    for row in rows:
        if row.origin == "identified" and row.data_share < NOT_MOVED:
            found.append(Finding(
                code="not-seen", where=row.symbol, value=row.data_share, threshold=NOT_MOVED,
                message=f"{row.symbol} rests on its prior: these maneuvers hardly show it",
            ))  # fmt: skip
        expected = BY_SYMBOL[row.symbol].sign
        if expected and row.value * expected < 0.0 and abs(row.value) > 2.0 * row.std:
            found.append(Finding(
                code="wrong-sign", where=row.symbol, value=row.value, threshold=0.0,
                message=f"{row.symbol} has the sign opposite to a streamlined hull's",
                remedy="It may stand in for an effect the model lacks.",
            ))  # fmt: skip
    spread = np.sqrt(np.diag(final.covariance))
    matrix = final.covariance / np.outer(spread, spread)
    for i, j in zip(*np.where(np.triu(np.abs(matrix), 1) > CORRELATED), strict=True):
        found.append(Finding(
            code="correlated", where=f"{symbols[i]}, {symbols[j]}", value=float(matrix[i, j]),
            threshold=CORRELATED,
            message=f"{symbols[i]} and {symbols[j]} can hardly be told apart",
        ))  # fmt: skip
    return found


def _history(setup: Setup, done: Sequence[Step]) -> pd.DataFrame:
    """Every coefficient and its standard deviation against time, by stage and cycle."""
    pieces = []
    every = max(round(HISTORY_PERIOD_S / setup.dt_s), 1)
    for order, step in enumerate(done):
        outcome = step.outcome
        symbols = [setup.structure.parameters[i] for i in outcome.free]
        if outcome.passed is not None:
            rows = slice(0, None, every)
            values, stds = outcome.passed.history[rows], outcome.passed.history_std[rows]
        else:
            scale = setup.prior_std[outcome.free]
            values = outcome.parameters[outcome.free][None, :]
            stds = np.sqrt(np.diag(outcome.covariance))[None, :] * scale
        times = np.arange(len(values)) * every * setup.dt_s
        pieces.append(pd.DataFrame({
            "order": order, "start": step.start, "cycle": step.cycle, "stage": step.stage.name,
            "time_s": np.repeat(times, len(symbols)), "symbol": symbols * len(times),
            "value": values.ravel(), "std": stds.ravel(),
        }))  # fmt: skip
    return pd.concat(pieces, ignore_index=True)
