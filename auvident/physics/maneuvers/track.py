"""Integral of a rate, track of a maneuver, and where a signal first reaches a value."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def integral_of(time_s: ArrayLike, rate: ArrayLike) -> Array:
    """Integral (n,) of a rate (n,) since the first sample, by the trapezoidal rule."""
    t, rate = np.asarray(time_s, dtype=float), np.asarray(rate, dtype=float)
    steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(t)
    return np.concatenate(([0.0], np.cumsum(steps)))


def dead_reckoning(
    time_s: ArrayLike, u: ArrayLike, v: ArrayLike, heading_rad: ArrayLike
) -> tuple[Array, Array]:
    """North and east [m] since the first sample, from body velocities and heading."""
    u, v = np.asarray(u, dtype=float), np.asarray(v, dtype=float)
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    return (
        integral_of(time_s, u * cos - v * sin),
        integral_of(time_s, u * sin + v * cos),
    )


def track_of(time_s: Array, states: Array) -> Array:
    """Dead-reckoned track (n, 2) of planar states (n, 4), north and east from the start [m]."""
    north, east = dead_reckoning(time_s, states[:, 0], states[:, 1], states[:, 3])
    return np.column_stack([north, east])


def first_crossing(t: Array, x: Array, value: float) -> float | None:
    """Time at which `x` first reaches `value` from below, interpolated; None if it does not."""
    above = np.flatnonzero(x >= value)
    if above.size == 0:
        return None
    i = int(above[0])
    if i == 0:
        return float(t[0])
    share = (value - x[i - 1]) / (x[i] - x[i - 1])
    return float(t[i - 1] + share * (t[i] - t[i - 1]))


def headings_from_start(measured: Array, predicted: Array) -> tuple[Array, Array]:
    """Headings counted from where a prediction starts.

    Whether the vehicle set out to the north or to the south is no property of the maneuver, and
    must not count in the spread of what was measured.

    Parameters
    ----------
    measured, predicted : (n,) array
        Headings [rad].
    """
    return measured - predicted[0], predicted - predicted[0]
