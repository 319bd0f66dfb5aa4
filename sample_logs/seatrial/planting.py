"""Planted effects in the form in which plant, servo and motor take them."""

from __future__ import annotations

import math

import numpy as np

from seatrial.actuators import Servo
from seatrial.plant import PlantEffects
from seatrial.simulate import Drive, Sea

DEGREE = math.pi / 180.0

# Effect -> parameter of the recipe -> field of `PlantEffects`.
_PLANT_NAMES = {
    "current": {"north_mps": "current_north", "east_mps": "current_east"},
    "propeller_race": {"c_m2ps2pn": "race"},
    "propeller_side_force": {"Y_nn": "side_force_nn", "N_nn": "yaw_moment_nn"},
    "hull_asymmetry": {
        "Y_0": "side_force_uu",
        "N_0": "yaw_moment_uu",
        "Z_0": "heave_force_uu",
        "M_0": "pitch_moment_uu",
    },
    "sway_cross_flow": {"factor": "sway_cross_flow"},
    "yaw_cross_flow": {"factor": "yaw_cross_flow"},
    "heave_cross_flow": {"factor": "heave_cross_flow"},
    "pitch_cross_flow": {"factor": "pitch_cross_flow"},
    "cubic_damping": {
        "N_vvr": "cubic_vvr",
        "N_rrr": "cubic_rrr",
        "M_wwq": "cubic_wwq",
        "M_qqq": "cubic_qqq",
    },
    "turning_drag": {
        "X_vv": "turning_vv",
        "X_rr": "turning_rr",
        "X_ww": "turning_ww",
        "X_qq": "turning_qq",
    },
    "linear_drag": {"X_u": "linear_drag"},
    "linear_damping": {"Y_v": "linear_v", "N_r": "linear_r", "Z_w": "linear_w", "M_q": "linear_q"},
    "thrust_line_moment": {"z_m": "thrust_line"},
    "buoyancy_gradient": {"gradient_npm": "buoyancy_gradient", "ballasted_at_m": "ballasted_at"},
    "roll_coupling": {"Y_uuphi": "roll_side_force", "N_uuphi": "roll_yaw_moment"},
    "heading_force": {"force_n": "heading_side_force", "moment_nm": "heading_yaw_moment"},
    "memory_force": {
        "Y_vr": "memory_side_force",
        "N_vr": "memory_yaw_moment",
        "Z_wq": "memory_heave_force",
        "M_wq": "memory_pitch_moment",
        "time_s": "memory_time",
    },
    "roll_mode": {
        "Y_phi": "mode_side_force",
        "omega_radps": "mode_frequency",
        "damping": "mode_damping",
    },
}


def plant_effects(planted: dict) -> PlantEffects:
    """What the compiled plant needs to know."""
    values = {}
    for name, columns in _PLANT_NAMES.items():
        for parameter, value in planted.get(name, {}).items():
            values[columns[parameter]] = float(value)
    return PlantEffects(**values)


def fin_servo(fin: str, planted: dict) -> Servo:
    """Servo of the "rudder" or the "elevator" with its faults."""
    clean = Servo()

    def get(fault: str, parameter: str, default: float, factor: float = 1.0) -> float:
        found = planted.get(f"{fin}_{fault}")
        return default if found is None else factor * found[parameter]

    return Servo(
        lag=get("lag", "lag_s", clean.lag),
        rate_limit=get("rate_limit", "rate_degps", clean.rate_limit, DEGREE),
        delay=get("delay", "delay_s", 0.0),
        deadband=get("deadband", "deadband_deg", 0.0, DEGREE),
        backlash=get("backlash", "half_width_deg", 0.0, DEGREE),
        asymmetry=get("asymmetry", "gain", 0.0),
        offset=get("offset", "offset_deg", 0.0, DEGREE),
        separation=get("stall", "angle_deg", clean.separation, DEGREE),
    )


def motor_drive(planted: dict) -> Drive:
    """Motor and thrust with their faults."""
    step = planted.get("thrust_step", {})
    return Drive(
        lag=float(planted.get("propeller_lag", {}).get("lag_s", Drive().lag)),
        sag_per_s=float(planted.get("thrust_sag", {}).get("fraction_per_1000_s", 0.0)) / 1000.0,
        step_fraction=float(step.get("fraction", 0.0)),
        step_time=float(step.get("time_s", 1e9)),
    )


def vertical_water(planted: dict, sea: Sea | None = None) -> Sea:
    """`sea`, or a calm one, with the water that rises and sinks."""
    sea = sea or Sea(np.zeros(6), np.ones(1), np.zeros(1), np.zeros((1, 6)))
    wave = planted.get("internal_wave", {})
    return sea._replace(
        sinking=float(planted.get("vertical_current", {}).get("down_mps", 0.0)),
        wave_speed=float(wave.get("down_mps", 0.0)),
        wave_omega=2.0 * math.pi / float(wave.get("period_s", 2.0 * math.pi)),
    )


def with_weight(planted: dict, sea: Sea) -> Sea:
    """`sea` with the weight that comes or goes in the course of the trial."""
    change = planted.get("weight_change", {})
    return sea._replace(
        weight_change=float(change.get("weight_n", 0.0)),
        weight_station=float(change.get("x_m", 0.0)),
        weight_time=float(change.get("time_s", 1e9)),
    )
