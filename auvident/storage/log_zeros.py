"""Rows of a table of several sensors in which one has no reading, and the logger wrote 0."""

from collections.abc import Sequence

import numpy as np

from auvident.schema.artifacts import Finding

ZEROS = "zero_for_empty"  # reason under which such rows are counted
LEAST_READINGS = 50  # fewer show no rhythm
# In a log with a row for each reading a zero makes the interval between two others twice as long.
# Where zeros stand between readings that come in one rhythm, they are none.
RHYTHM, RHYTHM_SHARE = (0.5, 1.6), 0.9  # of the usual interval; of all intervals
BETWEEN_SHARE = 0.2  # of the intervals have zeros within
APART = 0.9  # of the usual interval: a reading of zero is not closer to another


def zeros_between(time_s: np.ndarray, columns: Sequence[np.ndarray]) -> np.ndarray:
    """Which rows hold zeros that are no readings.

    A single zero for longer than the rhythm of the readings may be one, as of a rudder amidships:
    it is left where a reading would have been. Several columns of a sensor are not zero at once.

    Parameters
    ----------
    time_s : numpy.ndarray
        Times of the rows, shape (n,).
    columns : sequence of numpy.ndarray
        Numbers of one sensor as they stand in the file, shape (n,) each.

    Returns
    -------
    numpy.ndarray of bool
        Shape (n,).
    """
    none = np.zeros(time_s.size, dtype=bool)
    zero = np.logical_and.reduce([x == 0.0 for x in columns])
    if not zero.any():
        return none
    readings = np.flatnonzero(~zero & np.logical_or.reduce([np.isfinite(x) for x in columns]))
    if readings.size < LEAST_READINGS:
        return none
    apart = np.diff(time_s[readings])
    usual = float(np.median(apart))
    in_rhythm = (apart >= RHYTHM[0] * usual) & (apart <= RHYTHM[1] * usual)
    counts = np.concatenate(([0], np.cumsum(zero)))
    between = counts[readings[1:]] > counts[readings[:-1]]
    if in_rhythm.mean() < RHYTHM_SHARE or between[in_rhythm].mean() < BETWEEN_SHARE:
        return none
    if len(columns) > 1:
        return zero
    return zero & ~_may_be_readings(time_s, readings, usual)


def _may_be_readings(time_s: np.ndarray, readings: np.ndarray, usual: float) -> np.ndarray:
    """Rows that are so far from the readings before and after that one may have been there."""
    rows = np.arange(time_s.size)
    after = np.searchsorted(readings, rows)
    before = np.append(-np.inf, time_s[readings])[after]
    behind = np.append(time_s[readings], np.inf)[after]
    far = (time_s - before >= APART * usual) & (behind - time_s >= APART * usual)
    # of them one in each interval
    tick = np.floor((time_s - np.where(np.isfinite(before), before, time_s[0])) / usual + 0.1)
    first = np.ones(time_s.size, dtype=bool)
    first[1:] = (tick[1:] != tick[:-1]) | (after[1:] != after[:-1])
    return far & first


def zeros_told(sensor: str, where: str, names: Sequence[str], zeros: np.ndarray) -> Finding:
    """What is said of rows that hold zeros and no readings."""
    return Finding(
        code="zeros_for_empty",
        message=f"{zeros.sum()} of {zeros.size} rows have no reading of the {sensor} but 0 in "
        f"{', '.join(names)}: its readings come in a rhythm between them; they were left out",
        where=where,
        value=float(np.mean(zeros)),
        remedy="Let the logger leave such cells empty: a reading of 0 cannot be told from none.",
    )
