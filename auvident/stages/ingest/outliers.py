"""Samples that no motion of a vehicle can explain, and copies of a held sample."""

import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter

from auvident.schema.logs import RawSensor

WINDOW = 7  # samples of the running median: up to 3 wild ones in a row do not move it
MAX_RUN = 2  # wild samples in a row; a longer excursion may be motion and stays
MIN_SIGMAS = 6.0  # of the noise: once in 5e8 samples of a normal distribution
MIN_RESOLUTIONS = 3.0  # of the smallest step: a digit that toggles is no outlier
NEIGHBOUR_STEPS = 3.0  # times the largest step nearby: an onset or peak has such steps beside it
NEARBY = 5  # samples on either side whose steps count
NORMAL_MAD = 1.4826  # standard deviation over median absolute deviation, normal distribution

HELD_SENSORS = ("dvl", "gyro", "attitude")  # depth and position may well stand still
MIN_HELD_RUNS = 20  # fewer changes do not show a pattern
HELD_QUANTILE = 0.1  # so many of the runs may be shorter than two rows


def find_outliers(values: np.ndarray) -> np.ndarray:
    """Isolated samples far from a running median (Hampel filter with two guards).

    A sample goes only if its distance from the running median exceeds `MIN_SIGMAS` of the
    noise and `NEIGHBOUR_STEPS` times the largest step between samples nearby, in a run of at
    most `MAX_RUN`. The onset of a maneuver moves the samples that follow, too, and stays.

    Parameters
    ----------
    values : numpy.ndarray
        Samples in ascending time, angles unwrapped, shape (n,).

    Returns
    -------
    numpy.ndarray of bool
        True where a sample is an outlier, shape (n,).
    """
    flags = np.zeros(values.size, dtype=bool)
    if values.size < WINDOW:
        return flags
    residual = np.abs(values - median_filter(values, WINDOW, mode="nearest"))
    wild = residual > max(MIN_SIGMAS * noise_std(values), MIN_RESOLUTIONS * resolution(values))
    if not wild.any():
        return flags
    steps = np.abs(np.diff(values))
    steps[wild[1:] | wild[:-1]] = 0.0
    largest = np.zeros(values.size)
    largest[1:] = maximum_filter1d(steps, 2 * NEARBY + 1, mode="constant")
    largest[0] = largest[1]
    across = _step_across(values, wild)
    far = wild & (residual > NEIGHBOUR_STEPS * np.maximum(largest, across))
    return far & (_run_lengths(wild) <= MAX_RUN)


def _step_across(values: np.ndarray, wild: np.ndarray) -> np.ndarray:
    """Distance between the good samples on either side of each run of wild ones."""
    good = np.flatnonzero(~wild)
    if not good.size:
        return np.full(values.size, np.inf)
    index = np.arange(values.size)
    right = np.searchsorted(good, index)
    after = values[good[np.minimum(right, good.size - 1)]]
    before = values[good[np.maximum(right - 1, 0)]]
    return np.where(wild, np.abs(after - before), 0.0)


def _run_lengths(flags: np.ndarray) -> np.ndarray:
    """Length of the run of equal flags that each sample is in."""
    edges = np.flatnonzero(np.diff(flags.astype(np.int8))) + 1
    bounds = np.concatenate(([0], edges, [flags.size]))
    lengths = np.diff(bounds)
    return np.repeat(lengths, lengths)


def noise_std(values: np.ndarray) -> float:
    """Standard deviation of white noise on a smooth signal, from second differences.

    The second difference of white noise has sqrt(6) times its standard deviation; motion that is
    smooth over three samples cancels, and the median ignores the rest.
    """
    if values.size < WINDOW:
        return 0.0
    second = np.diff(values, 2)
    return float(NORMAL_MAD * np.median(np.abs(second - np.median(second))) / np.sqrt(6.0))


def resolution(values: np.ndarray) -> float:
    """Smallest step between two samples: the last digit of a coarse log, else about zero."""
    steps = np.abs(np.diff(values))
    steps = steps[steps > 0]
    return float(steps.min()) if steps.size else 0.0


def keep_one_of_held(raw: RawSensor, rows: np.ndarray) -> np.ndarray | None:
    """Rows that carry a new sample, where a slow sensor is copied into the rows of a faster log.

    Such copies would count one measurement several times and delay it by half its period.

    Parameters
    ----------
    raw : RawSensor
        Sensor as read.
    rows : numpy.ndarray
        Indices of its rows in ascending time, shape (n,).

    Returns
    -------
    numpy.ndarray of bool or None
        True for the rows to keep, shape (n,); None when the sensor is not held.
    """
    if raw.sensor not in HELD_SENSORS or rows.size <= MIN_HELD_RUNS:
        return None
    table = np.stack([raw.values[column][rows] for column in raw.values])
    table = np.where(np.isnan(table), np.inf, table)  # an empty cell equals an empty cell
    starts = np.concatenate(([0], np.flatnonzero((table[:, 1:] != table[:, :-1]).any(axis=0)) + 1))
    lengths = np.diff(np.concatenate((starts, [rows.size])))
    if lengths.size < MIN_HELD_RUNS or np.quantile(lengths[:-1], HELD_QUANTILE) < 2:
        return None
    typical = int(np.median(lengths))
    place = np.arange(rows.size) - np.repeat(starts, lengths)
    return place % typical == 0
