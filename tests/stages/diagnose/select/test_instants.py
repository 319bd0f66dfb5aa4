"""The time of a thrust step: found in the log between the maneuvers, open in what is held out."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from auvident.engines.free_run import NOTHING
from auvident.engines.prediction import At, readings_with_slopes
from auvident.engines.records import Record
from auvident.report.loop_words import place
from auvident.schema.artifacts import Maneuver
from auvident.schema.diagnosis import EffectFound, ParameterValue
from auvident.schema.effect_words import plain
from auvident.stages.diagnose.fit.case import ACTIVE, Case, case_of
from auvident.stages.diagnose.fit.fits import Fitted, first_colours, fit_with
from auvident.stages.diagnose.select import instants
from auvident.stages.diagnose.select.instants import (
    Instant,
    instant_of,
    placed_again,
    possible_times,
    records_between,
    span_of,
    with_best_times,
)
from auvident.stages.diagnose.verdict.uncertainty import time_of
from auvident.stages.identify import without_held_out
from tests.stages.diagnose.loop_chain import loop

STEP = "thrust_step"
FINE_S = 2.0  # of its grid
FRACTION = 0.15
EDGE_S = 6.0  # a step in the last seconds of a maneuver hardly shows in it


@cache
def case() -> Case:
    made = loop("harbour_trial")
    return case_of(made.setup, made.model, [])


@cache
def between() -> tuple[Record, ...]:
    chain = loop("harbour_trial").chain
    trial = without_held_out(chain.trials[0], chain.maneuvers, "horizontal")
    return tuple(records_between(case(), trial, chain.maneuvers))


@cache
def fitted() -> Fitted:
    """The identified model, as it is."""
    p = case().at_rest(case().identified)
    found = fit_with(case(), (), p, first_colours(case(), p), rounds=1, steps=1)
    assert found is not None
    return found


def instant() -> Instant:
    found = instant_of(case(), STEP)
    assert found is not None
    return found


def maneuvers(role: str) -> list[Maneuver]:
    """Maneuvers of a role between two others, times since the start of the trial."""
    chain = loop("harbour_trial").chain
    origin = chain.trials[0].table["time_s"].iloc[0]
    found = sorted(chain.maneuvers.maneuvers, key=lambda m: m.t_start_s)
    shift = [
        m.model_copy(update={"t_start_s": m.t_start_s - origin, "t_end_s": m.t_end_s - origin})
        for m in found
    ]
    return [m for m in shift[2:-2] if m.role == role]


def with_step(records: Sequence[Record], p: np.ndarray) -> tuple[Record, ...]:
    """The records as if the model with a step had made them, with the noise of the sensors."""
    rng, setup, made = np.random.default_rng(5), case().setup, []
    for record in records:
        found = readings_with_slopes(At(setup.frame, p, setup.free(NOTHING)), record, ACTIVE)
        assert found is not None
        noise = rng.normal(size=record.measured.shape) * setup.sensor_std
        seen = np.isfinite(record.measured)
        made.append(replace(record, measured=np.where(seen, found.readings + noise, np.nan)))
    return tuple(made)


def interval(time: float, placed: float) -> tuple[float, float]:
    """What is found of a step at a time that the search placed nearby, from the whole log."""
    p = fitted().parameters.copy()
    p[case().position(f"{STEP}.fraction")], p[instant().time] = FRACTION, time
    stepped, beside = replace(case(), records=with_step(case().records, p)), with_step(between(), p)
    p[instant().time] = placed
    return possible_times(stepped, replace(fitted(), parameters=p), instant(), beside)


def test_the_log_between_is_no_part_of_any_maneuver() -> None:
    assert len(between()) > 5
    for record in between():
        for m in loop("harbour_trial").chain.maneuvers.maneuvers:
            last, first = record.time_s[-1], record.time_s[0]
            assert last < m.t_start_s or first >= m.t_end_s - 1e-6


@pytest.mark.parametrize("number", [0, 1])
def test_a_step_in_a_held_out_maneuver_stays_open_for_as_long_as_it_lasts(number) -> None:
    m = maneuvers("validate")[number]
    low, high = interval(m.t_start_s + 0.3 * (m.t_end_s - m.t_start_s), m.t_start_s - 3.0)
    assert low == pytest.approx(m.t_start_s, abs=EDGE_S)
    assert high == pytest.approx(m.t_end_s, abs=EDGE_S)


@pytest.mark.parametrize("number", [0, 1])
def test_a_step_in_a_maneuver_that_identifies_is_found_to_seconds(number) -> None:
    m = maneuvers("identify")[number]
    time = 0.5 * (m.t_start_s + m.t_end_s)
    low, high = interval(time, time + 6.0)
    assert low <= time <= high
    assert high - low < 4 * FINE_S


def test_a_step_between_two_maneuvers_is_found_to_seconds() -> None:
    before, after = maneuvers("validate")[:2]
    assert after.t_start_s - before.t_end_s > 60.0
    time = before.t_end_s + 15.0  # in the transit, the next maneuver being further away
    low, high = interval(time, time + 6.0)
    assert low <= time <= high
    assert high - low < 4 * FINE_S


def test_the_search_finds_the_step_from_the_maneuvers_alone() -> None:
    m = maneuvers("identify")[1]
    time = 0.5 * (m.t_start_s + m.t_end_s)
    p = fitted().parameters.copy()
    p[case().position(f"{STEP}.fraction")], p[instant().time] = FRACTION, time
    stepped = replace(case(), records=with_step(case().records, p))
    found = with_best_times(stepped, fitted(), ("current", STEP))
    assert found.parameters[instant().time] == pytest.approx(time, abs=12.0)


def test_the_time_is_told_as_the_log_counts_it() -> None:
    p = fitted().parameters.copy()
    p[instant().time], p[instant().width] = 500.0, 40.0
    told, origin = (
        time_of(case(), STEP, p),
        loop("harbour_trial").chain.trials[0].table["time_s"][0],
    )
    assert told is not None
    assert (told.value, told.low, told.high) == pytest.approx(
        (500.0 + origin, 480.0 + origin, 520.0 + origin), abs=1e-6
    )


def test_the_interval_is_told_in_words() -> None:
    p = fitted().parameters.copy()
    p[instant().time], p[instant().width] = 500.0, 40.0
    told = time_of(case(), STEP, p)
    assert told is not None
    size = ParameterValue(symbol="fraction", value=0.15, std=0.01, unit="-")
    said = plain(STEP, (size, told), 1.5, 12.0)
    assert said == f"thrust that drops by 15.0% between {told.low:.0f} s and {told.high:.0f} s"
    effect = EffectFound(
        id=STEP, family="actuation", parameters=(size, told), plain=said, time_s=told.value
    )
    assert place(effect) == ""  # not the middle of the interval as well


def test_a_maneuver_shorter_than_a_step_of_the_grid_is_searched_too() -> None:
    """A log with one maneuver of a minute, which has no point of the grid within."""
    one = next(r for r in case().records if r.id.endswith("turn-1"))
    assert one.time_s[-1] - one.time_s[0] < instant().grid.apart_s
    alone = replace(case(), records=(one,))
    p = case().at_rest(case().identified)
    own = fit_with(alone, (), p, first_colours(alone, p), rounds=1, steps=1)
    assert own is not None
    placed = with_best_times(alone, own, (STEP,)).parameters[instant().time]
    first, last = (float(x) for x in span_of(one))
    assert first < placed < last


def test_a_step_that_was_put_elsewhere_is_found_once_all_else_is_fitted_again() -> None:
    """To first order it was put three maneuvers off, and the coefficients took up what they can."""
    truth, off = maneuvers("identify")[1], maneuvers("identify")[-1]
    time = 0.5 * (truth.t_start_s + truth.t_end_s)
    p = fitted().parameters.copy()
    p[case().position(f"{STEP}.fraction")], p[instant().time] = FRACTION, time
    stepped = replace(case(), records=with_step(case().records, p))
    start = instant().at(p, 0.5 * (off.t_start_s + off.t_end_s))
    there = fit_with(stepped, (STEP,), start, fitted().colours, rounds=1)
    assert there is not None
    beside = with_step(between(), p)
    found = placed_again(stepped, there, instant(), beside)
    assert found.log_likelihood > there.log_likelihood + 10.0
    low, high = possible_times(stepped, found, instant(), beside)
    assert low <= time <= high and high - low < 10 * FINE_S


@pytest.mark.parametrize(("fraction", "moves"), [(0.5 * FRACTION, True), (-FRACTION, False)])
def test_a_fall_that_is_placed_again_does_not_become_a_rise(monkeypatch, fraction, moves) -> None:
    """However much better that fits: it is another effect than the one that was accepted."""
    where, p = case().position(f"{STEP}.fraction"), instant().at(fitted().parameters, 300.0)
    p[where] = FRACTION
    accepted = replace(fitted(), effects=(STEP,), parameters=p)

    def better(case: Case, effects: Sequence[str], start: np.ndarray, *_, **__) -> Fitted:
        q = start.copy()
        q[where] = fraction
        likelihood = accepted.log_likelihood + 100.0
        return replace(accepted, parameters=q, log_likelihood=likelihood)

    monkeypatch.setattr(instants, "fit_with", better)
    found = placed_again(case(), accepted, instant(), [])
    assert (found.log_likelihood > accepted.log_likelihood) == moves
    assert (found.parameters[instant().time] == 300.0) == (not moves)
