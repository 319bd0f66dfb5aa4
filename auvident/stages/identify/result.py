"""The identified model and its history from the stages that were run."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import BEYOND_CHANCE_NATS, NOT_MOVED
from auvident.engines.carried import Carried, effect_rows
from auvident.engines.constraints import states_at
from auvident.engines.flown import range_of
from auvident.engines.free_run import NOTHING
from auvident.engines.jackknife import Scatter, structural_covariance
from auvident.engines.prediction import at_effects, linear_about
from auvident.engines.records import STATE_COLUMNS
from auvident.engines.setup import Outcome, Setup, active_states
from auvident.engines.states import smoothed_states
from auvident.estimation.identifiability import (
    Direction,
    correlations,
    data_shares,
)
from auvident.physics.consistency import BY_CONSTRAINT
from auvident.physics.terms import Structure
from auvident.schema.artifacts import (
    AseResult,
    Combination,
    ConstraintState,
    Finding,
    FittedNoise,
    IdentifiedModel,
    ModelCoefficient,
    ModelConstant,
    Origin,
    StageRecord,
)
from auvident.schema.coefficients import (
    BY_SYMBOL,
    ESTIMATED,
    constants_of,
    prime_unit,
    symbols_of,
)
from auvident.schema.effects import parameter_of
from auvident.schema.plan import PlanStage
from auvident.schema.trial import Columns, stacked
from auvident.schema.vehicle import Vehicle
from auvident.stages.identify.profiles import SECANT
from auvident.stages.identify.residuals import innovations_tested, nis_findings
from auvident.stages.identify.setup import rigid_body

Array = npt.NDArray[Any]

HISTORY_PERIOD_S = 0.5  # the history of the coefficients is stored this often
CORRELATED = 0.95
RESTS_ON_FILE = "rests on the vehicle file"
# scatter between maneuvers, where it is beyond chance, over the filter's own standard deviation
DISAGREE = 2.0


@dataclass(frozen=True)
class Step:
    """A stage that was run: in which cycle, from which start, and what it left."""

    cycle: int
    start: float
    stage: PlanStage
    outcome: Outcome


def model_of(
    setup: Setup,
    ase: AseResult,
    vehicle: Vehicle,
    done: Sequence[Step],
    unseen: Sequence[Direction],
    scatter: Scatter | None,
    findings: Sequence[Finding],
    carried: Carried | None = None,
) -> IdentifiedModel:
    """Assemble the artifact from the last stage that estimated each coefficient.

    `scatter` is that of the last stage's coefficients; None when there are too few maneuvers.
    """
    final = done[-1].outcome
    widen = widening(final.covariance, scatter, _steady(setup.names(final.free)))
    structure, plane = setup.structure, setup.structure.plane
    last: dict[int, tuple[Outcome, int]] = {}
    for step in done:
        for column, position in enumerate(step.outcome.free):
            last[int(position)] = (step.outcome, column)
    found = (
        _row(setup, ase, final.parameters, last, structure.index(symbol))
        for symbol in (*symbols_of(plane), *constants_of(plane))
    )
    rows = tuple(_widened(row, final, structure, setup.followers, scatter, widen) for row in found)
    symbols = setup.names(final.free)
    records = tuple(_stage_record(setup, step) for step in done)
    constraints = states_at(setup.constraints, final.parameters, final.prices)
    return IdentifiedModel(
        vehicle=vehicle.body.name,
        plane=plane,
        filter=setup.filter,  # type: ignore[arg-type]
        engine=setup.engine,  # type: ignore[arg-type]
        plan=setup.plan.name,
        length_m=ase.length_m,
        density_kgpm3=ase.density_kgpm3,
        rigid_body=rigid_body(vehicle, plane),
        sensing=setup.sensing,
        flown=range_of([record for _, record in setup.records.values()], plane),
        coefficients=tuple(row for row in rows if isinstance(row, ModelCoefficient)),
        constants=tuple(row for row in rows if not isinstance(row, ModelCoefficient)),
        effects=_effects(setup, final, widen, carried),
        covariance=_covariance(setup, final, symbols, widen),
        correlations=correlations(final.covariance, symbols),
        unidentifiable=tuple(_combination(direction, symbols) for direction in unseen),
        constraints=constraints,
        stages=records,
        findings=(
            *findings,
            *_findings(rows, final, symbols, _by_chance(symbols, scatter)),
            *_constraint_findings(constraints),
            *nis_findings(records[-1]),
        ),
    )


def _constraint_findings(constraints: Sequence[ConstraintState]) -> list[Finding]:
    """Constraints that hold a model against what the data ask for."""
    return [
        Finding(
            code="against-physics",
            where=state.id,
            value=state.cost_nats,
            threshold=BEYOND_CHANCE_NATS,
            message=f"the data ask for {BY_CONSTRAINT[state.id].asks} "
            f"(cost {state.cost_nats:.0f} nats): {BY_CONSTRAINT[state.id].lacks}",
            remedy="The model keeps what physics allows; look for the effect with "
            "`auvident diagnose` before using the coefficients.",
        )
        for state in constraints
        if state.cost_nats > BEYOND_CHANCE_NATS
    ]


def _effects(
    setup: Setup, final: Outcome, widen: Array, carried: Carried | None
) -> tuple[dict[str, Any], ...]:
    """The effects that the model carries, with the standard deviations of those estimated.

    The scatter between maneuvers is that of a Newton step, which means nothing along a secant:
    play of 1.4 degrees that refits without each maneuver put within 0.04 scattered by 1.1.
    """
    if carried is None:
        return ()
    names = setup.names(final.free)
    spread = np.sqrt(np.diag(final.covariance)) * setup.prior_std[final.free]
    spread *= np.where(_smooth(names), widen, 1.0)
    stds = {name: float(std) for name, std in zip(names, spread, strict=True)}
    return effect_rows(setup.structure, final.parameters, stds, carried.expected, carried.effects)


def _smooth(names: Sequence[str]) -> npt.NDArray[np.bool_]:
    """Parameters with a slope that is a derivative."""
    return np.array(["." not in n or parameter_of(n).step < SECANT for n in names])


def scatter_matrix(
    setup: Setup,
    final: Outcome,
    gradients: Mapping[str, Array],
    curvatures: Mapping[str, Array],
    prior: Array,
) -> dict[str, Any]:
    """Covariance of the estimates by the scatter between maneuvers, dimensional, as an entry.

    What the equations lack pulls every maneuver elsewhere, and every kind of them. At motions that
    drawn vehicles of other structure were in (`tests.bench.totals`) the accelerations of the model
    were off by more than the readings alone allow for; with this covariance added the claims hold.
    """
    kinds = {name: setup.records[name][0] for name in gradients}
    covariance = structural_covariance(gradients, curvatures, prior, kinds)
    if covariance is None:
        return {}
    unit = setup.prior_std[final.free] * _smooth(setup.names(final.free))
    return {"scatter": (covariance * np.outer(unit, unit)).tolist()}


def _combination(direction: Direction, symbols: Sequence[str]) -> Combination:
    """A direction the data cannot see, in words."""
    named = direction.named(symbols)
    equations = {ESTIMATED[symbol].equation for symbol, _ in named if symbol in ESTIMATED}
    # what is carried along (a servo's delay) may not show where it is; no equation hides it
    structural = direction.structural and bool(equations)
    if not structural:
        meaning = "combination that these maneuvers hardly show: its value comes from the prior"
    elif equations == {"X"}:
        meaning = (
            "common scale of the surge equation: only ratios to the inertia are "
            "identifiable, from any trial; the prior sets the scale"
        )
    else:
        pair = "heave and pitch" if equations & {"Z", "M"} else "sway and yaw"
        meaning = (
            f"linear combination of the {pair} equations (any matrix times the mass "
            "matrix): not identifiable from any trial; its value comes from the prior"
        )
    return Combination(
        symbols=tuple(symbol for symbol, _ in named),
        weights=tuple(weight for _, weight in named),
        information=direction.information,
        structural=structural,
        meaning=meaning,
    )


def _steady(names: Sequence[str]) -> npt.NDArray[np.bool_]:
    """Constants, which stand for a steady force or moment."""
    return np.array([name in ESTIMATED and name not in BY_SYMBOL for name in names])


def widening(
    covariance: Array, scatter: Scatter | None, steady: npt.NDArray[np.bool_] | bool = False
) -> Array:
    """Factor (n,) on each standard deviation: up to a scatter beyond chance, within the prior's.

    What pulls a maneuver steadily is no noise that averages out within it. Hence the scatter of a
    steady moment always counts: on eight plants the errors of the trim moment were 1.85 of the
    fit's standard deviations (rms), and in six of the eight its scatter was the larger one.
    """
    spread = np.sqrt(np.diag(covariance))
    if scatter is None:
        return np.ones(len(spread))
    wide = np.where(scatter.beyond_chance | steady, scatter.std, 0.0)
    return np.maximum(np.minimum(np.maximum(spread, wide), 1.0) / spread, 1.0)


def _widened(
    row: ModelConstant,
    final: Outcome,
    structure: Structure,
    followers: Array,
    scatter: Scatter | None,
    widen: Array,
) -> ModelConstant:
    """A row with its standard deviation widened to the scatter between maneuvers."""
    position = structure.index(row.symbol)
    position = dict(followers.tolist()).get(position, position)
    found = np.flatnonzero(final.free == position)
    if scatter is None or not found.size:
        return row.model_copy(update={"std_filter": row.std})
    column = int(found[0])
    unit = row.std / float(np.sqrt(final.covariance[column, column]))
    return row.model_copy(
        update={
            "std": row.std * float(widen[column]),
            "std_filter": row.std,
            "std_jackknife": float(scatter.std[column]) * unit,
        }
    )


def _covariance(
    setup: Setup, final: Outcome, symbols: Sequence[str], widen: Array
) -> dict[str, Any]:
    """Posterior covariance of the coefficients, dimensional, and their variances in the fit."""
    # added to the variances: scaling rows and columns would tilt what is known well together
    wide = final.covariance + np.diag((widen**2 - 1.0) * np.diag(final.covariance))
    scale = setup.prior_std[final.free]
    matrix = wide * np.outer(scale, scale)
    return {
        "symbols": list(symbols),
        "matrix": matrix.tolist(),
        "fitted_variance": (np.diag(final.covariance) * scale**2).tolist(),
        "scale": scale.tolist(),
        "prior": setup.prior[final.free].tolist(),
    }


def _row(
    setup: Setup,
    ase: AseResult,
    parameters: Array,
    last: dict[int, tuple[Outcome, int]],
    position: int,
) -> ModelConstant:
    symbol = setup.structure.parameters[position]
    leaders = dict(setup.followers.tolist())
    prior_std = float(setup.prior_std[position])
    source = last.get(leaders.get(position, position))
    origin: Origin = "kinematic" if position in leaders else "identified"
    std, share = prior_std, 0.0
    if source is None:
        origin = next((c.origin for c in ase.coefficients if c.symbol == symbol), "given")
    else:
        outcome, column = source
        leader = int(outcome.free[column])
        std = float(np.sqrt(outcome.covariance[column, column]) * setup.prior_std[leader])
        share = float(data_shares(outcome.covariance)[column])
    row = ModelConstant(
        symbol=symbol,
        value=float(parameters[position]),
        std=std,
        unit=ESTIMATED[symbol].unit,
        prior=float(setup.prior[position]),
        prior_std=prior_std,
        origin=origin,
        data_share=share,
    )
    if symbol not in BY_SYMBOL:
        return row
    prime = row.value / prime_unit(symbol, ase.density_kgpm3, ase.length_m)
    return ModelCoefficient(**row.model_dump(), prime=prime)


def _stage_record(setup: Setup, step: Step) -> StageRecord:
    structure, outcome, passed = setup.structure, step.outcome, step.outcome.passed
    active = active_states(step.stage.system, structure.plane)
    nis = innovations_tested(setup, outcome, step.stage, active)

    def named(values: Array) -> dict[str, float]:
        return dict(zip(STATE_COLUMNS[structure.plane], values.tolist(), strict=True))

    fitted = {
        column: FittedNoise(white_std=c.white, slow_std=c.slow, slow_time_s=c.time_s)
        for column, c, own in zip(
            STATE_COLUMNS[structure.plane], outcome.colours, active, strict=True
        )
        if own and passed is None
    }
    return StageRecord(
        stage=step.stage.name,
        cycle=step.cycle,
        system=step.stage.system,
        free=tuple(setup.names(outcome.free)),
        maneuvers=outcome.ids,
        samples=outcome.samples,
        log_likelihood=outcome.log_likelihood,
        noise_std=named(outcome.noise),
        nis_mean={column: test.mean for column, test in nis.items()},
        nis=nis,
        observer_time_s=outcome.observer_time_s,
        fitted_noise=fitted,
    )


def _by_chance(symbols: Sequence[str], scatter: Scatter | None) -> set[str]:
    """Symbols whose scatter chance explains."""
    if scatter is None:
        return set()
    return {name for name, beyond in zip(symbols, scatter.beyond_chance, strict=True) if not beyond}


def _findings(
    rows: Sequence[ModelConstant], final: Outcome, symbols: Sequence[str], by_chance: set[str]
) -> list[Finding]:
    """Warnings about coefficients and constants, each with its evidence."""
    of_rows = (
        finding
        for row in rows
        for finding in (_not_seen(row), _scattered(row, by_chance), _of_wrong_sign(row))
        if finding is not None
    )
    return [*of_rows, *_correlated(final.covariance, symbols)]


def _not_seen(row: ModelConstant) -> Finding | None:
    if row.origin != "identified" or row.data_share >= NOT_MOVED:
        return None
    return Finding(
        code="not-seen",
        where=row.symbol,
        value=row.data_share,
        threshold=NOT_MOVED,
        message="not identified by these maneuvers: the value "
        + ("rests on the prior" if row.symbol in BY_SYMBOL else RESTS_ON_FILE),
    )


def _scattered(row: ModelConstant, by_chance: set[str]) -> Finding | None:
    """Maneuvers that ask for other values, by more than the scatter of so few has by chance."""
    if row.origin != "identified" or not (row.std_jackknife and row.std_filter):
        return None
    ratio = row.std_jackknife / row.std_filter
    is_wider = row.std > row.std_filter and row.symbol not in by_chance
    if not is_wider or ratio <= DISAGREE or row.data_share <= NOT_MOVED:
        return None
    return Finding(
        code="maneuvers-disagree",
        where=row.symbol,
        value=ratio,
        threshold=DISAGREE,
        message="the maneuvers disagree: the standard deviation includes their scatter",
        remedy="An effect that the model lacks may act differently in them.",
    )


def _of_wrong_sign(row: ModelConstant) -> Finding | None:
    """A sign other than that of a streamlined hull, by two standard deviations."""
    expected = ESTIMATED[row.symbol].sign
    if not expected or row.value * expected >= 0.0 or abs(row.value) <= 2.0 * row.std:
        return None
    return Finding(
        code="wrong-sign",
        where=row.symbol,
        value=row.value,
        threshold=0.0,
        message="its sign is opposite to that of a streamlined hull"
        if row.symbol in BY_SYMBOL
        else "the centre of gravity lies above that of buoyancy",
        remedy="It may compensate for an effect that the model lacks.",
    )


def _correlated(covariance: Array, symbols: Sequence[str]) -> Iterator[Finding]:
    """Pairs of which the data determine a combination alone."""
    spread = np.sqrt(np.diag(covariance))
    matrix = covariance / np.outer(spread, spread)
    for i, j in zip(*np.where(np.triu(np.abs(matrix), 1) > CORRELATED), strict=True):
        yield Finding(
            code="correlated",
            where=f"{symbols[i]}, {symbols[j]}",
            value=float(matrix[i, j]),
            threshold=CORRELATED,
            message="strongly correlated: only a combination of the two is determined",
        )


def history_of(setup: Setup, done: Sequence[Step]) -> Columns:
    """Every coefficient and its standard deviation against time, by stage and cycle."""
    pieces = []
    every = max(round(HISTORY_PERIOD_S / setup.dt_s), 1)
    for order, step in enumerate(done):
        outcome = step.outcome
        symbols = setup.names(outcome.free)
        if outcome.passed is not None:
            rows = slice(0, None, every)
            values, stds = (
                outcome.passed.history[rows],
                outcome.passed.history_std[rows],
            )
        else:
            scale = setup.prior_std[outcome.free]
            values = outcome.parameters[outcome.free][None, :]
            stds = np.sqrt(np.diag(outcome.covariance))[None, :] * scale
        times = np.arange(len(values)) * every * setup.dt_s
        rows_of_all = len(times) * len(symbols)
        pieces.append(
            {
                "order": np.full(rows_of_all, order),
                "start": np.full(rows_of_all, step.start),
                "cycle": np.full(rows_of_all, step.cycle),
                "stage": np.full(rows_of_all, step.stage.name),
                "time_s": np.repeat(times, len(symbols)),
                "symbol": np.tile(symbols, len(times)),
                "value": values.ravel(),
                "std": stds.ravel(),
            }
        )
    return stacked(pieces)


def states_of(setup: Setup, parameters: Array) -> Columns:
    """Smoothed states of every maneuver that identifies, with their standard deviations."""
    active = active_states("coupled", setup.structure.plane)
    columns = STATE_COLUMNS[setup.structure.plane]
    pieces = []
    for name, (_, record) in setup.records.items():
        acting = at_effects(setup.frame, parameters, record)
        linear, sensor = linear_about(
            setup.frame, parameters, [acting], setup.free(NOTHING), len(record.time_s)
        )
        acting = replace(acting, measured=acting.measured - linear.offset[0])
        found = smoothed_states(
            setup.structure, parameters, acting, active, sensor, setup.sensor_std, setup.dt_s
        )
        piece = {"maneuver": np.full(len(record), name), "time_s": record.time_s}
        for c in np.flatnonzero(active):
            piece[columns[c]] = found.mean[:, c]
            piece[f"std_{columns[c]}"] = found.std[:, c]
        pieces.append(piece)
    return stacked(pieces)
