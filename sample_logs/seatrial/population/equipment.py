"""Servos, motor and sensors of different quality; what is logged, how often, how well timed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from seatrial.actuators import Servo
from seatrial.population.form import Size
from seatrial.sensors import RATES_HZ, Noise
from seatrial.simulate import Drive

DEGREE = math.pi / 180.0
# Chance that a log has the sensor at all
PRESENT = {"attitude": 0.85, "depth": 0.9, "position": 0.5}


@dataclass(frozen=True)
class Equipment:
    """What moves and what measures.

    jitter_s : standard deviation of the time stamps of each sensor
    missing : sensors without a file
    """

    rudder: Servo
    elevator: Servo
    drive: Drive
    noise: Noise
    jitter_s: dict
    missing: tuple


def draw_equipment(size: Size, rng: np.random.Generator) -> Equipment:
    """Good and poor equipment; servos quick enough that none is an effect by itself."""
    rates = {
        "dvl": _between(2.0, 10.0, rng),
        "gyro": _between(10.0, 100.0, rng),
        "rudder": _between(5.0, 20.0, rng),
        "rpm": _between(2.0, 10.0, rng),
        "attitude": _between(2.0, 50.0, rng),
        "depth": _between(1.0, 8.0, rng),
        "position": _between(0.2, 1.0, rng),
    }
    rates["elevator"] = rates["rudder"]
    noise = Noise(
        dvl_mps=_between(0.002, 0.02, rng),
        gyro_radps=_between(0.0002, 0.005, rng),
        tilt_rad=_between(0.05, 0.5, rng) * DEGREE,
        heading_rad=_between(0.1, 1.0, rng) * DEGREE,
        depth_m=_between(0.005, 0.05, rng),
        position_m=_between(0.1, 2.0, rng),
        rates_hz={name: round(rates[name], 1) for name in RATES_HZ},
    )
    worst = _between(0.0005, 0.02, rng)
    jitter = {name: min(worst * float(rng.uniform(0.3, 1.0)), 0.15 / rates[name]) for name in rates}
    missing = tuple(name for name, share in PRESENT.items() if rng.random() > share)
    servo = draw_servo(size, rng)
    drive = Drive(lag=max(0.02, float(rng.uniform(0.02, 0.12)) * size.time))
    return Equipment(servo, servo, drive, noise, jitter, missing)


def draw_servo(size: Size, rng: np.random.Generator) -> Servo:
    """A servo with a little of every fault."""
    return Servo(
        lag=max(0.015, float(rng.uniform(0.005, 0.03)) * size.time),
        rate_limit=float(rng.uniform(150.0, 400.0)) * DEGREE / size.time,
        delay=round(float(rng.uniform(0.0, 0.01)) * size.time, 2),
        deadband=float(rng.uniform(0.0, 0.1)) * DEGREE,
        backlash=float(rng.uniform(0.0, 0.15)) * DEGREE,
        asymmetry=float(rng.normal(0.0, 0.005)),
        offset=float(rng.normal(0.0, 0.05)) * DEGREE,
    )


def _between(low: float, high: float, rng: np.random.Generator) -> float:
    """A number between two others, even in its logarithm."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def jittered(measured: dict, equipment: Equipment, streams) -> dict:
    """The sensors that are logged, with the stamps off by the jitter; in order as written."""
    found = {}
    for name, data in measured.items():
        if name in equipment.missing:
            continue
        off = streams(f"{name} jitter").normal(0.0, equipment.jitter_s[name], data["time_s"].size)
        found[name] = {**data, "time_s": np.round(data["time_s"] + off, 3)}
    return found
