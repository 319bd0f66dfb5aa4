"""Resampling against closed forms: no delay, exact step means, nothing invented."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auvident.schema.holding import hold_rule
from auvident.stages.ingest.resample import (
    Grid,
    gap_limit,
    resample_input,
    resample_measured,
)

ROUNDING = 1e-9  # differences of cumulative sums over some hundred seconds


@settings(max_examples=50, deadline=None)
@given(edge=st.floats(1.0, 9.0), rate=st.sampled_from([1.0, 5.0, 10.0, 20.0]))
def test_step_mean_of_a_command_is_exact(edge, rate):
    grid = Grid(0, int(10 * rate), rate)
    found = resample_input(np.array([0.0, edge]), np.array([-0.2, 0.3]), grid, np.inf)
    share = np.clip((edge - grid.time_s) * rate, 0.0, 1.0)  # of the step before the change
    np.testing.assert_allclose(found.values, -0.2 * share + 0.3 * (1 - share), atol=ROUNDING)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_integral_of_a_command_is_kept(seed):
    rng = np.random.default_rng(seed)
    time = np.concatenate(([0.0], np.sort(rng.uniform(0.0, 10.0, 30))))
    values = rng.normal(size=31)
    found = resample_input(time, values, Grid(0, 100, 10.0), np.inf)
    integral = np.sum(values * np.diff(np.append(time, 10.0)))
    assert found.values.sum() / 10.0 == pytest.approx(integral, abs=ROUNDING)


def test_samples_of_a_command_lie_on_lines():
    """A ramp between two rows a step and a half apart, held before a gap and at the end."""
    time, values = np.array([0.0, 1.5, 3.0, 9.0]), np.array([0.0, 3.0, 0.0, 1.0])
    found = resample_input(time, values, Grid(0, 10, 1.0), 2.0, sampled=True).values
    expected = [1.0, 2.5, 1.0, 0.0, 0.0, np.nan, np.nan, np.nan, np.nan, 1.0]
    np.testing.assert_allclose(found, expected, atol=ROUNDING)


@settings(max_examples=30, deadline=None)
@given(phase=st.floats(0.0, 0.18), seed=st.integers(0, 1000))
def test_samples_come_without_delay(phase, seed):
    """Of a command that changes at any time, sampled at 5 Hz: its integral is kept in the mean."""
    rng = np.random.default_rng(seed)
    changes = np.sort(rng.uniform(1.0, 199.0, 200))
    time = np.arange(phase, 200.0, 0.2)
    values = np.searchsorted(changes, time, side="right") / 200.0
    grid = Grid(2, 1990, 10.0)
    true = 199.2 - np.mean(np.clip(changes, 0.2, 199.2))
    found = resample_input(time, values, grid, 2.0, sampled=True).values
    assert np.isfinite(found[:-10]).all()
    held = resample_input(time, values, grid, 2.0).values
    late = (true - np.nansum(held) / 10.0, true - np.nansum(found) / 10.0)
    assert late[0] == pytest.approx(0.1, abs=0.02) and abs(late[1]) < 0.02


def test_command_on_the_ticks_comes_out_unchanged():
    time = np.arange(200) * 0.1
    values = np.random.default_rng(0).normal(1000.0, 5.0, 200)
    found = resample_input(time, values, Grid(0, 199, 10.0), 2.0)
    np.testing.assert_array_equal(found.values, values[:199])
    assert found.sampled.all()


def test_command_is_not_held_beyond_the_limit():
    time = np.concatenate((np.arange(0, 5, 0.1), np.arange(9, 12, 0.1)))
    found = resample_input(time, np.ones(time.size), Grid(0, 118, 10.0), 2.0)
    unknown = Grid(0, 118, 10.0).time_s[np.isnan(found.values)]
    assert unknown[0] == pytest.approx(6.9)  # last command at 4.9 s, held for 2 s
    assert unknown[-1] == pytest.approx(8.9)


@settings(max_examples=20, deadline=None)
@given(phase=st.floats(0, 6.28), jitter=st.floats(0, 0.008), seed=st.integers(0, 99))
def test_fast_sinusoid_comes_out_without_delay(phase, jitter, seed):
    """0.5 Hz at 50 Hz with jitter: sinc of the step, no shift."""
    rng = np.random.default_rng(seed)
    time = np.arange(0, 40, 0.02) + rng.uniform(-jitter, jitter, 2000)
    omega = np.pi
    grid = Grid(10, 380, 10.0)
    found = resample_measured(time, np.sin(omega * time + phase), grid, 1.0).values
    sine, cosine = np.sin(omega * grid.time_s + phase), np.cos(omega * grid.time_s + phase)
    amplitude, lagging = np.linalg.lstsq(np.stack((sine, cosine)).T, found, rcond=None)[0]
    # A line through samples 20 to 36 ms apart cuts (omega dt)^2 / 12 = 3e-4 to 1e-3 of a crest.
    assert amplitude == pytest.approx(np.sinc(0.05), abs=1e-3)
    assert abs(lagging / amplitude / omega) < 1e-4  # s; the grid step is 0.1 s


def test_average_takes_the_noise_down():
    rng = np.random.default_rng(3)
    time = np.arange(0, 400, 0.02)
    found = resample_measured(time, rng.normal(size=time.size), Grid(1, 3990, 10.0), 1.0)
    assert np.std(found.values) == pytest.approx(1 / np.sqrt(5), rel=0.1)  # five per step


def test_slow_sensor_is_interpolated_and_flagged_at_its_ticks():
    time = np.arange(0.02, 20, 1 / 3)
    grid = Grid(1, 190, 10.0)
    found = resample_measured(time, 2 * time + 1, grid, 1.0)
    np.testing.assert_allclose(found.values, 2 * grid.time_s + 1, atol=ROUNDING)
    flagged = grid.time_s[found.sampled]
    for tick in flagged:
        assert np.abs(time - tick).min() <= 0.05 + 1e-9
    inside = time[(time > 0.06) & (time < 19.0)]
    assert flagged.size == pytest.approx(inside.size, abs=1)


def test_samples_on_the_ticks_come_out_unchanged():
    time = 3.7 + np.arange(300) / 10
    values = np.random.default_rng(0).normal(size=300)
    found = resample_measured(time, values, Grid(37, 300, 10.0), 1.0)
    np.testing.assert_array_equal(found.values, values)
    assert found.sampled.all()


@pytest.mark.parametrize("rate", [5.0, 50.0])
def test_a_long_gap_is_not_bridged_and_a_short_one_is(rate):
    time = np.arange(0, 20, 1 / rate)
    time = time[~((time > 5.01) & (time < 5.79)) & ~((time > 10.01) & (time < 12.99))]
    grid = Grid(2, 190, 10.0)
    found = resample_measured(time, 3.0 * time, grid, 1.0)
    missing = grid.time_s[np.isnan(found.values)]
    assert missing.min() == pytest.approx(10.1, abs=0.11)
    assert missing.max() == pytest.approx(12.9, abs=0.11)
    bridged = (grid.time_s > 5.15) & (grid.time_s < 5.65)
    np.testing.assert_allclose(found.values[bridged], 3.0 * grid.time_s[bridged], atol=1e-7)
    assert not found.sampled[bridged].any()


def test_gap_limit_of_slow_sensors_grows_with_their_period():
    assert gap_limit(np.arange(0, 10, 0.2), 1.0) == 1.0
    assert gap_limit(np.arange(0, 100, 1.0), 1.0) == 2.5


def test_rules_of_holding():
    rng = np.random.default_rng(5)
    polled = np.arange(0, 100, 0.1)
    steps = np.sign(np.sin(polled / 5))
    assert hold_rule(polled, steps, None).rule == "polled"
    assert hold_rule(polled, steps, None).limit_s == 2.0
    noisy = steps + 0.01 * rng.normal(size=polled.size)  # feedback: no two samples are equal
    lost = rng.random(polled.size) < 0.2
    assert hold_rule(polled[~lost], noisy[~lost], None).rule == "polled"
    slew = np.concatenate([start + np.arange(10) * 0.1 for start in range(0, 200, 20)])
    assert hold_rule(slew, np.arange(slew.size) % 7 - 3.0, None).rule == "on_change"
    assert hold_rule(np.array([3.0]), np.array([1200.0]), None).limit_s == np.inf
    assert hold_rule(polled, steps, True).limit_s == np.inf
    assert hold_rule(slew, np.arange(slew.size) % 7 - 3.0, False).rule == "polled"


def test_heartbeat_between_changes():
    moves = np.concatenate([start + np.arange(20) * 0.1 for start in range(0, 200, 20)])
    beats = np.concatenate([start + np.array([7.0, 12.0, 17.0]) for start in range(0, 200, 20)])
    time = np.sort(np.concatenate((moves, beats)))
    values = np.floor(time / 10)
    rule = hold_rule(time, values, None)
    assert rule.rule == "heartbeat"
    assert rule.limit_s == pytest.approx(7.5)
