"""Spikes in bursts or all over a channel, which a filter for lone outliers spares.

A Hampel filter of eleven samples over the rows beside a step that no motion explains. The limit
follows the spread of the window, so that an onset stays; a change of level stays because most of
the window is on its side.
"""

import numpy as np

from auvident.constants import MEDIAN_OF_ABS_TO_STD
from auvident.schema.channels import Channel
from auvident.stages.ingest.pace import Pace, step_limit
from auvident.stages.ingest.resample import median_period

REACH = 5  # samples on either side: four wild ones in a row are outvoted
SPREADS = 4.0  # of the window's own spread: a ramp or a peak of motion has it, too
BESIDE = 4  # rows from an impossible step that are looked at
MILDER = 0.5  # of the limit beside a spike: the rest of a burst
ROUNDS = 4  # what is near a burst is judged again without it
CHUNK = 100_000  # windows at a time
LEAST, LEAST_SHARE = 8, 0.002  # so many samples and share of the channel are a fault of its own


def find_spikes(time_s: np.ndarray, values: np.ndarray, channel: Channel, pace: Pace) -> np.ndarray:
    """Samples that leave the path of their neighbours faster than the vehicle can.

    Parameters
    ----------
    time_s, values : numpy.ndarray
        Samples in ascending time without lone outliers, angles unwrapped, shape (n,).
    channel : Channel
        What they are.
    pace : Pace
        Of the vehicle.

    Returns
    -------
    numpy.ndarray of bool
        True where a sample is a spike, shape (n,).
    """
    flags = np.zeros(values.size, dtype=bool)
    limit = step_limit(values, channel, pace)
    if limit is None:
        return flags
    for _ in range(ROUNDS):
        kept = np.flatnonzero(~flags) if flags.any() else slice(None)
        time, x = time_s[kept], values[kept]
        wild = limit.wild(time, x)
        if not wild.size:
            break
        least = float(limit.over(np.asarray(median_period(time))))
        found = _far_from_middle(x, _around(wild, x.size), least)
        if not found.size:
            break
        milder = _far_from_middle(x, _around(found, x.size), least * MILDER)
        for rows in (found, milder):
            flags[rows if isinstance(kept, slice) else kept[rows]] = True
    enough = flags.sum() >= max(LEAST, LEAST_SHARE * flags.size)
    return flags if enough else np.zeros_like(flags)


def _around(at: np.ndarray, size: int) -> np.ndarray:
    """Samples up to `BESIDE` rows from some of them, as indices."""
    near = np.zeros(size, dtype=bool)
    for shift in range(-BESIDE, BESIDE + 1):
        near[np.clip(at + shift, 0, size - 1)] = True
    return np.flatnonzero(near)


def _far_from_middle(values: np.ndarray, near: np.ndarray, least: float) -> np.ndarray:
    """Those of the samples `near` that are far from the median of their window."""
    found = []
    for chunk in np.array_split(near, max(1, near.size // CHUNK)):
        first = np.clip(chunk - REACH, 0, max(values.size - 2 * REACH - 1, 0))
        rows = first[:, None] + np.arange(min(2 * REACH + 1, values.size))
        window = values[rows]
        middle = np.median(window, axis=1)
        spread = np.median(np.abs(window - middle[:, None]), axis=1)
        off = np.abs(values[chunk] - middle)
        found.append(chunk[off > np.maximum(least, SPREADS * MEDIAN_OF_ABS_TO_STD * spread)])
    return np.concatenate(found)
