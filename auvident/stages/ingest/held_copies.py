"""Samples that a log copies into the rows that follow: of a slow sensor, or in a drop-out."""

import numpy as np

from auvident.schema.logs import RawSensor
from auvident.stages.ingest.flat import are_abrupt
from auvident.stages.ingest.outliers import STUCK_ROWS, STUCK_SHARE, of_rows

HELD_SENSORS = ("dvl", "gyro", "attitude", "position")  # a depth may well stand still
MIN_HELD_RUNS = 20  # fewer changes do not show a pattern
HELD_QUANTILE = 0.1  # so many of the runs may be shorter than two rows
# A sensor may hold its value of itself (a depth, a command): only changes at multiples of one
# interval show that it is sampled by a slower clock than that of the rows.
FEW_PERIODS = 5.5  # of more between two changes, jitter leaves nothing to be seen
PERIOD_SHARE = 0.95  # of the intervals are multiples,
PERIOD_WITHIN = 0.15  # within so much of the period, or a row where that is longer
MOST_WITHIN = 0.3  # ... but no more: half of it would be any interval
STUCK_SENSORS = ("dvl", "gyro")  # a heading is smoothed, and stands still on a straight run


def keep_one_of_held(raw: RawSensor, rows: np.ndarray) -> np.ndarray | None:
    """Rows that carry a new sample, where the last one is copied into the rows that follow.

    Logs of a fast sensor carry copies of a slow one, and some sensors repeat their last value
    in a drop-out. Copies would count one measurement several times, delay it and hide the gap.

    Parameters
    ----------
    raw : RawSensor
        Sensor as read.
    rows : numpy.ndarray
        Indices of its rows in ascending time, shape (n,).

    Returns
    -------
    numpy.ndarray of bool or None
        True for the rows to keep, shape (n,); None when there are no copies.
    """
    columns = [of_rows(raw.values[column], rows) for column in raw.values]
    lengths = _lengths(raw, columns)
    if lengths is None:
        return None
    starts = np.concatenate(([0], np.cumsum(lengths)[:-1]))
    first = np.zeros(rows.size, dtype=bool)
    first[starts] = True
    if _is_slow(lengths):
        return first
    # empty rows are drop-outs as they are
    known = np.logical_or.reduce([np.isfinite(x[starts]) for x in columns])
    stuck = (lengths >= STUCK_ROWS) & (raw.sensor in STUCK_SENSORS) & known
    repeats = rows.size - lengths.size - int(np.sum((lengths - 1)[~known]))
    if repeats > STUCK_SHARE * rows.size:
        stuck = _long_drop_outs(columns, starts, lengths, known, stuck)
    return first | ~np.repeat(stuck, lengths) if stuck.any() else None


def holds_throughout(raw: RawSensor, rows: np.ndarray) -> bool:
    """Whether each sample of a sensor is copied: it is slower than the log that has it."""
    lengths = _lengths(raw, [of_rows(raw.values[column], rows) for column in raw.values])
    return lengths is not None and _is_slow(lengths)


def slow_samples(time_s: np.ndarray, values: np.ndarray) -> np.ndarray | None:
    """Rows at which a slow clock took a sample that the log copies into the rows that follow.

    Parameters
    ----------
    time_s, values : numpy.ndarray
        Rows of one channel in ascending time, NaN where empty, shape (n,).

    Returns
    -------
    numpy.ndarray of bool or None
        True at changes and, where a value stays, once in each period of the slow clock, and at
        empty rows; None where the rows are samples of their own, or nothing tells.
    """
    known = np.flatnonzero(np.isfinite(values))
    time, values = time_s[known], values[known]
    starts = np.flatnonzero(values[1:] != values[:-1]) + 1
    period = _slow_period(time, starts)
    if period is None:
        return None
    starts = np.concatenate(([0], starts))
    spans = np.diff(time[starts], append=time[-1])
    counts = np.maximum(np.rint(spans / period).astype(int), 1)
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    ticks = np.repeat(time[starts], counts) + period * within
    half_row = 0.5 * float(np.median(np.diff(time)))
    taken = np.minimum(np.searchsorted(time, ticks - half_row), time.size - 1)
    found = np.ones(time_s.size, dtype=bool)
    found[known] = False
    found[known[taken]] = True
    return found


def _slow_period(time: np.ndarray, starts: np.ndarray) -> float | None:
    """Interval of which those between changes are multiples, if it is longer than a row."""
    apart = np.diff(time[starts])
    if apart.size < MIN_HELD_RUNS:
        return None
    row = float(np.median(np.diff(time)))
    shortest = apart[apart <= 1.6 * np.quantile(apart, HELD_QUANTILE)]
    period = float(np.mean(shortest))
    if period < 1.5 * row:
        return None
    near = apart[apart <= FEW_PERIODS * period]
    count = np.maximum(np.rint(near / period), 1.0)
    within = max(min(row, MOST_WITHIN * period), PERIOD_WITHIN * period)
    fits = np.abs(near - count * period) <= within
    return period if near.size >= MIN_HELD_RUNS and fits.mean() >= PERIOD_SHARE else None


def _lengths(raw: RawSensor, columns: list[np.ndarray]) -> np.ndarray | None:
    """How many rows each set of values stands for; None where too few show a pattern."""
    if raw.sensor not in HELD_SENSORS or columns[0].size <= MIN_HELD_RUNS:
        return None
    starts = np.concatenate(([0], np.flatnonzero(_changes(columns)) + 1))
    lengths = np.diff(np.concatenate((starts, [columns[0].size])))
    return lengths if lengths.size >= MIN_HELD_RUNS else None


def _is_slow(lengths: np.ndarray) -> bool:
    return bool(np.quantile(lengths[:-1], HELD_QUANTILE) >= 2)


def _long_drop_outs(
    columns: list[np.ndarray],
    starts: np.ndarray,
    lengths: np.ndarray,
    known: np.ndarray,
    stuck: np.ndarray,
) -> np.ndarray:
    """Which runs are drop-outs where copies are many: the bottom is lost for minutes.

    All columns stop at once, as no motion settles, and repeat themselves hardly anywhere else:
    coarse digits do, and a simulated log without noise comes to rest gradually.
    """
    outside = ~stuck & known
    few = np.sum(lengths[outside] - 1) <= STUCK_SHARE * np.sum(lengths[outside])
    filled = [x for x in map(np.nan_to_num, columns) if np.ptp(x) > 0.0]  # w may be zeros
    abrupt = np.logical_and.reduce([are_abrupt(x, starts[stuck]) for x in filled])
    found = np.zeros_like(stuck)
    found[np.flatnonzero(stuck)] = abrupt & few
    return found


def _changes(columns: list[np.ndarray]) -> np.ndarray:
    """Whether any column has another value than in the row before, shape (n - 1,)."""
    changed = np.zeros(columns[0].size - 1, dtype=bool)
    for x in columns:
        empty = np.isnan(x)  # an empty cell equals an empty cell
        changed |= (x[1:] != x[:-1]) & ~(empty[1:] & empty[:-1])
    return changed
