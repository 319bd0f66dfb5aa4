"""What accuses a clock: kinematics by how well it is known, dynamics only beyond all hulls."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from ingest_world import calm, vehicle

from auvident.schema.trial import Trial
from auvident.stages.ingest.clocks import _checks, _is_off, _may_be_off
from auvident.stages.ingest.clocks_estimate import Bench, ClockLag, Lags, passage_s
from auvident.stages.ingest.clocks_judged import _agreed, _doubted, _with_doubt, estimate_clocks
from auvident.stages.ingest.clocks_relations import RELATIONS, smooth_signals, without_current

RATE_HZ, SECONDS, SPEED = 10.0, 900.0, 1.5
EARLY_S = 1.0


def lag(lag_s: float, std_s: float, *, sure_s: float = 0.0, kinematic: bool = False) -> ClockLag:
    sure = max(std_s, sure_s)
    told = {"at_s": 300.0, "half_s": 300.0, "explained": 0.95, "steady": 1.0}
    drift = {"gain_s": 0.0, "gain_std_s": 0.1, "sure_gain_std_s": 0.1}
    return ClockLag(
        lag_s, std_s, sure, right=2.0, against=("test",), kinematic=kinematic, **told, **drift
    )


def swinging(*, current=(0.0, 0.0), turns=True, vertical=True) -> Trial:
    """A vehicle whose sway goes before its yaw rate, by more than any sway equation has it."""
    t = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    rng = np.random.default_rng(4)
    swing = np.sin(0.23 * t) + 0.6 * np.sin(0.41 * t + 1.0) + 0.4 * np.sin(0.117 * t + 2.0)
    r = 0.12 * swing + (0.06 * np.sign(np.sin(0.01 * t)) if turns else 0.0)
    heading = np.cumsum(r) / RATE_HZ
    early = np.interp(t + EARLY_S, t, r)
    pitch = 0.1 * np.sin(0.13 * t) + 0.05 * np.sin(0.31 * t)
    w = 0.12 * np.sin(0.37 * t + 0.5) + 0.08 * np.sin(0.19 * t)
    cos, sin = np.cos(heading), np.sin(heading)
    north, east = current
    noise = 0.003 * rng.standard_normal((3, t.size))
    table = {
        "time_s": t,
        "u_mps": SPEED - 2.0 * r**2 + north * cos + east * sin + noise[0],
        "v_mps": -0.8 * early + east * cos - north * sin + noise[1],
        "r_radps": r,
        "heading_rad": heading,
        "rudder_rad": 2.0 * np.interp(t + 0.5, t, r),
        "rpm": np.full(t.size, 1500.0),
    }
    if vertical:
        climb = w * np.cos(pitch) - table["u_mps"] * np.sin(pitch)
        table |= {"w_mps": w + noise[2], "pitch_rad": pitch}
        table["depth_m"] = 20.0 + np.cumsum(climb) / RATE_HZ
    return Trial.from_table("swinging", pd.DataFrame(table), RATE_HZ)


def estimated(trial: Trial):
    sensors = {"dvl", "gyro", "rudder", "attitude", "depth"}
    if "depth_m" not in trial.table:
        sensors -= {"depth"}
    raw = SimpleNamespace(name="swinging", sensors=dict.fromkeys(sensors))
    return estimate_clocks(raw, trial, vehicle(), _is_off)


def late_dvl(trial: Trial, by_s: float) -> Trial:
    table, t = trial.table.copy(), trial.table["time_s"].to_numpy()
    for column in ("u_mps", "v_mps", "w_mps"):
        if column in table:
            table[column] = np.interp(t - by_s, t, table[column].to_numpy())
    return trial.with_table(table)


@pytest.mark.parametrize("current", [(0.0, 0.0), (0.2, -0.1), (-0.25, 0.25)])
def test_a_current_is_taken_out_of_the_velocities(current):
    """It turns with the heading, and passed for a lag of the sway."""
    s = smooth_signals(swinging(current=current), 1.0)
    known = np.isfinite(s["current_u"])
    axes = np.column_stack((s["cos_heading"], s["sin_heading"]))[known]
    found, *_ = np.linalg.lstsq(axes, s["current_u"][known])
    np.testing.assert_allclose(found, current, atol=0.05)  # of drift it keeps a little


def test_a_current_is_taken_out_where_the_equation_explains_more_so():
    """The drift of a hull in turns feigns a little of one, which would spoil its sway."""
    shares = {}
    for current in ((0.0, 0.0), (0.25, -0.2)):
        trial = swinging(current=current, vertical=False)
        raw = SimpleNamespace(sensors={"dvl": None})
        bench = Bench(raw, trial, vehicle(), passage_s(trial, vehicle()))
        (row,) = (r for r in RELATIONS if r.against.startswith("sway"))
        s = smooth_signals(trial, 1.0)
        still = bench._fit(row, without_current(s), 1.0)
        shares[current] = bench._line(row, 1.0).explained, still.explained
    assert shares[0.0, 0.0][0] >= shares[0.0, 0.0][1]
    assert shares[0.25, -0.2][0] > shares[0.25, -0.2][1]


def test_on_one_heading_nothing_passes_for_a_current():
    trial = swinging(current=(0.3, 0.1), turns=False)
    table = trial.table.assign(heading_rad=0.05 * np.sin(0.1 * trial.table["time_s"]))
    s = smooth_signals(trial.with_table(table), 1.0)
    assert np.nanmax(np.abs(s["current_u"])) < 0.1  # of 1.5 m/s, most of which is way


def test_depth_places_the_dvl_whatever_the_hull_does():
    """Sway so early accuses no clock where depth rate and pitch say that the DVL is right."""
    own = estimated(swinging()).of["dvl"]
    assert own.kinematic
    assert own.lag_s == pytest.approx(0.0, abs=0.15)
    assert not _may_be_off("dvl", own, 1.0)


@pytest.mark.parametrize("late", [-1.0, 5.0])
def test_depth_measures_a_dvl_that_is_off(late):
    lags = estimated(late_dvl(swinging(), late)).of
    assert lags["dvl"].kinematic
    assert lags["dvl"].lag_s == pytest.approx(late, abs=0.15)
    assert _is_off("dvl", lags["dvl"], 1.0)
    assert lags["depth"].lag_s == pytest.approx(0.0, abs=0.15)
    assert "gyro" not in lags


def test_a_late_depth_is_not_the_dvls():
    trial = swinging()
    t = trial.table["time_s"].to_numpy()
    depth = np.interp(t - 3.0, t, trial.table["depth_m"].to_numpy())
    lags = estimated(trial.with_table(trial.table.assign(depth_m=depth))).of
    assert lags["depth"].lag_s == pytest.approx(3.0, abs=0.1)
    assert "dvl" not in lags or not _is_off("dvl", lags["dvl"], 1.0)


def test_sway_alone_accuses_no_clock_of_what_a_hull_may_do():
    lags = estimated(swinging(vertical=False)).of
    assert "gyro" not in lags
    assert "dvl" not in lags or not _is_off("dvl", lags["dvl"], 1.0)


def test_where_surge_contradicts_sway_neither_accuses_the_dvl():
    sway, surge = lag(-2.0, 0.2, sure_s=0.3), lag(0.1, 0.2, sure_s=0.3)
    assert _is_off("dvl", sway, 1.0)
    own = _doubted(sway, surge)
    assert own.lag_s == -2.0
    assert not _is_off("dvl", own, 1.0)
    assert _may_be_off("dvl", own, 1.0)
    assert _doubted(sway, replace(surge, lag_s=-5.0)) == sway
    assert _doubted(sway, replace(surge, lag_s=-0.1)).lag_s == -0.1


def test_an_attitude_that_agrees_with_the_gyro_outweighs_a_majority():
    """Three poorly known lags against one of a hundredth of a second."""
    judges = {
        "attitude": lag(0.002, 0.012, kinematic=True),
        "rudder": lag(-0.23, 0.44),
        "dvl": lag(-0.68, 0.07),
        "depth": lag(-0.66, 0.06),
        "position": lag(-0.02, 0.017, kinematic=True),
    }
    assert _agreed(judges, {"dvl", "depth"}) == ()
    without = {s: e for s, e in judges.items() if s != "attitude"}
    assert _agreed(without, {"dvl", "depth"}) == ()  # the position weighs as well
    off = judges | {"attitude": lag(-0.67, 0.012), "position": lag(-0.65, 0.017)}
    assert "attitude" in _agreed(off, {"dvl", "depth", "attitude"})


@pytest.mark.parametrize(("rudder", "instead"), [(-0.2, ""), (-1.1, "gyro")])
def test_attitude_or_gyro_is_for_another_sensor_to_tell(rudder, instead):
    """A rudder that is a second early fits either; one that is on the gyro's clock does not."""
    judges = {"attitude": lag(-1.0, 0.01, kinematic=True), "rudder": lag(rudder, 0.1, sure_s=0.3)}
    lags = _with_doubt(Lags(dict(judges)), judges, {"attitude"}).of
    assert lags["attitude"].instead == instead
    check = _checks(calm(), "dvl", lags["attitude"], 1.0)[0]
    assert bool(check.fix) == (not instead)
    assert ("check how both are stamped" in check.remedy) == bool(instead)


def test_filters_of_sensors_do_not_hide_a_gyro_that_is_off():
    judges = {"attitude": lag(-1.0, 0.01, kinematic=True), "depth": lag(-1.12, 0.02)}
    assert _agreed(judges, {"attitude", "depth"}) == ("attitude", "depth")


def test_a_correction_is_proposed_where_kinematics_measured_it():
    for kinematic in (True, False):
        found = lag(-2.0, 0.1, kinematic=kinematic)
        check = _checks(calm(), "dvl", found, 1.0)[0]
        assert check.outcome == "contradicts"
        assert bool(check.fix) == kinematic == ("--fix" in check.remedy)
        assert check.fix_if_asked.startswith("2.000")
        assert "time_offset_s = 2.000" in check.remedy
    assert "check how the dvl is stamped" in check.remedy


def test_within_what_hulls_differ_a_lag_is_told_and_accuses_nobody():
    check = _checks(calm(), "dvl", lag(-1.0, 0.1, sure_s=0.6), 1.0)[0]
    assert check.outcome == "untested"
    assert not check.fix_if_asked and not check.remedy
    assert "1.00 s early" in check.message and "hull" in check.message
