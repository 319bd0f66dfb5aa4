"""Figures of a straight run with thrust steps: levels of the propeller rate and their speeds."""

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from auvident.constants import VehicleTime
from auvident.physics.maneuvers.plateaus import odd_samples, plateaus, running_median
from auvident.physics.maneuvers.track import Array

RPM_LEVEL_SHARE = 0.025  # of the highest rpm: ripple of a motor control that is no step
RPM_STEP_SHARE = 0.05  # of the highest rpm: 10 % of thrust, the least step seen in the speed
SHORTEST_LEVEL_S: VehicleTime = 5.0  # shorter is a ramp
SETTLED_SHARE = 0.5  # of a level: its second half gives the steady speed


def straight_figures(
    time_s: ArrayLike, u: ArrayLike, rpm: ArrayLike
) -> dict[str, float | list[float]]:
    """Figures of a straight run with thrust steps.

    Parameters
    ----------
    time_s : array_like, shape (n,)
        Time [s], equidistant.
    u : array_like, shape (n,)
        Surge velocity [m/s].
    rpm : array_like, shape (n,)
        Propeller rate [1/min].

    Returns
    -------
    dict
        ``rpm_levels``, ``level_start_s`` (since the first sample), ``level_duration_s`` and
        ``steady_speed_mps`` (mean of the second half of each level), one entry per level;
        ``rpm_steps``, one less; ``steps``, their number.
    """
    t, u = np.asarray(time_s, dtype=float), np.asarray(u, dtype=float)
    levels = rpm_levels(np.asarray(rpm, dtype=float), 1.0 / float(np.median(np.diff(t))))
    value = [level for _, _, level in levels]
    settled = [
        float(np.mean(u[stop - max(1, int(SETTLED_SHARE * (stop - start))) : stop]))
        for start, stop, _ in levels
    ]
    last = t.size - 1
    return {
        "steps": float(max(0, len(levels) - 1)),
        "rpm_levels": value,
        "rpm_steps": [b - a for a, b in pairwise(value)],
        "level_start_s": [float(t[start] - t[0]) for start, _, _ in levels],
        "level_duration_s": [float(t[min(b, last)] - t[a]) for a, b, _ in levels],
        "steady_speed_mps": settled,
    }


def rpm_levels(
    rpm: Array, rate_hz: float, noise_rpm: float = 0.0, reference_rpm: float | None = None
) -> list[tuple[int, int, float]]:
    """Constant levels of the propeller rate as (start, stop, rpm), half-open sample ranges.

    Parameters
    ----------
    rpm : ndarray, shape (n,)
        Propeller rate [1/min].
    rate_hz : float
        Samples per second.
    noise_rpm : float
        Standard deviation of its noise; four of them stay within a level.
    reference_rpm : float, optional
        The rate to which the shares of ripple and step refer; else the highest one.
    """
    if rpm.size == 0:
        return []
    x = running_median(rpm, odd_samples(0.5, rate_hz))
    reference = float(np.max(np.abs(x))) if reference_rpm is None else reference_rpm
    ripple = max(RPM_LEVEL_SHARE * reference, 4 * noise_rpm, 1e-9)
    pieces = [p for p in plateaus(x, ripple) if p.samples >= SHORTEST_LEVEL_S * rate_hz]
    step = max(RPM_STEP_SHARE * reference, 2 * ripple)
    joined: list[tuple[int, int, float]] = []
    for piece in pieces:
        if joined and abs(joined[-1][2] - piece.level) < step:
            start = joined.pop()[0]
            joined.append((start, piece.stop, float(np.median(x[start : piece.stop]))))
        else:
            joined.append((piece.start, piece.stop, piece.level))
    return joined
