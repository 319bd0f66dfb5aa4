"""Numbers that stand for "no value": a lost bottom as 0, an overflow as -32.768, a 9999.

A fill value recurs exactly, and the readings jump to it and back in steps that no motion
explains, however long it lasts. A zero at rest is reached gradually and stays.
"""

import numpy as np

from auvident.schema.channels import Channel
from auvident.schema.logs import UNITS
from auvident.stages.ingest.pace import Pace, StepLimit, excerpt, step_limit

LEAST_ROWS = 3  # equal to the last digit, in places where no motion leads,
LEAST_RUNS = 2  # apart from each other, of a number that nobody writes for "none"
LEAST_SHARE = 1e-4  # and so many of the channel: in a long one some are equal by chance
APART_SHARE = 0.8  # of the rows with this value are such; of zero, which means something else, too

# What loggers write for "none", without the sign and in any decade; the largest numbers of two
# and four bytes among them.
SENTINELS = np.array(
    [999.0, 9999.0, 99999.0, 999999.0, 32767.0, 32768.0, 65535.0, 2147483647.0, 2147483648.0]
)
HUGE = 1e15  # a number beyond it is a fill value of a float: 1e30, 9.97e36, 1.8e308
FULL_TURN = 2.02 * np.pi  # with some rounding
WRAPPED_SHARE = 0.9  # of the samples within a turn: the log counts no turns
MOST_TURNS = 1e4  # that a heading without wrap counts in a trial
SPIKE_ROWS = 2  # of wild samples in a row; more are a stretch of their own
DECADES = 10.0 ** np.arange(-4, 5)
TOLERANCE = 1e-6  # of the number: it came through a conversion and a text


def is_sentinel(values: np.ndarray, channel: Channel) -> np.ndarray:
    """Numbers that in some unit of the channel are written for "none", shape (n,).

    Only to name what is beyond the plausible range anyway.
    """
    found = np.abs(values) > HUGE
    size = np.where(found, 1.0, np.abs(values))
    for dimension, factor in UNITS.values():
        if dimension == channel.unit:
            for decade in DECADES:
                ratio = size / (factor * decade)
                nearest = SENTINELS[np.abs(SENTINELS[:, None] - ratio).argmin(axis=0)]
                found |= np.abs(ratio - nearest) <= TOLERANCE * nearest
    return found


def is_impossible(values: np.ndarray, channel: Channel) -> np.ndarray:
    """Values beyond what the channel can have, shape (n,); an angle may have been unwrapped."""
    size = np.abs(values)
    if not channel.is_angle:
        return size > channel.plausible
    known = np.count_nonzero(~np.isnan(size))
    wrapped = np.count_nonzero(size <= FULL_TURN) >= WRAPPED_SHARE * known
    return size > (FULL_TURN if wrapped else MOST_TURNS * FULL_TURN)


def find_fills(time_s: np.ndarray, values: np.ndarray, channel: Channel, pace: Pace) -> np.ndarray:
    """Samples of a measured channel that are fill values within its plausible range.

    Parameters
    ----------
    time_s, values : numpy.ndarray
        Samples in ascending time, as logged (angles not unwrapped), shape (n,).

    Returns
    -------
    numpy.ndarray of bool
        Shape (n,).
    """
    flags = np.zeros(values.size, dtype=bool)
    some = excerpt(values)
    others = some[some != 0.0]  # a fifth of zeros would make jumps the usual step
    if _rows_of_a_run(others) > 1:  # beside copies every step would be an unusual one
        others = others[_begins(others)]
    limit = step_limit(np.unwrap(others) if channel.is_angle else others, channel, pace)
    if limit is None:
        return flags
    starts, ends, sure = _jumped_runs(time_s, values, channel, limit)
    if not sure.any():
        return flags
    kinds, kind = np.unique(values[starts], return_inverse=True)
    rows = np.bincount(kind[sure], weights=(ends - starts)[sure], minlength=kinds.size)
    place = np.minimum(np.searchsorted(kinds, values), kinds.size - 1)
    total = np.bincount(place[values == kinds[place]], minlength=kinds.size)
    none = (kinds == 0.0) | is_sentinel(kinds, channel)
    least = LEAST_ROWS * np.where(none, 1, _rows_of_a_run(values))  # copies are one reading
    least = np.maximum(least, LEAST_SHARE * values.size)
    again = np.bincount(kind[sure], minlength=kinds.size) >= LEAST_RUNS  # a held fix comes once
    again |= none
    is_fill = again & (rows >= least) & ((rows >= APART_SHARE * total) | (kinds == 0.0))
    edges = np.zeros(values.size + 1, dtype=int)
    edges[starts[is_fill[kind]]] += 1
    edges[ends[is_fill[kind]]] -= 1
    return np.cumsum(edges[:-1]) > 0


def _begins(values: np.ndarray) -> np.ndarray:
    """Rows with another value than the one before, shape (n,)."""
    return np.concatenate(([True], values[1:] != values[:-1]))[: values.size]


def _rows_of_a_run(values: np.ndarray) -> int:
    """Usual number of rows in a row with one value: more than 1 where a slow sensor is held."""
    starts = np.flatnonzero(_begins(values))
    return int(np.median(np.diff(starts, append=values.size))) if starts.size else 1


def _jumped_runs(
    time: np.ndarray, values: np.ndarray, channel: Channel, limit: StepLimit
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Runs of one value, start and end, that are entered or left by an impossible step.

    True where both are; else the other is a step beyond noise, over a gap in time.
    """
    steps = np.diff(values)
    if channel.is_angle:
        steps = (steps + np.pi) % (2.0 * np.pi) - np.pi
    changes = np.flatnonzero(steps)
    jumps = np.flatnonzero(np.abs(steps, out=steps) > limit.least)
    if not jumps.size:
        return jumps, jumps, np.zeros(0, dtype=bool)
    impossible = steps[jumps] > limit.over(time[jumps + 1] - time[jumps])
    starts, ends = np.concatenate(([0], jumps + 1)), np.append(jumps + 1, values.size)
    entered = np.concatenate(([not _is_left_for_a_spike(values, starts, ends)], impossible))
    left = np.concatenate(
        (
            impossible,
            [not _is_left_for_a_spike(values[::-1], *_reversed(values.size, starts, ends))],
        )
    )
    one = np.searchsorted(changes, starts) == np.searchsorted(changes, ends - 1)
    one &= entered | left
    return starts[one], ends[one], (entered & left)[one]


def _is_left_for_a_spike(values: np.ndarray, starts: np.ndarray, ends: np.ndarray) -> bool:
    """Whether the first stretch goes on behind a few wild samples: a vehicle still at rest."""
    if starts.size < 3 or ends[1] - starts[1] > SPIKE_ROWS:
        return False
    return bool(values[starts[2]] == values[ends[0] - 1])


def _reversed(size: int, starts: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same stretches counted from the end."""
    return size - ends[::-1], size - starts[::-1]


def fill_in_same_rows(filled: dict[str, np.ndarray], values: dict[str, np.ndarray]) -> None:
    """Mark the other channels of a row that has a fill value where they hold zero or the same.

    A sway velocity of 0 stands out nowhere; beside a surge velocity of 0 it is the same loss.
    """
    rows = {c: np.flatnonzero(mask) for c, mask in filled.items()}
    for column, found in rows.items():
        for other in filled:
            there = values[other][found]
            filled[other][found] |= (there == 0.0) | (there == values[column][found])
