"""Lag and drift between two signals of one motion, and how well they are known."""

import numpy as np
import pytest

from auvident.constants import NORMAL_95
from auvident.stages.ingest.clocks_line import LikelyCoefficients, Question, fit_line

RATE_HZ, SMOOTHING_S = 10.0, 1.0


def motion(t):
    """A rate that never repeats: slow turns and quick swings."""
    return np.sin(0.31 * t) + 0.7 * np.sin(0.73 * t + 1.0) + 0.5 * np.sin(1.13 * (t + 99.0) ** 1.02)


def smooth(values):
    """Averaged over the smoothing, twice, as the signals of a trial."""
    box = np.ones(round(SMOOTHING_S * RATE_HZ)) / round(SMOOTHING_S * RATE_HZ)
    return np.convolve(values, np.convolve(box, box), mode="same")


def question(lag_s=0.0, gain_s=0.0, noise=0.02, seconds=600.0, seed=1, **more) -> Question:
    """The second signal is stamped late by a line of a middle and a gain to the end."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / RATE_HZ)
    late = lag_s + gain_s * np.linspace(-1.0, 1.0, t.size)
    signals = {
        "time": t,
        "first": smooth(motion(t) + noise * rng.standard_normal(t.size)),
        "second": smooth(motion(t - late) + noise * rng.standard_normal(t.size)),
    }

    def same(s):
        return s["second"], np.column_stack((s["first"], np.ones_like(s["first"])))

    return Question(signals, ("second",), same, SMOOTHING_S, **more)


@pytest.mark.parametrize(
    ("lag", "gain"), [(0.0, 0.0), (-18.0, 0.0), (0.53, 0.0), (5.0, 0.6), (-1.0, -0.3)]
)
def test_lag_and_drift_are_found_below_the_step(lag, gain):
    line = fit_line(question(lag, gain))
    # at the time of the stamp or of the motion: 5 s times 2000 ppm are 0.01 s
    assert line.middle_s == pytest.approx(lag, abs=0.02)
    assert line.gain_s == pytest.approx(gain, abs=0.015)
    assert line.drift == pytest.approx(gain / 300.0, abs=5e-5)
    assert line.alone
    assert line.rival > 3.0
    if not gain:
        assert line.lag_s == pytest.approx(lag, abs=0.01)
        assert line.explained > 0.95  # but for the ends


def test_what_a_right_clock_leaves_unexplained():
    """Within the fine scan and beyond it; a clock that is right leaves no more than the best."""
    assert fit_line(question(noise=0.3)).right == pytest.approx(1.0, abs=0.01)
    shares = [fit_line(question(lag, noise=0.3)).right for lag in (0.3, 1.0, 5.0)]
    assert 1.1 < shares[0] < shares[1] < shares[2]
    white = question()
    gone = {**white.signals, "second": smooth(motion(white.signals["time"] + 4.0))}
    far = fit_line(Question(gone, white.own, white.equations, SMOOTHING_S))
    assert far.right > 10.0


def test_intervals_hold_the_truth():
    """Of 25 intervals of 95 % at least 20 do, with a probability of 0.998."""
    inside = {"lag": 0, "gain": 0}
    for seed in range(25):
        line = fit_line(question(0.3, 0.0, noise=0.6, seconds=200.0, seed=seed))
        inside["lag"] += abs(line.lag_s - 0.3) < NORMAL_95 * line.lag_std_s
        inside["gain"] += abs(line.gain_s) < NORMAL_95 * line.gain_std_s
    assert min(inside.values()) >= 20


def test_gaps_do_not_matter():
    asked = question(2.0)
    signals = dict(asked.signals)
    for name, start in (("first", 800), ("second", 3000)):
        values = signals[name].copy()
        values[start : start + 700] = np.nan
        signals[name] = values
    line = fit_line(Question(signals, asked.own, asked.equations, SMOOTHING_S))
    assert line.lag_s == pytest.approx(2.0, abs=0.01)


def test_noise_has_no_lag():
    rng = np.random.default_rng(3)
    asked = question()
    signals = {**asked.signals, "second": smooth(rng.standard_normal(asked.signals["time"].size))}
    line = fit_line(Question(signals, asked.own, asked.equations, SMOOTHING_S))
    assert line.explained < 0.05
    assert line.rival < 1.2


def test_a_period_fits_as_well_a_period_later():
    t = np.arange(0.0, 600.0, 0.1)
    noisy = 0.3 * smooth(np.random.default_rng(5).standard_normal(t.size))
    signals = {"time": t, "first": np.sin(t), "second": np.sin(t - 1.0) + noisy}
    asked = question()
    line = fit_line(Question(signals, asked.own, asked.equations, SMOOTHING_S))
    assert line.rival < 1.2  # nothing tells 1 s from 7.3 s, or 2.1 s early of the other sign


def test_nothing_to_compare():
    asked = question()
    signals = {**asked.signals, "second": np.full(asked.signals["time"].size, np.nan)}
    assert fit_line(Question(signals, asked.own, asked.equations, SMOOTHING_S)) is None
    assert fit_line(question(seconds=3.0)) is None


def test_a_day_is_sampled():
    """Pieces of a long record do, at the cost of a short one; the drift is as well determined."""
    line = fit_line(question(1.0, 2.0, seconds=20_000.0))
    assert line.middle_s == pytest.approx(1.0, abs=0.01)
    assert line.gain_s == pytest.approx(2.0, abs=0.02)


def test_a_prior_counts_where_the_data_say_little():
    """Two regressors that are alike: only their sum is known."""
    prior = LikelyCoefficients(np.array([0.7, 0.3]), np.array([0.01, 0.01]))
    asked = question(0.4)

    def twice(s):
        return s["second"], np.column_stack((s["first"], s["first"]))

    line = fit_line(Question(asked.signals, asked.own, twice, SMOOTHING_S, prior))
    assert line.lag_s == pytest.approx(0.4, abs=0.01)
