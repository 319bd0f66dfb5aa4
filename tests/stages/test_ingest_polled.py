"""Rows of an input: its changes, or samples of it."""

import numpy as np
import pytest

from auvident.stages.ingest.polled import (
    Share,
    asked_of,
    copied_inputs,
    sampled_inputs,
    share_before,
)

STEP_S, PERIOD_S, LAST_S = 0.005, 0.2, 600.0
DRAG = 0.8  # [1/s] of the rate
FINE = np.arange(0.0, LAST_S, STEP_S)


def signals_of(sampled: bool, lag_s: float = 0.0, noise: float = 2e-3, seed: int = 1):
    """A rate that answers to a stepped angle through a servo, and the log of both.

    The angle changes at any time and the log samples it, or it changes at its rows.
    """
    rng = np.random.default_rng(seed)
    rows = np.arange(0.0, LAST_S, PERIOD_S)
    changes = np.sort(rng.uniform(5.0, LAST_S, 60))
    if not sampled:
        changes = rows[np.searchsorted(rows, changes, side="right") - 1]
    sides = 0.35 * (-1.0) ** np.arange(61)
    ordered = sides[np.searchsorted(changes, FINE, side="right")]
    angle, rate = np.empty(FINE.size), np.zeros(FINE.size)
    keep = np.exp(-STEP_S / lag_s) if lag_s else 0.0
    angle[0] = ordered[0]
    for k in range(1, FINE.size):
        angle[k] = ordered[k - 1] + (angle[k - 1] - ordered[k - 1]) * keep
        rate[k] = rate[k - 1] + STEP_S * (angle[k] - DRAG * rate[k - 1])
    gyro_s = np.arange(0.0, LAST_S, 0.02)
    gyro = np.interp(gyro_s, FINE, rate) + noise * rng.normal(size=gyro_s.size)
    at_rows = sides[np.searchsorted(changes, rows, side="right")]
    u = (gyro_s, np.full(gyro_s.size, 1.5))
    return {"rudder_rad": (rows, at_rows), "r_radps": (gyro_s, gyro), "u_mps": u}


@pytest.mark.parametrize("lag_s", [0.0, 0.05, 0.15])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_rows_that_are_changes_are_answered_behind_them(lag_s: float, seed: int) -> None:
    signals = signals_of(sampled=False, lag_s=lag_s, seed=seed)
    share = share_before("rudder_rad", signals)
    assert share is not None and share.std < 0.1
    assert abs(share.value) < max(3.0 * share.std, 0.02)
    assert sampled_inputs(signals, 1.0) == ()


@pytest.mark.parametrize(("lag_s", "least"), [(0.0, 0.4), (0.05, 0.25), (0.15, 0.15)])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_samples_are_answered_before_their_rows(lag_s: float, least: float, seed: int) -> None:
    signals = signals_of(sampled=True, lag_s=lag_s, seed=seed)
    share = share_before("rudder_rad", signals)
    assert share is not None and least < share.value < 0.7
    assert sampled_inputs(signals, 1.0) == ("rudder_rad",)
    assert sampled_inputs(signals, 2.0) == ()  # half a period is nothing to a slower vehicle


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_gyro_as_slow_as_the_rows_feigns_no_early_answer(seed: int) -> None:
    """Its lines cut the corners: a sixth of its period in the mean, were that not taken off."""
    for is_sampled in (False, True):
        signals = signals_of(sampled=is_sampled, seed=seed)
        time, rate = signals["r_radps"]
        slow = np.arange(0.0, LAST_S, 0.0613 * 3.0)
        signals |= {"r_radps": (slow, np.interp(slow, time, rate))}
        share = share_before("rudder_rad", signals)
        assert share is not None and share.sampled is is_sampled
        assert is_sampled or abs(share.value) < 0.06


def test_what_one_input_tells_holds_for_those_of_its_logger() -> None:
    signals = signals_of(sampled=True)
    rpm_s = np.arange(0.0, LAST_S, 0.5)
    signals |= {"rpm": (rpm_s, np.full(rpm_s.size, 900.0))}
    assert sampled_inputs(signals, 1.0) == ("rudder_rad", "rpm")
    assert sampled_inputs(signals, 3.0) == ("rpm",)


def test_a_noisy_gyro_tells_nothing() -> None:
    signals = signals_of(sampled=True, noise=0.5)
    share = share_before("rudder_rad", signals)
    assert share is not None and not share.sampled


def test_what_nobody_answers_to_tells_nothing() -> None:
    signals = signals_of(sampled=True)
    assert share_before("elevator_rad", signals) is None
    time, rate = signals["r_radps"]
    for answer in ((time, 0.0 * rate), (time[::20], rate[::20])):
        assert share_before("rudder_rad", signals | {"r_radps": answer}) is None
    rows, angle = signals["rudder_rad"]
    assert share_before("rudder_rad", signals | {"rudder_rad": (rows, 0.0 * angle)}) is None


def test_only_inputs_and_what_answers_to_them_are_looked_at() -> None:
    signals = copied(busy(signals_of(sampled=True))) | {"p_radps": (FINE, 0.0 * FINE)}
    some = {column: signals[column] for column in asked_of(signals)}
    assert set(some) == {"rudder_rad", "r_radps", "u_mps"}
    assert copied_inputs(some).keys() == copied_inputs(signals).keys() == {"rudder_rad"}
    assert share_before("rudder_rad", some) == share_before("rudder_rad", signals)
    assert asked_of({"p_radps": ()}) == ()


def test_a_share_has_to_be_large_sure_and_possible() -> None:
    assert Share(0.4, 0.1).sampled and Share(0.11, 0.01).sampled
    assert not any(s.sampled for s in (Share(0.4, 0.2), Share(0.09, 0.01), Share(1.2, 0.1)))


def copied(signals: dict) -> dict:
    """The same with each row of the rudder copied into the rows of the gyro."""
    rows, angle = signals["rudder_rad"]
    fast = signals["r_radps"][0]
    return signals | {"rudder_rad": (fast, angle[np.searchsorted(rows, fast + 1e-6) - 1])}


def at_once(signals: dict) -> dict:
    once = copied_inputs(signals)["rudder_rad"]
    return signals | {"rudder_rad": tuple(x[once] for x in signals["rudder_rad"])}


@pytest.mark.parametrize("is_sampled", [True, False])
def test_samples_copied_into_faster_rows_are_told_from_commands_held(is_sampled: bool) -> None:
    signals = copied(busy(signals_of(sampled=is_sampled)))
    found = at_once(signals)
    period = np.diff(found["rudder_rad"][0])
    assert np.mean(np.abs(period - PERIOD_S) < 0.021) > 0.95
    assert sampled_inputs(signals, 1.0) == ()  # rows of the gyro are no half a period late
    assert sampled_inputs(found, 1.0) == (("rudder_rad",) if is_sampled else ())


def busy(signals: dict) -> dict:
    """A minute at the end in which an autopilot moves the rudder a little with each row."""
    rows, angle = signals["rudder_rad"]
    late = rows > LAST_S - 60.0
    moved = angle + np.where(late, 1e-4 * np.arange(rows.size), 0.0)
    return signals | {"rudder_rad": (rows, moved)}


def test_rows_that_change_at_any_time_are_no_copies() -> None:
    signals = signals_of(sampled=True)
    assert copied_inputs(signals) == {}
    assert copied_inputs(busy(signals)) == {}  # in rows of its own
    fast = signals["r_radps"][0]
    noisy = np.random.default_rng(2).integers(0, 3, fast.size).astype(float)
    assert copied_inputs(signals | {"rudder_rad": (fast, noisy)}) == {}
