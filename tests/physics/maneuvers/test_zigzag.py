"""Figures of a zigzag against closed forms."""

import numpy as np
import pytest

from auvident.physics.maneuvers import reversals, zigzag_figures

DT = 0.05


def triangle_zigzag(rate: float, switch: float, overshoot: float, executes: int, first: int):
    """Heading at constant rate between +-(switch + overshoot), rudder reversed at +-switch."""
    peak = switch + overshoot
    quarter = peak / rate
    t = np.arange(0, (2 * executes - 1) * quarter, DT / 10)
    phase = (t / quarter) % 4
    psi = peak * np.where(phase < 1, phase, np.where(phase < 3, 2 - phase, phase - 4))
    rudder = np.zeros(t.size)
    side, count = 1, 1
    for i in range(t.size):
        rudder[i] = -0.3 * side * first
        if count < executes and side * psi[i] >= switch and (i == 0 or side * psi[i - 1] < switch):
            side, count = -side, count + 1
    return t, first * psi, rudder


@pytest.mark.parametrize("first", [1, -1])
def test_triangular_zigzag(first):
    rate, switch, over = np.radians(4), np.radians(10), np.radians(3)
    t, psi, rudder = triangle_zigzag(rate, switch, over, executes=5, first=first)
    figures = zigzag_figures(t, psi, rudder)
    sampled = np.degrees(rate * DT / 10)  # a reversal is seen at most one sample late
    assert figures["executes"] == 5
    assert figures["rudder_deg"] == pytest.approx(np.degrees(0.3))
    assert figures["switch_deg"] == pytest.approx(10, abs=2 * sampled)
    for k in range(1, 5):
        assert figures[f"overshoot_{k}_deg"] == pytest.approx(3, abs=2 * sampled)
    assert figures["time_to_second_execute_s"] == pytest.approx(10 / 4, abs=2 * DT / 10)
    assert figures["time_to_check_yaw_s"] == pytest.approx(3 / 4, abs=2 * DT / 10)
    assert figures["period_s"] == pytest.approx(4 * 13 / 4, abs=2 * DT / 10)
    assert figures["reach_s"] == pytest.approx(2 * 13 / 4, abs=2 * DT / 10)


def test_overshoot_of_a_sine():
    """Heading a sin(w t) with the rudder reversed at w t = 0.5: overshoot a (1 - sin 0.5)."""
    w, a = 0.4, np.radians(15)
    t = np.arange(0, 3 * 2 * np.pi / w, DT)
    rudder = -0.2 * np.where(np.sin(w * t - 0.5 + np.pi) > 0, 1, -1)
    figures = zigzag_figures(t, a * np.sin(w * t), rudder)
    expected = np.degrees(a) * (1 - np.sin(0.5))
    # one sample late moves the reversal by w dt in phase
    late = np.degrees(a) * w * DT
    assert figures["overshoot_1_deg"] == pytest.approx(expected, abs=late)
    assert figures["overshoot_2_deg"] == pytest.approx(expected, abs=late)
    assert figures["period_s"] == pytest.approx(2 * np.pi / w, abs=2 * DT)


def test_a_first_swing_that_falls_short_has_no_initial_turning_time():
    """Not that of a later swing, a period after it."""
    t, psi, rudder = triangle_zigzag(np.radians(4), np.radians(10), np.radians(3), 5, 1)
    assert zigzag_figures(t, psi, rudder)["initial_turning_time_s"] == pytest.approx(2.5, abs=0.02)
    assert zigzag_figures(t, psi, rudder, switch_rad=np.radians(12))["initial_turning_time_s"] < 3.1
    shrunk = np.where(t < 2 * 13 / 4, 0.6, 1.0) * psi  # 7.8 deg, then 13
    assert "initial_turning_time_s" not in zigzag_figures(t, shrunk, rudder)


def test_an_overshoot_that_the_record_cuts_is_absent():
    t, psi, rudder = triangle_zigzag(np.radians(4), np.radians(10), np.radians(3), 5, 1)
    last = reversals(rudder)[-1]
    figures = zigzag_figures(t[: last + 5], psi[: last + 5], rudder[: last + 5])
    assert "overshoot_3_deg" in figures
    assert "overshoot_4_deg" not in figures


@pytest.mark.parametrize("steps", [1, 5, 30, 200])
def test_reversal_of_a_ramp_is_where_it_begins(steps):
    """Not where a tenth of the amplitude has gone by: the heading turns on meanwhile."""
    ramp = np.linspace(0.3, -0.3, steps + 1)[1:]
    rudder = np.concatenate([np.full(50, 0.3), ramp, np.full(50, -0.3)])
    assert reversals(rudder).tolist() == [50]
    noise = 0.003 * np.random.default_rng(7).standard_normal(rudder.size)
    (found,) = reversals(rudder + noise)
    assert abs(found - 50) <= 1 + 0.02 * steps


def test_rudder_that_never_reverses():
    t = np.arange(0, 10, DT)
    figures = zigzag_figures(t, 0.1 * t, np.full(t.size, 0.2))
    assert figures["executes"] == 1
    assert "switch_deg" not in figures
