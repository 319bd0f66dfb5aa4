"""Effects of the vertical plane: rows of the table of `seatrial.effects`.

An effect that acts in either plane with other symbols (``cubic_damping``) has a row here as well,
which holds in trials of the vertical plane. Sizes are those of the like effect of the other plane.
"""

from __future__ import annotations

from seatrial.draws import one, pair, side

BALLASTED_AT_M = 8.0  # about the working depth of the trials


def _lever_arm(rng, scale, revs):
    return {"dx_m": side(rng, 0.1, 0.3), "dz_m": side(rng, 0.04, 0.1)}


def _turning(rng, scale, revs):
    return {
        "X_ww": float(-rng.uniform(30, 60) * scale),
        "X_qq": float(-rng.uniform(8, 18) * scale**2),
    }


def _cubic(rng, scale, revs):
    return {
        "M_wwq": float(-rng.uniform(40, 80) * scale),
        "M_qqq": float(-rng.uniform(10, 25) * scale**2),
    }


def _linear(rng, scale, revs):
    return {
        "Z_w": float(-rng.uniform(15, 35) * scale),
        "M_q": float(-rng.uniform(4, 9) * scale**2),
    }


def _memory(rng, scale, revs):
    return {
        "Z_wq": side(rng, 70, 120) * scale,
        "M_wq": side(rng, 14, 25) * scale**1.5,
        "time_s": float(rng.uniform(3, 6)),
    }


def _gradient(rng, scale, revs):
    return {
        "gradient_npm": float(rng.uniform(0.4, 1.2) * scale),
        "ballasted_at_m": BALLASTED_AT_M,
    }


def _weight(rng, scale, revs):
    return {
        "weight_n": side(rng, 0.8, 2.0) * scale,
        "x_m": side(rng, 0.02, 0.2),
        "time_s": float(rng.uniform(400, 800)),
    }


def _internal_wave(rng, scale, revs):
    return {"down_mps": float(rng.uniform(0.05, 0.1)), "period_s": float(rng.uniform(60, 180))}


def _stuck(rng, scale, revs):
    return {
        "maneuver_fraction": float(rng.uniform(0.1, 0.9)),
        "after_s": float(rng.uniform(6.0, 20.0)),
        "duration_s": float(rng.uniform(9.0, 18.0)),
    }


# A new row goes to the end: its number seeds the draw.
ROWS = (
    # id, family, units, into, how, draw
    (
        "elevator_backlash",
        "actuation",
        {"half_width_deg": "deg"},
        "servo",
        "play between servo and fin",
        one("half_width_deg", 0.6, 1.5),
    ),
    (
        "elevator_deadband",
        "actuation",
        {"deadband_deg": "deg"},
        "servo",
        "small commands do nothing",
        one("deadband_deg", 0.6, 1.5),
    ),
    (
        "elevator_asymmetry",
        "actuation",
        {"gain": "-"},
        "servo",
        "gain 1 + k to one side, 1 - k to the other",
        one("gain", 0.1, 0.3, True),
    ),
    (
        "elevator_stall",
        "actuation",
        {"angle_deg": "deg"},
        "servo",
        "flow separates: the effect of a deflection d is d / sqrt(1 + (d / angle)^2)",
        one("angle_deg", 10.0, 18.0),
    ),
    (
        "thrust_line_moment",
        "actuation",
        {"z_m": "m"},
        "plant",
        "thrust acts so far below O",
        one("z_m", 0.025, 0.07, True),
    ),
    (
        "pitch_bias",
        "sensing",
        {"bias_deg": "deg"},
        "sensors",
        "added to the measured pitch",
        one("bias_deg", 1.0, 3.0, True),
    ),
    (
        "pitch_scale",
        "sensing",
        {"fraction": "-"},
        "sensors",
        "measured pitch times 1 + s",
        one("fraction", 0.04, 0.1, True),
    ),
    (
        "q_bias",
        "sensing",
        {"bias_degps": "deg/s"},
        "sensors",
        "added to the measured pitch rate",
        one("bias_degps", 0.2, 0.5, True),
    ),
    (
        "q_scale",
        "sensing",
        {"fraction": "-"},
        "sensors",
        "measured pitch rate times 1 + s",
        one("fraction", 0.03, 0.08, True),
    ),
    (
        "depth_lag",
        "sensing",
        {"lag_s": "s"},
        "sensors",
        "first-order lag of the measured depth",
        one("lag_s", 0.7, 2.0),
    ),
    (
        "depth_scale",
        "sensing",
        {"fraction": "-"},
        "sensors",
        "measured depth times 1 + s",
        one("fraction", 0.03, 0.08, True),
    ),
    (
        "dvl_pitch",
        "sensing",
        {"pitch_deg": "deg"},
        "sensors",
        "DVL turned bow up",
        one("pitch_deg", 1.5, 4.0, True),
    ),
    (
        "buoyancy_gradient",
        "environment",
        {"gradient_npm": "N/m", "ballasted_at_m": "m"},
        "plant",
        "weight less buoyancy grows with depth, from the depth of ballasting",
        _gradient,
    ),
    (
        "weight_change",
        "environment",
        {"weight_n": "N", "x_m": "m", "time_s": "s"},
        "sea",
        "weight comes or goes at one time and station: a leak, a dropped weight",
        _weight,
    ),
    (
        "heave_cross_flow",
        "hydrodynamics",
        {"factor": "-"},
        "plant",
        "extra strip cross-flow in the heave force",
        one("factor", 1.5, 4.0),
    ),
    (
        "pitch_cross_flow",
        "hydrodynamics",
        {"factor": "-"},
        "plant",
        "extra strip cross-flow in the pitch moment",
        one("factor", 1.5, 4.0),
    ),
    (
        "vertical_current",
        "environment",
        {"down_mps": "m/s"},
        "sea",
        "the water sinks or rises steadily",
        one("down_mps", 0.03, 0.08, True),
    ),
    (
        "internal_wave",
        "outside",
        {"down_mps": "m/s", "period_s": "s"},
        "sea",
        "the water sinks and rises slowly",
        _internal_wave,
    ),
    (
        "stuck_elevator",
        "outside",
        {"maneuver_fraction": "-", "after_s": "s", "duration_s": "s"},
        "sea",
        "the elevators stand still for a while within one maneuver",
        _stuck,
    ),
    (
        "dvl_lever_arm",
        "sensing",
        {"dx_m": "m", "dz_m": "m"},
        "sensors",
        "true position minus the one in the vehicle file",
        _lever_arm,
    ),
    (
        "hull_asymmetry",
        "hydrodynamics",
        {"Z_0": "kg/m", "M_0": "kg"},
        "plant",
        "heave force and pitch moment with u^2",
        pair("Z_0", (0.3, 0.7), "M_0", (0.1, 0.25)),
    ),
    (
        "cubic_damping",
        "hydrodynamics",
        {"M_wwq": "kg s", "M_qqq": "kg m^2 s"},
        "plant",
        "third-order pitch damping",
        _cubic,
    ),
    (
        "turning_drag",
        "hydrodynamics",
        {"X_ww": "kg/m", "X_qq": "kg m"},
        "plant",
        "extra axial drag in heave and pitch",
        _turning,
    ),
    (
        "linear_damping",
        "hydrodynamics",
        {"Z_w": "kg/s", "M_q": "kg m^2/s"},
        "plant",
        "heave force with w and pitch moment with q",
        _linear,
    ),
    (
        "memory_force",
        "outside",
        {"Z_wq": "kg", "M_wq": "kg m", "time_s": "s"},
        "plant",
        "heave force and pitch moment with |w| q lagged by time_s",
        _memory,
    ),
)
# Effects of the horizontal table that act in the vertical plane as they stand.
SHARED = (
    "wave",
    "one_off_event",
    "elevator_offset",
    "elevator_lag",
    "elevator_rate_limit",
    "elevator_delay",
    "propeller_lag",
    "propeller_race",
    "thrust_sag",
    "thrust_step",
    "dvl_delay",
    "gyro_delay",
    "dvl_scale",
    "linear_drag",
    "current",
)
