"""The effects a model may lack, each declared once.

The candidates of `diagnose`, the parameters of the prediction, ``auvident effects`` and the
report derive from this table; the equation of each stands in `auvident.physics.actuation` (what
becomes of a command), `auvident.physics.terms` (forces) or `auvident.physics.sensing` (readings).
An effect is off when its parameters are zero. Values here and in the artifacts are in the unit an
engineer reads; `EffectParameter.internal` brings them to SI, radians and a form in which zero
means off.
"""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from auvident.schema.coefficients import HV, H
from auvident.schema.planes import Plane
from auvident.schema.unexplained import NAME, PRODUCTS

EffectFamily = Literal["environment", "actuation", "sensing", "hydrodynamics"]
# where an effect enters: before the equations of motion, in them, after them, or in no model (a
# disturbance of one trial, which is named and masked)
Enters = Literal["input", "force", "reading", "disturbance"]
# how a value is stored: as it is, its inverse (a limit that is infinite without the effect), or
# the inverse of its square
Form = Literal["plain", "inverse", "inverse_square"]

DEGREES = 180.0 / math.pi
LONGEST_TRIAL_S = 7.0 * 86_400.0  # bound of a time in a trial
NOTHING = 0.01  # of the practical size: a value below it is as good as no effect


@dataclass(frozen=True)
class TimeGrid:
    """Where a time is looked for that no slope finds, since what it changes is a step.

    Attributes
    ----------
    apart_s, most : float, int
        The first grid, over all maneuvers: so far apart, in a long trial further, so that there
        are no more than `most` and the time of a search grows with the length of the trial.
    reach : tuple of float
        Then about the best one, each time this share of the first distance to both sides.
    fine_s : float
        At last so far apart, between the maneuvers before and after.
    """

    apart_s: float
    most: int
    reach: tuple[float, ...]
    fine_s: float


@dataclass(frozen=True)
class EffectParameter:
    """Declaration of one parameter of an effect.

    Attributes
    ----------
    symbol : str
        Name in the artifacts, unit as suffix.
    unit : str
        Unit in the artifacts.
    prior : float
        Standard deviation of the internal value before the data, in internal units; where there
        are `powers`, in units of these. Zero where it is looked for on a grid: any value is as
        likely.
    practical : float
        Size from which on the effect is worth a word, stated like `prior`.
    low, high : float
        Bounds of the internal value, stated like `prior`.
    factor : float
        Unit conversion: one internal unit is this many of `unit`.
    form : str
    step : float
        Change, in units of the prior, over which a slope is taken; effects that do nothing
        when they are small (play, dead band) need a large one.
    powers : tuple of int
        Sizes and bounds scale with density/2, length, speed and propeller rate to these powers:
        what a delay of a sensor or a lag of a servo does to the motion depends on L/U. The bounds
        are wide: for L/U of 0.4 s a delay may be 2 s.
    nuisance_std : float
        Standard deviation as a nuisance parameter of every model: no real servo is without
        lag and no hull without asymmetry. Zero for most.
    grid : TimeGrid, optional
        Of a time since the start of the trial.
    width_of : str
        Symbol of the parameter with a grid whose interval it is the width of.
    """

    symbol: str
    unit: str
    prior: float
    practical: float
    low: float
    high: float
    factor: float = 1.0
    form: Form = "plain"
    step: float = 0.02
    powers: tuple[int, int, int, int] = (0, 0, 0, 0)
    nuisance_std: float = 0.0
    grid: TimeGrid | None = None
    width_of: str = ""

    def size_unit(
        self, density_kgpm3: float, length_m: float, speed_mps: float, rate_rps: float
    ) -> float:
        """What sizes and bounds are multiplied by for a vehicle (1 for shares and angles)."""
        quantities = (0.5 * density_kgpm3, length_m, speed_mps, rate_rps)
        return math.prod(q**power for q, power in zip(quantities, self.powers, strict=True))

    def is_nothing(self, internal: float) -> bool:
        """Whether a value is too small to be told from no effect at all."""
        return abs(internal) <= NOTHING * self.practical

    def holds_nothing(self, value: float, low: float, high: float) -> bool:
        """Whether an interval as shown cannot be told from no effect at all.

        No effect is an internal value of zero. Of a limit the interval is that of its inverse to
        first order; what has no practical size (a time, a direction) is no size to be told.
        """
        if self.practical <= 0.0:
            return False
        if self.form == "plain":
            return low <= 0.0 <= high
        power = 1.0 if self.form == "inverse" else 0.5
        return 0.5 * (high - low) >= power * value

    def internal(self, shown: float) -> float:
        """Internal value of a value as shown."""
        if self.form == "plain":
            return shown / self.factor
        power = 1.0 if self.form == "inverse" else 2.0
        return (self.factor / shown) ** power

    def shown(self, internal: float, std: float = 0.0) -> tuple[float, float]:
        """Value and standard deviation as shown, from the internal ones.

        A limit that is not reached (internal value zero) is shown as the largest finite number
        of its form: the one at `NOTHING` of the practical size.
        """
        if self.form == "plain":
            return internal * self.factor, std * self.factor
        power = 1.0 if self.form == "inverse" else 0.5
        least = max(internal, NOTHING * self.practical)
        value = self.factor * least**-power
        return value, power * value / least * std


@dataclass(frozen=True)
class Effect:
    """Declaration of one effect.

    Attributes
    ----------
    id : str
        Name in every file and table.
    family : str
    enters : str
        Part of the prediction that carries it.
    planes : tuple of str
    parameters : tuple of EffectParameter
    equation : str
        For people.
    signature : str
        How it shows, for people.
    needs : tuple of str
        Columns of the trial without which it cannot be seen or told apart.
    source : str
    words : str
        What a model with it has, for people; fields are its parameters as shown.
    alike : str
        Its group of `auvident.schema.likeness`, if it has one.
    parts : tuple of str
        Effects that together do what it does alone.
    surge_alone : bool
        The surge equation alone can show it.
    curved : bool
        Its signature changes with its size: a fit needs a start of typical size.
    higher_order : bool
        A term of higher order, of which every hull has a little.
    steady : bool
        It shows in a straight run as a drift angle or a turn in proportion to the speed.
    nuisance : bool
        Only ever taken along: no engineer asks for it.
    late : bool
        A sensor shows what was a while ago.
    """

    id: str
    family: EffectFamily
    enters: Enters
    planes: tuple[Plane, ...]
    parameters: tuple[EffectParameter, ...]
    equation: str
    signature: str
    needs: tuple[str, ...] = ()
    source: str = ""
    words: str = ""
    alike: str = ""
    parts: tuple[str, ...] = ()
    surge_alone: bool = False
    curved: bool = False
    higher_order: bool = False
    steady: bool = False
    nuisance: bool = False
    late: bool = False

    def names(self) -> tuple[str, ...]:
        """Names of its parameters in the parameter vector."""
        return tuple(f"{self.id}.{p.symbol}" for p in self.parameters)

    @property
    def instant(self) -> EffectParameter | None:
        """Its time in the trial, if it has one that is looked for on a grid."""
        return next((p for p in self.parameters if p.grid is not None), None)


P = EffectParameter
# powers of what scales with the size of the vehicle: L/U, U/L, L and U
TIME, RATE, LENGTH, SPEED = (0, 1, -1, 0), (0, -1, 1, 0), (0, 1, 0, 0), (0, 0, 1, 0)
SERVO = "first-order servo with play and limits; Fossen (2021), Handbook, 9.5"
SENSOR = "Hegrenaes and Hallingstad (2011), model-aided INS; Pan and Wu (2015), DVL calibration"

# Effects that are special cases of each other or look alike in most maneuvers: the name of the
# group, and the maneuvers that tell its members apart.
LIKENESSES: dict[str, str] = {
    "turns amidships": "coast-downs and thrust steps with the rudder amidships",
    "late": "zigzags of two sizes (10/10 and 20/20), logged at 10 Hz or faster",
    "small helms": "zigzags of 5 degrees and less, and circles entered from both sides",
    "large helms": "circles of 25 degrees and more, and circles with a thrust step",
    "falling thrust": "straight runs at the same rpm all through the trial",
    "drag": "straight runs at low and at full speed",
    "damping": "zigzags of two sizes, circles of small and of large rudder angles",
}

# fmt: off
EFFECTS: tuple[Effect, ...] = (
    Effect("current", "environment", "reading", H, (
        P("north_mps", "m/s", 0.2, 0.033, -4.0, 4.0, powers=SPEED),
        P("east_mps", "m/s", 0.2, 0.033, -4.0, 4.0, powers=SPEED),
    ), "velocity over ground = velocity through the water + R(heading)' (north, east)",
        "u and v residuals that turn with the heading", ("heading_rad",), "Fossen (2021), 10.3"),
    Effect("current_drift", "environment", "reading", H, (
        P("north_early_mps_per_1000_s", "m/s in 1000 s", 0.2, 0.033, -4.0, 4.0, powers=SPEED),
        P("east_early_mps_per_1000_s", "m/s in 1000 s", 0.2, 0.033, -4.0, 4.0, powers=SPEED),
        P("north_late_mps_per_1000_s", "m/s in 1000 s", 0.2, 0.033, -4.0, 4.0, powers=SPEED),
        P("east_late_mps_per_1000_s", "m/s in 1000 s", 0.2, 0.033, -4.0, 4.0, powers=SPEED),
    ), "current + (north, east) (t - t_mid) / 1000 s; one (north, east) before t_mid, one after",
        "u and v residuals that turn with the heading and change through the trial",
        ("heading_rad",), "Fossen (2021), 10.3"),
    Effect("wave", "environment", "disturbance", H, (
        P("omega_radps", "rad/s", 1.0, 0.0, 0.0, 4.0),
        P("direction_deg", "deg", 3.0, 0.0, -4.0, 4.0, DEGREES),
    ), "force at the encounter frequency omega - omega^2 u cos(heading - direction) / g",
        "a spectral line in the residual that shifts with heading and speed", ("heading_rad",),
        "Fossen (2021), 10.2"),
    Effect("one_off_event", "environment", "disturbance", H, (
        P("time_s", "s", 1.0, 0.0, 0.0, 1e9), P("duration_s", "s", 1.0, 0.0, 0.0, 1e3),
    ), "none: the rows are masked", "residual energy in a few seconds of one maneuver"),
    Effect("rudder_offset", "actuation", "input", HV, (
        P("offset_deg", "deg", 0.035, 0.0087, -0.35, 0.35, DEGREES),
    ), "d = d_command + offset", "turns with the rudder amidships, in proportion to u^2", (),
        SERVO,
        words="a rudder offset of {offset_deg:.1f} deg", alike="turns amidships", steady=True),
    Effect("rudder_lag", "actuation", "input", HV, (
        P("lag_s", "s", 0.35, 0.13, 0.0, 5.0, nuisance_std=0.035, step=0.05, powers=TIME),
    ), "d' = (d_command - d) / lag", "residual after every rudder movement, decaying", (), SERVO,
        words="a servo lag of {lag_s:.2f} s", alike="late", curved=True),
    Effect("rudder_rate_limit", "actuation", "input", HV, (
        P("rate_degps", "deg/s", 2.6, 1.7, 0.0, 50.0, DEGREES, "inverse", step=0.3,
          nuisance_std=0.26, powers=TIME),
    ), "|d'| <= rate", "residual after every rudder movement, longer after larger ones", (), SERVO,
        words="a servo speed limit of {rate_degps:.0f} deg/s", alike="late", curved=True),
    Effect("rudder_delay", "actuation", "input", HV, (
        P("delay_s", "s", 0.26, 0.13, -0.75, 5.0, nuisance_std=0.018, step=0.05, powers=TIME),
    ), "d(t) = d_command(t - delay)",
        "residual after every rudder movement, flat-topped", (), SERVO,
        words="a rudder delay of {delay_s:.2f} s", alike="late", curved=True),
    Effect("rudder_backlash", "actuation", "input", HV, (
        P("half_width_deg", "deg", 0.026, 0.0122, 0.0, 0.2, DEGREES, step=0.7),
    ), "d follows d_command at a distance of the half width",
        "turning circles differ after rudder reversals",
        (), SERVO,
        words="a rudder backlash of ±{half_width_deg:.1f} deg", alike="small helms",
        curved=True),
    Effect("rudder_deadband", "actuation", "input", HV, (
        P("deadband_deg", "deg", 0.026, 0.0122, 0.0, 0.2, DEGREES, step=0.7),
    ), "d = sign(d_command) max(|d_command| - deadband, 0)",
        "small rudder angles have too little effect", (),
        SERVO,
        words="a rudder dead band of ±{deadband_deg:.1f} deg", alike="small helms",
        curved=True),
    Effect("rudder_asymmetry", "actuation", "input", HV, (
        P("gain", "-", 0.15, 0.05, -0.9, 0.9),
    ), "d = d_command (1 + gain sign(d_command))",
        "turns to port and to starboard differ", (), SERVO,
        words="a rudder asymmetry of {gain:+.2f}"),
    Effect("rudder_stall", "actuation", "input", HV, (
        P("angle_deg", "deg", 6.0, 3.0, 0.0, 60.0, DEGREES, "inverse_square", step=0.1,
          nuisance_std=1.2),
    ), "effective d = d / sqrt(1 + (d / angle)^2)",
        "large rudder angles have too little effect", (),
        "Molland and Turnock (2007), 5.3",
        words="a rudder that stalls at about {angle_deg:.0f} deg", alike="large helms",
        curved=True),
    Effect("propeller_lag", "actuation", "input", HV, (
        P("lag_s", "s", 0.62, 0.26, 0.0, 15.0, nuisance_std=0.13, step=0.05, powers=TIME),
    ), "n' = (n_command - n) / lag", "u residual after thrust steps only",
        words="a propeller lag of {lag_s:.2f} s", surge_alone=True,
        curved=True),
    Effect("propeller_race", "actuation", "input", HV, (
        P("c_m2ps2pn", "m^2/s^2/N", 100.0, 50.0, -1000.0, 1000.0, powers=(-1, -2, 0, 0),
          nuisance_std=15.0),
    ), "rudder sees u^2 + c T", "rudder effectiveness depends on propeller loading", (),
        "Molland and Turnock (2007), 3.6",
        words="propeller race on the rudder, {c_m2ps2pn:.4f} m^2/s^2 per N",
        alike="large helms"),
    Effect("thrust_sag", "actuation", "input", HV, (
        P("fraction_per_1000_s", "-", 0.15, 0.05, -0.9, 0.9),
    ), "thrust (1 - fraction t / 1000 s)", "u falls slowly through the trial",
        words="thrust that declines by {fraction_per_1000_s:.1%} in 1000 s", alike="falling thrust",
        surge_alone=True),
    Effect("thrust_step", "actuation", "input", HV, (
        P("fraction", "-", 0.15, 0.05, -0.9, 0.9),
        P("time_s", "s", 0.0, 0.0, 0.0, LONGEST_TRIAL_S,
          grid=TimeGrid(120.0, 20, (0.75, 0.19), 2.0)),
        P("over_s", "s", 0.0, 0.0, 0.0, LONGEST_TRIAL_S, width_of="time_s"),
    ), "thrust (1 - fraction) from one time on, spread over its uncertainty",
        "u drops at one time and stays low",
        words="thrust that drops by {fraction:.1%}", alike="falling thrust", surge_alone=True),
    Effect("dvl_delay", "sensing", "reading", HV, (
        P("delay_s", "s", 0.22, 0.09, -2.5, 5.0, powers=TIME),
    ), "u, v(t) are those of t - delay",
        "u and v residuals in proportion to their derivatives", (), SENSOR,
        words="a DVL delay of {delay_s:.2f} s", alike="late", curved=True, late=True),
    Effect("gyro_delay", "sensing", "reading", HV, (
        P("delay_s", "s", 0.22, 0.09, -2.5, 5.0, powers=TIME),
    ), "r(t) is that of t - delay", "r residual in proportion to its derivative", (), SENSOR,
        words="a gyro delay of {delay_s:.2f} s", alike="late", curved=True, late=True),
    Effect("dvl_misalignment", "sensing", "reading", H, (
        P("yaw_deg", "deg", 0.035, 0.0087, -0.5, 0.5, DEGREES),
    ), "(u, v) turned by yaw", "v in proportion to u while r = 0", (), SENSOR,
        words="a DVL misalignment of {yaw_deg:.1f} deg in yaw", steady=True),
    Effect("dvl_scale", "sensing", "reading", HV, (
        P("fraction", "-", 0.03, 0.015, -0.5, 0.5),
    ), "(u, v) (1 + fraction)", "only logged positions show it", ("north_m",), SENSOR,
        words="a DVL scale error of {fraction:+.1%}"),
    Effect("dvl_lever_arm", "sensing", "reading", H, (
        P("dx_m", "m", 0.12, 0.03, -1.0, 1.0, powers=LENGTH),
        P("dy_m", "m", 0.06, 0.018, -1.0, 1.0, powers=LENGTH),
    ), "v + r dx, u - r dy", "u differs in port and starboard turns (dy)", (), SENSOR,
        words="a DVL {dx_m:.2f} m forward and {dy_m:.2f} m to starboard of its stated position"),
    Effect("gyro_bias", "sensing", "reading", HV, (
        P("bias_degps", "deg/s", 0.0057, 0.002, -0.5, 0.5, DEGREES, powers=RATE),
    ), "r + bias", "heading disagrees with the integral of r", (), SENSOR,
        words="a gyro bias of {bias_degps:.2f} deg/s"),
    Effect("gyro_scale", "sensing", "reading", HV, (
        P("fraction", "-", 0.03, 0.015, -0.5, 0.5),
    ), "r (1 + fraction)", "heading disagrees with the integral of r in turns", ("heading_rad",),
        SENSOR,
        words="a gyro scale error of {fraction:+.1%}"),
    Effect("propeller_side_force", "hydrodynamics", "force", H, (
        P("Y_nn", "N s^2", 1.2e-3, 2e-4, -0.1, 0.1, powers=(1, 2, 2, -2)),
        P("N_nn", "N m s^2", 2.5e-4, 4e-5, -0.1, 0.1, powers=(1, 3, 2, -2)),
    ), "Y + Y_nn n|n|, N + N_nn n|n|", "turns with the rudder amidships, in proportion to n^2",
        alike="turns amidships", parts=("rudder_offset", "dvl_misalignment"), steady=True),
    Effect("hull_asymmetry", "hydrodynamics", "force", H, (
        P("Y_0", "kg/m", 1.2e-3, 2e-4, -0.1, 0.1, powers=(1, 2, 0, 0), nuisance_std=3e-5),
        P("N_0", "kg", 2.5e-4, 4e-5, -0.1, 0.1, powers=(1, 3, 0, 0), nuisance_std=1e-5),
    ), "Y + Y_0 u|u|, N + N_0 u|u|", "turns with the rudder amidships, in proportion to u^2",
        alike="turns amidships", parts=("rudder_offset", "dvl_misalignment"), steady=True),
    Effect("sway_cross_flow", "hydrodynamics", "force", H, (
        P("Y_v|r|", "kg", 0.03, 0.01, -1.0, 1.0, powers=(1, 3, 0, 0)),
        P("Y_r|v|", "kg", 0.03, 0.01, -1.0, 1.0, powers=(1, 3, 0, 0)),
    ), "Y + Y_v|r| v|r| + Y_r|v| r|v|", "drift angle depends on the rate of turn", (),
        "Norrbin (1971); Clarke (2003)",
        alike="damping", higher_order=True),
    Effect("yaw_cross_flow", "hydrodynamics", "force", H, (
        P("N_v|r|", "kg m", 0.008, 0.003, -1.0, 1.0, powers=(1, 4, 0, 0)),
        P("N_r|v|", "kg m", 0.008, 0.003, -1.0, 1.0, powers=(1, 4, 0, 0)),
    ), "N + N_v|r| v|r| + N_r|v| r|v|", "overshoot depends on the rate of turn", (),
        "Norrbin (1971); Clarke (2003)",
        alike="damping", higher_order=True),
    Effect("cubic_damping", "hydrodynamics", "force", H, (
        P("N_vvr", "kg s", 0.05, 0.02, -5.0, 5.0, powers=(1, 4, -1, 0)),
        P("N_rrr", "kg m^2 s", 0.01, 0.004, -1.0, 1.0, powers=(1, 6, -1, 0)),
    ), "N + N_vvr v v r + N_rrr r^3", "yaw damping grows faster than the square", (),
        "Abkowitz (1964)",
        alike="large helms", higher_order=True),
    Effect("turning_drag", "hydrodynamics", "force", H, (
        P("X_vvu", "kg s/m^2", 0.05, 0.02, -5.0, 5.0, powers=(1, 2, -1, 0)),
        P("X_rru", "kg s", 0.01, 0.004, -5.0, 5.0, powers=(1, 4, -1, 0)),
    ), "X + X_vvu v v u + X_rru r r u", "u lower in turns than X_vv, X_vr and X_rr explain",
        alike="drag", surge_alone=True, higher_order=True),
    Effect("linear_drag", "hydrodynamics", "force", H, (
        P("X_u", "kg/s", 1.0e-3, 4e-4, -0.1, 0.1, powers=(1, 2, 1, 0), nuisance_std=1.5e-4),
    ), "X + X_u u", "u / n changes with speed",
        words="linear drag of {X_u:.2f} kg/s", alike="drag",
        surge_alone=True),
    Effect("linear_damping", "hydrodynamics", "force", H, (
        P("Y_v", "kg/s", 0.015, 0.005, -1.0, 1.0, powers=(1, 2, 1, 0)),
        P("N_r", "kg m^2/s", 3e-3, 1e-3, -1.0, 1.0, powers=(1, 4, 1, 0)),
    ), "Y + Y_v v, N + N_r r", "drift and turns die faster at low speed", (),
        "Fossen (2021), 6.4", alike="damping"),
    Effect("roll_coupling", "hydrodynamics", "force", H, (
        P("Y_uuphi", "kg/m", 0.015, 0.004, -1.0, 1.0, powers=(1, 2, 0, 0)),
        P("N_uuphi", "kg", 0.004, 0.001, -1.0, 1.0, powers=(1, 3, 0, 0)),
    ), "Y + Y_uuphi u u roll, N + N_uuphi u u roll", "residual follows the roll", ("roll_rad",)),
    Effect("dvl_height", "sensing", "reading", H, (
        P("dz_m", "m", 0.09, 0.06, -1.0, 1.0, nuisance_std=0.09, powers=LENGTH),
    ), "v - p dz, u + q dz", "v residual follows the roll rate", ("p_radps",), SENSOR,
        nuisance=True),
    Effect("weight_excess", "hydrodynamics", "force", H, (
        P("W-B_n", "N", 1.0e-3, 5e-4, -0.1, 0.1, powers=(1, 2, 2, 0), nuisance_std=1e-3),
    ), "X - (W-B) pitch", "u residual follows the pitch", ("pitch_rad",), "Fossen (2021), 4.1",
        surge_alone=True, nuisance=True),
)
# fmt: on
# Predicts without a name, hence no candidate and no row of `EFFECTS`; see `schema.unexplained`.
UNEXPLAINED = Effect(
    NAME,
    "hydrodynamics",
    "force",
    H,
    tuple(
        P(q.symbol, q.unit, q.prior, 0.5 * q.prior, -1e3 * q.prior, 1e3 * q.prior, powers=q.powers)
        for q in PRODUCTS
    ),
    "X, Y, N + coefficients times products of u, v, r, rudder angle and heading",
    "what is left after every named effect",
    nuisance=True,
)

FAMILIES: tuple[EffectFamily, ...] = get_args(EffectFamily)
BY_ID: dict[str, Effect] = {effect.id: effect for effect in (*EFFECTS, UNEXPLAINED)}


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
