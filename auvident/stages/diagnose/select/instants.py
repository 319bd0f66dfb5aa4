"""When something happened: the time of an effect that is a step, which no slope can find.

The search takes the time that explains most in the maneuvers that identify, on the grid that the
table of effects declares. What they leave open is narrowed with the log between the maneuvers;
held-out maneuvers have no part, so that a step in one of them stays undecided for as long as it
lasts, and is predicted as the mean of all its times.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import VehicleTime
from auvident.engines.free_run import normal_equations
from auvident.engines.records import Record, record_of, sensor_matrix
from auvident.parallel import each
from auvident.schema.artifacts import Maneuver, Maneuvers
from auvident.schema.channels import RECORD_COLUMN, TIME_COLUMN
from auvident.schema.effects import BY_ID, TimeGrid
from auvident.schema.trial import Trial
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted, fit_with, output_error
from auvident.stages.diagnose.score.first_order import Form, scores_of_forms
from auvident.stages.diagnose.select.candidates import Traced

Array = npt.NDArray[Any]

# [nats] times worse by less than this stay possible: a 95 % interval of one parameter needs 1.92;
# a model is never as good as its noise says, hence twice that
POSSIBLE = 4.0
SHORTEST_S: VehicleTime = 8.0  # pieces of the log between maneuvers that say something


@dataclass(frozen=True)
class Instant:
    """Where the time of an effect stands in the parameters of a case.

    Attributes
    ----------
    effect : str
    time, width : int
        Positions of the time and of the width of the interval that it lies in.
    grid : TimeGrid
    low_s, high_s : float
        Bounds of the time.
    """

    effect: str
    time: int
    width: int
    grid: TimeGrid
    low_s: float
    high_s: float

    def at(self, p: Array, time_s: float, undecided_s: float = 0.0) -> Array:
        """Parameters with another time."""
        moved = p.copy()
        moved[self.time], moved[self.width] = time_s, undecided_s
        return moved


def instant_of(case: Case, effect: str) -> Instant | None:
    """The time of an effect; None for those without."""
    found = BY_ID[effect].instant
    if found is None or found.grid is None:
        return None
    width = next(p for p in BY_ID[effect].parameters if p.width_of == found.symbol)
    time, over = (case.position(f"{effect}.{p.symbol}") for p in (found, width))
    return Instant(effect, time, over, found.grid, found.low, found.high)


def with_best_times(case: Case, fitted: Fitted, candidates: Sequence[str]) -> Fitted:
    """The model with each absent effect that is a step at the time that would explain most."""
    for effect in candidates:
        instant = instant_of(case, effect)
        if instant is not None and effect not in fitted.effects:
            fitted = _with_best_time(case, fitted, instant)
    return fitted


def _with_best_time(case: Case, fitted: Fitted, instant: Instant) -> Fitted:
    best = _searched(case, instant, lambda times: _best(case, fitted, instant, times))
    return replace(fitted, parameters=instant.at(fitted.parameters, best))


def _searched(case: Case, instant: Instant, best_of: Callable[[Array], float]) -> float:
    """The best time by a grid over all maneuvers, and by closer ones about the best so far."""
    starts, ends = zip(*(span_of(r) for r in case.records), strict=True)
    first, last = max(min(starts), instant.low_s), min(max(ends), instant.high_s)
    apart = max(instant.grid.apart_s, (last - first) / instant.grid.most)
    inside = np.arange(first, last, apart)[1:]
    middle = np.array([0.5 * (first + last)])  # of what is shorter than a step of the grid
    best = best_of(inside if len(inside) else middle)
    for reach in instant.grid.reach:
        best = best_of(best + reach * apart * np.linspace(-1, 1, 5))
    return best


def _best(case: Case, fitted: Fitted, instant: Instant, times: Array) -> float:
    forms = [Form(instant.at(fitted.parameters, float(time)), case.records) for time in times]
    scores = scores_of_forms(case, fitted, instant.effect, forms)
    return float(times[int(np.argmax([s.gain for s in scores]))]) if scores else float(times[0])


def span_of(record: Record) -> tuple[float, float]:
    """First and last second of a record since the start of its trial."""
    assert record.source is not None
    elapsed = record.source.elapsed_s
    return float(elapsed[len(elapsed) - len(record.time_s)]), float(elapsed[-1])


def narrowed(traced: Traced, trials: Sequence[Trial], maneuvers: Maneuvers) -> Traced:
    """The result of a search with each time where the whole log allows it.

    Parameters
    ----------
    traced : Traced
    trials : sequence of Trial
        With the readings of held-out maneuvers blanked.
    maneuvers : Maneuvers
    """
    case = traced.case
    instants = [instant_of(case, effect) for effect in traced.final.effects]
    for instant in (i for i in instants if i is not None):
        between = [r for t in trials for r in records_between(case, t, maneuvers)]
        placed = placed_again(case, traced.final, instant, between)
        low, high = possible_times(case, placed, instant, between)
        traced = replace(traced, final=_over(case, placed, instant, low, high))
    return traced


def placed_again(case: Case, fitted: Fitted, instant: Instant, between: Sequence[Record]) -> Fitted:
    """The model fitted again with its step at each time of a grid, where it explains most.

    To first order a step lies where the model without it leaves most; what the coefficients had
    taken up of it moves it. A thrust that fell in a zigzag was put 50 s before it, and fitted
    there with 60 nats less. Seconds count: the fit has a hollow of its own at many times.

    A step to the other side is none of them, but another effect than the one that was accepted:
    beside a thrust that sags a drop of 12 % became a rise of 6 %, 500 s later (population, seed
    3178).
    """
    made: dict[float, tuple[float, Fitted]] = {}
    own = case.positions(instant.effect)
    accepted = fitted.parameters[own] / case.setup.prior_std[own] ** 2

    def add(time: float, found: Fitted | None) -> None:
        if found is not None and found.parameters[own] @ accepted >= 0.0:
            seen = replace(found, colours=fitted.colours)
            beside = sum(_cost_of(case, seen, instant, record)(time) for record in between)
            made[time] = (found.log_likelihood - beside, found)

    def again(time: float) -> Fitted | None:
        p = instant.at(fitted.parameters, time)
        return fit_with(case, fitted.effects, p, fitted.colours, rounds=1)

    def best_of(times: Array) -> float:
        new = [float(t) for t in times if float(t) not in made]
        for time, found in zip(new, each(again, new), strict=True):
            add(time, found)
        return max(made, key=lambda time: made[time][0])

    add(float(fitted.parameters[instant.time]), fitted)
    best = _searched(case, instant, best_of)
    reach = instant.grid.reach[-1] * instant.grid.apart_s
    return made[best_of(best + np.arange(-reach, reach, instant.grid.fine_s))][1]


def _over(case: Case, fitted: Fitted, instant: Instant, low: float, high: float) -> Fitted:
    """The model fitted again with a time that may be any of an interval."""
    p = instant.at(fitted.parameters, 0.5 * (low + high), high - low)
    again = fit_with(case, fitted.effects, p, fitted.colours, rounds=1)
    return again or replace(fitted, parameters=p)


def records_between(case: Case, trial: Trial, maneuvers: Maneuvers) -> list[Record]:
    """The log between the maneuvers of a trial, in pieces without a gap."""
    time, piece = trial.columns[TIME_COLUMN], trial.columns[RECORD_COLUMN].copy()
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
                plane=plane,
                planes=(plane,),
            )
            found.append(record_of(span, trial, plane, sensor_matrix(plane, sensing)))
    return found


def possible_times(
    case: Case, fitted: Fitted, instant: Instant, between: Sequence[Record]
) -> tuple[float, float]:
    """First and last time that a step can have had, since the start of the trial.

    Looked for from the start of the last maneuver before the best time to the end of the first
    one after it, with the model as it is.
    """
    best, spans = float(fitted.parameters[instant.time]), [span_of(r) for r in case.records]
    low = max([s for s, e in spans if e < best], default=min(s for s, _ in spans))
    high = min([e for s, e in spans if s > best], default=max(e for _, e in spans))
    fine = instant.grid.fine_s
    times = np.arange(low, high + fine, fine)
    costs = np.zeros(len(times))
    for record in (*case.records, *between):
        start, end = span_of(record)
        if end >= low and start <= high:
            cost = _cost_of(case, fitted, instant, record)
            # a step before the record or after it is the same wherever it lies
            costs += [cost(float(np.clip(t, start, end + fine))) for t in times]
    good = times[costs <= costs.min() + POSSIBLE]
    return float(good[0] - 0.5 * fine), float(good[-1] + 0.5 * fine)


def _cost_of(
    case: Case, fitted: Fitted, instant: Instant, record: Record
) -> Callable[[float], float]:
    """What a record costs with the step at a time [nats]; infinite where it runs away."""
    output = output_error(case, fitted.colours)

    @cache
    def cost(time: float) -> float:
        p = instant.at(fitted.parameters, time)
        parts = normal_equations(output, p, record, output.no_parameter)
        return parts[0] if parts is not None else np.inf

    return cost
