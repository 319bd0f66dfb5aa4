"""Copies of the last sample: for minutes where the bottom is lost, and of slow fixes."""

import numpy as np
import pytest
from ingest_world import sensor

from auvident.stages.ingest.held_copies import holds_throughout, keep_one_of_held

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
