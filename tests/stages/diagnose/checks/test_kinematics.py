"""Sensors against each other, on motions whose logs are known in closed form."""

import math
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from auvident.schema.trial import Trial
from auvident.schema.vehicle import Dvl
from auvident.stages.diagnose.checks.kinematics import (
    HEADING_LATENCY_S,
    HEADING_REFERENCE_RAD,
    HEEL_SCALE,
    SensorCheck,
    heading_against_gyro,
    position_against_dvl,
)
from tests.command_line import SAMPLES

RATE_HZ = 10.0
FINE = 20  # steps of the truth per row
DVL = Dvl(x_m=-0.2, y_m=0.1, z_m=0.15)


class Truth:
    """A boat on a winding way: Euler angles given, rates by their definition, track integrated."""

    def __init__(self, duration_s: float = 900.0) -> None:
        self.t = np.arange(-5.0, duration_s + 5.0, 1.0 / RATE_HZ / FINE)
        t = self.t
        self.heading = 1.5 * np.sin(0.09 * t) + 0.4 * np.sin(0.31 * t) + 0.01 * t
        self.roll, self.pitch = 0.12 * np.sin(0.09 * t + 0.3), 0.06 * np.sin(0.05 * t)
        self.u = 1.5 + 0.4 * np.sin(0.041 * t)
        self.v, self.w = 0.15 * np.cos(0.31 * t), 0.05 * np.sin(0.2 * t)
        yaw, roll, pitch = (np.gradient(x, t) for x in (self.heading, self.roll, self.pitch))
        sr, cr, sp, cp = (f(x) for x in (self.roll, self.pitch) for f in (np.sin, np.cos))
        self.p = roll - yaw * sp  # inverse of Fossen (2021), 2.39
        self.q = pitch * cr + yaw * cp * sr
        self.r = yaw * cp * cr - pitch * sr
        ch, sh = np.cos(self.heading), np.sin(self.heading)
        across = self.v * sr + self.w * cr
        north = (
            self.u * cp * ch + self.v * (ch * sp * sr - sh * cr) + self.w * (sh * sr + ch * cr * sp)
        )
        east = self.u * cp * sh + sh * sp * across + ch * (self.v * cr - self.w * sr)
        self.north, self.east = (np.cumsum(x) * (t[1] - t[0]) for x in (north, east))

    def at(self, name: str, time: np.ndarray) -> np.ndarray:
        return np.interp(time, self.t, getattr(self, name))


TRUTH = Truth()


def trial_of(
    rng: np.random.Generator,
    *,
    bias: float = 0.0,
    scale: float = 0.0,
    gyro_delay: float = 0.0,
    dvl_scale: float = 0.0,
    yaw: float = 0.0,
    current: tuple[float, float] = (0.0, 0.0),
    latency: float = 0.0,
    position_noise: float = 0.5,
    drop: tuple[str, ...] = (),
) -> Trial:
    """Logs of the truth; the current moves the position but not what the DVL sees."""
    time = np.arange(0.0, 900.0, 1.0 / RATE_HZ)
    rates = {n: TRUTH.at(n, time - gyro_delay) for n in "pqr"}
    table = {
        "time_s": time,
        "record": np.zeros(len(time), dtype=int),
        "p_radps": rates["p"],
        "q_radps": rates["q"],
        "r_radps": (1.0 + scale) * rates["r"] + bias + rng.normal(0, 4e-4, len(time)),
        "heading_rad": TRUTH.at("heading", time) + rng.normal(0, 5e-3, len(time)),
        "roll_rad": TRUTH.at("roll", time),
        "pitch_rad": TRUTH.at("pitch", time),
    }
    p, q, r = (TRUTH.at(n, time) for n in "pqr")
    u = TRUTH.at("u", time) - r * DVL.y_m + q * DVL.z_m
    v = TRUTH.at("v", time) + r * DVL.x_m  # ingest has taken p z out
    w = TRUTH.at("w", time) + p * DVL.y_m - q * DVL.x_m
    c, s = math.cos(yaw), math.sin(yaw)
    readings = {"u_mps": c * u + s * v, "v_mps": c * v - s * u, "w_mps": w}
    for name, x in readings.items():
        table[name] = (1.0 + dvl_scale) * x + rng.normal(0, 5e-3, len(time))
    for name, drift in zip(("north", "east"), current, strict=True):
        wander = np.convolve(rng.normal(0, 1.0, len(time) + 50), np.ones(51) / 7.1, "valid")
        noise = position_noise * 0.7 * (wander + rng.normal(0, 1.0, len(time)))
        table[f"{name}_m"] = TRUTH.at(name, time - latency) + drift * time + noise
    for sensor in ("gyro", "attitude", "dvl", "position"):
        table[f"{sensor}_sampled"] = np.ones(len(time), dtype=bool)
    table["position_sampled"] = np.arange(len(time)) % 10 == 0
    return Trial.from_table("t", pd.DataFrame(table).drop(columns=list(drop)), RATE_HZ)


ALLOWANCES = {
    "gyro_delay.delay_s": HEADING_LATENCY_S,
    "dvl_delay.delay_s": HEADING_LATENCY_S,
    "dvl_misalignment.yaw_deg": HEADING_REFERENCE_RAD,
}


def scatter(check: SensorCheck) -> np.ndarray:
    """Claimed standard deviations without what is allowed for beyond these logs."""
    allowed = np.array([ALLOWANCES.get(n, 0.0) for n in check.names])
    return np.sqrt(np.diag(check.covariance) - allowed**2)


def errors(check: SensorCheck | None, truth: dict[str, float]) -> np.ndarray:
    """Errors over claimed standard deviations."""
    assert check is not None
    known = np.array([truth.get(n, 0.0) for n in check.names])
    return (check.mean - known) / scatter(check)


def test_gyro_errors_are_found_together() -> None:
    trial = trial_of(np.random.default_rng(1), bias=4e-3, scale=-0.03, gyro_delay=0.27)
    check = heading_against_gyro([trial])
    truth = {"gyro_bias.bias_degps": 4e-3, "gyro_scale.fraction": -0.03, "gyro_delay.delay_s": 0.27}
    assert check is not None and tuple(truth) == check.names
    assert np.abs(errors(check, truth)).max() < 3.5
    assert np.all(scatter(check) < [1e-4, 2e-3, 5e-3])
    assert check.residual_rms == pytest.approx(5e-3, rel=0.1)


def test_without_gyro_errors_the_claims_hold() -> None:
    """Over 20 seeds the errors are distributed as claimed: rms of 60 z within 1 +- 0.25."""
    z = [errors(heading_against_gyro([trial_of(np.random.default_rng(s))]), {}) for s in range(20)]
    assert 0.75 < np.sqrt(np.mean(np.square(z))) < 1.25


def test_heel_matters_and_is_counted_when_it_is_not_logged() -> None:
    trial = trial_of(np.random.default_rng(2), drop=("roll_rad",))
    check = heading_against_gyro([trial])
    assert check is not None
    assert check.covariance[1, 1] >= HEEL_SCALE**2
    assert abs(check.mean[1]) < 3.0 * math.sqrt(check.covariance[1, 1])


def test_held_out_rows_and_an_outlier_do_no_harm() -> None:
    trial = trial_of(np.random.default_rng(3), bias=4e-3)
    table = trial.table.copy()
    blank = [c for c in table if c.endswith(("_rad", "_radps", "_mps", "_m"))]
    table.loc[2000:2900, blank] = np.nan
    table.loc[5000, "heading_rad"] += 0.5
    check = heading_against_gyro([Trial.from_table("t", table, RATE_HZ)])
    assert np.abs(errors(check, {"gyro_bias.bias_degps": 4e-3})).max() < 3.5


def test_dvl_errors_are_found_together_in_spite_of_a_late_position_log() -> None:
    trial = trial_of(np.random.default_rng(4), dvl_scale=0.04, yaw=-0.05, latency=0.8)
    check = position_against_dvl([trial], DVL)
    assert check is not None
    z = errors(check, {"dvl_scale.fraction": 0.04, "dvl_misalignment.yaw_deg": -0.05})
    assert np.abs(z).max() < 3.5
    assert np.all(scatter(check)[:2] < 0.01)
    assert check.covariance[1, 1] >= HEADING_REFERENCE_RAD**2
    assert check.covariance[2, 2] >= HEADING_LATENCY_S**2


def test_current_is_seen_by_a_dvl_that_measures_through_the_water() -> None:
    trial = trial_of(np.random.default_rng(5), current=(0.2, -0.1))
    water = DVL.model_copy(update={"reference": "water"})
    check = position_against_dvl([trial], water)
    truth = {"current.north_mps": 0.2, "current.east_mps": -0.1}
    assert check is not None and check.names[-2:] == tuple(truth)
    assert np.abs(errors(check, truth)).max() < 3.5
    assert np.all(np.sqrt(np.diag(check.covariance)[-2:]) < 0.03)


def test_without_position_errors_the_claims_hold() -> None:
    """Coloured position noise; 10 seeds, rms of 30 z."""
    found = [
        errors(position_against_dvl([trial_of(np.random.default_rng(s))], DVL), {})
        for s in range(10)
    ]
    assert 0.5 < np.sqrt(np.mean(np.square(found))) < 1.5


@pytest.mark.parametrize("column", ["heading_rad", "north_m"])
def test_a_missing_log_gives_no_check(column: str) -> None:
    trial = trial_of(np.random.default_rng(6), drop=(column,))
    assert position_against_dvl([trial], DVL) is None
    assert (heading_against_gyro([trial]) is None) == (column == "heading_rad")


def test_too_little_of_a_log_gives_no_check() -> None:
    trial = trial_of(np.random.default_rng(7))
    short = Trial.from_table("t", trial.table.iloc[:600].reset_index(drop=True), RATE_HZ)
    assert heading_against_gyro([short]) is None
    assert position_against_dvl([short], DVL) is None


def test_generated_trial_through_ingest(tmp_path: Path) -> None:
    """Sensors on clocks of their own, drop-outs, outliers; gyro and DVL both with errors."""
    sys.path.insert(0, str(SAMPLES))
    from seatrial.trial import generate

    from auvident.stages.ingest import ingest
    from auvident.storage.logs import read_trials
    from auvident.storage.vehicle_file import load_vehicle

    effects = [
        {"id": "gyro_bias", "bias_degps": 0.3},
        {"id": "dvl_scale", "fraction": -0.03},
        {"id": "gyro_delay", "delay_s": 0.2},
        {"id": "current"},
        {"id": "rudder_lag"},
    ]
    generate({"name": "g", "vehicle": "remus100", "seed": 90040, "effect": effects}, tmp_path / "g")
    vehicle = load_vehicle(SAMPLES / "remus100.toml")
    trial, _ = ingest(read_trials([tmp_path / "g"], None)[0], vehicle)
    truth = {"gyro_bias.bias_degps": math.radians(0.3), "gyro_delay.delay_s": 0.2}
    assert np.abs(errors(heading_against_gyro([trial]), truth)).max() < 4.0
    check = position_against_dvl([trial], vehicle.dvl)
    assert np.abs(errors(check, {"dvl_scale.fraction": -0.03})).max() < 4.0
