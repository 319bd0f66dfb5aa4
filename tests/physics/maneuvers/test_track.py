"""Heading, track and crossings against closed forms."""

import numpy as np
import pytest

from auvident.physics.maneuvers import dead_reckoning, first_crossing, integral_of


def test_dead_reckoning_of_a_straight_course():
    t = np.linspace(0, 10, 101)
    north, east = dead_reckoning(t, np.full(101, 2.0), np.zeros(101), np.full(101, np.pi / 6))
    assert north[-1] == pytest.approx(20 * np.cos(np.pi / 6))
    assert east[-1] == pytest.approx(20 * np.sin(np.pi / 6))


def test_heading_is_the_integral_of_the_rate():
    t = np.linspace(0, 5, 501)
    assert integral_of(t, np.cos(t))[-1] == pytest.approx(np.sin(5), abs=1e-4)  # dt^2/12


def test_first_crossing():
    t = np.arange(5.0)
    assert first_crossing(t, np.array([0, 1, 2, 1, 3.0]), 1.5) == pytest.approx(1.5)
    assert first_crossing(t, np.zeros(5), 0.5) is None
    assert first_crossing(t, np.ones(5), 0.5) == 0.0
