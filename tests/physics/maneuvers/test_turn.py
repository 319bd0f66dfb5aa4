"""Figures of a turning circle against closed forms."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auvident.physics.maneuvers import turn_figures

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
