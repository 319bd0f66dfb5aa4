"""Inputs off for a row or two: a propeller at 600, 0 and 600 rpm in 0.2 s, a fin at 3, 50, 3 deg.

What a motor or a fin cannot do in the time; a command that is given and taken back stays, as do
the levels between which an autopilot switches. A propeller at -9999 is off however long that lasts.
"""

import numpy as np

from auvident.schema.channels import Channel
from auvident.stages.ingest.fill_values import is_sentinel
from auvident.stages.ingest.pace import Pace

MOST_ROWS = 2  # in a row
MOST_PASSAGES = 0.5  # lengths of way until the value is back: no vehicle has answered by then
AGREE = 0.2  # of the jump: the value is back
LEAST_SHARE = 0.3  # of the usual magnitude of the channel: the jump
USUAL = 0.9  # quantile of the magnitudes
MOST_SHARE = 0.2  # of the rows: beyond it this is how the vehicle is steered
SENTINEL_SHARE = 1.2  # of every other value: a fin angle that no fin has otherwise
FEWEST = 2  # times
# 1/min: from 9999 on no propeller turns so; from 999 on some do, but none astern by that alone
NEVER_RPM, NEVER_ASTERN_RPM = 9998.0, 998.0
# so many, and share of the rows, as of spikes of other sensors: a few may have been commanded
FEWEST_PULSES, PULSE_SHARE = 8, 0.002
REACHED = 0.99  # of the rows: two pulses in a row are among the others


def find_drop_outs(
    time_s: np.ndarray, values: np.ndarray, channel: Channel, pace: Pace
) -> np.ndarray:
    """Rows of an input that jump to zero, or far beyond its range, and back; an rpm of -9999.

    Parameters
    ----------
    time_s, values : numpy.ndarray
        Samples in ascending time, as logged, shape (n,).

    Returns
    -------
    numpy.ndarray of bool
        Shape (n,).
    """
    flags, turns = np.zeros(values.size, dtype=bool), channel.quantity == "rpm"
    for rows in range(1, MOST_ROWS + 1):
        first = _brief_runs(time_s, values, rows, pace)
        value = values[first]
        off = _is_beyond(values, value) | (turns & (value == 0.0))
        for k in range(rows):
            flags[first[off] + k] = True
    if flags.sum() < FEWEST or flags.sum() > MOST_SHARE * values.size:
        flags[:] = False
    return flags | _stands_for_none(values, channel) if turns else flags


def _stands_for_none(values: np.ndarray, channel: Channel) -> np.ndarray:
    """Propeller rates that loggers write for "none", far from all others; fewer than those."""
    size = np.abs(values)
    none = is_sentinel(values, channel) & (size >= NEVER_ASTERN_RPM)
    others = values[~none]
    if none.sum() >= others.size:
        return np.zeros_like(none)
    beyond = (size >= NEVER_RPM) & (size > SENTINEL_SHARE * np.abs(others).max())
    astern = (values < 0.0) & (others.min() >= 0.0)
    return none & (beyond | astern)


def find_pulses(time_s: np.ndarray, values: np.ndarray, channel: Channel, pace: Pace) -> np.ndarray:
    """Lone rows of an input far beyond all that is held or passed through otherwise.

    Parameters
    ----------
    time_s, values : numpy.ndarray
        Samples in ascending time without drop-outs, shape (n,).

    Returns
    -------
    numpy.ndarray of bool
        Shape (n,).
    """
    flags = np.zeros(values.size, dtype=bool)
    lone = _brief_runs(time_s, values, 1, pace)
    others = np.abs(np.delete(values, lone))
    if not lone.size or not others.size:
        return flags
    reach = float(np.quantile(others, REACHED))
    flags[lone[np.abs(values[lone]) > SENTINEL_SHARE * reach]] = True
    least = max(FEWEST_PULSES, PULSE_SHARE * values.size)
    usual_way = not least <= flags.sum() <= MOST_SHARE * values.size
    return np.zeros_like(flags) if usual_way else flags


def _is_beyond(values: np.ndarray, found: np.ndarray) -> np.ndarray:
    """Which of some values recur, and are far beyond every value that is none of them."""
    if not found.size:
        return np.zeros(0, dtype=bool)
    kinds, counts = np.unique(found, return_counts=True)
    candidates = kinds[counts >= FEWEST]
    others = np.abs(values[~np.isin(values, candidates)])
    reach = float(others.max()) if others.size else np.inf
    return np.isin(found, candidates[np.abs(candidates) > SENTINEL_SHARE * reach])


def _brief_runs(time: np.ndarray, values: np.ndarray, rows: int, pace: Pace) -> np.ndarray:
    """First rows of runs of one value, so many rows long, off the same value on either side."""
    least = LEAST_SHARE * float(np.quantile(np.abs(values), USUAL)) if values.size else 0.0
    if values.size < rows + 2 or least <= 0.0:
        return np.empty(0, dtype=int)
    start = np.arange(1, values.size - rows)
    left, right = values[start - 1], values[start + rows]
    jump = np.minimum(np.abs(values[start] - left), np.abs(values[start] - right))
    same = np.logical_and.reduce([values[start + k] == values[start] for k in range(rows)])
    brief = time[start + rows] - time[start] <= MOST_PASSAGES * pace.passage_s
    back = np.abs(right - left) <= AGREE * jump
    return start[same & brief & back & (jump >= least)]
