"""Sizes of effects of the vertical plane, as `seatrial.population.sizes` has them of the other.

Ranges are those of the like effect in the horizontal plane, except where the vertical plane shows
less (play, dead band: executes are smaller) or has no like effect.
"""

from __future__ import annotations

SERVO: dict[str, dict[str, tuple]] = {
    "elevator_offset": {"offset_deg": (1.0, 3.0, "one", True)},
    "elevator_lag": {"lag_s": (0.35, 0.9, "time", False)},
    "elevator_rate_limit": {"rate_degps": (7.0, 18.0, "per time", False)},
    "elevator_delay": {"delay_s": (0.22, 0.67, "time", False)},
    "elevator_backlash": {"half_width_deg": (0.8, 2.5, "one", False)},
    "elevator_deadband": {"deadband_deg": (0.8, 2.0, "one", False)},
    "elevator_asymmetry": {"gain": (0.1, 0.3, "one", True)},
    "elevator_stall": {"angle_deg": (9.0, 18.0, "fixed", False)},
}
OWN: dict[str, dict[str, tuple]] = {
    **SERVO,
    "thrust_line_moment": {"z_m": (0.02, 0.05, "length", True)},
    "pitch_bias": {"bias_deg": (1.0, 3.0, "one", True)},
    "pitch_scale": {"fraction": (0.04, 0.1, "one", True)},
    "q_bias": {"bias_degps": (0.18, 0.45, "per time", True)},
    "q_scale": {"fraction": (0.03, 0.08, "one", True)},
    "depth_lag": {"lag_s": (0.8, 2.2, "time", False)},
    "depth_scale": {"fraction": (0.03, 0.08, "one", True)},
    "dvl_pitch": {"pitch_deg": (1.5, 4.0, "one", True)},
    "dvl_lever_arm": {
        "dx_m": (0.08, 0.22, "length", True),
        "dz_m": (0.03, 0.075, "length", True),
    },
    "buoyancy_gradient": {
        "gradient_npm": (1.0e-4, 3.0e-4, "force per length", False),
        "ballasted_at_m": (1.0, 1.0, "fixed depth", False),
    },
    "weight_change": {
        "weight_n": (6e-4, 1.5e-3, "force", True),
        "x_m": (0.02, 0.2, "fixed length", True),
        "time_s": (0.3, 0.7, "trial", False),
    },
    "heave_cross_flow": {"factor": (1.5, 4.0, "one", False)},
    "pitch_cross_flow": {"factor": (1.5, 4.0, "one", False)},
    "hull_asymmetry": {
        "Z_0": (3.3e-4, 7.7e-4, "force per u^2", True),
        "M_0": (8e-5, 2.1e-4, "moment per u^2", True),
    },
    "cubic_damping": {
        "M_wwq": (-0.074, -0.037, "cubic vvr", False),
        "M_qqq": (-0.013, -0.0052, "cubic rrr", False),
    },
    "turning_drag": {
        "X_ww": (-0.066, -0.033, "force per u^2", False),
        "X_qq": (-0.011, -0.005, "drag rr", False),
    },
    "linear_damping": {
        "Z_w": (-0.026, -0.011, "force per u", False),
        "M_q": (-3.8e-3, -1.7e-3, "moment per r", False),
    },
    "vertical_current": {"down_mps": (0.02, 0.05, "speed", True)},
    "internal_wave": {
        "down_mps": (0.03, 0.06, "speed", False),
        "period_s": (40.0, 120.0, "fixed time", False),
    },
    "stuck_elevator": {
        "maneuver_fraction": (0.1, 0.9, "fixed", False),
        "after_s": (4.0, 14.0, "fixed time", False),
        "duration_s": (8.0, 15.0, "fixed time", False),
    },
    "memory_force": {
        "Z_wq": (0.058, 0.1, "mass", True),
        "M_wq": (0.0087, 0.0155, "mass length", True),
        "time_s": (3.4, 6.7, "fixed time", False),
    },
}
