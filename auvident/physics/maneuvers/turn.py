"""Figures of a turning circle (IMO MSC.137(76), ITTC 7.5-04-02-01)."""

import numpy as np
from numpy.typing import ArrayLike

from auvident.physics.maneuvers.track import (
    Array,
    dead_reckoning,
    first_crossing,
    integral_of,
)

ADVANCE_RAD = np.pi / 2  # IMO: advance and transfer at 90 degrees change of heading
TACTICAL_RAD = np.pi  # IMO: tactical diameter at 180 degrees
STEADY_SHARE = 1 / 3  # the last third of a turn is taken for steady
STEADY_FROM_RAD = np.radians(120)  # and only where the turn went this far: transients are over


def turn_figures(
    time_s: ArrayLike,
    u: ArrayLike,
    v: ArrayLike,
    r: ArrayLike,
    rudder_rad: ArrayLike,
    heading_rad: ArrayLike | None = None,
    approach_speed_mps: float | None = None,
) -> dict[str, float]:
    """Figures of a turning circle that begins with the rudder execute.

    Parameters
    ----------
    time_s : array_like, shape (n,)
        From rudder execute to rudder release [s].
    u, v, r : array_like, shape (n,)
        Surge and sway [m/s], yaw rate [rad/s] (positive to starboard).
    rudder_rad : array_like, shape (n,)
        Rudder angle [rad].
    heading_rad : array_like, shape (n,), optional
        Unwrapped heading [rad]; else `r` is integrated.
    approach_speed_mps : float, optional
        Speed before the execute; else the speed at the first sample.

    Returns
    -------
    dict of str to float
        ``rudder_deg`` (median, sign as given), ``heading_change_deg`` (signed, to starboard
        positive), ``duration_s``, ``approach_speed_mps``; ``advance_m`` (along the original
        course at 90 degrees), ``transfer_m`` (across it, towards the turn), ``time_to_90_s``;
        ``tactical_diameter_m`` (across the original course at 180 degrees), ``time_to_180_s``;
        of the last third: ``steady_r_degps``, ``steady_speed_mps``, ``speed_loss`` (1 - steady
        over approach speed), ``steady_drift_deg`` (atan2(-v, u): positive with the bow inside a
        turn to starboard), ``steady_diameter_m`` (2 U / |r|).
    """
    t = np.asarray(time_s, dtype=float)
    u, v, r = (np.asarray(x, dtype=float) for x in (u, v, r))
    heading = integral_of(t, r) if heading_rad is None else np.asarray(heading_rad)
    turned = heading - heading[0]
    approach = float(np.hypot(u[0], v[0])) if approach_speed_mps is None else approach_speed_mps
    figures = {
        "rudder_deg": float(np.degrees(np.median(np.asarray(rudder_rad)))),
        "heading_change_deg": float(np.degrees(turned[-1])),
        "duration_s": float(t[-1] - t[0]),
        "approach_speed_mps": float(approach),
    }
    figures |= _track_figures(t, u, v, turned)
    if abs(turned[-1]) >= STEADY_FROM_RAD:
        figures |= _steady_figures(t, u, v, r, approach)
    return figures


def _track_figures(t: Array, u: Array, v: Array, turned: Array) -> dict[str, float]:
    """Advance, transfer and tactical diameter in axes of the original course."""
    side = 1.0 if turned[-1] >= 0 else -1.0
    along, across = dead_reckoning(t, u, v, turned)
    figures: dict[str, float] = {}
    time = first_crossing(t, side * turned, ADVANCE_RAD)
    if time is not None:
        figures["advance_m"] = float(np.interp(time, t, along))
        figures["transfer_m"] = float(side * np.interp(time, t, across))
        figures["time_to_90_s"] = time - float(t[0])
    time = first_crossing(t, side * turned, TACTICAL_RAD)
    if time is not None:
        figures["tactical_diameter_m"] = float(side * np.interp(time, t, across))
        figures["time_to_180_s"] = time - float(t[0])
    return figures


def _steady_figures(t: Array, u: Array, v: Array, r: Array, approach: float) -> dict[str, float]:
    """Means over the last third of the turn."""
    late = t >= t[-1] - STEADY_SHARE * (t[-1] - t[0])
    u_mean, v_mean, r_mean = (float(np.mean(x[late])) for x in (u, v, r))
    speed = float(np.hypot(u_mean, v_mean))
    figures = {
        "steady_r_degps": float(np.degrees(r_mean)),
        "steady_speed_mps": speed,
        "steady_drift_deg": float(np.degrees(np.arctan2(-v_mean, u_mean))),
    }
    if approach > 0:
        figures["speed_loss"] = 1.0 - speed / approach
    if r_mean != 0:
        figures["steady_diameter_m"] = 2.0 * speed / abs(r_mean)
    return figures
