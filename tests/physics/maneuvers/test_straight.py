"""Figures of a straight run with thrust steps."""

import numpy as np
import pytest

from auvident.physics.maneuvers import straight_figures


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
