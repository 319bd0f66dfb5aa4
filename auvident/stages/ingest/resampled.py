"""A log that was brought to another rate and clock: is it the same recording?

The noise of a gyro is its fingerprint. Whatever way a log was resampled (a mean, a line, a filter),
each of its values is a weighted sum of the readings nearby, noise and all; of another flight of
the same helm program it is not, and no weights can make it so: what they leave is at least the
noise that they let through. Where the clocks are apart, the sharpest part of the signals, their
second differences, tells by how much.
"""

from dataclasses import dataclass
from functools import cached_property
from math import comb

import numpy as np

from auvident.constants import MEDIAN_OF_ABS_TO_STD
from auvident.stages.ingest.outliers import resolution

EVEN_HZ = 10.0  # at which clocks are compared
CLIP_STDS = 4.0  # an execute of the helm, alike in all flights, counts no more than noise
MIN_SCORE = 6.0  # standard deviations of a chance agreement
MOST_SHIFTS = 3  # that are looked at closely
ORDER = 5  # of the differences that tell noise: motion cancels
MOST_TAPS = 91  # readings in a weighted sum
ROWS_PER_TAP, MOST_ROWS = 20, 4000
FRACTIONS = 8  # of the period, for clocks between two readings
# What is left over the noise let through: copies of clean trials leave 0.0 to 0.3, other flights
# 1.6 and more (a second flight adds its own noise).
LEFT_OVER = 0.5
# Of all fractions two are tried first, as they hardly differ: copies leave 0.22 at most with the
# better of them, other flights 1.0 and more. What leaves more than so much is not looked at closer.
FAR_FROM = 2.0 * LEFT_OVER
LEAST_NOISE = 3.0  # last digits: coarser logs have no noise that tells


@dataclass(frozen=True)
class Signal:
    """Readings in ascending time, and what is asked of them again for each other log."""

    time_s: np.ndarray
    values: np.ndarray

    @cached_property
    def step_s(self) -> float:
        """Median time from one reading to the next; 0 where most stamps repeat."""
        return float(np.median(np.diff(self.time_s)))

    @cached_property
    def white_noise(self) -> float:
        """Standard deviation of white noise, motion taken out."""
        return _white_noise(self.values)

    @cached_property
    def digit(self) -> float:
        """The last digit of the readings."""
        return resolution(self.values)


@dataclass(frozen=True)
class Even:
    """A channel on even ticks, NaN in gaps; the first tick is at `start_s`."""

    start_s: float
    values: np.ndarray


def evenly(time_s: np.ndarray, values: np.ndarray, max_gap_s: float) -> Even:
    """Mean over each tenth of a second, or the line where readings are farther apart."""
    if time_s.size < 2:
        return Even(0.0, np.empty(0))
    place = np.floor((time_s - time_s[0]) * EVEN_HZ).astype(np.int64)
    count = np.bincount(place)
    with np.errstate(invalid="ignore"):
        found = np.bincount(place, values) / count
    empty = np.flatnonzero(count == 0)
    at = time_s[0] + (empty + 0.5) / EVEN_HZ
    after = np.clip(np.searchsorted(time_s, at), 1, time_s.size - 1)
    near = time_s[after] - time_s[after - 1] <= max_gap_s
    found[empty] = np.where(near, np.interp(at, time_s, values), np.nan)
    return Even(float(time_s[0]), found)


def likely_shifts(old: Even, new: Even, period_s: float) -> list[float]:
    """By how much the clock of the new one may be ahead, the likeliest first."""
    ticks = max(1, round(period_s * EVEN_HZ))
    a, b = (_sharp(even.values, ticks) for even in (old, new))
    if not a.any() or not b.any():
        return []
    size = 1 << int(a.size + b.size - 1).bit_length()
    alike = np.fft.irfft(np.fft.rfft(b, size) * np.conj(np.fft.rfft(a, size)), size)
    chance = np.sqrt(np.mean(a**2) * np.mean(b**2) * min(a.size, b.size))
    found: list[float] = []
    for _ in range(MOST_SHIFTS):
        best = int(np.argmax(alike))
        if alike[best] < MIN_SCORE * chance:
            break
        lag = best - size if best > size // 2 else best
        found.append(new.start_s - old.start_s + lag * ticks / EVEN_HZ)
        alike[np.arange(best - 2, best + 3) % size] = 0.0
    return found


def _sharp(values: np.ndarray, ticks: int) -> np.ndarray:
    """Second differences of means over some ticks, clipped; 0 where unknown."""
    whole = values[: values.size // ticks * ticks].reshape(-1, ticks).mean(axis=1)
    sharp = np.diff(whole, 2)
    known = np.isfinite(sharp)
    if not known.any():
        return np.zeros(0)
    limit = CLIP_STDS * MEDIAN_OF_ABS_TO_STD * float(np.median(np.abs(sharp[known])))
    return np.where(known, np.clip(sharp, -limit, limit), 0.0)


def left_over(
    source: Signal,
    other: Signal,
    ahead_s: float,
    max_gap_s: float,
) -> tuple[float, np.ndarray]:
    """What the best weighted sum of readings leaves of a log, over the noise that it lets through.

    Parameters
    ----------
    source, other : Signal
        Readings in ascending time; the source is the faster one.
    ahead_s : float
        Of the other clock, within some hundredths of a second.
    max_gap_s : float
        Between readings of the source.

    Returns
    -------
    share : float
        Infinite where there is no telling; where it is `FAR_FROM` or more, about that.
    time_s : numpy.ndarray
        Times of the other log that were compared.
    """
    times, period = other.time_s, source.step_s
    if period <= 0.0:  # whole seconds: the stamps do not tell when a reading was taken
        return np.inf, times[:0]
    reach = int(np.ceil((other.step_s + 1.0 / EVEN_HZ) / period))
    taps = 2 * reach + 1
    if taps > MOST_TAPS or source.white_noise < LEAST_NOISE * source.digit:
        return np.inf, times[:0]
    rows = _comparable(source.time_s, times - ahead_s, (reach + 1) * period, max_gap_s)
    if rows.size < ROWS_PER_TAP * taps:
        return np.inf, times[:0]
    lags = period * np.arange(-reach, reach + 1)

    def rest(part: int, most_rows: int = MOST_ROWS) -> float:
        some = rows[:: -(-rows.size // most_rows)]
        at = times[some] - ahead_s + period * part / FRACTIONS
        return _rest(source, at, other.values[some], lags)

    # A few rows first, just enough to determine the weights, in a tenth of the time: of copies they
    # leave no more than all rows do, in the tests of copies 0.22 at most.
    halves = (0, FRACTIONS // 2)
    least = min(rest(part, ROWS_PER_TAP * taps) for part in halves)
    if least < FAR_FROM:
        least = min(rest(part) for part in halves)
    if least < FAR_FROM:
        least = min(least, *(rest(part) for part in range(FRACTIONS) if part not in halves))
    return least, times[rows]


def _comparable(time: np.ndarray, at: np.ndarray, reach_s: float, max_gap_s: float) -> np.ndarray:
    """Times around which the source has readings."""
    inside = (at >= time[0] + reach_s) & (at <= time[-1] - reach_s)
    gaps = np.flatnonzero(np.diff(time) > max_gap_s)
    for k in gaps:
        inside &= (at < time[k] - reach_s) | (at > time[k + 1] + reach_s)
    return np.flatnonzero(inside)


def _rest(source: Signal, at: np.ndarray, y: np.ndarray, lags: np.ndarray) -> float:
    readings = np.column_stack([np.interp(at + lag, source.time_s, source.values) for lag in lags])
    both = np.column_stack((readings, y))
    both -= both.mean(axis=0)
    good = np.ones(at.size, dtype=bool)
    for _ in range(2):  # the second time without outliers
        weights = np.linalg.lstsq(both[good, :-1], both[good, -1], rcond=1e-10)[0]
        rest = both[:, -1] - both[:, :-1] @ weights
        spread = MEDIAN_OF_ABS_TO_STD * float(np.median(np.abs(rest[good])))
        good = np.abs(rest) <= CLIP_STDS * spread
    # the line between two readings halves the power of their noise at most
    through = source.white_noise * float(np.linalg.norm(np.convolve(weights, (0.5, 0.5))))
    return spread / through if through > 0 else np.inf


def _white_noise(values: np.ndarray) -> float:
    """Standard deviation of white noise, from differences of so high an order that motion goes."""
    apart = np.diff(values, ORDER)
    if not apart.size:
        return 0.0
    std = MEDIAN_OF_ABS_TO_STD * float(np.median(np.abs(apart)))
    return std / float(np.sqrt(comb(2 * ORDER, ORDER)))
