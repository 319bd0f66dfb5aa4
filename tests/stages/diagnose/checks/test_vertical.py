"""Pitch and depth against the motion, on dives whose logs are known in closed form."""

import math

import numpy as np
import pandas as pd
import pytest

from auvident.schema.trial import Trial
from auvident.schema.vehicle import Dvl, Vehicle
from auvident.stages.diagnose.checks.kinematics import SensorCheck
from auvident.stages.diagnose.checks.vertical import (
    DEPTH_SENSOR,
    PITCH_LATENCY_S,
    depth_against_dvl,
    pitch_against_gyro,
)
from auvident.storage.vehicle_file import load_vehicle
from tests.command_line import SAMPLES

RATE_HZ = 10.0
FINE = 20  # steps of the truth per row
DVL = Dvl(x_m=-0.2, y_m=0.1, z_m=0.15)


def vehicle() -> Vehicle:
    return load_vehicle(SAMPLES / "remus100.toml").model_copy(update={"dvl": DVL})


class Dive:
    """Down and up with a little heel: Euler angles given, rates by definition, depth integrated."""

    def __init__(self, duration_s: float = 900.0) -> None:
        self.t = np.arange(-5.0, duration_s + 5.0, 1.0 / RATE_HZ / FINE)
        t = self.t
        self.pitch = 0.15 * np.sin(0.11 * t) + 0.08 * np.sin(0.47 * t)
        self.roll, heading = 0.04 * np.sin(0.3 * t), 0.2 * np.sin(0.05 * t)
        self.u = 1.5 + 0.4 * np.sin(0.041 * t)
        self.v, self.w = 0.02 * np.cos(0.31 * t), 0.06 * np.sin(0.47 * t + 0.4)
        yaw, roll, pitch = (np.gradient(x, t) for x in (heading, self.roll, self.pitch))
        sr, cr, sp, cp = (f(x) for x in (self.roll, self.pitch) for f in (np.sin, np.cos))
        self.p = roll - yaw * sp  # inverse of Fossen (2021), 2.39
        self.q = pitch * cr + yaw * cp * sr
        self.r = yaw * cp * cr - pitch * sr
        self.depth = 8.0 + np.cumsum(-self.u * sp + (self.v * sr + self.w * cr) * cp) * (
            t[1] - t[0]
        )

    def at(self, name: str, time: np.ndarray) -> np.ndarray:
        return np.interp(time, self.t, getattr(self, name))


DIVE = Dive()


def trial_of(
    rng: np.random.Generator,
    *,
    q_bias: float = 0.0,
    q_scale: float = 0.0,
    gyro_delay: float = 0.0,
    pitch_bias: float = 0.0,
    pitch_scale: float = 0.0,
    dvl_pitch: float = 0.0,
    depth_scale: float = 0.0,
    depth_lag: float = 0.0,
    drop: tuple[str, ...] = (),
) -> Trial:
    """Logs of the dive, the sensors as they are."""
    time = np.arange(0.0, 900.0, 1.0 / RATE_HZ)
    rates = {n: DIVE.at(n, time - gyro_delay) for n in "pqr"}
    p, q, r = (DIVE.at(n, time) for n in "pqr")
    u = DIVE.at("u", time) + q * DVL.z_m - r * DVL.y_m
    v = DIVE.at("v", time) + r * DVL.x_m  # ingest has taken p z out
    w = DIVE.at("w", time) + p * DVL.y_m - q * DVL.x_m
    c, s = math.cos(dvl_pitch), math.sin(dvl_pitch)
    noise = {n: rng.normal(0, 5e-3, len(time)) for n in "uvw"}
    table = {
        "time_s": time,
        "record": np.zeros(len(time), dtype=int),
        "p_radps": rates["p"],
        "q_radps": (1.0 + q_scale) * rates["q"] + q_bias + rng.normal(0, 4e-4, len(time)),
        "r_radps": rates["r"],
        "roll_rad": DIVE.at("roll", time),
        "pitch_rad": (1.0 + pitch_scale) * DIVE.at("pitch", time)
        + pitch_bias
        + rng.normal(0, 2e-3, len(time)),
        "u_mps": c * u - s * w + noise["u"],
        "v_mps": v + noise["v"],
        "w_mps": s * u + c * w + noise["w"],
        "depth_m": (1.0 + depth_scale) * DIVE.at("depth", time - depth_lag)
        + rng.normal(0, 0.01, len(time)),
    }
    for sensor in ("gyro", "attitude", "dvl", "depth"):
        table[f"{sensor}_sampled"] = np.ones(len(time), dtype=bool)
    table["depth_sampled"] = np.arange(len(time)) % 2 == 0
    return Trial.from_table("t", pd.DataFrame(table).drop(columns=list(drop)), RATE_HZ)


def told(check: SensorCheck | None, name: str) -> tuple[float, float]:
    assert check is not None
    return check.alone(name)


def test_errors_of_the_pitch_gyro_are_found_together() -> None:
    trial = trial_of(np.random.default_rng(1), q_bias=3e-3, q_scale=-0.03, gyro_delay=0.2)
    check = pitch_against_gyro([trial])
    truth = {"q_bias.bias_degps": 3e-3, "q_scale.fraction": -0.03, "gyro_delay.delay_s": 0.2}
    for name, value in truth.items():
        found, std = told(check, name)
        # three planted at once: a hundredth of each is left by the few steps of the fit
        assert abs(found - value) < max(3.5 * std, 0.01 * abs(value)), name
    assert told(check, "q_bias.bias_degps")[1] < 2e-4
    assert told(check, "q_scale.fraction")[1] < 4e-3
    assert told(check, "gyro_delay.delay_s")[1] == pytest.approx(PITCH_LATENCY_S, rel=0.05)


def test_a_scale_is_of_the_pitch_where_the_gyro_has_none() -> None:
    """Only the difference of the two is seen: each alone explains it, with opposite sign."""
    check = pitch_against_gyro([trial_of(np.random.default_rng(2), pitch_scale=0.04)])
    assert told(check, "pitch_scale.fraction")[0] == pytest.approx(0.04, abs=5e-3)
    assert told(check, "q_scale.fraction")[0] == pytest.approx(-0.04, abs=5e-3)
    assert check is not None
    both = check.with_only(check.names)
    assert np.sqrt(both.covariance[1, 1]) > 0.1  # with both in a model neither is known


def test_a_large_scale_is_told_to_what_is_claimed() -> None:
    """(1 + q scale) / (1 + pitch scale) is seen, and not their difference: -0.1 would be -0.091."""
    check = pitch_against_gyro([trial_of(np.random.default_rng(2), pitch_scale=0.1)])
    for name, truth in (("pitch_scale.fraction", 0.1), ("q_scale.fraction", 1.0 / 1.1 - 1.0)):
        found, std = told(check, name)
        assert abs(found - truth) < 3.0 * std
        assert std < 1e-3


def test_a_scale_of_the_pitch_is_no_tilt_of_the_pitch() -> None:
    """The sine of a pitch that reads too much is no scale of the depth: what is left is counted."""
    check = depth_against_dvl([trial_of(np.random.default_rng(4), pitch_scale=0.1)], vehicle())
    assert check is not None
    both = check.with_only({"pitch_bias.bias_deg", "pitch_scale.fraction"})
    away = np.abs(both.mean - [0.0, 0.1, 0.0]) / np.sqrt(np.diag(both.covariance))
    assert np.all(away < 3.0)
    assert np.all(np.sqrt(np.diag(both.covariance))[:2] < [1e-3, 5e-3])


@pytest.mark.parametrize(
    ("planted", "name"),
    [
        ({"pitch_bias": math.radians(2.0)}, "pitch_bias.bias_deg"),
        ({"dvl_pitch": math.radians(-2.0)}, "dvl_pitch.pitch_deg"),
        ({"depth_scale": 0.05}, "depth_scale.fraction"),
        ({"depth_lag": 1.0}, "depth_lag.lag_s"),
    ],
)
def test_errors_that_the_depth_shows(planted: dict[str, float], name: str) -> None:
    check = depth_against_dvl([trial_of(np.random.default_rng(3), **planted)], vehicle())
    found, std = told(check, name)
    (value,) = planted.values()
    assert abs(found - value) < 3.0 * std
    assert std < 0.25 * abs(value)


def test_without_errors_the_claims_hold() -> None:
    """Over 12 seeds the errors are distributed as claimed: rms of 48 z within 1 +- 0.3."""
    trials = [trial_of(np.random.default_rng(s)) for s in range(12)]
    z = []
    for trial in trials:
        pitch, depth = pitch_against_gyro([trial]), depth_against_dvl([trial], vehicle())
        for check, names in (
            (pitch, ("q_bias.bias_degps", "q_scale.fraction")),
            (depth, ("pitch_bias.bias_deg", "depth_scale.fraction")),
        ):
            z += [value / std for value, std in (told(check, name) for name in names)]
    assert 0.7 < np.sqrt(np.mean(np.square(z))) < 1.3


def test_a_place_ahead_of_the_origin_is_allowed_for_a_depth_sensor() -> None:
    check = depth_against_dvl([trial_of(np.random.default_rng(4))], vehicle())
    allowed = DEPTH_SENSOR * vehicle().hull.length_m / 1.5
    assert told(check, "depth_lag.lag_s")[1] == pytest.approx(allowed, rel=0.15)


def test_without_its_logs_a_check_says_nothing() -> None:
    rng = np.random.default_rng(5)
    assert pitch_against_gyro([trial_of(rng, drop=("q_radps",))]) is None
    assert depth_against_dvl([trial_of(rng, drop=("depth_m",))], vehicle()) is None
    assert depth_against_dvl([trial_of(rng, drop=("w_mps",))], vehicle()) is None


def test_what_a_model_leaves_out_of_rivals_counts_as_zero() -> None:
    """By hand: a + b = 1 +- 0.1, b open; without b, a is 1; with both, each is half of it."""
    open_ = 100.0
    information = np.array([[1.0, 1.0], [1.0, 1.0]]) / 0.01 + np.eye(2) / open_
    covariance = np.linalg.inv(information)
    mean = covariance @ np.array([1.0, 1.0]) / 0.01
    check = SensorCheck(("a.x", "b.x"), mean, covariance, 10, 0.1, "by hand", ("a.x", "b.x"))
    alone = check.with_only({"a.x"})
    assert alone.names == ("a.x",)
    assert alone.mean[0] == pytest.approx(1.0, abs=1e-3)
    assert math.sqrt(alone.covariance[0, 0]) == pytest.approx(0.1, rel=1e-3)
    assert check.alone("b.x")[0] == pytest.approx(1.0, abs=1e-3)
    assert check.mean[0] == pytest.approx(0.5, abs=1e-3)
    assert check.of({"a.x"}).covariance.shape == (1, 1)  # type: ignore[union-attr]
    assert check.of({"c.x"}) is None
