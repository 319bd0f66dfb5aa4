"""The effects that can be planted: parameters with units, a size drawn at random, and where.

`EFFECTS` is the one table. A recipe names effects by id; parameters it leaves out are drawn from
the recipe's seed. Forces scale with the lateral size of the vehicle (``vehicle.scale``).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from seatrial.draws import one, pair, polar, side
from seatrial.effects_vertical import ROWS, SHARED


@dataclass(frozen=True)
class Effect:
    """One row of the table.

    draw : (rng, vehicle scale, cruise rev/s) -> parameters
    into : which part of the trial takes it (plant, servo, drive, sea, sensors)
    how : how it is planted
    """

    id: str
    family: str
    units: dict
    into: str
    how: str
    draw: Callable


def _current(rng, scale, revs):
    north, east = polar(rng, 0.15, 0.25)
    return {"north_mps": north, "east_mps": east}


def _wave(rng, scale, revs):
    return {
        "force_n": float(rng.uniform(2.0, 5.0) * scale),
        "moment_nm": float(rng.uniform(0.3, 0.8) * scale**1.5),
        "omega_radps": float(rng.uniform(0.7, 1.3)),
        "direction_rad": float(rng.uniform(-math.pi, math.pi)),
    }


def _event(rng, scale, revs):
    return {
        "maneuver_fraction": float(rng.uniform(0.1, 0.9)),
        "after_s": float(rng.uniform(6.0, 20.0)),
        "duration_s": float(rng.uniform(2.0, 4.0)),
        "force_n": side(rng, 10.0, 20.0) * scale,
        "moment_nm": side(rng, 2.0, 4.0) * scale**1.5,
    }


def _side_force(rng, scale, revs):
    force, moment = side(rng, 0.6, 1.5) * scale, side(rng, 0.2, 0.6) * scale**1.5
    return {"Y_nn": force / revs**2, "N_nn": moment / revs**2}


def _turning(rng, scale, revs):
    return {
        "X_vv": float(-rng.uniform(30, 60) * scale),
        "X_rr": float(-rng.uniform(8, 18) * scale**2),
    }


def _cubic(rng, scale, revs):
    return {
        "N_vvr": float(-rng.uniform(40, 80) * scale),
        "N_rrr": float(-rng.uniform(10, 25) * scale**2),
    }


def _linear(rng, scale, revs):
    return {
        "Y_v": float(-rng.uniform(15, 35) * scale),
        "N_r": float(-rng.uniform(4, 9) * scale**2),
    }


def _drift(rng, scale, revs):
    (north, east), (later_north, later_east) = (polar(rng, 0.15, 0.35) for _ in range(2))
    return {
        "north_early_mps_per_1000_s": north,
        "east_early_mps_per_1000_s": east,
        "north_late_mps_per_1000_s": later_north,
        "east_late_mps_per_1000_s": later_east,
    }


def _memory(rng, scale, revs):
    return {
        "Y_vr": side(rng, 70, 120) * scale,
        "N_vr": side(rng, 14, 25) * scale**1.5,
        "time_s": float(rng.uniform(3, 6)),
    }


def _mode(rng, scale, revs):
    return {
        "Y_phi": side(rng, 6, 12) * scale,
        "omega_radps": float(rng.uniform(1.5, 2.5)),
        "damping": float(rng.uniform(0.04, 0.08)),
    }


# The row number seeds the draw: new rows go to the end.
_ROWS = (
    # id, family, units, into, how, draw
    (
        "current",
        "environment",
        {"north_mps": "m/s", "east_mps": "m/s"},
        "plant",
        "steady uniform drift of the water",
        _current,
    ),
    (
        "wave",
        "environment",
        {"force_n": "N", "moment_nm": "N m", "omega_radps": "rad/s", "direction_rad": "rad"},
        "sea",
        "swell force at the encounter frequency, not fading with depth",
        _wave,
    ),
    (
        "one_off_event",
        "environment",
        {
            "maneuver_fraction": "-",
            "after_s": "s",
            "duration_s": "s",
            "force_n": "N",
            "moment_nm": "N m",
        },
        "sea",
        "half-sine bump within one maneuver",
        _event,
    ),
    (
        "rudder_offset",
        "actuation",
        {"offset_deg": "deg"},
        "servo",
        "fin angle = servo angle + offset",
        one("offset_deg", 1.0, 3.0, True),
    ),
    (
        "rudder_lag",
        "actuation",
        {"lag_s": "s"},
        "servo",
        "first-order servo instead of 0.05 s",
        one("lag_s", 0.3, 0.8),
    ),
    (
        "rudder_rate_limit",
        "actuation",
        {"rate_degps": "deg/s"},
        "servo",
        "slew limit instead of 120 deg/s",
        one("rate_degps", 8.0, 20.0),
    ),
    (
        "rudder_delay",
        "actuation",
        {"delay_s": "s"},
        "servo",
        "command acts later",
        one("delay_s", 0.2, 0.6),
    ),
    (
        "rudder_backlash",
        "actuation",
        {"half_width_deg": "deg"},
        "servo",
        "play between servo and fin",
        one("half_width_deg", 1.0, 3.0),
    ),
    (
        "rudder_deadband",
        "actuation",
        {"deadband_deg": "deg"},
        "servo",
        "small commands do nothing",
        one("deadband_deg", 1.0, 2.5),
    ),
    (
        "rudder_asymmetry",
        "actuation",
        {"gain": "-"},
        "servo",
        "gain 1 + k to one side, 1 - k to the other",
        one("gain", 0.1, 0.3, True),
    ),
    (
        "rudder_stall",
        "actuation",
        {"angle_deg": "deg"},
        "servo",
        "flow separates: the effect of a deflection d is d / sqrt(1 + (d / angle)^2)",
        one("angle_deg", 13.0, 22.0),
    ),
    (
        "propeller_lag",
        "actuation",
        {"lag_s": "s"},
        "drive",
        "first-order motor instead of 0.12 s",
        one("lag_s", 0.7, 2.0),
    ),
    (
        "propeller_race",
        "actuation",
        {"c_m2ps2pn": "m^2/s^2/N"},
        "plant",
        "tail fins see u^2 + c T",
        one("c_m2ps2pn", 0.08, 0.20),
    ),
    (
        "thrust_sag",
        "actuation",
        {"fraction_per_1000_s": "-"},
        "drive",
        "thrust falls linearly through the trial",
        one("fraction_per_1000_s", 0.1, 0.25),
    ),
    (
        "thrust_step",
        "actuation",
        {"fraction": "-", "time_s": "s"},
        "drive",
        "thrust falls at one time and stays down",
        lambda rng, s, n: {
            "fraction": float(rng.uniform(0.1, 0.25)),
            "time_s": float(rng.uniform(400, 800)),
        },
    ),
    (
        "dvl_delay",
        "sensing",
        {"delay_s": "s"},
        "sensors",
        "stamps are late by this",
        one("delay_s", 0.2, 0.5),
    ),
    (
        "gyro_delay",
        "sensing",
        {"delay_s": "s"},
        "sensors",
        "stamps are late by this",
        one("delay_s", 0.15, 0.4),
    ),
    (
        "dvl_misalignment",
        "sensing",
        {"yaw_deg": "deg"},
        "sensors",
        "DVL turned clockwise seen from above",
        one("yaw_deg", 1.5, 4.0, True),
    ),
    (
        "dvl_scale",
        "sensing",
        {"fraction": "-"},
        "sensors",
        "all DVL velocities times 1 + s",
        one("fraction", 0.02, 0.05, True),
    ),
    (
        "dvl_lever_arm",
        "sensing",
        {"dx_m": "m", "dy_m": "m"},
        "sensors",
        "true position minus the one in the vehicle file",
        lambda rng, s, n: {"dx_m": side(rng, 0.1, 0.3), "dy_m": side(rng, 0.04, 0.1)},
    ),
    (
        "gyro_bias",
        "sensing",
        {"bias_degps": "deg/s"},
        "sensors",
        "added to the measured yaw rate",
        one("bias_degps", 0.2, 0.5, True),
    ),
    (
        "gyro_scale",
        "sensing",
        {"fraction": "-"},
        "sensors",
        "measured yaw rate times 1 + s",
        one("fraction", 0.02, 0.05, True),
    ),
    (
        "propeller_side_force",
        "hydrodynamics",
        {"Y_nn": "N s^2", "N_nn": "N m s^2"},
        "plant",
        "side force and yaw moment with n^2",
        _side_force,
    ),
    (
        "hull_asymmetry",
        "hydrodynamics",
        {"Y_0": "kg/m", "N_0": "kg"},
        "plant",
        "side force and yaw moment with u^2",
        pair("Y_0", (0.3, 0.7), "N_0", (0.1, 0.25)),
    ),
    (
        "sway_cross_flow",
        "hydrodynamics",
        {"factor": "-"},
        "plant",
        "extra strip cross-flow in the side force",
        one("factor", 1.5, 4.0),
    ),
    (
        "yaw_cross_flow",
        "hydrodynamics",
        {"factor": "-"},
        "plant",
        "extra strip cross-flow in the yaw moment",
        one("factor", 1.5, 4.0),
    ),
    (
        "cubic_damping",
        "hydrodynamics",
        {"N_vvr": "kg s", "N_rrr": "kg m^2 s"},
        "plant",
        "third-order yaw damping",
        _cubic,
    ),
    (
        "turning_drag",
        "hydrodynamics",
        {"X_vv": "kg/m", "X_rr": "kg m"},
        "plant",
        "extra axial drag in turns",
        _turning,
    ),
    (
        "linear_drag",
        "hydrodynamics",
        {"X_u": "kg/s"},
        "plant",
        "axial drag in proportion to u",
        lambda rng, s, n: {"X_u": float(-rng.uniform(1.2, 2.5) * s)},
    ),
    (
        "roll_coupling",
        "hydrodynamics",
        {"Y_uuphi": "kg/m", "N_uuphi": "kg"},
        "plant",
        "side force and yaw moment with u^2 roll",
        pair("Y_uuphi", (10, 25), "N_uuphi", (3, 7)),
    ),
    (
        "heading_force",
        "outside",
        {"force_n": "N", "moment_nm": "N m"},
        "plant",
        "side force and moment with cos(2 heading)",
        pair("force_n", (1.5, 3), "moment_nm", (0.3, 0.6)),
    ),
    (
        "memory_force",
        "outside",
        {"Y_vr": "kg", "N_vr": "kg m", "time_s": "s"},
        "plant",
        "side force and moment with |v| r lagged by time_s",
        _memory,
    ),
    (
        "roll_mode",
        "outside",
        {"Y_phi": "kg", "omega_radps": "rad/s", "damping": "-"},
        "plant",
        "side force from a lightly damped mode driven by u r",
        _mode,
    ),
    (
        "elevator_offset",
        "actuation",
        {"offset_deg": "deg"},
        "servo",
        "fin angle = servo angle + offset",
        one("offset_deg", 0.6, 1.5, True),
    ),
    (
        "elevator_lag",
        "actuation",
        {"lag_s": "s"},
        "servo",
        "first-order servo instead of 0.05 s",
        one("lag_s", 0.3, 0.6),
    ),
    (
        "elevator_rate_limit",
        "actuation",
        {"rate_degps": "deg/s"},
        "servo",
        "slew limit instead of 120 deg/s",
        one("rate_degps", 8.0, 20.0),
    ),
    (
        "elevator_delay",
        "actuation",
        {"delay_s": "s"},
        "servo",
        "command acts later",
        one("delay_s", 0.2, 0.4),
    ),
    (
        "linear_damping",
        "hydrodynamics",
        {"Y_v": "kg/s", "N_r": "kg m^2/s"},
        "plant",
        "side force with v and yaw moment with r",
        _linear,
    ),
    (
        "current_drift",
        "environment",
        {
            f"{axis}_{half}_mps_per_1000_s": "m/s in 1000 s"
            for half in ("early", "late")
            for axis in ("north", "east")
        },
        "sea",
        "the water changes its drift, by one rate up to the middle of the trial, by another after",
        _drift,
    ),
)
EFFECTS = {row[0]: Effect(*row) for row in _ROWS}
VERTICAL = {name: EFFECTS[name] for name in SHARED} | {row[0]: Effect(*row) for row in ROWS}
# what can be planted in a trial of the plane; in one of both, symbols are the horizontal ones
PLANTED = {"horizontal": EFFECTS, "vertical": {**EFFECTS, **VERTICAL}, "both": VERTICAL | EFFECTS}
# Came when studies had their seeds: planted where asked for by name, drawn by no older seed.
LATER = ("linear_damping", "current_drift")


def draw_effects(
    wanted: list[dict], seed: int, scale: float, revs: float, plane: str = "horizontal"
) -> dict[str, dict]:
    """Effects of a recipe with every parameter given a value.

    Parameters
    ----------
    wanted : ``[{"id": ..., parameter: value, ...}, ...]``; parameters left out are drawn
    seed : seed of the recipe; each effect has a stream of its own
    scale, revs : lateral size of the vehicle, cruise propeller speed [rev/s]
    plane : of the trial, as in `PLANTED`
    """
    planted, numbers = {}, list(EFFECTS) + [row[0] for row in ROWS if row[0] not in EFFECTS]
    for entry in wanted:
        effect = PLANTED[plane][entry["id"]]
        given = {k: v for k, v in entry.items() if k != "id"}
        unknown = set(given) - set(effect.units)
        if unknown:
            raise ValueError(f"effect {effect.id} has no parameter {sorted(unknown)}")
        rng = np.random.default_rng([seed, 7, numbers.index(effect.id)])
        planted[effect.id] = {**effect.draw(rng, scale, revs), **given}
    return planted
