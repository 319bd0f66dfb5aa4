"""Levels, ramps and noise of logged inputs."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auvident.physics.maneuvers.plateaus import (
    noise_std,
    odd_samples,
    plateaus,
    ramp_start,
    running_mean,
    running_median,
    slew_rate,
)


@given(
    st.lists(st.tuples(st.integers(-5, 5), st.integers(2, 30)), min_size=1, max_size=12),
)
def test_clean_levels_come_back(pieces):
    x = np.concatenate([np.full(n, float(level)) for level, n in pieces])
    found = plateaus(x, tolerance=0.3)
    assert [p.start for p in found[1:]] == [p.stop for p in found[:-1]]
    assert found[0].start == 0
    assert found[-1].stop == x.size
    for p in found:
        assert np.all(x[p.start : p.stop] == p.level)
    assert all(a.level != b.level for a, b in itertools.pairwise(found))


def test_noise_within_the_tolerance_does_not_cut_a_level():
    rng = np.random.default_rng(0)
    x = np.concatenate([np.full(400, 0.0), np.full(400, 3.0)]) + rng.normal(0, 0.1, 800)
    long = [p for p in plateaus(x, 0.4) if p.samples > 50]
    assert len(long) == 2
    # a median of 400 samples: 0.1 * 1.25 / 20, four of these
    assert [p.level for p in long] == pytest.approx([0.0, 3.0], abs=0.025)


@pytest.mark.parametrize("samples", [5, 20])
def test_ramp_start_of_a_ramp(samples):
    x = np.concatenate([np.zeros(40), np.linspace(0, 1, samples + 1)[1:], np.ones(40)])
    arrival = 40 + samples - 1
    # the first moved sample; the walk stops once a span grows by less than the tolerance
    assert ramp_start(x, arrival, 1.0, span=5, tolerance=0.05) == pytest.approx(40, abs=1)


def test_ramp_start_of_a_step_is_the_step():
    x = np.concatenate([np.zeros(40), np.ones(40)])
    assert ramp_start(x, 40, 1.0, span=5, tolerance=0.05) == 40


def test_noise_std_of_white_noise_on_a_ramp():
    x = np.random.default_rng(1).normal(0, 0.2, 20_000) + np.linspace(0, 50, 20_000)
    # the quietest quarter of windows of 20 lies some 10 % low
    assert noise_std(x, 20) == pytest.approx(0.2, rel=0.2)


def test_noise_std_of_a_command_is_zero():
    assert noise_std(np.repeat([0.0, 1.0, -1.0], 200), 20) == 0.0


def test_noise_std_ignores_a_busy_part():
    rng = np.random.default_rng(2)
    x = np.concatenate([rng.normal(0, 0.1, 4000), rng.normal(0, 2.0, 6000)])
    assert noise_std(x, 20) < 0.2


def test_slew_rate_of_a_ramp():
    x = np.concatenate([np.zeros(30), np.arange(0, 20, 0.5), np.full(30, 20.0)])
    assert slew_rate(x, rate_hz=10) == pytest.approx(5.0)


def test_running_mean_and_median_keep_a_constant_and_remove_a_spike():
    x = np.full(50, 2.0)
    assert running_mean(x, 11) == pytest.approx(x)
    x[20] = 100.0
    assert running_median(x, 5) == pytest.approx(np.full(50, 2.0))


def test_odd_samples():
    assert odd_samples(0.5, 10) == 5
    assert odd_samples(0.01, 10) == 3
