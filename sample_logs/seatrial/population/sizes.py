"""Sizes of planted effects relative to the vehicle: times by L/U, forces by 1/2 rho U^2 L^2.

The ranges are those of `seatrial.effects` on the REMUS plant at 1.5 m/s made dimensionless, all
parameters of a draw times one strength of 0.5 to 1.5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from seatrial.effects import EFFECTS, LATER, VERTICAL
from seatrial.population.form import Size
from seatrial.population.sizes_vertical import OWN

STRENGTH = (0.5, 1.5)
LIMITS = ("rudder_rate_limit", "elevator_rate_limit")  # the less, the more they do


@dataclass(frozen=True)
class Scales:
    """What sizes are measured by.

    revs : cruise [rev/s]; drag [N]; duration_s, depth_m : of the trial, and at which it works
    """

    size: Size
    revs: float
    drag: float
    duration_s: float
    depth_m: float = 8.0


# Effect -> parameter -> (low, high, unit, signed). Units: see `unit`. "fixed" takes no strength.
RANGES: dict[str, dict[str, tuple]] = {
    "wave": {
        "force_n": (1.0e-3, 2.5e-3, "force", False),
        "moment_nm": (1.1e-4, 2.9e-4, "moment", False),
        "omega_radps": (0.7, 1.3, "fixed", False),
        "direction_rad": (-math.pi, math.pi, "fixed", False),
    },
    "one_off_event": {
        "maneuver_fraction": (0.1, 0.9, "fixed", False),
        "after_s": (4.0, 14.0, "fixed time", False),
        "duration_s": (2.2, 4.5, "fixed time", False),
        "force_n": (5e-3, 1e-2, "force", True),
        "moment_nm": (7e-4, 1.5e-3, "moment", True),
    },
    "rudder_offset": {"offset_deg": (1.0, 3.0, "one", True)},
    "rudder_lag": {"lag_s": (0.35, 0.9, "time", False)},
    "rudder_rate_limit": {"rate_degps": (7.0, 18.0, "per time", False)},
    "rudder_delay": {"delay_s": (0.22, 0.67, "time", False)},
    "rudder_backlash": {"half_width_deg": (1.0, 3.0, "one", False)},
    "rudder_deadband": {"deadband_deg": (1.0, 2.5, "one", False)},
    "rudder_asymmetry": {"gain": (0.1, 0.3, "one", True)},
    "rudder_stall": {"angle_deg": (13.0, 22.0, "fixed", False)},
    "propeller_lag": {"lag_s": (0.8, 2.2, "time", False)},
    "propeller_race": {"c_m2ps2pn": (0.3, 0.75, "race", False)},
    "thrust_sag": {"fraction_per_1000_s": (0.1, 0.25, "per trial", False)},
    "thrust_step": {
        "fraction": (0.1, 0.25, "one", False),
        "time_s": (0.3, 0.7, "trial", False),
    },
    "dvl_delay": {"delay_s": (0.22, 0.56, "time", False)},
    "gyro_delay": {"delay_s": (0.17, 0.45, "time", False)},
    "dvl_misalignment": {"yaw_deg": (1.5, 4.0, "one", True)},
    "dvl_scale": {"fraction": (0.02, 0.05, "one", True)},
    "dvl_lever_arm": {
        "dx_m": (0.08, 0.22, "length", True),
        "dy_m": (0.03, 0.075, "length", True),
    },
    "gyro_bias": {"bias_degps": (0.18, 0.45, "per time", True)},
    "gyro_scale": {"fraction": (0.02, 0.05, "one", True)},
    "propeller_side_force": {
        "Y_nn": (3e-4, 7.3e-4, "force per revs^2", True),
        "N_nn": (7.3e-5, 2.2e-4, "moment per revs^2", True),
    },
    "hull_asymmetry": {
        "Y_0": (3.3e-4, 7.7e-4, "force per u^2", True),
        "N_0": (8e-5, 2.1e-4, "moment per u^2", True),
    },
    "sway_cross_flow": {"factor": (1.5, 4.0, "one", False)},
    "yaw_cross_flow": {"factor": (1.5, 4.0, "one", False)},
    "cubic_damping": {
        "N_vvr": (-0.074, -0.037, "cubic vvr", False),
        "N_rrr": (-0.013, -0.0052, "cubic rrr", False),
    },
    "turning_drag": {
        "X_vv": (-0.066, -0.033, "force per u^2", False),
        "X_rr": (-0.011, -0.005, "drag rr", False),
    },
    "linear_drag": {"X_u": (-0.45, -0.2, "drag per u", False)},
    "linear_damping": {
        "Y_v": (-0.026, -0.011, "force per u", False),
        "N_r": (-3.8e-3, -1.7e-3, "moment per r", False),
    },
    "current_drift": {
        f"{axis}_{half}_mps_per_1000_s": (0.06, 0.17, "speed per trial", True)
        for half in ("early", "late")
        for axis in ("north", "east")
    },
    "roll_coupling": {
        "Y_uuphi": (0.011, 0.027, "force per u^2", True),
        "N_uuphi": (0.0025, 0.0058, "moment per u^2", True),
    },
    "heading_force": {
        "force_n": (7e-4, 1.5e-3, "force", True),
        "moment_nm": (1.1e-4, 2.2e-4, "moment", True),
    },
    "memory_force": {
        "Y_vr": (0.058, 0.1, "mass", True),
        "N_vr": (0.0087, 0.0155, "mass length", True),
        "time_s": (3.4, 6.7, "fixed time", False),
    },
    "roll_mode": {
        "Y_phi": (0.005, 0.01, "mass", True),
        "omega_radps": (1.35, 2.2, "fixed per time", False),
        "damping": (0.04, 0.08, "fixed", False),
    },
}
CURRENT = (0.08, 0.17)  # of U
SINGLES = tuple(
    n for n in ("current", *RANGES) if EFFECTS[n].family != "outside" and n not in LATER
)
OUTSIDE = tuple(n for n in RANGES if EFFECTS[n].family == "outside")
OUTSIDE_UPRIGHT = ("wave",)  # of the vertical plane, beside those of the family
# By plane: sizes, what is planted alone and in pairs, what is outside of the program's table
RANGES_OF = {
    "horizontal": RANGES,
    "vertical": {n: r for n, r in RANGES.items() if n in VERTICAL} | OWN,
}
SINGLES_OF = {
    "horizontal": SINGLES,
    "vertical": tuple(
        n for n in VERTICAL if VERTICAL[n].family != "outside" and n not in OUTSIDE_UPRIGHT
    ),
}
OUTSIDE_OF = {
    "horizontal": OUTSIDE,
    "vertical": tuple(n for n in VERTICAL if n not in SINGLES_OF["vertical"]),
}


def unit(kind: str, scales: Scales) -> float:
    """One of a parameter's unit, in the generator's own."""
    size = scales.size
    length, speed, time, force = size.length, size.speed, size.time, size.force
    moment = force * length
    units = {
        "one": 1.0,
        "force": force,
        "moment": moment,
        "time": time,
        "per time": 1.0 / time,
        "length": length,
        "race": speed**2 / scales.drag,
        "per trial": 1000.0 / scales.duration_s,
        "trial": scales.duration_s,
        "force per revs^2": force / scales.revs**2,
        "moment per revs^2": moment / scales.revs**2,
        "force per u^2": force / speed**2,
        "moment per u^2": moment / speed**2,
        "drag per u": scales.drag / speed,
        "force per u": force / speed,
        "moment per r": moment * time,
        "speed per trial": speed * 1000.0 / scales.duration_s,
        "drag rr": force * time**2,
        "cubic vvr": moment * time / speed**2,
        "cubic rrr": moment * time**3,
        "speed": speed,
        "depth": scales.depth_m,
        "force per length": force / length,
        "mass": force * time / speed,
        "mass length": moment * time / speed,
    }
    return units[kind.removeprefix("fixed").strip() or "one"]


def draw_sizes(
    names: tuple[str, ...],
    scales: Scales,
    rng: np.random.Generator,
    plane: str = "horizontal",
    times: float = 1.0,
) -> dict:
    """Parameters of the effects planted in a trial of a plane, by id; so many times the usual."""
    planted = {}
    for name in names:
        strength = float(rng.uniform(*STRENGTH)) * (1.0 / times if name in LIMITS else times)
        if name == "current":
            drift = strength * rng.uniform(*CURRENT) * scales.size.speed
            angle = float(rng.uniform(-math.pi, math.pi))
            north, east = float(drift * math.cos(angle)), float(drift * math.sin(angle))
            planted[name] = {"north_mps": north, "east_mps": east}
            continue
        planted[name] = {
            symbol: _one(low, high, kind, signed, strength, scales, rng)
            for symbol, (low, high, kind, signed) in RANGES_OF[plane][name].items()
        }
    return planted


def _one(low, high, kind, signed, strength, scales: Scales, rng: np.random.Generator) -> float:
    value = float(rng.uniform(low, high)) * unit(kind, scales)
    if signed:
        value *= float(rng.choice([-1.0, 1.0]))
    return value if kind.startswith("fixed") or kind == "trial" else value * strength
