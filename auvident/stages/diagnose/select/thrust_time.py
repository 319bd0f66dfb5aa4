"""When the thrust fell: the time of a step of the thrust, which no slope can find.

The search takes the time that explains most in the maneuvers that identify. What they leave open
is narrowed with the log between the maneuvers; held-out maneuvers have no part, so that a step in
one of them stays undecided for as long as it lasts, and is predicted as the mean of all its times.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.free_run import normal_equations
from auvident.engines.records import Record, record_of, sensor_matrix
from auvident.schema.artifacts import Maneuver, Maneuvers
from auvident.schema.channels import RECORD_COLUMN, TIME_COLUMN
from auvident.schema.diagnosis import ParameterValue
from auvident.schema.trial import Trial
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted, fit_with, output_error
from auvident.stages.diagnose.score.first_order import gains_of_absent
from auvident.stages.diagnose.select.candidates import Traced

Array = npt.NDArray[Any]

STEP = "thrust_step"
TIME, OVER = f"{STEP}.time_s", f"{STEP}.over_s"
APART_S = 120.0  # steps of thrust are looked for this far apart,
MOST_TIMES = 20  # ... in a long trial further, so that time grows with its length
REACHES = (0.75, 0.19)  # ... and then about the best one [of that]
FINE_S = 2.0  # ... and at last this far apart, between the maneuvers before and after
# [nats] times worse by less than this stay possible: a 95 % interval of one parameter needs 1.92;
# a model is never as good as its noise says, hence twice that
POSSIBLE = 4.0
SHORTEST_S = 8.0  # pieces of the log between maneuvers that say something


def with_best_time(case: Case, fitted: Fitted) -> Fitted:
    """The model with the time at which a step of the thrust would explain most.

    A model that carries a step already stays as it is.
    """
    if STEP in fitted.effects:
        return fitted
    starts, ends = zip(*(_span(r) for r in case.records), strict=True)
    apart = max(APART_S, (max(ends) - min(starts)) / MOST_TIMES)
    best = _best(case, fitted, np.arange(min(starts), max(ends), apart)[1:])
    for reach in REACHES:
        best = _best(case, fitted, best + reach * apart * np.linspace(-1, 1, 5))
    return replace(fitted, parameters=_at(case, fitted.parameters, best))


def _best(case: Case, fitted: Fitted, times: Sequence[float] | Array) -> float:
    forms = [_at(case, fitted.parameters, float(time)) for time in times]
    return float(times[int(np.argmax(gains_of_absent(case, fitted, STEP, forms)))])


def _at(case: Case, p: Array, time: float, undecided: float = 0.0) -> Array:
    """Parameters with another time of the step."""
    moved = p.copy()
    moved[case.position(TIME)], moved[case.position(OVER)] = time, undecided
    return moved


def _span(record: Record) -> tuple[float, float]:
    """First and last second of a record since the start of its trial."""
    assert record.source is not None
    elapsed = record.source.elapsed_s
    return float(elapsed[len(elapsed) - len(record.time_s)]), float(elapsed[-1])


def narrowed(traced: Traced, trials: Sequence[Trial], maneuvers: Maneuvers) -> Traced:
    """The result of a search with the step of the thrust where the whole log allows it.

    Parameters
    ----------
    traced : Traced
    trials : sequence of Trial
        With the readings of held-out maneuvers blanked.
    maneuvers : Maneuvers
    """
    case, final = traced.case, traced.final
    if STEP not in final.effects:
        return traced
    between = [r for t in trials for r in records_between(case, t, maneuvers)]
    low, high = possible_times(case, final, between)
    p = _at(case, final.parameters, 0.5 * (low + high), high - low)
    again = fit_with(case, final.effects, p, final.colours, rounds=1)
    return replace(traced, final=again or replace(final, parameters=p))


def records_between(case: Case, trial: Trial, maneuvers: Maneuvers) -> list[Record]:
    """The log between the maneuvers of a trial, in pieces without a gap."""
    time = trial.table[TIME_COLUMN].to_numpy()
    piece = trial.table[RECORD_COLUMN].to_numpy().copy()
    for m in (m for m in maneuvers.maneuvers if m.trial == trial.name):
        piece[(time >= m.t_start_s) & (time < m.t_end_s)] = -1
    cuts = np.flatnonzero(np.diff(piece)) + 1
    plane, sensing = case.setup.structure.plane, case.setup.sensing
    found = []
    for rows in np.split(np.arange(len(time)), cuts):
        if piece[rows[0]] >= 0 and len(rows) > SHORTEST_S * trial.rate_hz:
            span = Maneuver(
                id=f"{trial.name}-between-{rows[0]}",
                trial=trial.name,
                kind="straight",
                t_start_s=time[rows[0]],
                t_end_s=time[rows[-1]],
                role="identify",
            )
            found.append(record_of(span, trial, plane, sensor_matrix(plane, sensing)))
    return found


def possible_times(case: Case, fitted: Fitted, between: Sequence[Record]) -> tuple[float, float]:
    """First and last time that the step can have had, since the start of the trial.

    Looked for from the start of the last maneuver before the best time to the end of the first
    one after it, with the model as it is.
    """
    best, spans = float(fitted.parameters[case.position(TIME)]), [_span(r) for r in case.records]
    low = max([s for s, e in spans if e < best], default=min(s for s, _ in spans))
    high = min([e for s, e in spans if s > best], default=max(e for _, e in spans))
    times = np.arange(low, high + FINE_S, FINE_S)
    costs = np.zeros(len(times))
    for record in (*case.records, *between):
        start, end = _span(record)
        if end >= low and start <= high:
            cost = _cost_of(case, fitted, record)
            # a step before the record or after it is the same wherever it lies
            costs += [cost(float(np.clip(t, start, end + FINE_S))) for t in times]
    good = times[costs <= costs.min() + POSSIBLE]
    return float(good[0] - 0.5 * FINE_S), float(good[-1] + 0.5 * FINE_S)


def _cost_of(case: Case, fitted: Fitted, record: Record) -> Callable[[float], float]:
    """What a record costs with the step at a time [nats]; infinite where it runs away."""
    output = output_error(case, fitted.colours)

    @cache
    def cost(time: float) -> float:
        p = _at(case, fitted.parameters, time)
        parts = normal_equations(output, p, record, output.no_parameter)
        return parts[0] if parts is not None else np.inf

    return cost


def step_time(case: Case, p: Array) -> ParameterValue:
    """Time of the step as the log of the first trial counts it, with the interval it lies in."""
    first, half = case.records[0], 0.5 * float(p[case.position(OVER)])
    time = float(p[case.position(TIME)] + first.time_s[0] - _span(first)[0])
    return ParameterValue(
        symbol="time_s",
        value=time,
        std=half / 3.0**0.5,
        unit="s",
        low=time - half,
        high=time + half,
    )
