"""Maneuver figures against closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auvident.physics.figures import (
    dead_reckoning,
    first_crossing,
    heading_from_rate,
    reversals,
    straight_figures,
    turn_figures,
    zigzag_figures,
)

DT = 0.05
# second order of the trapezoidal rule: (r dt)^2 / 12 of a circle's diameter, r dt < 0.02
TRAPEZOID = 1e-4


def circle(r: float, u: float, degrees: float, v: float = 0.0):
    t = np.arange(0, np.radians(degrees) / abs(r) + DT, DT)
    return t, np.full(t.size, u), np.full(t.size, v), np.full(t.size, r)


@pytest.mark.parametrize("r_degps", [2.0, -10.0, 20.0])
def test_steady_circle_has_the_diameter_of_its_radius(r_degps):
    r, u = np.radians(r_degps), 1.5
    t, u_, v_, r_ = circle(r, u, 400)
    figures = turn_figures(t, u_, v_, r_, np.full(t.size, -0.2 * np.sign(r)))
    diameter = 2 * u / abs(r)
    assert figures["steady_diameter_m"] == pytest.approx(diameter, rel=1e-12)
    assert figures["tactical_diameter_m"] == pytest.approx(diameter, rel=TRAPEZOID)
    assert figures["advance_m"] == pytest.approx(diameter / 2, rel=TRAPEZOID)
    assert figures["transfer_m"] == pytest.approx(diameter / 2, rel=TRAPEZOID)
    assert figures["steady_r_degps"] == pytest.approx(r_degps)
    assert figures["time_to_90_s"] == pytest.approx(90 / abs(r_degps), rel=1e-9)
    assert figures["time_to_180_s"] == pytest.approx(180 / abs(r_degps), rel=1e-9)
    assert figures["speed_loss"] == pytest.approx(0.0, abs=1e-12)
    assert figures["rudder_deg"] == pytest.approx(np.degrees(-0.2 * np.sign(r)))


def test_drift_turns_the_circle_and_keeps_its_diameter():
    r, u, v = np.radians(8), 1.2, -0.3
    t, u_, v_, r_ = circle(r, u, 380, v)
    figures = turn_figures(t, u_, v_, r_, np.zeros(t.size), approach_speed_mps=1.6)
    speed = np.hypot(u, v)
    assert figures["steady_diameter_m"] == pytest.approx(2 * speed / r)
    assert figures["steady_drift_deg"] == pytest.approx(np.degrees(np.arctan2(0.3, 1.2)))
    assert figures["speed_loss"] == pytest.approx(1 - speed / 1.6)
    # course is heading less drift angle: the diameter across the *heading* is u/r-wide
    assert figures["tactical_diameter_m"] == pytest.approx(2 * u / r, rel=TRAPEZOID)


def test_what_the_turn_does_not_reach_is_absent():
    t, u, v, r = circle(np.radians(5), 1.0, 100)
    figures = turn_figures(t, u, v, r, np.zeros(t.size))
    assert "advance_m" in figures
    assert not {"tactical_diameter_m", "steady_r_degps", "time_to_180_s"} & figures.keys()
    assert all(np.isfinite(x) for x in figures.values())


@given(r=st.floats(0.02, 0.5), u=st.floats(0.3, 5.0), v=st.floats(-0.3, 0.3))
def test_port_is_the_mirror_of_starboard(r, u, v):
    t, u_, v_, r_ = circle(r, u, 200, v)
    right = turn_figures(t, u_, v_, r_, np.full(t.size, -0.2))
    left = turn_figures(t, u_, -v_, -r_, np.full(t.size, 0.2))
    signed = {"rudder_deg", "heading_change_deg", "steady_r_degps", "steady_drift_deg"}
    assert right.keys() == left.keys()
    for name, value in right.items():
        assert left[name] == pytest.approx(-value if name in signed else value, abs=1e-9)


def test_dead_reckoning_of_a_straight_course():
    t = np.linspace(0, 10, 101)
    north, east = dead_reckoning(t, np.full(101, 2.0), np.zeros(101), np.full(101, np.pi / 6))
    assert north[-1] == pytest.approx(20 * np.cos(np.pi / 6))
    assert east[-1] == pytest.approx(20 * np.sin(np.pi / 6))


def test_heading_is_the_integral_of_the_rate():
    t = np.linspace(0, 5, 501)
    assert heading_from_rate(t, np.cos(t))[-1] == pytest.approx(np.sin(5), abs=1e-4)  # dt^2/12


def test_first_crossing():
    t = np.arange(5.0)
    assert first_crossing(t, np.array([0, 1, 2, 1, 3.0]), 1.5) == pytest.approx(1.5)
    assert first_crossing(t, np.zeros(5), 0.5) is None
    assert first_crossing(t, np.ones(5), 0.5) == 0.0


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


def test_an_overshoot_that_the_record_cuts_is_absent():
    t, psi, rudder = triangle_zigzag(np.radians(4), np.radians(10), np.radians(3), 5, 1)
    last = reversals(rudder)[-1]
    figures = zigzag_figures(t[: last + 5], psi[: last + 5], rudder[: last + 5])
    assert "overshoot_3_deg" in figures
    assert "overshoot_4_deg" not in figures


def test_reversal_of_a_ramp_is_where_it_begins():
    rudder = np.concatenate([np.full(50, 0.3), np.linspace(0.3, -0.3, 31)[1:], np.full(50, -0.3)])
    found = reversals(rudder)
    assert found.size == 1
    # a tenth of the amplitude, 0.03 at 0.02 per sample, may pass before the move is sure
    assert 50 <= found[0] <= 52


def test_rudder_that_never_reverses():
    t = np.arange(0, 10, DT)
    figures = zigzag_figures(t, 0.1 * t, np.full(t.size, 0.2))
    assert figures["executes"] == 1
    assert "switch_deg" not in figures


def test_straight_levels_and_their_speeds():
    t = np.arange(0, 90, 0.1)
    rpm = np.where(t < 30, 800.0, np.where(t < 60, 1000.0, 900.0))
    u = rpm / 500
    figures = straight_figures(t, u, rpm)
    assert figures["rpm_levels"] == [800.0, 1000.0, 900.0]
    assert figures["rpm_steps"] == [200.0, -100.0]
    assert figures["steady_speed_mps"] == pytest.approx([1.6, 2.0, 1.8])
    assert figures["level_start_s"] == pytest.approx([0, 30, 60], abs=0.11)
    assert figures["steps"] == 2


def test_ripple_of_the_motor_is_no_step():
    t = np.arange(0, 60, 0.1)
    rpm = 900 + 10 * np.sin(3 * t)
    assert straight_figures(t, np.ones(t.size), rpm)["steps"] == 0
