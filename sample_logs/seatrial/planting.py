"""Planted effects in the form in which plant, servo and motor take them."""

from __future__ import annotations

import math

from seatrial.actuators import Servo
from seatrial.plant import PlantEffects
from seatrial.simulate import Drive

DEGREE = math.pi / 180.0

# Effect -> parameter of the recipe -> field of `PlantEffects`.
_PLANT_NAMES = {
    "current": {"north_mps": "current_north", "east_mps": "current_east"},
    "propeller_race": {"c_m2ps2pn": "race"},
    "propeller_side_force": {"Y_nn": "side_force_nn", "N_nn": "yaw_moment_nn"},
    "hull_asymmetry": {"Y_0": "side_force_uu", "N_0": "yaw_moment_uu"},
    "sway_cross_flow": {"factor": "sway_cross_flow"},
    "yaw_cross_flow": {"factor": "yaw_cross_flow"},
    "cubic_damping": {"N_vvr": "cubic_vvr", "N_rrr": "cubic_rrr"},
    "turning_drag": {"X_vv": "turning_vv", "X_rr": "turning_rr"},
    "linear_drag": {"X_u": "linear_drag"},
    "linear_damping": {"Y_v": "linear_v", "N_r": "linear_r"},
    "roll_coupling": {"Y_uuphi": "roll_side_force", "N_uuphi": "roll_yaw_moment"},
    "heading_force": {"force_n": "heading_side_force", "moment_nm": "heading_yaw_moment"},
    "memory_force": {
        "Y_vr": "memory_side_force",
        "N_vr": "memory_yaw_moment",
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
