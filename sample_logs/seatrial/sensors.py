"""Sensors: each on its own clock, with noise, drop-outs and the flaws of a real file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from seatrial.planting import vertical_water
from seatrial.simulate import (
    CALM_ABOVE_M,
    ELEVATOR_COMMAND,
    RPM_COMMAND,
    RUDDER_COMMAND,
    STEP_S,
)

DEGREE = math.pi / 180.0


RATES_HZ = {
    "dvl": 5.0,
    "gyro": 50.0,
    "rudder": 20.0,
    "elevator": 20.0,
    "rpm": 10.0,
    "attitude": 10.0,
    "depth": 5.0,
    "position": 1.0,
}


@dataclass(frozen=True)
class Noise:
    """Standard deviations of the sensors, and their rates."""

    dvl_mps: float = 0.005
    gyro_radps: float = 0.05 * DEGREE
    tilt_rad: float = 0.1 * DEGREE
    heading_rad: float = 0.3 * DEGREE
    depth_m: float = 0.01
    position_m: float = 0.3
    rates_hz: Mapping[str, float] = field(default_factory=lambda: RATES_HZ)


def clock(rng: np.random.Generator, end_s: float, rate_hz: float) -> np.ndarray:
    """Sampling times of one sensor: own start, rate off by some 0.1 %, 2 % jitter."""
    start = rng.uniform(0.0, 1.5)
    period = 1.0 / (rate_hz * (1.0 + rng.normal(0, 1e-3)))
    times = np.arange(start, end_s - rng.uniform(0.1, 1.5), period)
    return np.round(times + rng.normal(0, 0.02 * period, times.size).clip(-0.08, 0.08), 3)


def at(record: np.ndarray, column: int, times: np.ndarray) -> np.ndarray:
    """A recorded column at those times, linear between steps."""
    grid = np.arange(record.shape[0]) * STEP_S
    return np.interp(times, grid, record[:, column])


def held(record: np.ndarray, column: int, times: np.ndarray) -> np.ndarray:
    """A command at those times, held between steps."""
    index = np.clip(np.floor(times / STEP_S + 1e-9).astype(int), 0, record.shape[0] - 1)
    return record[index, column]


def steady_current(planted: dict) -> tuple[float, float]:
    """North and east drift of the water at mid-trial [m/s]."""
    current = planted.get("current", {})
    return current.get("north_mps", 0.0), current.get("east_mps", 0.0)


def gained(steps: int, rates: dict) -> np.ndarray:
    """What a changing current has gained since mid-trial, north and east, (steps, 2) [m/s].

    The vehicle does not feel it: water that speeds up carries a body of its own density along.
    """
    time = (np.arange(steps) - 0.5 * (steps - 1)) * STEP_S / 1000.0
    early, late = (
        np.array([rates[f"{axis}_{half}_mps_per_1000_s"] for axis in ("north", "east")])
        for half in ("early", "late")
    )
    return np.where(time[:, None] < 0.0, np.outer(time, early), np.outer(time, late))


def drifted(record: np.ndarray, planted: dict) -> np.ndarray:
    """The record with the track that a changing current carries the vehicle along."""
    if "current_drift" not in planted:
        return record
    moved, water = record.copy(), gained(record.shape[0], planted["current_drift"])
    moved[:, 6:8] += np.cumsum(water, axis=0) * STEP_S
    return moved


def body_over_ground(record: np.ndarray, planted: dict) -> np.ndarray:
    """Velocity of O over ground in body axes, every step, (steps, 3) [m/s]."""
    north, east = steady_current(planted)
    if "current_drift" in planted:
        change = gained(record.shape[0], planted["current_drift"])
        north, east = north + change[:, 0], east + change[:, 1]
    cr, sr = np.cos(record[:, 9]), np.sin(record[:, 9])
    cp, sp = np.cos(record[:, 10]), np.sin(record[:, 10])
    ch, sh = np.cos(record[:, 11]), np.sin(record[:, 11])
    drift = np.column_stack(
        [
            ch * cp * north + sh * cp * east,
            (ch * sp * sr - sh * cr) * north + (sh * sp * sr + ch * cr) * east,
            (ch * sp * cr + sh * sr) * north + (sh * sp * cr - ch * sr) * east,
        ]
    )
    if {"vertical_current", "internal_wave"} & set(planted):
        down = sinking_water(record, planted)
        drift += np.column_stack([-sp * down, cp * sr * down, cp * cr * down])
    return record[:, :3] + drift


def sinking_water(record: np.ndarray, planted: dict) -> np.ndarray:
    """Downward speed of the water around the vehicle, every step [m/s]."""
    sea, time = vertical_water(planted), np.arange(record.shape[0]) * STEP_S
    below = np.clip(record[:, 8] / CALM_ABOVE_M, 0.0, 1.0)
    return below * (sea.sinking + sea.wave_speed * np.sin(sea.wave_omega * time))


def lagged(values: np.ndarray, lag_s: float) -> np.ndarray:
    """First-order lag of a recorded column."""
    if lag_s <= 0.0:
        return values
    keep, found = math.exp(-STEP_S / lag_s), values.copy()
    for k in range(1, values.size):
        found[k] = keep * found[k - 1] + (1.0 - keep) * values[k]
    return found


def dvl(record, vehicle, planted, rng, noise: Noise) -> dict[str, np.ndarray]:
    """DVL velocity over ground at its own position, with drop-outs and outliers."""
    times = clock(rng, record.shape[0] * STEP_S, noise.rates_hz["dvl"])
    lever = planted.get("dvl_lever_arm", {})
    mount = vehicle.file["dvl"]
    x, y = mount["x_m"] + lever.get("dx_m", 0.0), mount["y_m"] + lever.get("dy_m", 0.0)
    position = np.array([x, y, vehicle.plant.dvl_z + lever.get("dz_m", 0.0)])
    velocity = body_over_ground(record, planted) + np.cross(record[:, 3:6], position)
    yaw = planted.get("dvl_misalignment", {}).get("yaw_deg", 0.0) * DEGREE
    turn = np.array(
        [[math.cos(yaw), math.sin(yaw), 0], [-math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]]
    )
    up = planted.get("dvl_pitch", {}).get("pitch_deg", 0.0) * DEGREE
    if up != 0.0:
        bow_up = [[math.cos(up), 0, -math.sin(up)], [0, 1, 0], [math.sin(up), 0, math.cos(up)]]
        turn = turn @ np.array(bow_up)
    velocity = velocity @ turn.T * (1.0 + planted.get("dvl_scale", {}).get("fraction", 0.0))
    taken = times - planted.get("dvl_delay", {}).get("delay_s", 0.0)
    measured = np.column_stack([at(velocity, i, taken) for i in range(3)])
    measured += rng.normal(0, noise.dvl_mps, measured.shape)
    wild = rng.random(times.size) < 0.0012
    measured[wild] += rng.uniform(-1.2, 1.2, (int(wild.sum()), 3))
    valid = bottom_lock(rng, times)
    measured[~valid] = np.nan
    return {
        "time_s": times,
        "u_mps": measured[:, 0],
        "v_mps": measured[:, 1],
        "w_mps": measured[:, 2],
        "valid": valid.astype(int),
    }


def bottom_lock(rng: np.random.Generator, times: np.ndarray) -> np.ndarray:
    """False in short drop-outs: about one in two minutes, 0.4 to 2.5 s long."""
    valid = np.ones(times.size, bool)
    for _ in range(rng.poisson(times[-1] / 120.0)):
        start = rng.uniform(times[0], times[-1])
        valid &= ~((times >= start) & (times < start + rng.uniform(0.4, 2.5)))
    return valid


def gyro(record, planted, rng, noise: Noise) -> dict[str, np.ndarray]:
    """Rates p, q, r [rad/s]."""
    times = clock(rng, record.shape[0] * STEP_S, noise.rates_hz["gyro"])
    taken = times - planted.get("gyro_delay", {}).get("delay_s", 0.0)
    rates = np.column_stack([at(record, i, taken) for i in (3, 4, 5)])
    if "q_scale" in planted or "q_bias" in planted:
        rates[:, 1] *= 1.0 + planted.get("q_scale", {}).get("fraction", 0.0)
        rates[:, 1] += planted.get("q_bias", {}).get("bias_degps", 0.0) * DEGREE
    rates[:, 2] *= 1.0 + planted.get("gyro_scale", {}).get("fraction", 0.0)
    rates[:, 2] += planted.get("gyro_bias", {}).get("bias_degps", 0.0) * DEGREE
    rates += rng.normal(0, noise.gyro_radps, rates.shape)
    return {"time_s": times, "p": rates[:, 0], "q": rates[:, 1], "r": rates[:, 2]}


def command(record, column: int, sensor: str, rng, noise: Noise) -> dict[str, np.ndarray]:
    """A logged command (rudder or elevator [rad], propeller [rpm])."""
    times = clock(rng, record.shape[0] * STEP_S, noise.rates_hz[sensor])
    return {"time_s": times, "value": held(record, column, times)}


def attitude(record, planted, rng, noise: Noise) -> dict[str, np.ndarray]:
    """Roll, pitch and heading [rad], heading within 0 .. 2 pi."""
    times = clock(rng, record.shape[0] * STEP_S, noise.rates_hz["attitude"])
    heading = at(record, 11, times) + rng.normal(0, noise.heading_rad, times.size)
    gain = 1.0 + planted.get("pitch_scale", {}).get("fraction", 0.0)
    pitch = at(record, 10, times) * gain
    pitch += planted.get("pitch_bias", {}).get("bias_deg", 0.0) * DEGREE
    return {
        "time_s": times,
        "roll": at(record, 9, times) + rng.normal(0, noise.tilt_rad, times.size),
        "pitch": pitch + rng.normal(0, noise.tilt_rad, times.size),
        "heading": np.mod(heading, 2 * math.pi),
    }


def depth(record, planted, rng, noise: Noise) -> dict[str, np.ndarray]:
    """Depth of O [m]."""
    times = clock(rng, record.shape[0] * STEP_S, noise.rates_hz["depth"])
    true = lagged(record[:, 8], planted.get("depth_lag", {}).get("lag_s", 0.0))
    measured = np.interp(times, np.arange(record.shape[0]) * STEP_S, true)
    measured *= 1.0 + planted.get("depth_scale", {}).get("fraction", 0.0)
    measured += rng.normal(0, noise.depth_m, times.size)
    return {"time_s": times, "depth": measured}


def position(record, rng, noise: Noise) -> dict[str, np.ndarray]:
    """Acoustic position [m] relative to the start."""
    times = clock(rng, record.shape[0] * STEP_S, noise.rates_hz["position"])
    error = rng.normal(0, noise.position_m, (times.size, 2))
    return {
        "time_s": times,
        "north": at(record, 6, times) + error[:, 0],
        "east": at(record, 7, times) + error[:, 1],
    }


def measure_all(record, vehicle, planted, streams, noise: Noise | None = None) -> dict:
    """All sensors, SI and internal signs; `streams` maps a sensor to its random stream."""
    noise = noise or Noise()
    return {
        "dvl": dvl(record, vehicle, planted, streams("dvl"), noise),
        "gyro": gyro(record, planted, streams("gyro"), noise),
        "rudder": command(record, RUDDER_COMMAND, "rudder", streams("rudder"), noise),
        "elevator": command(record, ELEVATOR_COMMAND, "elevator", streams("elevator"), noise),
        "rpm": command(record, RPM_COMMAND, "rpm", streams("rpm"), noise),
        "attitude": attitude(record, planted, streams("attitude"), noise),
        "depth": depth(record, planted, streams("depth"), noise),
        "position": position(record, streams("position"), noise),
    }
