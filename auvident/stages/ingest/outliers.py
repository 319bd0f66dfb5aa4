"""Samples that no motion of a vehicle can explain."""

import numpy as np

from auvident.constants import MEDIAN_OF_ABS_TO_STD

MIN_SAMPLES = 7  # fewer do not show what is usual
MAX_RUN = 2  # wild samples in a row; a longer excursion may be motion and stays
MIN_SIGMAS = 6.0  # of the noise: with the guard below none in 3 million samples of mere noise
MIN_RESOLUTIONS = 3.0  # of the smallest step: a digit that toggles is no outlier
NEIGHBOUR_STEPS = 3.0  # times the steps nearby: an onset or peak has such steps beside it
NEARBY = 5  # steps on either side that count
BLOCK = 1 << 18  # samples looked at together, for the sake of memory
SPARED = 2  # largest of them that do not: those of another outlier
STUCK_ROWS = 8  # equal rows of a sensor whose noise otherwise hardly ever repeats a value ...
STUCK_SHARE = 0.05  # ... in less than this share of its rows: a drop-out filled with copies


def find_outliers(values: np.ndarray) -> np.ndarray:
    """Isolated samples far from the line between the samples on either side.

    A Hampel filter of the shortest window, with two guards: a sample, or a run of up to
    `MAX_RUN`, goes only if every one is farther from that line than `MIN_SIGMAS` of the noise,
    and than `NEIGHBOUR_STEPS` times the distance of the two good samples and the steps nearby.
    The onset of a maneuver moves the samples that follow, too, and stays.

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
    if values.size < MIN_SAMPLES:
        return flags
    limit = max(MIN_SIGMAS * noise_std(values), MIN_RESOLUTIONS * resolution(values))
    for size in range(1, MAX_RUN + 1):
        for first in _wild_runs(values, size, limit):
            flags[first : first + size] = True
    return flags


def _wild_runs(values: np.ndarray, size: int, limit: float) -> np.ndarray:
    """First samples of runs of `size` that stand out; the ends are mirrored."""
    padded = np.pad(values, 1, mode="reflect")
    blocks = range(0, padded.size - size - 1, BLOCK)
    far_ones = [_far_from_line(padded[k : k + BLOCK + size + 1], size, limit) for k in blocks]
    first = np.concatenate([k + found for k, (found, _) in zip(blocks, far_ones, strict=True)])
    far = np.concatenate([far for _, far in far_ones])
    return first[far > NEIGHBOUR_STEPS * _usual_steps(values, first, size)]


def _far_from_line(padded: np.ndarray, size: int, limit: float) -> tuple[np.ndarray, np.ndarray]:
    """Runs of `size` that all lie far from the line between their neighbours, and how far."""
    left, right = padded[: -size - 1], padded[size + 1 :]
    across = right - left
    far = np.full(left.size, np.inf)
    for k in range(1, size + 1):
        inside = padded[k : k + left.size]
        far = np.minimum(far, np.abs(inside - left - across * k / (size + 1)))
    first = np.flatnonzero(far > np.maximum(limit, NEIGHBOUR_STEPS * np.abs(across)))
    return first, far[first]


def _usual_steps(values: np.ndarray, first: np.ndarray, size: int) -> np.ndarray:
    """Largest step near each run but `SPARED`, those into and out of the run left out."""
    before = first[:, None] - 2 - np.arange(NEARBY)
    after = first[:, None] + size + np.arange(NEARBY)
    nearby = np.hstack((before, after))
    there = (nearby >= 0) & (nearby < values.size - 1)
    nearby[~there] = 0
    steps = np.where(there, np.abs(values[nearby + 1] - values[nearby]), 0.0)
    return np.sort(steps, axis=1)[:, -1 - SPARED]


def noise_std(values: np.ndarray) -> float:
    """Standard deviation of white noise on a smooth signal, from second differences.

    The second difference of white noise has sqrt(6) times its standard deviation; motion that is
    smooth over three samples cancels, and the median ignores the rest.
    """
    if values.size < MIN_SAMPLES:
        return 0.0
    second = np.empty(values.size - 2)
    for k in range(0, second.size, BLOCK):
        second[k : k + BLOCK] = np.diff(values[k : k + BLOCK + 2], 2)
    second -= np.median(second, overwrite_input=True)  # their order does not matter below
    apart = np.median(np.abs(second, out=second), overwrite_input=True)
    return float(MEDIAN_OF_ABS_TO_STD * apart / np.sqrt(6.0))


def resolution(values: np.ndarray) -> float:
    """Smallest step between two samples: the last digit of a coarse log, else about zero."""
    steps = np.diff(values)
    np.abs(steps, out=steps)
    least = float(np.min(steps, where=steps > 0, initial=np.inf))
    return least if np.isfinite(least) else 0.0


def of_rows(values: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Values of some ascending rows; without a copy when these are all."""
    return values if rows.size == values.size else values[rows]
