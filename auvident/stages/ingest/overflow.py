"""Readings beyond the range of a sensor whose whole numbers overflow.

They come out at its other end: a yaw rate that passes the end of the range jumps to the opposite
one within a row, and back when the turn eases. No vehicle does that, and neither does a spike,
which comes from the middle.
"""

import itertools

import numpy as np

from auvident.schema.channels import Channel
from auvident.stages.ingest.pace import Pace, step_limit

SYMMETRIC = 0.1  # of a jump: its middle is zero, ...
ALIKE = 0.1  # ... and all are as high, ...
BEYOND_SHARE = 0.005  # ... for nothing is beyond the range but some spikes
FEWEST = 2  # jumps: out of the range and back


def find_overflows(
    time_s: np.ndarray, values: np.ndarray, channel: Channel, pace: Pace
) -> np.ndarray:
    """Samples that went out of the range, from each jump to the one back.

    Parameters
    ----------
    time_s, values : numpy.ndarray
        Samples in ascending time, shape (n,).
    channel : Channel
        What they are.
    pace : Pace
        Of the vehicle.

    Returns
    -------
    numpy.ndarray of bool
        Shape (n,).
    """
    flags = np.zeros(values.size, dtype=bool)
    limit = step_limit(values, channel, pace)
    if limit is None:
        return flags
    jumps = _full_jumps(values, limit.wild(time_s, values), limit.noise)
    if jumps.size < FEWEST:
        return flags
    return _between_pairs(values, jumps)


def _full_jumps(values: np.ndarray, at: np.ndarray, noise: float) -> np.ndarray:
    """Those of some steps that go over the whole range, from one side of zero to the other."""
    before, after = values[at], values[at + 1]
    heights = np.abs(after - before)
    across = np.abs(before + after) <= np.maximum(SYMMETRIC * heights, noise)
    at, heights = at[across], heights[across]
    if not at.size:
        return at
    height = float(np.median(heights))
    beyond = np.abs(values) > 0.5 * (1.0 + ALIKE) * height + noise
    if np.count_nonzero(beyond) > BEYOND_SHARE * values.size:
        return at[:0]
    return np.asarray(at[np.abs(heights - height) <= np.maximum(ALIKE * height, noise)])


def _between_pairs(values: np.ndarray, jumps: np.ndarray) -> np.ndarray:
    """Samples from each jump to the next if they stay at that end of the range; none twice."""
    flags, last = np.zeros(values.size, dtype=bool), -1
    for first, end in itertools.pairwise(jumps.tolist()):
        out = values[first + 1 : end + 1]
        if first != last and (out * out[0] > 0.0).all():
            flags[first + 1 : end + 1] = True
            last = end
    return flags
