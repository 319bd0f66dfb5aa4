"""What holds between two sensors of a vehicle when their clocks agree.

A relation is a row of `RELATIONS`. Where kinematics relates two sensors it does so whatever the
vehicle; between rudder, yaw rate and velocities it is the dynamics of the hull, with coefficients
that are estimated along. What these equations leave out passes for a lag: `usual_lengths` is its
mean and standard deviation in L/U, from the clean trials of the even seeds of the drawn population
(`sample_logs/seatrial/population`), sensors on one clock. Hulls are not all drawn from there:
`unlike_lengths` is what a lag has to exceed besides before it accuses a clock.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from auvident.schema.channels import CHANNELS
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle
from auvident.stages.ingest.clocks_line import RIDGE, LikelyCoefficients, Signals
from auvident.stages.ingest.response import SLOW_SHARE, SMOOTHING_S, heading_rate
from auvident.stages.ingest.still import still_channels

SMOOTHING_LENGTHS = 0.6  # L/U: turbulence and noise of slow hulls out, zigzags left
FIX_PERIODS = 2.5  # position fixes are joined by straight lines: smoothing hides their corners
FIX_LENGTHS, FIX_S = 3.0, 5.0
CURRENT_RIDGE = 0.05  # of its power in turns: on a steady heading it passes for way or drift
ROWS_OF_CURRENT = 100_000  # that tell it: of a day at 10 Hz each eighth
FIXES = ("north_m", "east_m")
# Symbols of the equations, their columns and the sensor that delivers them.
SYMBOLS = {
    "u": "u_mps",
    "v": "v_mps",
    "w": "w_mps",
    "p": "p_radps",
    "q": "q_radps",
    "r": "r_radps",
    "rudder": "rudder_rad",
    "elevator": "elevator_rad",
    "n": "rpm",
    "roll": "roll_rad",
    "pitch": "pitch_rad",
    "heading": "heading_rad",
    "z": "depth_m",
    "north": "north_m",
    "east": "east_m",
}
# Coefficients of `_sway` over L and U, of the even seeds; in steady turns those of drift, yaw rate
# and rudder stand in for each other, and for a lag.
SWAY = LikelyCoefficients(
    np.array([-0.75, -3.5, -0.3, 0.25, 0.0, 0.0, 0.0]),
    np.array([0.4, 1.5, 0.12, 0.1, 0.1, 0.05, 0.01]),
)
Equations = Callable[[Signals, Vehicle], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class ClockRelation:
    """One relation.

    Attributes
    ----------
    sensor : str
        Whose clock it tests.
    against : str
        What with, in words.
    own, others : tuple of str
        Symbols of the sensor and of the others that the equations need.
    equations : callable
        (signals, vehicle) -> y and X of `fit_line`.
    usual_lengths : (float, float)
        Lag that it shows on one clock, in L/U: mean and standard deviation.
    gain_lengths : float
        Standard deviation of the change of it along a trial, to either end, in L/U.
    rival : float
        A lag elsewhere has to leave so many times more unexplained.
    widths : tuple of float
        Smoothing over the usual one, by turns until the lag is distinct; what the equations leave
        out grows with it.
    prior : LikelyCoefficients, optional
    slow : bool
        Position fixes: wide smoothing.
    kinematic : bool
        It holds whatever the vehicle.
    in_water : bool
        It holds for the velocities through the water. What is estimated of a current is taken out
        if the relation explains more so: a hull that drifts in turns feigns a little of one.
    unlike_lengths : float
        Standard deviation of the lag on hulls that are not of the population, in L/U.
    """

    sensor: str
    against: str
    own: tuple[str, ...]
    others: tuple[str, ...]
    equations: Equations
    usual_lengths: tuple[float, float] = (0.0, 0.0)
    gain_lengths: float = 0.0
    rival: float = 1.5
    widths: tuple[float, ...] = (1.0,)
    prior: LikelyCoefficients | None = None
    slow: bool = False
    kinematic: bool = False
    in_water: bool = False
    unlike_lengths: float = 0.0


def smoothing_s(passage_s: float) -> float:
    """Width of the moving average, applied twice, of all but position fixes."""
    return max(SMOOTHING_S, SMOOTHING_LENGTHS * passage_s)


def fix_smoothing_s(passage_s: float, period_s: float) -> float:
    """The same for position fixes `period_s` apart."""
    return max(FIX_PERIODS * period_s, FIX_LENGTHS * passage_s, FIX_S)


def smooth_signals(trial: Trial, width_s: float) -> Signals:
    """Smoothed signals of a trial and their derivatives (``<symbol>_dot``), NaN where unknown."""
    time = trial.table["time_s"].to_numpy()
    average = _Average(width_s, trial)
    found: Signals = {"time": time}
    if time.size <= 2 * average.width:
        return found
    still = still_channels(trial.table)
    for symbol, column in SYMBOLS.items():
        if column in trial.table and column not in still:
            values = average(trial.table[column].to_numpy(dtype=float))
            found[symbol] = values
            found[symbol + "_dot"] = np.gradient(values, time)
    if "r" in found:
        heading = _heading_of(trial)
        found["cos_heading"] = average(np.cos(heading))
        found["sin_heading"] = average(np.sin(heading))
    if {"u", "v", "r"} <= set(found):
        found |= _current(found)
    if "u" in found and np.isfinite(found["u"]).any():
        least = SLOW_SHARE * float(np.nanquantile(found["u"], 0.9))
        found["u"] = np.where(found["u"] > least, found["u"], np.nan)
    return found


def _current(s: Signals) -> Signals:
    """A steady current in the axes of the vehicle, as far as it shows in turns.

    What the velocities over ground have in common with the heading, besides thrust, the loss of
    speed in turns and the drift in them; where the heading hardly changes it stays near 0.
    """
    thin = slice(None, None, max(1, s["u"].size // ROWS_OF_CURRENT))
    u, v, r, cos, sin = (s[k][thin] for k in ("u", "v", "r", "cos_heading", "sin_heading"))
    one, none = np.ones_like(u), np.zeros_like(u)
    n = s["n"][thin] if "n" in s else none
    size = float(np.nanmax(np.abs(n), initial=0.0)) or 1.0
    along = (one, n / size, (n / size) ** 2, r**2, np.abs(r), none, none, none, cos, sin)
    across = (none, none, none, none, none, one, r, r * np.abs(r), -sin, cos)
    known = np.isfinite(u + v + r + n + cos)
    x = np.concatenate((_columns(*along)[known], _columns(*across)[known]))
    y = np.concatenate((u[known], v[known]))
    north, east = _shrunk(x, y)[-2:] if known.any() else (0.0, 0.0)
    cos, sin = s["cos_heading"], s["sin_heading"]
    found = {"current_u": north * cos + east * sin, "current_v": east * cos - north * sin}
    return found | {k + "_dot": np.gradient(c, s["time"]) for k, c in found.items()}


def without_current(s: Signals) -> Signals:
    """The same signals in still water."""
    return {n: np.zeros_like(x) if n.startswith("current_") else x for n, x in s.items()}


def _shrunk(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Least squares; the last two coefficients give way where others explain as much."""
    scale = np.sqrt(np.sum(x**2, axis=0))
    scale = np.where(scale > 0.0, scale, 1.0)
    unit, ridge = x / scale, np.full(scale.size, RIDGE)
    ridge[-2:] = CURRENT_RIDGE
    gram = unit.T @ unit + np.diag(ridge)
    return np.asarray(np.linalg.solve(gram, unit.T @ y) / scale)


class _Average:
    """Moving average, applied twice; NaN at the ends."""

    def __init__(self, width_s: float, trial: Trial) -> None:
        self.width = max(1, round(width_s * trial.rate_hz))
        box = np.ones(self.width) / self.width
        self.window = np.convolve(box, box)

    def __call__(self, values: np.ndarray) -> np.ndarray:
        smooth = np.full(values.size, np.nan)
        inside = slice(self.width - 1, values.size - self.width + 1)
        smooth[inside] = np.convolve(values, self.window, mode="valid")
        return smooth


def _heading_of(trial: Trial) -> np.ndarray:
    """Heading of a trial, or where none was logged the sum of the yaw rates."""
    table = trial.table
    if "heading_rad" in table:
        return table["heading_rad"].to_numpy(dtype=float)
    r = table["r_radps"].to_numpy(dtype=float)
    return np.asarray(np.cumsum(np.nan_to_num(r)) / trial.rate_hz)


def with_derivatives(symbols: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the signals of some symbols."""
    return tuple(name for s in symbols for name in (s, s + "_dot"))


def symbols_of(sensor: str) -> tuple[str, ...]:
    """Symbols of all that a sensor measures."""
    own = {c.column for c in CHANNELS if c.sensor == sensor}
    return tuple(s for s, column in SYMBOLS.items() if column in own)


def _columns(*columns: np.ndarray) -> np.ndarray:
    return np.stack(columns, axis=-1)


def _or_zero(s: Signals, name: str) -> np.ndarray:
    return s[name] if name in s else np.zeros_like(s["time"])


def _heading(s: Signals, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """d(heading)/dt = k (q sin(roll) + r cos(roll)) / cos(pitch) + c."""
    roll, pitch = _or_zero(s, "roll"), _or_zero(s, "pitch")
    rate = heading_rate(_or_zero(s, "q"), s["r"], roll, pitch)
    return s["heading_dot"], _columns(rate, np.ones_like(rate))


def _pitch(s: Signals, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """d(pitch)/dt = k (q cos(roll) - r sin(roll)) + c."""
    roll = _or_zero(s, "roll")
    rate = s["q"] * np.cos(roll) - s["r"] * np.sin(roll)
    return s["pitch_dot"], _columns(rate, np.ones_like(rate))


def _yaw(s: Signals, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """dr/dt = a u r + b r|r| + c u^2 rudder + d u^2."""
    u, r = s["u"], s["r"]
    return s["r_dot"], _columns(u * r, r * np.abs(r), u**2 * s["rudder"], u**2)


def _pitching(s: Signals, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """dq/dt = a u q + b q|q| + c u^2 elevator + d pitch + e u^2."""
    u, q = s["u"], s["q"]
    x = [u * q, q * np.abs(q), u**2 * s["elevator"], _or_zero(s, "pitch"), u**2]
    return s["q_dot"], _columns(*x)


def _sway(s: Signals, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """The sway equation, of `SWAY`; the DVL reads v = v_D - x_D r at its place, and rolls.

    The hull feels the water: velocities are those through it, less the steady current.
    """
    arm, length, u = vehicle.dvl.x_m, vehicle.hull.length_m, s["u"] - s["current_u"]
    v = s["v"] - s["current_v"] - arm * s["r"]
    x = [u * v / length, v * np.abs(v) / length, u * s["r"], u**2 * s["rudder"] / length]
    x += [_or_zero(s, "p") * u, _or_zero(s, "p_dot") * length, u**2 / length]
    return s["v_dot"] - s["current_v_dot"] - arm * s["r_dot"], _columns(*x)


def _surge(s: Signals, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """du/dt = a u^2 + b n^2 + c u n + d r^2 + e: thrust steps, and the loss of speed in turns."""
    u, n = s["u"] - s["current_u"], s["n"]
    return s["u_dot"] - s["current_u_dot"], _columns(
        u**2, n * np.abs(n), u * n, s["r"] ** 2, np.ones_like(u)
    )


def _depth(s: Signals, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """d(depth)/dt of the velocities, turned by roll and pitch; a bias of the pitch left free."""
    arm, roll, pitch = vehicle.dvl.x_m, _or_zero(s, "roll"), s["pitch"]
    w = _or_zero(s, "w") + arm * _or_zero(s, "q")
    v = s["v"] - arm * s["r"]
    across = v * np.sin(roll) + w * np.cos(roll)
    rate = across * np.cos(pitch) - s["u"] * np.sin(pitch)
    return s["z_dot"], _columns(rate, s["u"], np.ones_like(rate))


def _track(s: Signals, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """Rates of the position from the velocities turned by the heading, and a current.

    A bias and a drift of the heading are left free.
    """
    north, east = s["course_north"], s["course_east"]
    tau = (s["time"] - s["time"][0]) / (s["time"][-1] - s["time"][0]) - 0.5
    one, none = np.ones_like(north), np.zeros_like(north)
    first = _columns(north, -east, tau * north, -tau * east, one, none)
    second = _columns(east, north, tau * east, tau * north, none, one)
    return _columns(s["north_dot"], s["east_dot"]), np.stack((first, second), axis=1)


def _carried(s: Signals, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray]:
    """The track in the axes of the vehicle, of the velocities; as `_track`, for their clock.

    The heading is that of the track's side: only the velocities are moved.
    """
    tau = (s["time"] - s["time"][0]) / (s["time"][-1] - s["time"][0]) - 0.5
    u, v = s["u"], s["v"] - vehicle.dvl.x_m * s["r"]
    cos, sin = s["cos_heading"], s["sin_heading"]
    first = _columns(u, -v, tau * u, -tau * v, cos, sin)
    second = _columns(v, u, tau * v, tau * u, -sin, cos)
    return _columns(s["track_u"], s["track_v"]), np.stack((first, second), axis=1)


def with_course(s: Signals, trial: Trial, vehicle: Vehicle, width_s: float) -> Signals:
    """Signals with the velocities in north and east, and the track's in the vehicle's axes.

    They are turned before they are smoothed.
    """
    table = trial.table
    names = {"u_mps", "v_mps", "r_radps"}
    if not names <= set(table.columns) or not {"north", "east"} <= set(s):
        return s
    heading, average = _heading_of(trial), _Average(width_s, trial)
    cos, sin = np.cos(heading), np.sin(heading)
    u = table["u_mps"].to_numpy(dtype=float)
    v = table["v_mps"].to_numpy(dtype=float)
    v = v - vehicle.dvl.x_m * table["r_radps"].to_numpy(dtype=float)
    north, east = (np.gradient(table[c].to_numpy(dtype=float), s["time"]) for c in FIXES)
    turned = {
        "course_north": u * cos - v * sin,
        "course_east": u * sin + v * cos,
        "track_u": north * cos + east * sin,
        "track_v": east * cos - north * sin,
    }
    return s | {name: average(values) for name, values in turned.items()}


RELATIONS: tuple[ClockRelation, ...] = (
    ClockRelation(
        "attitude",
        "heading against yaw rate",
        ("heading", "roll", "pitch"),
        ("r",),
        _heading,
        kinematic=True,
    ),
    ClockRelation(
        "attitude",
        "pitch against pitch rate",
        ("pitch", "roll"),
        ("q",),
        _pitch,
        kinematic=True,
    ),
    ClockRelation(
        "rudder",
        "rudder against yaw acceleration",
        ("rudder",),
        ("u", "r"),
        _yaw,
        unlike_lengths=0.15,
        usual_lengths=(0.02, 0.07),
        gain_lengths=0.04,
        rival=5.0,
        widths=(1.0, 2.0),
    ),
    ClockRelation(
        "elevator",
        "elevator against pitch acceleration",
        ("elevator",),
        ("u", "q"),
        _pitching,
        unlike_lengths=0.15,
        usual_lengths=(0.04, 0.08),
        gain_lengths=0.04,
        rival=4.0,
    ),
    ClockRelation(
        "dvl",
        "sway against yaw rate and rudder",
        ("u", "v"),
        ("r", "rudder"),
        _sway,
        in_water=True,
        unlike_lengths=0.5,
        usual_lengths=(0.0, 0.1),
        gain_lengths=0.03,
        rival=2.5,
        widths=(1.0, 2.0),
        prior=SWAY,
    ),
    ClockRelation(
        "dvl",
        "surge against propeller and yaw rate",
        ("u",),
        ("n", "r"),
        _surge,
        in_water=True,
        unlike_lengths=0.4,
        usual_lengths=(0.03, 0.06),
        gain_lengths=0.05,
        rival=2.0,
    ),
    ClockRelation(
        "rpm",
        "propeller against surge and yaw rate",
        ("n",),
        ("u", "r"),
        _surge,
        in_water=True,
        unlike_lengths=0.4,
        usual_lengths=(0.0, 0.06),
        gain_lengths=0.05,
        rival=1.2,  # few thrust steps: 1.26 is the least of even trials that know their lag
    ),
    ClockRelation(
        "depth",
        "depth rate against velocities and pitch",
        ("z",),
        ("u", "v", "r", "pitch"),
        _depth,
        usual_lengths=(0.0, 0.01),
        gain_lengths=0.01,
        kinematic=True,
    ),
    ClockRelation(
        "dvl",
        "velocities against depth rate and pitch",
        ("w", "u", "v"),
        ("z", "r", "pitch"),
        _depth,
        usual_lengths=(0.02, 0.05),
        gain_lengths=0.02,
        kinematic=True,
    ),
    ClockRelation(
        "position",
        "position against velocities and heading",
        ("north", "east"),
        ("course_north", "course_east"),
        _track,
        slow=True,
        kinematic=True,
    ),
    ClockRelation(
        "dvl",
        "velocities against position and heading",
        ("u", "v"),
        ("track_u", "track_v"),
        _carried,
        usual_lengths=(0.0, 0.05),
        gain_lengths=0.02,
        slow=True,
        kinematic=True,
    ),
)
