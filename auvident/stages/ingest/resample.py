"""Samples at any ticks brought to a uniform grid without delay and without invention.

Measured channels are values at instants: a faster sensor is averaged over the step centred on the
tick, a slower one interpolated. Inputs are held until the next command, or lie on the line between
two samples of it: their value at a tick is the exact mean over the step that follows.
"""

from dataclasses import dataclass

import numpy as np

from auvident.schema.holding import median_period

AVERAGE_BELOW = 0.75  # of the step: a sensor with a shorter period is averaged, else interpolated
TICK_TOLERANCE = 1e-6  # of the step: rounding of time stamps in files
BLOCK = 1 << 18  # samples worked on together, for the sake of memory
ENOUGH_PERIODS = 2.5  # a single lost sample leaves a gap of two periods; jitter adds a bit


@dataclass(frozen=True)
class Grid:
    """Uniform ticks ``(first + k) / rate_hz``."""

    first: int
    size: int
    rate_hz: float

    @property
    def step_s(self) -> float:
        """Distance of two ticks in s."""
        return 1.0 / self.rate_hz

    @property
    def time_s(self) -> np.ndarray:
        """The ticks, shape (size,)."""
        return np.arange(self.first, self.first + self.size) / self.rate_hz

    @classmethod
    def within(cls, start_s: float, end_s: float, rate_hz: float) -> "Grid":
        """All ticks from `start_s` to `end_s`, both included."""
        first = int(np.ceil(start_s * rate_hz - TICK_TOLERANCE))
        last = int(np.floor(end_s * rate_hz + TICK_TOLERANCE))
        return cls(first, max(0, last - first + 1), rate_hz)


@dataclass(frozen=True)
class Resampled:
    """A channel on the grid: values (NaN where unknown) and where a real sample stands behind."""

    values: np.ndarray
    sampled: np.ndarray


def is_averaged(time_s: np.ndarray, step_s: float) -> bool:
    """Whether a sensor is fast enough to be averaged over the step of the grid."""
    return time_s.size > 1 and median_period(time_s) < AVERAGE_BELOW * step_s


def gap_limit(time_s: np.ndarray, max_gap_s: float) -> float:
    """Longest interval between two samples that is interpolated, in s."""
    return max(max_gap_s, ENOUGH_PERIODS * median_period(time_s))


def resample_measured(
    time_s: np.ndarray, values: np.ndarray, grid: Grid, limit_s: float
) -> Resampled:
    """Bring a measured channel to the grid.

    Parameters
    ----------
    time_s, values : numpy.ndarray
        Samples in ascending time, angles unwrapped, shape (n,).
    grid : Grid
        The ticks.
    limit_s : float
        Longest interval between samples that is bridged.

    Returns
    -------
    Resampled
        `sampled` is True at the tick nearest to a sample; when averaged, at every tick whose
        step holds one.
    """
    if is_averaged(time_s, grid.step_s):
        found = _average(time_s, values, grid, limit_s)
    else:
        found = _interpolate(time_s, values, grid, limit_s)
    ticks = time_s * grid.rate_hz
    np.rint(ticks, out=ticks)
    return Resampled(found, _holding(ticks, grid) & np.isfinite(found))


def _holding(ticks: np.ndarray, grid: Grid) -> np.ndarray:
    """Whether a tick of the grid is among some of any grid, bool of shape (grid.size,)."""
    first, last = np.searchsorted(ticks, (grid.first, grid.first + grid.size))
    holding = np.zeros(grid.size, dtype=bool)
    for k in range(first, last, BLOCK):
        holding[ticks[k : min(k + BLOCK, last)].astype(np.int64) - grid.first] = True
    return holding


def _interpolate(time: np.ndarray, values: np.ndarray, grid: Grid, limit: float) -> np.ndarray:
    ticks, slack = grid.time_s, TICK_TOLERANCE * grid.step_s
    after = np.searchsorted(time, ticks - slack)
    right = np.minimum(after, time.size - 1)
    left = np.maximum(right - 1, 0)
    on_sample = np.abs(time[right] - ticks) <= slack
    known = (after > 0) & (after < time.size) & (time[right] - time[left] <= limit * (1 + 1e-9))
    found = np.where(known, np.interp(ticks, time, values), np.nan)
    return np.where(on_sample, values[right], found)


def _average(time: np.ndarray, values: np.ndarray, grid: Grid, limit: float) -> np.ndarray:
    """Mean over the centred step of the line through the samples: jitter makes no delay."""
    middle = float(np.mean(values))  # a small integral keeps its digits
    edges = np.concatenate((grid.time_s, [(grid.first + grid.size) / grid.rate_hz]))
    edges -= 0.5 * grid.step_s
    integral = np.diff(_integral_of_line(time, values, middle, edges))
    gap = np.diff(np.interp(edges, time, _time_in_gaps(time, limit)))
    slack = TICK_TOLERANCE * grid.step_s
    inside = (edges[:-1] >= time[0] - slack) & (edges[1:] <= time[-1] + slack)
    known = inside & (gap <= slack)
    return np.where(known, middle + integral * grid.rate_hz, np.nan)


def _time_in_gaps(time: np.ndarray, limit: float) -> np.ndarray:
    """Seconds of intervals longer than the limit before each sample, shape (n,)."""
    total = np.zeros(time.size)
    steps = total[1:]  # written in place: a day of a fast gyro is long
    np.subtract(time[1:], time[:-1], out=steps)
    steps[steps <= limit * (1 + 1e-9)] = 0.0
    np.cumsum(steps, out=steps)
    return total


def _integral_of_line(
    time: np.ndarray, values: np.ndarray, middle: float, at: np.ndarray
) -> np.ndarray:
    """Integral of the line through the samples less `middle`, from the first of them."""
    total = np.zeros(time.size)
    areas = total[1:]
    for k in range(0, areas.size, BLOCK):
        x = values[k : k + BLOCK + 1] - middle
        areas[k : k + BLOCK] = 0.5 * np.diff(time[k : k + BLOCK + 1]) * (x[1:] + x[:-1])
    np.cumsum(areas, out=areas)
    place = np.searchsorted(time, at, side="right")
    place = np.clip(place - 1, 0, time.size - 2, out=place)
    x = np.clip(at, time[0], time[-1]) - time[place]
    left, right = values[place] - middle, values[place + 1] - middle
    slope = (right - left) / (time[place + 1] - time[place])
    return total[place] + x * (left + 0.5 * slope * x)


# --- inputs -------------------------------------------------------------------------------


def resample_input(
    time_s: np.ndarray, values: np.ndarray, grid: Grid, limit_s: float, sampled: bool = False
) -> Resampled:
    """Bring a command to the grid: exact mean over [tick, tick + step).

    Parameters
    ----------
    time_s, values : numpy.ndarray
        Commands in ascending time, shape (n,); each holds until the next, at most `limit_s`.
    grid : Grid
        The ticks.
    limit_s : float
        Longest hold; may be infinite. A step that is not fully held is NaN.
    sampled : bool
        The rows are samples of a command that changed at any time between two of them: the mean of
        all these times is the line through both. Where none follows in time it is held.
    """
    starts, slack = grid.time_s, TICK_TOLERANCE * grid.step_s
    ends = np.concatenate((starts[1:], [(grid.first + grid.size) / grid.rate_hz]))
    until = np.append(time_s[1:], np.inf)
    until = np.minimum(until, time_s + limit_s)
    until[-1] = min(until[-1], max(ends[-1] if ends.size else 0.0, time_s[-1]))
    knots = np.column_stack((time_s, until)).ravel()
    held = np.column_stack((until - time_s, np.zeros_like(time_s))).ravel()[:-1]
    covered = _between(knots, held, starts, ends)
    if sampled:
        mean = _on_lines(time_s, values, until, np.append(starts, ends[-1:])) / grid.step_s
    else:
        area = _between(knots, held * np.repeat(values, 2)[:-1], starts, ends)
        first = np.searchsorted(time_s, starts + slack, side="right") - 1
        last = np.searchsorted(time_s, ends - slack, side="left") - 1
        held_on = values[np.maximum(first, 0)]
        mean = np.where(first == last, held_on, area / np.maximum(covered, slack))
    found = np.where(covered >= grid.step_s - 2 * slack, mean, np.nan)
    ticks = np.floor(time_s * grid.rate_hz + TICK_TOLERANCE)
    return Resampled(found, _holding(ticks, grid) & np.isfinite(found))


def _on_lines(
    time: np.ndarray, values: np.ndarray, until: np.ndarray, edges: np.ndarray
) -> np.ndarray:
    """Integrals between edges of the lines through samples; before a gap the last one is held."""
    alone = np.append(until[:-1] < time[1:], until[-1] > time[-1])
    at, line = np.append(time, until[alone]), np.append(values, values[alone])
    order, middle = np.argsort(at, kind="stable"), float(np.mean(values))
    area = np.diff(_integral_of_line(at[order], line[order], middle, edges))
    return np.asarray(area + middle * np.diff(edges))


def _between(
    knots: np.ndarray, pieces: np.ndarray, starts: np.ndarray, ends: np.ndarray
) -> np.ndarray:
    """Sum of pieces (each spread evenly between two knots) from `starts` to `ends`."""
    total = np.concatenate(([0.0], np.cumsum(pieces)))
    return np.interp(ends, knots, total) - np.interp(starts, knots, total)
