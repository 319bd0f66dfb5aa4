"""Sensors against each other in the vertical plane, by kinematics alone.

As in `checks.kinematics`: the pitch log against the integral of the pitch gyro, and the depth log
against the integral of what the DVL's velocity is downwards at that pitch.

Some errors of two sensors show in the difference of two logs as one: a pitch log that reads a
degree too much lets the vehicle seem to climb as a DVL does that is pitched down by one. The check
holds what is seen of them together (`SensorCheck.one_of`); the motion tells the rest.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.schema.effects import parameter_of
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Dvl, Vehicle
from auvident.stages.diagnose.checks.kinematics import (
    SensorCheck,
    integral,
    late,
    position_against_dvl,
    position_change,
    turned,
)
from auvident.stages.diagnose.checks.paired_logs import (
    WEAK,
    Predict,
    Stretch,
    fit_windows,
    stretches_of,
)

Array = npt.NDArray[Any]

PITCH_WINDOW_S, DEPTH_WINDOW_S = 20.0, 60.0
# Counted besides the scatter, because no log here can show it (one standard deviation):
PITCH_LATENCY_S = 0.03  # a pitch reference that filters looks like a gyro ahead of time
# A depth sensor ahead of the origin rises with the bow, as a late one does in a dive. Its place is
# in no vehicle file: a quarter of the length, over the speed.
DEPTH_SENSOR = 0.25

PITCH_NAMES = (
    "q_bias.bias_degps",
    "q_scale.fraction",
    "pitch_scale.fraction",
    "gyro_delay.delay_s",
)
DEPTH_NAMES = (
    "pitch_bias.bias_deg",
    "dvl_pitch.pitch_deg",
    "depth_scale.fraction",
    "dvl_scale.fraction",
    "pitch_scale.fraction",
    "depth_lag.lag_s",
)
# The position log shows errors of the pitch too, through the cosine of it. They are fitted along
# within so many of their priors: where the vehicle hardly dives it shows nothing of them.
ALONG = ("pitch_bias.bias_deg", "pitch_scale.fraction")
REACH = 3.0


def pitch_against_gyro(trials: Sequence[Trial]) -> SensorCheck | None:
    """Bias, scale and delay of the pitch gyro, and scale of the pitch, from the pitch log.

    pitch(t) / (1 + pitch scale) = c + integral of ((q_log(t + delay) - bias) / (1 + q scale)
    cos(roll) - r sin(roll)) dt (Fossen 2021, 2.39). Of the two scales only the ratio shows.
    Without a roll log the vehicle is taken as upright.

    Parameters
    ----------
    trials : sequence of Trial
        Held-out rows blanked to NaN.

    Returns
    -------
    SensorCheck or None
        None without a pitch log or with too little of it.
    """
    optional = ("r_radps", "roll_rad")
    stretches = stretches_of(trials, ("pitch_rad",), ("q_radps",), optional, PITCH_WINDOW_S)
    prior = np.array([parameter_of(PITCH_NAMES[k]).prior for k in (0, 1, 3)])
    found = fit_windows(stretches, pitch_change, prior)
    if found is None:
        return None
    mean, covariance, samples, rms = found
    covariance[2, 2] += PITCH_LATENCY_S**2
    by_pitch = ratio_row(mean[1])[1]
    seen = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, by_pitch, 0.0], [0.0, 0.0, 0.0, 1.0]])
    found = mean, covariance, samples, rms
    return _check(PITCH_NAMES, seen, found, "pitch log against pitch gyro")


def ratio_row(x: float) -> tuple[float, float]:
    """Factors of the scales a and b in what (1 + a) / (1 + b) = 1 + x says of them.

    a - (1 + x) b = x, exactly: beside a scale error of a tenth, told to a third of a thousandth,
    the difference a - b would be off by 27 standard deviations.
    """
    return 1.0, -(1.0 + x)


def pitch_change(stretch: Stretch, x: Array) -> Array:
    """Pitch log minus integrated gyro (n, 1) in rad at x = (bias, ratio of scales - 1, delay)."""
    s = stretch.signals
    q, r = (late(s[name], x[2], stretch.dt_s) for name in ("q_radps", "r_radps"))
    rate = (q - x[0]) / (1.0 + x[1]) * np.cos(s["roll_rad"]) - r * np.sin(s["roll_rad"])
    return np.asarray(s["pitch_rad"] - integral(rate, stretch.dt_s))[:, None]


def depth_against_dvl(trials: Sequence[Trial], vehicle: Vehicle) -> SensorCheck | None:
    """Bias of the pitch or tilt of the DVL, lag of the depth, and scales, from the depth log.

    depth(t + lag) / (1 + scale) = c + integral of (-u sin(pitch - angle) + (v sin(roll) +
    w cos(roll)) cos(pitch - angle)) dt (Fossen 2021, 2.18), velocities at the origin, the angle
    that by which the pitch log reads more than the axes of the DVL are pitched. Of the scales of
    depth, DVL and pitch the ratio shows, that of the pitch as far as its sine is straight: how far
    the fit would end elsewhere if it were the pitch's is counted. Where a current rises or sinks, a
    DVL over ground goes with it.

    Parameters
    ----------
    trials : sequence of Trial
        Held-out rows blanked to NaN.
    vehicle : Vehicle
        Lever arm of the DVL, and length.

    Returns
    -------
    SensorCheck or None
        None without logs of depth, pitch and heave, or with too little of them.
    """
    needed = ("u_mps", "w_mps", "pitch_rad", "q_radps")
    optional = ("v_mps", "p_radps", "r_radps", "roll_rad")
    stretches = stretches_of(trials, ("depth_m",), needed, optional, DEPTH_WINDOW_S)
    prior = np.array([parameter_of(DEPTH_NAMES[k]).prior for k in (0, 2, 5)])

    def change(of_pitch: bool) -> Predict:
        return lambda s, x: depth_change(s, x, vehicle.dvl, of_pitch)

    found, if_pitch = (fit_windows(stretches, change(of), prior) for of in (False, True))
    if found is None or if_pitch is None:
        return None
    mean, covariance, samples, rms = found
    covariance += np.diag((mean - if_pitch[0]) ** 2)
    speed = float(np.median(np.concatenate([s.signals["u_mps"] for s in stretches])))
    if speed > 0.0:
        covariance[2, 2] += (DEPTH_SENSOR * vehicle.hull.length_m / speed) ** 2
    of_depth, of_other = ratio_row(mean[1])
    seen = np.zeros((3, len(DEPTH_NAMES)))
    seen[0, :2], seen[1, 2:5], seen[2, 5] = (1.0, -1.0), (of_depth, of_other, of_other), 1.0
    return _check(
        DEPTH_NAMES, seen, (mean, covariance, samples, rms), "depth log against DVL and pitch"
    )


def depth_change(stretch: Stretch, x: Array, dvl: Dvl, of_pitch: bool = False) -> Array:
    """Depth log minus integrated velocity (n, 1) in m at x = (angle, ratio of scales - 1, lag).

    With `of_pitch` the ratio is that of the pitch.
    """
    s, yaw = stretch.signals, math.radians(dvl.mounting_yaw_deg)
    u, v = turned(s["u_mps"], s["v_mps"], yaw)
    p, q, r = s["p_radps"], s["q_radps"], s["r_radps"]
    u, v = u - q * dvl.down_m + r * dvl.y_m, v - r * dvl.x_m
    w = s["w_mps"] - p * dvl.y_m + q * dvl.x_m
    by_pitch, by_depth = (1.0 + x[1], 1.0) if of_pitch else (1.0, 1.0 + x[1])
    pitch, roll = by_pitch * (s["pitch_rad"] - x[0]), s["roll_rad"]
    down = -u * np.sin(pitch) + (v * np.sin(roll) + w * np.cos(roll)) * np.cos(pitch)
    expected = late(integral(by_depth * down, stretch.dt_s), -x[2], stretch.dt_s)
    return np.asarray(s["depth_m"] - expected)[:, None]


def position_in_dives(trials: Sequence[Trial], dvl: Dvl) -> SensorCheck | None:
    """As `kinematics.position_against_dvl`, errors of the pitch fitted along.

    A vehicle that dives goes forward with the cosine of its pitch: a pitch log that reads a tenth
    too much, taken as it is, passed for a DVL that was six seconds late.
    """
    along = tuple(REACH / WEAK * parameter_of(name).prior for name in ALONG)

    def change(stretch: Stretch, x: Array) -> Array:
        pitch = (stretch.signals["pitch_rad"] - x[-2]) / (1.0 + x[-1])
        righted = replace(stretch, signals=stretch.signals | {"pitch_rad": pitch})
        return position_change(righted, x[:-2], dvl)

    return position_against_dvl(trials, dvl, along, change)


def _check(
    names: tuple[str, ...], seen: Array, found: tuple[Array, Array, int, float], what: str
) -> SensorCheck:
    """A check on parameters of which sums and differences are seen.

    Parameters
    ----------
    names : tuple of str
    seen : (m, k) array
        What was fitted, by the k parameters.
    found : tuple
        Mean (m,), covariance (m, m), number of samples, rms of the residual.
    """
    mean, covariance, samples, rms = found
    information = np.linalg.inv(covariance)
    open_ = np.diag([(WEAK * parameter_of(name).prior) ** -2.0 for name in names])
    whole = np.linalg.inv(seen.T @ information @ seen + open_)
    together = np.abs(seen[(np.abs(seen).sum(axis=1) > 1.0)]).sum(axis=0) > 0.0
    rivals = tuple(name for name, shared in zip(names, together, strict=True) if shared)
    return SensorCheck(
        names, whole @ seen.T @ information @ mean, whole, samples, rms, what, rivals
    )
