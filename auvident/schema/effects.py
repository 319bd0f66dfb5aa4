"""The effects a model may lack, each declared once.

The candidates of `diagnose`, the parameters of the prediction, ``auvident effects`` and the
report derive from this table; the equation of each stands in `auvident.physics.actuation` (what
becomes of a command), `auvident.physics.terms` (forces) or `auvident.physics.sensing` (readings).
An effect is off when its parameters are zero. Values here and in the artifacts are in the unit an
engineer reads; `EffectParameter.internal` brings them to SI, radians and a form in which zero
means off.
"""

import math
from dataclasses import replace
from typing import Any

from auvident.schema.coefficients import HV, H, V
from auvident.schema.effect import (
    FAMILIES,
    NOTHING,
    Effect,
    EffectFamily,
    EffectParameter,
    TimeGrid,
)
from auvident.schema.planes import HORIZONTAL, VERTICAL, Plane, PlaneRow, symbol_in
from auvident.schema.unexplained import NAME, PRODUCTS

__all__ = ["FAMILIES", "NOTHING", "Effect", "EffectFamily", "EffectParameter", "TimeGrid"]

DEGREES = 180.0 / math.pi
LONGEST_TRIAL_S = 7.0 * 86_400.0  # bound of a time in a trial

P = EffectParameter
# powers of what scales with the size of the vehicle: L/U, U/L, L and U
TIME, RATE, LENGTH, SPEED = (0, 1, -1, 0), (0, -1, 1, 0), (0, 1, 0, 0), (0, 0, 1, 0)
SERVO = "first-order servo with play and limits; Fossen (2021), Handbook, 9.5"
SENSOR = "Hegrenaes and Hallingstad (2011), model-aided INS; Pan and Wu (2015), DVL calibration"

# Effects that are special cases of each other or look alike in most maneuvers: the name of the
# group, and the maneuvers of each plane that tell its members apart.
LIKENESSES: dict[str, str] = {
    "amidships": "coast-downs and thrust steps with the rudder amidships",
    "late": "zigzags of two sizes (10/10 and 20/20), logged at 10 Hz or faster",
    "small helms": "zigzags of 5 degrees and less, and circles entered from both sides",
    "large helms": "circles of 25 degrees and more, and circles with a thrust step",
    "falling thrust": "straight runs at the same rpm all through the trial",
    "drag": "straight runs at low and at full speed",
    "damping": "zigzags of two sizes, circles of small and of large rudder angles",
}
LIKENESSES_VERTICAL: dict[str, str] = {
    "amidships": "level runs at two speeds, coast-downs and thrust steps at level pitch",
    "late": "vertical zigzags of two sizes, logged at 10 Hz or faster",
    "small helms": "vertical zigzags of elevator angles of 5 degrees and less",
    "large helms": "large vertical zigzags at two speeds, and through a thrust step",
    "falling thrust": LIKENESSES["falling thrust"],
    "drag": LIKENESSES["drag"],
    "damping": "vertical zigzags of two sizes, and depth steps at two speeds",
    "incidence": "depth steps at two speeds and to two pitch angles, with the depth logged",
    "weight": "slow level runs at one depth, early and late in the trial, and at two depths",
}
BY_MANEUVERS: dict[Plane, dict[str, str]] = {
    "horizontal": LIKENESSES,
    "vertical": LIKENESSES_VERTICAL,
}

# Parameters that stand in both planes, or in two effects.
BIAS = P("bias_degps", "deg/s", 0.0057, 0.002, -0.5, 0.5, DEGREES, powers=RATE)
SCALE = P("fraction", "-", 0.03, 0.015, -0.5, 0.5)
ONCE = (  # when something happened
    P("time_s", "s", 0.0, 0.0, 0.0, LONGEST_TRIAL_S, grid=TimeGrid(120.0, 20, (0.75, 0.19), 2.0)),
    P("over_s", "s", 0.0, 0.0, 0.0, LONGEST_TRIAL_S, width_of="time_s"),
)


def in_axes(generic: str, *args: Any, of: tuple[Plane, ...] = HV, **kw: Any) -> tuple[P, ...]:
    """A coefficient with generic axes (``A_a|b|``) in those of each plane: Y_v|r| and Z_w|q|."""
    return tuple(
        replace(P(symbol_in(plane, generic), *args, **kw), planes=(plane,)) for plane in of
    )


# What is said of the fin of a plane: with its article, of its servo, what it makes the vehicle do.
OF_FIN: dict[Plane, tuple[str, str, str, str, str]] = {
    "horizontal": (
        "a rudder",
        "a servo",
        "turns",
        "turning circles",
        "turns to port and to starboard",
    ),
    "vertical": ("an elevator", "an elevator", "pitches", "depth steps", "pitches down and up"),
}


# fmt: off
def of_fin(own: PlaneRow, other: PlaneRow) -> tuple[Effect, ...]:
    """What may be amiss with the fin of a plane."""
    fin, (a_fin, servo, turns, circles, to_both_sides) = own.fin, OF_FIN[own.name]

    def row(kind: str, parameter: P, equation: str, signature: str, source: str,
            **kw: Any) -> Effect:
        return Effect(f"{fin}_{kind}", "actuation", "input", (own.name,), (parameter,), equation,
                      signature, (), source, twin=f"{other.fin}_{kind}", **kw)

    return (
        row("offset", P("offset_deg", "deg", 0.035, 0.0087, -0.35, 0.35, DEGREES),
            "d = d_command + offset",
            f"{turns} with the {fin} amidships, in proportion to u^2", SERVO,
            words=f"{a_fin} offset of {{offset_deg:.1f}} deg", alike="amidships", steady=True,
            of_trial=True),
        row("lag", P("lag_s", "s", 0.35, 0.13, 0.0, 5.0, nuisance_std=0.035, step=0.05,
                     powers=TIME),
            "d' = (d_command - d) / lag",
            f"residual after every {fin} movement, decaying", SERVO,
            words=f"{servo} lag of {{lag_s:.2f}} s", alike="late", curved=True),
        row("rate_limit", P("rate_degps", "deg/s", 2.6, 2.0, 0.0, 50.0, DEGREES, "inverse",
                            step=0.3, nuisance_std=0.26, powers=TIME),
            "|d'| <= rate",
            f"residual after every {fin} movement, longer after larger ones", SERVO,
            words=f"{servo} speed limit of {{rate_degps:.0f}} deg/s", alike="late", curved=True),
        row("delay", P("delay_s", "s", 0.26, 0.13, -0.75, 5.0, nuisance_std=0.018, step=0.05,
                       powers=TIME),
            "d(t) = d_command(t - delay)",
            f"residual after every {fin} movement, flat-topped", SERVO,
            words=f"{a_fin} delay of {{delay_s:.2f}} s", alike="late", curved=True),
        row("backlash", P("half_width_deg", "deg", 0.026, 0.0122, 0.0, 0.2, DEGREES, step=0.7),
            "d follows d_command at a distance of the half width",
            f"{circles} differ after {fin} reversals", SERVO,
            words=f"{a_fin} backlash of ±{{half_width_deg:.1f}} deg", alike="small helms",
            curved=True),
        row("deadband", P("deadband_deg", "deg", 0.026, 0.0122, 0.0, 0.2, DEGREES, step=0.7),
            "d = sign(d_command) max(|d_command| - deadband, 0)",
            f"small {fin} angles have too little effect", SERVO,
            words=f"{a_fin} dead band of ±{{deadband_deg:.1f}} deg", alike="small helms",
            curved=True),
        row("asymmetry", P("gain", "-", 0.15, 0.05, -0.9, 0.9),
            "d = d_command (1 + gain sign(d_command))",
            f"{to_both_sides} differ", SERVO,
            words=f"{a_fin} asymmetry of {{gain:+.2f}}"),
        row("stall", P("angle_deg", "deg", 6.0, 3.0, 0.0, 60.0, DEGREES, "inverse_square", step=0.1,
                       nuisance_std=1.2),
            "effective d = d / sqrt(1 + (d / angle)^2)",
            f"large {fin} angles have too little effect",
            "Molland and Turnock (2007), 5.3",
            words=f"{a_fin} that stalls at about {{angle_deg:.0f}} deg", alike="large helms",
            curved=True),
    )


def cross_flow(own: PlaneRow, *ids: str) -> tuple[Effect, ...]:
    """Cross flow that drift and turn make of each other: of force and moment, here and there."""
    force, moment, *twins = (f"{name}_cross_flow" for name in ids)
    of, names = (own.name,), own.names
    a, b, force_axis, moment_axis = names["a"], names["b"], names["A"], names["B"]

    def row(id_: str, twin: str, axis: str, generic: str, unit: str, prior: float, practical: float,
            power: int, signature: str) -> Effect:
        size = (unit, prior, practical, -1.0, 1.0)
        return Effect(id_, "hydrodynamics", "force", of, (
            *in_axes(f"{generic}_a|b|", *size, powers=(1, power, 0, 0), of=of),
            *in_axes(f"{generic}_b|a|", *size, powers=(1, power, 0, 0), of=of),
        ), f"{axis} + {axis}_{a}|{b}| {a}|{b}| + {axis}_{b}|{a}| {b}|{a}|", signature, (),
            "Norrbin (1971); Clarke (2003)", alike="damping", higher_order=True, twin=twin)

    return (
        row(force, twins[0], force_axis, "A", "kg", 0.03, 0.01, 3,
            "drift angle depends on the rate of turn" if own is HORIZONTAL
            else "angle of attack depends on the rate of pitch"),
        row(moment, twins[1], moment_axis, "B", "kg m", 0.008, 0.003, 4,
            "overshoot depends on the rate of turn" if own is HORIZONTAL
            else "overshoot depends on the rate of pitch"),
    )


EFFECTS: tuple[Effect, ...] = (
    Effect("current", "environment", "reading", HV, (
        P("north_mps", "m/s", 0.2, 0.033, -4.0, 4.0, powers=SPEED),
        P("east_mps", "m/s", 0.2, 0.033, -4.0, 4.0, powers=SPEED),
    ), "velocity over ground = velocity through the water + R(heading)' (north, east)",
        "u and v residuals that turn with the heading", ("heading_rad",), "Fossen (2021), 10.3",
        of_trial=True, by_rate=True,
        shows=("u and v residuals that turn with the heading",
               "u residual that turns with the heading")),
    Effect("current_drift", "environment", "reading", H, (
        P("north_early_mps_per_1000_s", "m/s in 1000 s", 0.2, 0.033, -4.0, 4.0, powers=SPEED),
        P("east_early_mps_per_1000_s", "m/s in 1000 s", 0.2, 0.033, -4.0, 4.0, powers=SPEED),
        P("north_late_mps_per_1000_s", "m/s in 1000 s", 0.2, 0.033, -4.0, 4.0, powers=SPEED),
        P("east_late_mps_per_1000_s", "m/s in 1000 s", 0.2, 0.033, -4.0, 4.0, powers=SPEED),
    ), "current + (north, east) (t - t_mid) / 1000 s; one (north, east) before t_mid, one after",
        "u and v residuals that turn with the heading and change through the trial",
        ("heading_rad",), "Fossen (2021), 10.3", of_trial=True),
    Effect("wave", "environment", "disturbance", HV, (
        P("omega_radps", "rad/s", 1.0, 0.0, 0.0, 4.0),
        P("direction_deg", "deg", 3.0, 0.0, -4.0, 4.0, DEGREES),
    ), "force at the encounter frequency omega - omega^2 u cos(heading - direction) / g",
        "a spectral line in the residual that shifts with heading and speed", ("heading_rad",),
        "Fossen (2021), 10.2", of_trial=True),
    Effect("vertical_current", "environment", "reading", V, (
        P("down_mps", "m/s", 0.05, 0.012, -1.0, 1.0, powers=SPEED),
    ), "velocity over ground = velocity through the water + R(pitch)' (0, down)",
        "w residual that is the same at every speed, u residual that follows the pitch", (),
        "Fossen (2021), 10.3", words="water that {down_mps:sinks|rises} by {down_mps:abs.3f} m/s",
        alike="incidence",
        of_trial=True),
    Effect("one_off_event", "environment", "disturbance", HV, (
        P("time_s", "s", 1.0, 0.0, 0.0, 1e9), P("duration_s", "s", 1.0, 0.0, 0.0, 1e3),
    ), "none: the rows are masked", "residual energy in a few seconds of one maneuver",
        of_trial=True),
    *of_fin(HORIZONTAL, VERTICAL),
    *of_fin(VERTICAL, HORIZONTAL),
    Effect("propeller_lag", "actuation", "input", HV, (
        P("lag_s", "s", 0.62, 0.26, 0.0, 15.0, nuisance_std=0.13, step=0.05, powers=TIME),
    ), "n' = (n_command - n) / lag", "u residual after thrust steps only",
        words="a propeller lag of {lag_s:.2f} s", surge_alone=True,
        curved=True),
    Effect("propeller_race", "actuation", "input", HV, (
        # momentum theory: 8 / (pi density D^2) in a race that has developed, 130 to 260 of these
        # units for a propeller of a tenth to a fourteenth of the length; no thrust slows the flow,
        # and what stands at the lower bound, a practical size of that, is impossible
        P("c_m2ps2pn", "m^2/s^2/N", 200.0, 50.0, -50.0, 1000.0, powers=(-1, -2, 0, 0),
          nuisance_std=15.0, known_to=2.0),
        # k is 1.2 to 2.8 by the build of the fin (`terms.RACE_DAMPING`). Of 12 races of retired
        # drawn vehicles (odd seeds 11645 to 13327, even ones of 62000 on) with k above 1.5 (1.75
        # to 2.4) six of seven came out at 0.6 to 0.8 of their size, with k below (1.2 to 1.4) five
        # at 1.1 to 2.1 of it
    ), "fin meets V^2 = u^2 + c T; its lift is A_uud (V^2 d - k V (v + x_fin r)), k = 1.5; by its "
       "build k may be 1.2 to 2.8, which leaves a factor of 2 in c",
        "fin effectiveness depends on propeller loading", (),
        "Molland and Turnock (2007), 3.6",
        words="propeller race on the fin, {c_m2ps2pn:.4f} m^2/s^2 per N",
        alike="large helms"),
    Effect("thrust_sag", "actuation", "input", HV, (
        P("fraction_per_1000_s", "-", 0.15, 0.05, -0.9, 0.9),
    ), "thrust (1 - fraction t / 1000 s)", "u falls slowly through the trial",
        words="thrust that {fraction_per_1000_s:declines|rises} by {fraction_per_1000_s:abs.1%} "
        "in 1000 s",
        alike="falling thrust",
        surge_alone=True, of_trial=True),
    Effect("thrust_step", "actuation", "input", HV, (
        P("fraction", "-", 0.15, 0.05, -0.9, 0.9),
        *ONCE,
    ), "thrust (1 - fraction) from one time on, spread over its uncertainty",
        "u drops at one time and stays low",
        words="thrust that {fraction:drops|rises} by {fraction:abs.1%}", alike="falling thrust",
        surge_alone=True,
        of_trial=True),
    Effect("dvl_delay", "sensing", "reading", HV, (
        P("delay_s", "s", 0.22, 0.09, -2.5, 5.0, powers=TIME),
    ), "u, v (w) are those of t - delay",
        "u and v (w) residuals in proportion to their derivatives", (), SENSOR,
        words="a DVL delay of {delay_s:.2f} s", alike="late", curved=True, late=True,
        of_trial=True, shows=("u and v residuals in proportion to their derivatives",
                              "u and w residuals in proportion to their derivatives")),
    Effect("gyro_delay", "sensing", "reading", HV, (
        P("delay_s", "s", 0.22, 0.09, -2.5, 5.0, powers=TIME),
    ), "r (q) is that of t - delay", "r (q) residual in proportion to its derivative", (), SENSOR,
        words="a gyro delay of {delay_s:.2f} s", alike="late", curved=True, late=True,
        of_trial=True, shows=("r residual in proportion to its derivative",
                              "q residual in proportion to its derivative")),
    Effect("dvl_misalignment", "sensing", "reading", H, (
        P("yaw_deg", "deg", 0.035, 0.0087, -0.5, 0.5, DEGREES),
    ), "(u, v) turned by yaw", "v in proportion to u while r = 0", (), SENSOR,
        words="a DVL misalignment of {yaw_deg:.1f} deg in yaw", steady=True, twin="dvl_pitch"),
    Effect("dvl_pitch", "sensing", "reading", V, (
        P("pitch_deg", "deg", 0.035, 0.0087, -0.5, 0.5, DEGREES),
    ), "(u, w) turned by pitch, bow up: u - w sin, w + u sin", "w in proportion to u while q = 0",
        (), SENSOR, words="a DVL misalignment of {pitch_deg:.1f} deg in pitch", alike="incidence",
        steady=True, twin="dvl_misalignment"),
    Effect("dvl_scale", "sensing", "reading", HV, (
        P("fraction", "-", 0.03, 0.015, -0.5, 0.5),
    ), "(u, v (w)) (1 + fraction)", "only logged positions show it", ("north_m",), SENSOR,
        words="a DVL scale error of {fraction:+.1%}"),
    Effect("dvl_lever_arm", "sensing", "reading", HV, (
        P("dx_m", "m", 0.12, 0.03, -1.0, 1.0, powers=LENGTH),
        P("dy_m", "m", 0.06, 0.018, -1.0, 1.0, powers=LENGTH, planes=H),
        # stated: read off a drawing, 2 cm of 1.3 m
        P("dz_m", "m", 0.09, 0.06, -1.0, 1.0, nuisance_std=0.09, stated_std=0.015, powers=LENGTH,
          planes=V),
    ), "v + r dx, u - r dy; w - q dx, u + q dz",
        "u differs in port and starboard turns (dy), while pitching up and down (dz)", (), SENSOR,
        words=(
            "a DVL {dx_m:abs.2f} m {dx_m:forward|aft} and {dy_m:abs.2f} m to "
            "{dy_m:starboard|port} of its stated position",
            "a DVL {dx_m:abs.2f} m {dx_m:forward|aft} of and {dz_m:abs.2f} m {dz_m:below|above} "
            "its stated position",
            "a DVL {dx_m:abs.2f} m {dx_m:forward|aft} of its stated position",
            "a DVL {dy_m:abs.2f} m to {dy_m:starboard|port} of its stated position",
            "a DVL {dz_m:abs.2f} m {dz_m:below|above} its stated position",
        ),
        shows=("u differs in port and starboard turns (dy)",
               "u differs while pitching up and down (dz)")),
    Effect("gyro_bias", "sensing", "reading", H, (BIAS,),
        "r + bias", "heading disagrees with the integral of r", (), SENSOR,
        words="a gyro bias of {bias_degps:.2f} deg/s", twin="q_bias",
        of_trial=True),
    Effect("q_bias", "sensing", "reading", V, (BIAS,),
        "q + bias", "pitch disagrees with the integral of q", (), SENSOR,
        words="a pitch gyro bias of {bias_degps:.2f} deg/s", twin="gyro_bias",
        of_trial=True),
    Effect("gyro_scale", "sensing", "reading", H, (SCALE,),
        "r (1 + fraction)", "heading disagrees with the integral of r in turns", ("heading_rad",),
        SENSOR, words="a gyro scale error of {fraction:+.1%}", twin="q_scale"),
    Effect("q_scale", "sensing", "reading", V, (SCALE,),
        "q (1 + fraction)", "pitch disagrees with the integral of q while pitching",
        ("pitch_rad",), SENSOR,
        words="a pitch gyro scale error of {fraction:+.1%}", twin="gyro_scale"),
    Effect("pitch_bias", "sensing", "reading", V, (
        P("bias_deg", "deg", 0.035, 0.0087, -0.35, 0.35, DEGREES),
    ), "pitch + bias", "depth rate disagrees with u and w turned by the pitch",
        ("pitch_rad", "depth_m"),
        SENSOR, words="a pitch bias of {bias_deg:.1f} deg", alike="incidence", steady=True,
        of_trial=True),
    Effect("pitch_scale", "sensing", "reading", V, (
        P("fraction", "-", 0.05, 0.02, -0.5, 0.5),
    ), "pitch (1 + fraction)", "pitch disagrees with the integral of q, up and down alike",
        ("pitch_rad",), SENSOR, words="a pitch scale error of {fraction:+.1%}"),
    Effect("depth_lag", "sensing", "reading", V, (
        P("lag_s", "s", 1.0, 0.3, 0.0, 15.0, powers=TIME),
    ), "z_log' = (depth - z_log) / lag; no state: depth' = w cos pitch - u sin pitch",
        "logged depth trails the integral of the depth rate; no other reading shows it",
        ("depth_m", "pitch_rad"), SENSOR, words="a depth sensor with a lag of {lag_s:.2f} s"),
    Effect("depth_scale", "sensing", "reading", V, (
        P("fraction", "-", 0.05, 0.015, -0.5, 0.5),
    ), "depth (1 + fraction); no state: depth' = w cos pitch - u sin pitch",
        "logged depth disagrees with the integral of the depth rate; no other reading shows it",
        ("depth_m", "pitch_rad"), SENSOR, words="a depth scale error of {fraction:+.1%}"),
    Effect("propeller_side_force", "hydrodynamics", "force", H, (
        P("Y_nn", "N s^2", 1.2e-3, 2e-4, -0.1, 0.1, powers=(1, 2, 2, -2)),
        P("N_nn", "N m s^2", 2.5e-4, 4e-5, -0.1, 0.1, powers=(1, 3, 2, -2)),
    ), "Y + Y_nn n|n|, N + N_nn n|n|", "turns with the rudder amidships, in proportion to n^2",
        alike="amidships", parts=("rudder_offset", "dvl_misalignment"), steady=True),
    Effect("thrust_line_moment", "actuation", "force", V, (
        P("z_m", "m", 0.03, 0.005, -0.5, 0.5, powers=LENGTH),
    ), "M + z T", "pitches with the elevator amidships, in proportion to the thrust", (),
        words="a thrust line at z = {z_m:+.3f} m", alike="amidships",
        parts=("elevator_offset", "dvl_pitch"), steady=True),
    Effect("hull_asymmetry", "hydrodynamics", "force", HV, (
        *in_axes("A_0", "kg/m", 1.2e-3, 2e-4, -0.1, 0.1, powers=(1, 2, 0, 0), nuisance_std=3e-5),
        *in_axes("B_0", "kg", 2.5e-4, 4e-5, -0.1, 0.1, powers=(1, 3, 0, 0), nuisance_std=1e-5),
    ), "Y (Z) + Y_0 u|u|, N (M) + N_0 u|u|",
        "turns (pitches) with the fin amidships, in proportion to u^2",
        alike="amidships", parts=("rudder_offset", "dvl_misalignment"), steady=True,
        shows=("turns with the rudder amidships, in proportion to u^2",
               "pitches with the elevator amidships, in proportion to u^2")),
    *cross_flow(HORIZONTAL, "sway", "yaw", "heave", "pitch"),
    *cross_flow(VERTICAL, "heave", "pitch", "sway", "yaw"),
    Effect("cubic_damping", "hydrodynamics", "force", HV, (
        *in_axes("B_aab", "kg s", 0.05, 0.02, -5.0, 5.0, powers=(1, 4, -1, 0)),
        *in_axes("B_bbb", "kg m^2 s", 0.01, 0.004, -1.0, 1.0, powers=(1, 6, -1, 0)),
    ), "N + N_vvr v v r + N_rrr r^3 (M, w, q)",
        "yaw (pitch) damping grows faster than the square", (), "Abkowitz (1964)",
        alike="large helms", higher_order=True,
        shows=("yaw damping grows faster than the square",
               "pitch damping grows faster than the square")),
    Effect("turning_drag", "hydrodynamics", "force", HV, (
        *in_axes("X_aau", "kg s/m^2", 0.05, 0.02, -5.0, 5.0, powers=(1, 2, -1, 0)),
        *in_axes("X_bbu", "kg s", 0.01, 0.004, -5.0, 5.0, powers=(1, 4, -1, 0)),
    ), "X + X_vvu v v u + X_rru r r u (w, q)",
        "u lower while turning (pitching) than X_vv, X_vr and X_rr explain",
        alike="drag", surge_alone=True, higher_order=True,
        shows=("u lower while turning than X_vv, X_vr and X_rr explain",
               "u lower while pitching than X_ww, X_wq and X_qq explain")),
    Effect("linear_drag", "hydrodynamics", "force", HV, (
        P("X_u", "kg/s", 1.0e-3, 4e-4, -0.1, 0.1, powers=(1, 2, 1, 0), nuisance_std=1.5e-4),
    ), "X + X_u u", "u / n changes with speed",
        words="linear drag of {X_u:abs.2f} kg/s{X_u: that pushes ahead|}", alike="drag",
        surge_alone=True),
    Effect("linear_damping", "hydrodynamics", "force", HV, (
        *in_axes("A_a", "kg/s", 0.015, 0.005, -1.0, 1.0, powers=(1, 2, 1, 0)),
        *in_axes("B_b", "kg m^2/s", 3e-3, 1e-3, -1.0, 1.0, powers=(1, 4, 1, 0)),
    ), "Y + Y_v v, N + N_r r (Z, M; w, q)", "drift and turns die faster at low speed", (),
        "Fossen (2021), 6.4", alike="damping",
        shows=("drift and turns die faster at low speed",
               "angle of attack and pitching die faster at low speed")),
    Effect("roll_coupling", "hydrodynamics", "force", H, (
        P("Y_uuphi", "kg/m", 0.015, 0.004, -1.0, 1.0, powers=(1, 2, 0, 0)),
        P("N_uuphi", "kg", 0.004, 0.001, -1.0, 1.0, powers=(1, 3, 0, 0)),
    ), "Y + Y_uuphi u u roll, N + N_uuphi u u roll", "residual follows the roll", ("roll_rad",)),
    Effect("weight_change", "environment", "force", V, (
        P("weight_n", "N", 1e-3, 1.5e-4, -0.5, 0.5, powers=(1, 2, 2, 0)),
        P("moment_nm", "N m", 1.5e-4, 3e-5, -0.2, 0.2, powers=(1, 3, 2, 0)),
        *ONCE,
    ), "W-B + weight and x_GW + moment from one time on, spread over its uncertainty",
        "Z and M residuals that set in at one time and stay, whatever the speed", (),
        "Fossen (2021), 4.1",
        words=(
            "weight that {weight_n:grows|falls} by {weight_n:abs.1f} N and a bow-down moment "
            "that {moment_nm:grows|falls} by {moment_nm:abs.2f} N m",
            "weight that {weight_n:grows|falls} by {weight_n:abs.1f} N",
            "a bow-down moment that {moment_nm:grows|falls} by {moment_nm:abs.2f} N m",
        ),
        alike="weight", of_trial=True),
    Effect("buoyancy_gradient", "environment", "force", V, (
        P("gradient_npm", "N/m", 4e-4, 8e-5, -0.02, 0.02, powers=(1, 1, 2, 0)),
    ), "W-B + gradient depth", "Z residual that follows the depth", ("depth_m",),
        "Fossen (2021), 4.1",
        words="weight minus buoyancy that {gradient_npm:grows|falls} by {gradient_npm:abs.2f} N "
        "per m of depth",
        alike="weight", of_trial=True),
    Effect("dvl_height", "sensing", "reading", H, (
        P("dz_m", "m", 0.09, 0.06, -1.0, 1.0, nuisance_std=0.09, powers=LENGTH),
    ), "v - p dz, u + q dz", "v residual follows the roll rate", ("p_radps",), SENSOR,
        nuisance=True),
    Effect("weight_excess", "hydrodynamics", "force", H, (
        P("W-B_n", "N", 1.0e-3, 5e-4, -0.1, 0.1, powers=(1, 2, 2, 0), nuisance_std=1e-3),
    ), "X - (W-B) pitch", "u residual follows the pitch", ("pitch_rad",), "Fossen (2021), 4.1",
        surge_alone=True, nuisance=True, of_trial=True),
)
# fmt: on
# Predicts without a name, hence no candidate and no row of `EFFECTS`; see `schema.unexplained`.
UNEXPLAINED = Effect(
    NAME,
    "hydrodynamics",
    "force",
    HV,
    tuple(
        P(
            symbol,
            q.unit,
            q.prior,
            0.5 * q.prior,
            -1e3 * q.prior,
            1e3 * q.prior,
            powers=q.powers,
            planes=planes,
        )
        for q in PRODUCTS
        for symbol, planes in q.symbols.items()
    ),
    "X, Y (Z), N (M) + coefficients times products of u, v (w), r (q), fin angle and heading",
    "what is left after every named effect",
    nuisance=True,
)

BY_ID: dict[str, Effect] = {effect.id: effect for effect in (*EFFECTS, UNEXPLAINED)}


def own_in(plane: Plane, effect: str) -> str:
    """The effect, or where it belongs to the other plane what it is called in this one."""
    row = BY_ID[effect]
    return row.twin if row.twin and plane not in row.planes else effect


def name_in(plane: Plane, generic: str) -> str:
    """Name ``effect.symbol`` in a plane, from one of the other plane or with generic axes."""
    effect, dot, symbol = generic.partition(".")
    return f"{own_in(plane, effect)}.{symbol}" if dot else generic


def parts_of(effect: str) -> tuple[tuple[str, ...], ...]:
    """What together does what an effect does alone, in each of its planes."""
    row = BY_ID[effect]
    found = (tuple(own_in(plane, part) for part in row.parts) for plane in row.planes)
    return tuple(dict.fromkeys(parts for parts in found if parts))


def in_plane(plane: Plane) -> tuple[Effect, ...]:
    """Effects whose parameters stand in the prediction of a plane, in the order of the table."""
    return tuple(e for e in EFFECTS if plane in e.planes and e.enters != "disturbance")


def allowable() -> tuple[str, ...]:
    """Effects of servo and propeller that a plan may allow every vehicle a little of."""
    return tuple(
        e.id
        for e in EFFECTS
        if e.enters == "input"
        and all(p.nuisance_std > 0.0 and not p.powers[0] for p in e.parameters)
    )


def parameter_of(name: str) -> EffectParameter:
    """Declaration behind a name ``effect.parameter``."""
    effect, _, symbol = name.partition(".")
    return next(p for p in BY_ID[effect].parameters if p.symbol == symbol)
