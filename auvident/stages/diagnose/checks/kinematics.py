"""Sensors held against each other by kinematics alone, without any model of the vehicle.

Two logs of the same motion differ by what is wrong with one of them: the heading log against the
integral of the yaw rate (bias, scale and delay of the gyro), the position log against the
integral of the DVL's velocity (scale and misalignment of the DVL, the current when it measures
through the water). Whatever the water or an actuator does moves both logs alike.

The difference of the two logs is fitted in windows, each with a constant of its own
(`checks.paired_logs`). On 90 generated trials (two vehicles; clean, and ten effects planted) error
over claimed standard deviation, without the allowances below, has an rms of 0.9 to 1.2 in every
parameter (misalignment 1.3 with a gyro bias, see there). With a compass deviation of 1 degree it
stays below 1.3, but for the misalignment (3), which the allowance covers.

What cannot be told apart by these logs is said in each function and counted in the covariance.
The ingest stage corrects no clock (it only reports lags), so delays are still in the tables; its
means over centred steps and its lines between samples shift nothing. Delays are seen to a
millisecond between gyro and heading, to some hundredths of a second between DVL and heading.
"""

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.schema.effects import parameter_of
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Dvl
from auvident.stages.diagnose.checks.paired_logs import (
    ANGLES,
    MARGIN_S,
    Stretch,
    fit_windows,
    stretches_of,
)

Array = npt.NDArray[Any]

HEADING_WINDOW_S, POSITION_WINDOW_S = 20.0, 60.0
# Counted besides the scatter, because no log here can show it (one standard deviation):
HEEL_SCALE = 0.01  # heel of 8 degrees in turns looks like gyro scale when no roll is logged
HEADING_LATENCY_S = 0.03  # a heading reference that filters looks like a gyro or DVL ahead of time
HEADING_REFERENCE_RAD = math.radians(0.5)  # a heading log turned by so much looks like a DVL so


@dataclass(frozen=True)
class SensorCheck:
    """What two logs say about sensors, as a Gaussian.

    Attributes
    ----------
    names : tuple of str
        Parameters ``effect.parameter``.
    mean : (k,) array
        Estimates in internal units (rad, rad/s, s, m/s, fractions).
    covariance : (k, k) array
        Robust against coloured errors; its inverse is the information.
    samples : int
        Samples of the log that served as reference.
    residual_rms : float
        Of what is left, rad or m: mostly the noise of the reference.
    what : str
        One line for people.
    one_of : tuple of str
        Parameters that these logs do not tell from each other: what a model leaves out of them
        counts as zero.
    """

    names: tuple[str, ...]
    mean: Array
    covariance: Array
    samples: int
    residual_rms: float
    what: str
    one_of: tuple[str, ...] = ()

    def of(self, names: Collection[str]) -> "SensorCheck | None":
        """What is said of some parameters, the others left open; None where that is nothing."""
        own = [k for k, name in enumerate(self.names) if name in names]
        if not own or len(own) == len(self.names):
            return self if own else None
        return replace(
            self,
            names=tuple(self.names[k] for k in own),
            mean=self.mean[own],
            covariance=self.covariance[np.ix_(own, own)],
        )

    def with_only(self, there: Collection[str]) -> "SensorCheck":
        """What is said where those of `one_of` that are not there are zero."""
        out = [k for k, n in enumerate(self.names) if n in self.one_of and n not in there]
        own = [k for k in range(len(self.names)) if k not in out]
        if not out or not own:
            return self
        covariance = self.covariance
        share = np.linalg.solve(covariance[np.ix_(out, out)], covariance[np.ix_(out, own)]).T
        return replace(
            self,
            names=tuple(self.names[k] for k in own),
            mean=self.mean[own] - share @ self.mean[out],
            covariance=covariance[np.ix_(own, own)] - share @ covariance[np.ix_(out, own)],
        )

    def alone(self, name: str) -> tuple[float, float]:
        """Value and standard deviation of one parameter, its rivals zero."""
        told = self.with_only({name})
        k = told.names.index(name)
        return float(told.mean[k]), math.sqrt(told.covariance[k, k])


def heading_against_gyro(trials: Sequence[Trial]) -> SensorCheck | None:
    """Bias, scale and delay of the yaw gyro from the heading log.

    heading(t) = c + integral of (q sin(roll) + (r_log(t + delay) - bias) / (1 + scale) cos(roll))
    / cos(pitch) dt (Fossen 2021, 2.39). The delay is that of the gyro's stamps behind those of
    the heading log; which of the two is late is not known here (`HEADING_LATENCY_S`). Without a
    roll log, heel looks like scale, which is counted (`HEEL_SCALE`). A heading log that is itself
    the integral of this gyro says nothing: its residual is far below any compass's noise.

    Parameters
    ----------
    trials : sequence of Trial
        Held-out rows blanked to NaN.

    Returns
    -------
    SensorCheck or None
        None without a heading log or with too little of it.
    """
    names = ("gyro_bias.bias_degps", "gyro_scale.fraction", "gyro_delay.delay_s")
    optional = ("q_radps", "roll_rad", "pitch_rad")
    stretches = stretches_of(trials, ("heading_rad",), ("r_radps",), optional, HEADING_WINDOW_S)
    found = fit_windows(stretches, heading_change, np.array([parameter_of(n).prior for n in names]))
    if found is None:
        return None
    mean, covariance, samples, rms = found
    if not all("roll_rad" in trial.columns for trial in trials):
        covariance[1, 1] += HEEL_SCALE**2
    covariance[2, 2] += HEADING_LATENCY_S**2
    return SensorCheck(names, mean, covariance, samples, rms, "heading log against yaw gyro")


def heading_change(stretch: Stretch, x: Array) -> Array:
    """Heading log minus integrated gyro (n, 1) in rad at x = (bias, scale, delay)."""
    s, ((cr, sr), (cp, _)) = stretch.signals, (stretch.cosines[k] for k in ANGLES[:2])
    r = (late(s["r_radps"], x[2], stretch.dt_s) - x[0]) / (1.0 + x[1])
    q = late(s["q_radps"], x[2], stretch.dt_s)
    rate = (q * sr + r * cr) / cp
    return (s["heading_rad"] - integral(rate, stretch.dt_s))[:, None]


def position_against_dvl(
    trials: Sequence[Trial],
    dvl: Dvl,
    along: Sequence[float] = (),
    change: Callable[[Stretch, Array], Array] | None = None,
) -> SensorCheck | None:
    """Scale, misalignment and delay of the DVL from the position log, and the current.

    position(t) = c + integral of R(roll, pitch, heading) v dt (+ current t when the DVL measures
    through the water), v = R(yaw) v_log(t + delay) / (1 + scale) - rates x lever arm (Fossen
    2021, 2.18 and 2.40). A DVL over ground sees no current, so none matters then. The
    delay is that of the DVL behind the heading log; that of the position log, and a transponder
    beside the origin, are fitted along and dropped. A heading log whose reference is turned
    cannot be told from a misaligned DVL (`HEADING_REFERENCE_RAD` is counted). The gyro enters
    through the lever arm only: a bias of 0.3 deg/s at 0.3 m passes for 0.07 degrees of yaw.
    Without logs of roll, pitch and heave the motion is taken as level.

    Parameters
    ----------
    trials : sequence of Trial
        Held-out rows blanked to NaN.
    dvl : Dvl
        Lever arm, mounting angle and reference.
    along : sequence of float
        Usual sizes of further parameters that are fitted along and dropped.
    change : callable, optional
        In place of `position_change`, with these behind its parameters.

    Returns
    -------
    SensorCheck or None
        None without a position or heading log or with too little of it.
    """
    names: tuple[str, ...] = ("dvl_scale.fraction", "dvl_misalignment.yaw_deg", "dvl_delay.delay_s")
    if dvl.reference == "water":
        names += ("current.north_mps", "current.east_mps")
    needed = ("u_mps", "v_mps", "heading_rad", "r_radps")
    optional = ("w_mps", "p_radps", "q_radps", "roll_rad", "pitch_rad")
    stretches = stretches_of(trials, ("north_m", "east_m"), needed, optional, POSITION_WINDOW_S)
    nuisances = [1.0, 1.0, 1.0]  # latency of the position log in s, transponder in m
    prior = np.array([*nuisances, *(parameter_of(n).prior for n in names), *along])
    reach = np.full(len(prior), math.inf)
    reach[len(nuisances) + names.index("dvl_delay.delay_s")] = MARGIN_S
    predict = change or (lambda s, x: position_change(s, x, dvl))
    found = fit_windows(stretches, predict, prior, reach)
    if found is None:
        return None
    mean, covariance, samples, rms = found
    own = slice(len(nuisances), len(nuisances) + len(names))
    mean, covariance = mean[own], covariance[own, own]
    covariance[1, 1] += HEADING_REFERENCE_RAD**2
    covariance[2, 2] += HEADING_LATENCY_S**2
    return SensorCheck(names, mean, covariance, samples, rms, "position log against DVL")


def position_change(stretch: Stretch, x: Array, dvl: Dvl) -> Array:
    """Position log minus integrated DVL (n, 2) in m, north and east.

    x = (latency of the position log, transponder ahead, to starboard; scale, yaw, delay of the
    DVL; current north, east when the DVL measures through the water).
    """
    s, dt = stretch.signals, stretch.dt_s
    yaw = math.radians(dvl.mounting_yaw_deg) + x[4]
    u, v, w = (late(s[c], x[5], dt) / (1.0 + x[3]) for c in ("u_mps", "v_mps", "w_mps"))
    u, v = turned(u, v, yaw)
    p, q, r = s["p_radps"], s["q_radps"], s["r_radps"]
    at_origin = (
        u - q * dvl.down_m + r * dvl.y_m,
        v - r * dvl.x_m,  # p * dvl.down_m is taken out where the log is read
        w - p * dvl.y_m + q * dvl.x_m,
    )
    over_ground = _north_east(stretch, at_origin)
    if len(x) > 6:
        over_ground = over_ground + x[6:8]
    track = np.column_stack([integral(over_ground[:, i], dt) for i in range(2)])
    beside = _north_east(stretch, (np.full(len(u), x[1]), np.full(len(u), x[2]), np.zeros(len(u))))
    expected = track - x[0] * over_ground + beside
    return np.column_stack([s["north_m"], s["east_m"]]) - expected


def turned(u: Array, v: Array, yaw: float) -> tuple[Array, Array]:
    """Velocities ahead and to starboard, from those in axes that lie to starboard by an angle."""
    c, s = math.cos(yaw), math.sin(yaw)
    return c * u - s * v, s * u + c * v


def _north_east(stretch: Stretch, vector: tuple[Array, Array, Array]) -> Array:
    """North and east parts (n, 2) of a vector in vehicle axes; Fossen (2021), 2.18."""
    a, b, c = vector
    (cr, sr), (cp, sp), (ch, sh) = (stretch.cosines[k] for k in ANGLES)
    ahead, aside = a * cp + (b * sr + c * cr) * sp, b * cr - c * sr
    return np.column_stack([ch * ahead - sh * aside, sh * ahead + ch * aside])


def late(values: Array, delay_s: float, dt_s: float) -> Array:
    """Values (n,) of a log whose stamps are late by a delay, at the true times."""
    rows = np.arange(len(values))
    return np.interp(rows + delay_s / dt_s, rows, values)


def integral(values: Array, dt_s: float) -> Array:
    """Integral (n,) from the first row; the grid's values are at instants: trapezoids."""
    return np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * dt_s)])
