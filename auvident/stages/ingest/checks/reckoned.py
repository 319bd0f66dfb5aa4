"""Positions and headings that are computed from the sensor they would be held against.

A position by dead reckoning follows the integrated velocity as closely as two sensors never do; it
agrees with whatever scale that has. Where the integration is late, or is for another point of the
hull, is left free. So it is with a heading that is the integral of the gyro's yaw rate.
"""

import numpy as np

from auvident.stages.ingest.checks.seen import Array, Seen
from auvident.stages.ingest.response import Relation

PIECE_S = 20.0  # as of the track
LEAST_PIECES = 12  # for four numbers each way
# Median of what is left of a displacement, over the way: 0.0014 to 0.0017 of reckoned positions,
# logged to 0.1 mm, 0.0052 at least of 73 drawn trials with a position of its own
SAME = 0.0025
FAR, ROUNDS = 4.0, 4  # medians, beyond which a displacement does not count in the next fit
SAME_SCALE = 3e-3  # of the scale from 1: an integral has that of what it integrates
# Share of the rate of the heading that the gyro leaves, and its gain from 1: 3e-6 and 1e-4 of an
# integral; 1e-4 at least is left in 73 drawn trials, by roll and pitch alone
SAME_RATE, SAME_GAIN = 2e-5, 1e-3
POSITION, HEADING = (
    "the position is computed from the DVL",
    "the heading is computed from the gyro",
)


def is_integrated(found: Relation) -> bool:
    """Whether a heading is the integral of the yaw rate that it would test."""
    close = abs(float(found.theta[0]) - 1.0) <= SAME_GAIN
    return bool(close and 1.0 - found.explained <= SAME_RATE)


def is_reckoned(seen: Seen) -> bool:
    """Whether the position is the integral of the DVL's velocity, with or without the pitch."""
    if not seen.has("u_mps", "v_mps", "heading_rad", "north_m", "east_m"):
        return False
    pitch = np.nan_to_num(seen.whole("pitch_rad"))
    return any(_follows(seen, seen.whole("u_mps") * ahead) for ahead in (1.0, np.cos(pitch)))


def _follows(seen: Seen, ahead: Array) -> bool:
    """Whether the fixes follow a velocity as an integral does."""
    time, heading = seen.whole("time_s"), seen.whole("heading_rad")
    velocity = (ahead + 1j * seen.whole("v_mps")) * np.exp(1j * heading)
    steps = 0.5 * (velocity[1:] + velocity[:-1]) / seen.trial.rate_hz
    known = np.isfinite(steps)
    track = np.concatenate(([0.0], np.cumsum(np.where(known, steps, 0.0))))
    lost = np.concatenate(([0], np.cumsum(~known)))
    fix_s, place = _fixes(seen, time[0], time[-1])
    if fix_s.size <= LEAST_PIECES:
        return False
    way, change = (np.diff(_at(fix_s, time, x)) for x in (track, np.nan_to_num(velocity)))
    turned = np.diff(np.exp(1j * np.interp(fix_s, time, np.unwrap(np.nan_to_num(heading)))))
    good = np.diff(np.interp(fix_s, time, lost)) == 0.0
    if good.sum() < LEAST_PIECES:
        return False
    x = np.column_stack((way, np.diff(fix_s).astype(complex), change, turned))[good]
    moved = np.diff(place)[good]
    keep = np.ones(moved.size, bool)
    for _ in range(ROUNDS):  # what was dropped from one of both is not the same in the other
        theta, *_ = np.linalg.lstsq(x[keep], moved[keep], rcond=None)
        left = np.abs(moved - x @ theta)
        keep = left <= FAR * np.median(left)
    close = np.median(left) <= SAME * np.median(np.abs(way[good]))
    return bool(close and abs(abs(theta[0]) - 1.0) <= SAME_SCALE)


def _at(moments: Array, time: Array, values: np.ndarray) -> np.ndarray:
    """Complex values at some moments."""
    return np.asarray(
        np.interp(moments, time, values.real) + 1j * np.interp(moments, time, values.imag)
    )


def _fixes(seen: Seen, start_s: float, end_s: float) -> tuple[Array, np.ndarray]:
    """Times and places, north + i east, of fixes as logged, a piece apart."""
    log = seen.raw.sensors["position"]
    place = log.values["north_m"] + 1j * log.values["east_m"]
    inside = np.isfinite(place) & (log.time_s >= start_s) & (log.time_s <= end_s)
    time, first = np.unique(log.time_s[inside], return_index=True)
    if time.size < 2:
        return time, place[inside][first]
    every = max(round(PIECE_S / float(np.median(np.diff(time)))), 1)
    return time[::every], place[inside][first][::every]
