"""Copies of the last sample: for minutes where the bottom is lost, and of slow fixes."""

import numpy as np
import pytest
from ingest_world import sensor

from auvident.stages.ingest.held_copies import holds_throughout, keep_one_of_held, slow_samples

ROWS = np.arange(3000)
TIME_S = 0.2 * ROWS


def dvl(**values):
    return sensor("dvl", TIME_S, **values)


def measured(seed=0):
    """Velocities with noise and short drop-outs, each of a few rows that repeat the last one."""
    rng = np.random.default_rng(seed)
    u, v = 1.5 + 0.01 * rng.normal(size=ROWS.size), 0.01 * rng.normal(size=ROWS.size)
    for start in (100, 400, 700, 2600):
        for x in (u, v):
            x[start : start + 6] = x[start]
    return u, v


@pytest.mark.parametrize("w", [{}, {"w_mps": np.zeros(ROWS.size)}])
@pytest.mark.parametrize("lost", [slice(1000, 1500), slice(1000, 2500)])
def test_a_bottom_lost_for_minutes_is_a_gap_however_long(lost, w):
    u, v = measured()
    u[lost], v[lost] = u[lost.start], v[lost.start]
    kept = keep_one_of_held(dvl(u_mps=u, v_mps=v, **w), ROWS)
    assert kept is not None
    assert kept[lost].sum() == 1
    assert kept[: lost.start].all() and kept[lost.stop :].all()


def test_a_log_without_noise_that_settles_keeps_its_rows():
    """A simulated one: rounded velocities stop changing as the motion does."""
    since = TIME_S % 150.0
    u = np.round(1.5 - 0.4 * np.exp(-since / 8.0), 4)
    v = np.round(0.1 * np.exp(-since / 5.0), 4)
    assert keep_one_of_held(dvl(u_mps=u, v_mps=v), ROWS) is None


def test_fixes_copied_into_the_rows_of_a_faster_log_count_once():
    rng = np.random.default_rng(1)
    fixes = np.repeat(1.5 * TIME_S[::15] + 0.3 * rng.normal(size=200), 15)
    raw = sensor("position", TIME_S, north_m=fixes, east_m=fixes[::-1].copy())
    assert holds_throughout(raw, ROWS)
    assert keep_one_of_held(raw, ROWS).sum() == 200


def dived(period_s, rate_hz=50.0, digits=3):
    """A depth sampled with noise, copied into rows that jitter a little; at rest in the middle."""
    rng = np.random.default_rng(3)
    time = np.sort(
        np.arange(0.0, 400.0, 1.0 / rate_hz) + 0.02 / rate_hz * rng.normal(size=int(400 * rate_hz))
    )
    at = np.arange(-period_s, 401.0, period_s) - 0.4 / rate_hz  # between two rows
    depth = 5.0 + 3.0 * np.sin(at / 20.0) + 0.01 * rng.normal(size=at.size)
    depth[(at > 150.0) & (at < 200.0)] = 4.0
    taken = np.searchsorted(at, time, side="right") - 1
    return time, np.round(depth, digits)[taken], at


@pytest.mark.parametrize("period_s", [0.1, 0.2, 0.37, 1.0, 2.0])
@pytest.mark.parametrize("rate_hz", [10.0, 50.0])
def test_depths_copied_into_faster_rows_count_once_also_at_rest(period_s, rate_hz):
    time, depth, at = dived(period_s, rate_hz)
    kept = slow_samples(time, depth)
    if period_s * rate_hz < 1.5:
        assert kept is None
        return
    assert abs(kept.sum() - 400.0 / period_s) < 0.03 * kept.sum() + 2
    late = time[kept] - at[np.searchsorted(at, time[kept], side="right") - 1]
    assert np.median(late) <= 1.05 / rate_hz
    assert np.diff(time[kept]).max() < 1.6 * period_s + 1.0 / rate_hz


def test_a_depth_of_coarse_digits_and_one_at_rest_are_no_copies():
    time, depth, _ = dived(0.2, rate_hz=5.0, digits=1)
    assert slow_samples(time, depth) is None
    assert slow_samples(time, 0.0 * time) is None


def test_empty_cells_are_left_to_be_counted_as_such():
    time, depth, _ = dived(1.0)
    depth[100:120] = np.nan
    kept = slow_samples(time, depth)
    assert kept[100:120].all()
    assert abs(kept.sum() - 420) < 12
