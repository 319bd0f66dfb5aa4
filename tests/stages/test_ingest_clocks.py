"""Clocks of the sensors of trials that the independent generator sailed, moved by known amounts."""

import sys
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from ingest_world import calm, vehicle

from auvident.errors import ContradictionError
from auvident.schema.logs import CheckMade, RawTrial, moved_stamps
from auvident.schema.vehicle import Vehicle
from auvident.stages.ingest import ingest
from auvident.stages.ingest.clocks import FIXES, LIMITS, apply_clock, corrected
from auvident.storage.logs import read_trials
from auvident.storage.vehicle_file import load_vehicle

SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"
TESTED = ("attitude", "dvl", "rudder", "rpm", "depth", "position")


@cache
def harbour() -> tuple[RawTrial, Vehicle]:
    (raw,) = read_trials([SAMPLES / "harbour_trial"])
    return raw, load_vehicle(SAMPLES / "remus100.toml")


def stamped(raw: RawTrial, sensor: str, late_s: float, ppm: float = 0.0) -> RawTrial:
    """The trial with the stamps of one sensor late, and later as time goes on."""
    own = raw.sensors[sensor]
    late = late_s + 1e-6 * ppm * (own.time_s - np.median(own.time_s))
    return replace(raw, sensors={**raw.sensors, sensor: replace(own, time_s=own.time_s + late)})


def made(raw: RawTrial) -> dict[str, CheckMade]:
    return {c.name: c for c in ingest(raw, harbour()[1])[1].checks_made}


def test_a_clean_trial_has_one_clock():
    checks = made(harbour()[0])
    for sensor in TESTED:
        check = checks[f"clock_{sensor}"]
        assert check.outcome == "agrees"
        assert check.fix == ""
        assert check.low < 0.05  # hulls differ by a few hundredths of a second
        assert check.high > -0.05
        assert checks[f"drift_{sensor}"].outcome == "agrees"
    assert checks["clock_elevator"].outcome == "untested"
    assert "do not determine" in checks["clock_elevator"].message
    assert "clock_gyro" not in checks


@pytest.mark.parametrize(
    ("sensor", "late", "ppm"),
    [
        ("dvl", -1.0, 0.0),
        ("dvl", 0.0, -2000.0),
        ("rudder", 1.0, 0.0),
        ("rpm", 2.5, 0.0),
        ("position", 18.0, 1000.0),
        ("depth", -5.0, 0.0),
    ],
)
def test_an_offset_and_a_drift_are_told_and_put_right(sensor, late, ppm):
    raw = stamped(harbour()[0], sensor, late, ppm)
    checks = made(raw)
    own = checks[f"clock_{sensor}"]
    assert own.outcome == "contradicts"
    assert not own.only  # a wrong clock is told, not how closely
    assert own.low - 0.05 < late < own.high + 0.05
    assert ("drift" in own.message) == bool(ppm)
    drift = checks[f"drift_{sensor}"]
    assert drift.low < ppm < drift.high
    assert all(c.outcome != "contradicts" for n, c in checks.items() if sensor not in n)
    offset_s, drift_ppm = (float(x) for x in own.fix_if_asked.split(","))
    assert f"time_offset_s = {offset_s:.3f}" in own.remedy
    right = corrected(raw, own.name, own.fix_if_asked).sensors[sensor].time_s
    spread = (own.high - own.low) / 2.0
    np.testing.assert_allclose(right, harbour()[0].sensors[sensor].time_s, atol=2 * spread + 0.1)
    assert (drift_ppm != 0.0) == bool(ppm)


def test_the_gyro_is_named_when_all_others_agree_against_it():
    checks = made(stamped(harbour()[0], "gyro", 1.2))
    assert checks["clock_gyro"].outcome == "contradicts"
    assert checks["clock_gyro"].value == pytest.approx(1.2, abs=0.03)
    for sensor in TESTED:
        assert checks[f"clock_{sensor}"].outcome == "agrees"


@pytest.mark.parametrize(("sensor", "late"), [("dvl", 18.0), ("rudder", 5.0), ("rpm", -18.0)])
def test_a_clock_that_leaves_nothing_to_identify_is_refused_unless_put_right(sensor, late):
    raw = stamped(harbour()[0], sensor, late)
    with pytest.raises(ContradictionError) as caught:
        made(raw)
    error = caught.value
    assert error.exit_code == 3
    side, sign = ("late", "-") if late > 0.0 else ("early", "")
    where = f"[{sensor}] time_offset_s = {sign}"
    for word in (f"{sensor}.csv", side, f"--fix clock_{sensor}", where):
        assert word in str(error)
    offset_s, drift_ppm = (float(x) for x in error.fix.split(","))
    right = apply_clock(raw, sensor, offset_s, drift_ppm)
    assert made(right)[error.check].outcome == "agrees"


@pytest.mark.parametrize("seed", [156, 174])
def test_a_lag_that_explains_hardly_more_accuses_no_clock(seed, tmp_path):
    """Sway and yaw of these vehicles go hand in hand: a lag of 0.6 to 1 L/U fits a bit better."""
    sys.path.insert(0, str(SAMPLES))
    from seatrial.population import draw

    drawn = draw(seed, planted=())
    drawn.write(drawn.sail(), tmp_path / "trial", tmp_path / "vehicle.toml")
    (raw,) = read_trials([tmp_path / "trial"])
    own = load_vehicle(tmp_path / "vehicle.toml")
    checks = {c.name: c for c in ingest(raw, own)[1].checks_made}
    for name in ("clock_dvl", "drift_dvl"):
        assert checks[name].outcome != "contradicts"
        assert not checks[name].fix and not checks[name].fix_if_asked


def test_a_slow_servo_is_no_clock():
    """A rudder that acts half a second later than it is logged: the loop finds why."""
    checks = made(stamped(harbour()[0], "rudder", -0.5))
    assert checks["clock_rudder"].outcome == "agrees"


def test_a_trial_without_maneuvers_tests_nothing():
    _, quality = ingest(calm(duration_s=120.0), vehicle())
    checks = {c.name: c.outcome for c in quality.checks_made if c.name.startswith("clock_")}
    assert checks == {"clock_dvl": "untested", "clock_rudder": "untested", "clock_rpm": "untested"}


def test_stamps_are_moved_from_their_median():
    t = np.array([10.0, 11.0, 12.0, np.nan, 0.0, 99.0])
    np.testing.assert_array_equal(moved_stamps(t, 0.5, 0.0), t + 0.5)
    drifted = moved_stamps(t, 0.5, 1e5)
    np.testing.assert_allclose(drifted[:3], [10.5 - 0.1, 11.5, 12.5 + 0.1])
    raw = apply_clock(calm(), "dvl", -0.25, 0.0)
    np.testing.assert_allclose(raw.sensors["dvl"].time_s, calm().sensors["dvl"].time_s - 0.25)
    assert raw.sensors["gyro"].time_s[0] == 0.0


def test_every_clock_with_a_limit_has_a_fix():
    assert {f"clock_{sensor}" for sensor in LIMITS} == set(FIXES)
